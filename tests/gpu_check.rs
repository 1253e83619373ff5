//! `scripts/gpu-check` finds a GPU's driver in unusual places or says where it has looked, and a run that is out of time
//! keeps what it has measured.
mod support;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};
use support::{root, stderr, stdout, welkin};

/// A kit whose `welkin` is a shell script: it sees a GPU where the manifest in use holds the word `EGL`.
const WELKIN: &str = r#"#!/bin/sh
case $1 in
devices)
    if grep -q EGL "$VK_DRIVER_FILES"; then echo '{"devices": [{"kind": "discrete"}]}'; else echo 'it is broken'; exit 2; fi ;;
*) echo "$VK_DRIVER_FILES"; cat "$VK_DRIVER_FILES"; echo "$LD_LIBRARY_PATH"; echo "$@" ;;
esac
"#;

/// `gpu-check run` in such a kit, on a machine whose `/` is `machine`.
fn run(folder: &Path, machine: &Path) -> Output {
    let kit = folder.join("kit");
    for name in ["bin", "lib", "spare"] {
        fs::create_dir_all(kit.join(name)).unwrap();
    }
    fs::write(kit.join("needs"), "GLIBC_2.0\n").unwrap();
    let program = kit.join("bin/welkin");
    fs::write(&program, WELKIN).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    fs::copy(root().join("scripts/gpu-check"), kit.join("gpu-check")).unwrap();
    let mut command = Command::new(kit.join("gpu-check"));
    command.args(["run", "--scale", "tiny", "--out", "here"]).env("GPU_CHECK_ROOT", machine).current_dir(folder);
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "WELKIN_DRIVER", "WELKIN_PREFIX", "LD_LIBRARY_PATH"] {
        command.env_remove(name);
    }
    command.output().unwrap()
}

#[test]
fn a_machine_without_a_driver_is_told_where_it_was_looked_for() {
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine");
    let manifests = machine.join("usr/share/vulkan/icd.d");
    fs::create_dir_all(&manifests).unwrap();
    fs::write(manifests.join("broken_icd.json"), "{}").unwrap();
    let output = run(folder.path(), &machine);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    for part in [
        &format!("looked: {}", manifests.display()),
        &format!("looked: {}/usr/local/nvidia/lib64", machine.display()),
        &format!("tried: {}/broken_icd.json", manifests.display()),
        "it is broken",
        "no driver of a GPU was found",
    ] {
        assert!(text.contains(part), "{part:?} is not in {text}");
    }
}

#[test]
fn a_library_without_a_manifest_in_an_unusual_place_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine");
    let libraries = machine.join("usr/local/nvidia/lib64");
    fs::create_dir_all(&libraries).unwrap();
    for name in ["libGLX_nvidia.so.0", "libEGL_nvidia.so.0"] {
        fs::write(libraries.join(name), "").unwrap(); // GLX is tried first, and this machine's does not work
    }
    let output = run(folder.path(), &machine);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    let library = format!("\"library_path\": \"{}/libEGL_nvidia.so.0\"", libraries.display());
    assert!(text.contains(&library), "{text}");
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[2].ends_with(libraries.to_str().unwrap()), "what lies beside the driver is not found: {text}");
    assert!(lines[3].contains("gpu-check --kit") && lines[3].contains("--scale tiny --out here"), "{text}");
}

#[test]
fn what_was_measured_before_the_time_was_up_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (kit, out) = (folder.path().join("kit"), folder.path().join("out"));
    fs::create_dir_all(kit.join("scenes")).unwrap();
    for name in ["noon.toml", "above.toml"] {
        fs::copy(root().join("scenes").join(name), kit.join("scenes").join(name)).unwrap();
    }
    let output = welkin()
        .args(["gpu-check", "--scale", "tiny", "--budget", "6", "--kit"])
        .args([&kit, Path::new("--out"), &out])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output)); // there is no picture to compare with
    let find = |end: &str| {
        let mut files = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path());
        files.find(|path| path.extension().is_some_and(|e| e == end)).unwrap()
    };
    let report: serde_json::Value = serde_json::from_str(&fs::read_to_string(find("json")).unwrap()).unwrap();
    let steps = report["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 9, "{report}");
    let result = |step: usize, task: usize| steps[step]["tasks"][task]["result"].as_str().unwrap().to_owned();
    assert_eq!((result(0, 0), result(0, 1)), ("done".into(), "done".into()), "{report}");
    assert!(report["device"]["name"].as_str().is_some_and(|name| !name.is_empty()), "{report}");
    if report["device"]["kind"] == "cpu" {
        assert_eq!(result(8, 0), "left out", "{report}");
        assert!(fs::read_to_string(find("md")).unwrap().contains("the time for all steps is up"));
    }
    // It is one set of files: those from before the device was known are gone.
    assert_eq!(fs::read_dir(&out).unwrap().count(), 3); // and run/
}

#[test]
fn a_kit_that_is_none_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = welkin().args(["gpu-check", "--out", "x", "--kit"]).arg(folder.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("--kit = ") && stderr(&output).contains("gpu-check prepare"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn sorting_is_timed_and_its_result_looked_at() {
    let output = welkin().args(["bench", "--json", "--sort", "1,5000", "--measure", "2"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&report["sort"][0]["pairs"], &report["sort"][1]["pairs"]), (&1.into(), &5000.into()));
    let sorted = &report["sort"][1];
    let (ms, rate) = (sorted["median_ms"].as_f64().unwrap(), sorted["pairs_per_second"].as_f64().unwrap());
    assert!(ms > 0.0 && (rate * ms * 1e-3 - 5000.0).abs() < 1e-6, "{report}");
    for wrong in [&["bench"][..], &["bench", "--sort", "0"], &["bench", "scenes/noon.toml", "--sort", "9"]] {
        assert_eq!(welkin().args(wrong).output().unwrap().status.code(), Some(2), "{wrong:?}");
    }
}
