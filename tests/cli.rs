//! The command line from outside: exit status, messages, files.
mod support;

use std::path::Path;
use std::process::Output;
use support::{stderr, stdout, welkin};

/// A scene that needs no tables: one ellipsoid of its own colour before black.
const FLAT: &str = r#"
    [camera]
    position = [0, 0, 0]
    pitch = 0
    [clouds]
    source = "particles"
    lighting = "flat"
    style = "homogeneous"
    [[clouds.particle]]
    centre = [0, 0, -500]
    radii = [100, 50, 100]
    [quality]
    downscale = 1
    [sky]
    model = "none"
    [animation]
    velocity = [0, 0, -20]
"#;

/// A directory of its own for a test, with `sky.toml` in it.
fn directory(scene: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("sky.toml"), scene).unwrap();
    directory
}

/// Runs `welkin` with the words of `line` in `directory`.
fn run(directory: &Path, line: &str) -> Output {
    welkin().args(line.split_whitespace()).current_dir(directory).output().expect("welkin starts")
}

/// Names in `directory` other than the scene's.
fn files(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|name| name != "sky.toml");
    names.sort();
    names
}

#[test]
fn bad_input_is_status_2_with_a_reason_and_leaves_no_file() {
    let cases = [
        ("[clouds]\ncovrage = 1", "", "sky.toml:2:1: clouds.covrage: expected a known key"),
        ("[clouds]\ncoverage = \"x\"", "", "sky.toml:2:12: clouds.coverage = \"x\": expected a number"),
        ("[clouds]\ncoverage = nan", "", "sky.toml:2:12: clouds.coverage = NaN: expected a number from 0.0 to 1.0"),
        ("[clouds]\nthickness = -5", "", "sky.toml:2:13: clouds.thickness = -5: expected a number above 0"),
        ("[clouds]\nlighting = \"march\"", "", "clouds.lighting = \"march\" is not supported by this version yet"),
        ("[sky]\nground = \"a.png\"", "", "is not supported by this version yet"),
        ("[clouds]\nsource = \"particles\"\nfile = \"c.csv\"", "", "c.csv: cannot be read: "),
        ("[clouds]\ncoverage_map = \"m.png\"", "", "m.png: cannot be read: "),
        ("", "--size 0x0", "'0x0' for '--size <WxH>': expected WIDTHxHEIGHT"),
        ("", "--size 100000x100000", "'100000x100000' for '--size <WxH>': expected WIDTHxHEIGHT"),
        ("", "--blend glass", "'glass' for '--blend <MODE[:K]>': expected one of auto"),
        ("", "--blend tiled", "--blend \"tiled\" is not supported by this version yet"),
        ("", "--set clouds.coverage=7", "--set clouds.coverage = 7: expected a number from 0.0 to 1.0"),
        ("", "--device no-such-device", "--device = no-such-device: expected"),
        ("", "--frames 3..1", "'3..1' for '--frames <A..B>': expected A..B"),
        ("", "-o sky.jpg", "sky.jpg: names no picture format"),
        ("", "-o no/such/sky.png", "there is no directory no/such"),
        ("", "more.toml", "more.toml: cannot be read: "),
    ];
    for (scene, flags, expected) in cases {
        let directory = directory(scene);
        let output = run(directory.path(), &format!("render sky.toml {flags}"));
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{scene:?} {flags}: {message}");
        assert!(message.contains(expected), "{scene:?} {flags} gave {message:?}, not {expected:?}");
        assert!(stdout(&output).is_empty());
        assert!(files(directory.path()).is_empty(), "{flags} left {:?}", files(directory.path()));
    }
}

#[test]
fn devices_says_why_a_mode_cannot_be_used() {
    let directory = directory("");
    let output = run(directory.path(), "devices --json");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let devices = report["devices"].as_array().unwrap();
    assert!(!devices.is_empty());
    for mode in devices.iter().flat_map(|device| device["blend"].as_array().unwrap()) {
        assert_ne!(mode["supported"].as_bool().unwrap(), mode["reason"].is_string(), "{mode}");
    }
    assert!(stdout(&run(directory.path(), "devices")).contains("interlock"));
}

#[test]
fn a_picture_its_transmittance_and_its_statistics() {
    let directory = directory(FLAT);
    let line = "render sky.toml -o a.exr --size 40x30 --aux --stats s.json";
    let output = run(directory.path(), line);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(files(directory.path()), ["a.exr", "a.transmittance.npy", "s.json"]);

    let picture = image::open(directory.path().join("a.exr")).unwrap().to_rgb32f();
    assert_eq!(picture.dimensions(), (40, 30));
    // Through the middle of the ellipsoid τ = 0.07 · 200, so its colour is all there is: Eq. 8 with T = 8e-7.
    assert!(picture.get_pixel(20, 15).0.iter().all(|v| (v - 1.0).abs() < 1e-3), "f16 targets hold 3 digits");
    assert_eq!(picture.get_pixel(0, 0).0, [0.0; 3]);

    let bytes = std::fs::read(directory.path().join("a.transmittance.npy")).unwrap();
    let transmittance = npyz::NpyFile::new(&bytes[..]).unwrap();
    assert_eq!(transmittance.shape(), [30, 40]);
    let transmittance = transmittance.into_vec::<f32>().unwrap();
    assert_eq!(transmittance[0], 1.0);
    assert!(transmittance[15 * 40 + 20] < 1e-3);

    let stats: serde_json::Value =
        serde_json::from_slice(&std::fs::read(directory.path().join("s.json")).unwrap()).unwrap();
    assert_eq!(stats["particles"]["generated"], 1);
    assert_eq!(stats["particles"]["visible"], 1);
    assert_eq!(stats["blend"]["requested"], "auto");
    assert!(stats["blend"]["used"] == "interlock" || stats["blend"]["reason"].as_str().unwrap().contains("interlock"));
    assert_eq!(stats["validation_messages"], 0);
    assert!(!stats["passes"].as_array().unwrap().is_empty());
}

#[test]
fn a_sequence_is_numbered_and_moves() {
    let directory = directory(FLAT);
    let output = run(directory.path(), "render sky.toml -o a.npy --size 160x80 --frames 3..5");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(files(directory.path()), ["a.0003.npy", "a.0004.npy"]);
    let read = |name| std::fs::read(directory.path().join(name)).unwrap();
    assert!(read("a.0003.npy") != read("a.0004.npy"), "the camera moved 20 m, the picture did not change");
}

#[test]
fn several_scenes_go_into_a_directory_with_one_list_of_statistics() {
    let directory = directory(FLAT);
    std::fs::write(directory.path().join("b.toml"), FLAT).unwrap();
    let output = run(directory.path(), "render sky.toml b.toml -o out/ --size 16x8 --stats");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(files(&directory.path().join("out")), ["b.png", "sky.png"]);
    let stats: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(stats.as_array().unwrap().len(), 2);
}

#[test]
fn bench_compares_two_modes_in_one_run() {
    let directory = directory(FLAT);
    let line = "bench sky.toml --size 32x16 --blend alpha --vs alpha --measure 2 --warmup 1 --json";
    let output = run(directory.path(), line);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(report["a"]["blend"]["used"], "alpha");
    assert!(report["ratio"]["frame"].as_f64().unwrap() > 0.0);
    assert!(report["a"]["passes"][0]["median_ms"].as_f64().unwrap() >= 0.0);
}
