//! What the integration tests share: the drivers that this machine has, and a way to start `welkin` on one of them.
#![allow(dead_code)] // Each test file uses its own part.

pub mod folder;
pub mod tile;
pub mod vdb;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A Vulkan driver that `scripts/runner` can start a program on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// The machine's own loader and drivers.
    System,
    /// The lavapipe with fragment shader interlock.
    Lavapipe,
    /// The distribution's own lavapipe, on Debian 12 a device without interlock.
    Distro,
    /// SwiftShader, which Chromium brings along: an implementation of its own, without interlock.
    SwiftShader,
}

impl Driver {
    /// The name that `WELKIN_DRIVER` takes.
    pub fn name(self) -> &'static str {
        match self {
            Self::System => "system",
            Self::Lavapipe => "lavapipe",
            Self::Distro => "distro",
            Self::SwiftShader => "swiftshader",
        }
    }
}

/// The drivers that set-up left on this machine, the one that plain `cargo run` uses first.
pub fn drivers() -> Vec<Driver> {
    let root = root().join(".welkin");
    let auto = std::fs::read_to_string(root.join("auto")).unwrap_or_default();
    let mut drivers: Vec<_> = if auto.trim() == "system" { vec![Driver::System] } else { Vec::new() };
    drivers.extend([Driver::Lavapipe, Driver::Distro].into_iter().filter(|d| root.join(d.name()).join("run").exists()));
    if root.join("chromium/swiftshader.json").exists() {
        drivers.push(Driver::SwiftShader);
    }
    drivers
}

/// `welkin` on the driver that this test itself runs on, under validation: a single message makes it fail.
pub fn welkin() -> Command {
    // The program that runs on a driver's own libc cannot start another one directly: the runner does.
    let mut command = Command::new(root().join("scripts/runner"));
    command.arg(env!("CARGO_BIN_EXE_welkin")).current_dir(root()).env("WELKIN_VALIDATION", "1");
    command
}

/// `welkin` on the given driver.
pub fn welkin_on(driver: Driver) -> Command {
    let mut command = welkin();
    command.env("WELKIN_DRIVER", driver.name());
    command
}

/// The repository's top folder: scenes and scripts lie there.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_path_buf()
}

/// Standard error of a finished program.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Standard output of a finished program.
pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}
