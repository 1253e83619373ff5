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
