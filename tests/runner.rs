//! Programs started by cargo, and by a test, find the driver that they ask for.
mod support;

use std::process::Command;
use support::{Driver, drivers, root, stderr, stdout};

fn probe(driver: &str) -> std::process::Output {
    Command::new(root().join("scripts/runner"))
        .arg(root().join(".welkin/probe"))
        .env("WELKIN_DRIVER", driver)
        .output()
        .expect("scripts/runner starts")
}

#[test]
fn lavapipe_offers_interlock_and_every_driver_has_a_device() {
    let found = drivers();
    assert!(!found.is_empty(), "no driver: run scripts/setup --tests");
    for driver in found {
        let output = probe(driver.name());
        assert!(output.status.success(), "{driver:?}: {}", stderr(&output));
        assert!(
            driver != Driver::Lavapipe || stdout(&output).contains("cpu interlock"),
            "{driver:?}: {}",
            stdout(&output)
        );
    }
}

#[test]
fn an_unknown_driver_is_an_error_that_names_the_choices() {
    let output = probe("voodoo");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("WELKIN_DRIVER=voodoo: expected auto, system, lavapipe, distro or swiftshader"),
        "{}",
        stderr(&output)
    );
}

/// A program that was installed finds the driver that setup has unpacked.
#[test]
fn a_program_on_a_system_without_a_driver_starts_again_on_a_prefix() {
    if !drivers().contains(&Driver::Lavapipe) {
        return; // Nothing is unpacked.
    }
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("welkin");
    std::fs::copy(env!("CARGO_BIN_EXE_welkin"), &program).unwrap();
    let scene = "[clouds]\nsource = \"particles\"\nlighting = \"flat\"\nstyle = \"homogeneous\"\n\
                 [[clouds.particle]]\ncentre = [0, 1000, -2000]\nradii = [400, 300, 400]\n";
    std::fs::write(folder.path().join("sky.toml"), scene).unwrap();
    let render = |prefix: Option<&str>| {
        let mut command = Command::new(&program);
        command.args(["render", "sky.toml", "-o", "a.png", "--size", "32x18", "--stats"]).current_dir(folder.path());
        // The system's loader, if it has one, finds no driver.
        command.env_clear().env("VK_DRIVER_FILES", folder.path().join("none.json"));
        command.envs(prefix.map(|prefix| ("WELKIN_PREFIX_DIR", root().join(prefix))));
        command.output().unwrap()
    };
    let without = render(None);
    assert_eq!(without.status.code(), Some(2), "{}", stderr(&without));
    assert!(stderr(&without).contains("welkin setup"), "{}", stderr(&without));
    let with = render(Some(".welkin/lavapipe"));
    assert_eq!(with.status.code(), Some(0), "{}", stderr(&with));
    let stats: serde_json::Value = serde_json::from_str(&stdout(&with)).unwrap();
    assert!(stats["device"]["name"].as_str().unwrap().contains("llvmpipe"), "{}", stats["device"]);
    assert_eq!(stats["validation_messages"], 0, "{}", stderr(&with));
    let size = image::image_dimensions(folder.path().join("a.png")).unwrap();
    assert_eq!(size, (32, 18));
}
