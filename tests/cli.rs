//! Bad input to the program: each gives a clear error that names field, value and expectation, exit status 2, and leaves no
//! file or part of one.
mod support;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use support::{Driver, drivers, root, stderr, welkin, welkin_on};

/// A scene that renders in a moment: one opaque ball, no tables.
const BALL: &str = r#"
    [camera]
    position = [0, 0, 0]
    yaw = 0
    pitch = 0
    [clouds]
    source = "particles"
    lighting = "flat"
    style = "homogeneous"
    [[clouds.particle]]
    centre = [0, 0, -100]
    radii = [20, 20, 20]
    [quality]
    downscale = 1
    [sky]
    model = "none"
"#;

/// A folder for one run: the scene in it, and what a run may leave.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(scene: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("scene.toml"), scene).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().unwrap().to_owned()
    }

    /// `welkin render scene.toml -o out.png --size 32x32` with `arguments` added.
    fn render(&self, arguments: &[&str]) -> Output {
        self.start(welkin(), arguments)
    }

    fn start(&self, mut command: Command, arguments: &[&str]) -> Output {
        command.args(["render", &self.path("scene.toml")]);
        if !arguments.contains(&"-o") {
            command.args(["-o", &self.path("out.png")]);
        }
        if !arguments.iter().any(|argument| argument.starts_with("--size")) {
            command.args(["--size", "32x32"]);
        }
        command.args(arguments).output().unwrap()
    }

    /// Every file but the scene.
    fn left(&self) -> Vec<String> {
        let names = fs::read_dir(self.folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name != "scene.toml").collect()
    }

    /// The run failed as it must: status 2, a message with each of `parts`, nothing left that was not in `had`.
    fn assert_refused(&self, output: &Output, parts: &[&str], had: &[&str]) {
        let message = stderr(output);
        assert_eq!(output.status.code(), Some(2), "{parts:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
        let mut left = self.left();
        left.retain(|name| !had.contains(&name.as_str()));
        assert!(left.is_empty(), "{parts:?} left {left:?}");
    }
}

#[test]
fn a_good_scene_renders() {
    let bench = Bench::new(BALL);
    let output = bench.render(&[]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(bench.left(), ["out.png"]);
}

#[test]
fn faults_of_the_scene_name_place_field_value_and_expectation() {
    let cases: [(&str, &[&str]); 14] = [
        ("[clouds]\ncovrage = 0.5", &["scene.toml:2:1", "clouds.covrage", "known key"]),
        ("[weather]\nwind = 3", &["scene.toml:1:2", "weather", "known key"]),
        ("[clouds]\ncoverage = \"lots\"", &["scene.toml:2:12", "clouds.coverage", "lots", "a number"]),
        ("[clouds]\nseed = 1.5", &["scene.toml:2:8", "clouds.seed", "1.5", "whole number"]),
        ("[camera]\nposition = [0, 1]", &["scene.toml:2:12", "camera.position", "3 numbers"]),
        ("[clouds]\nsigma_t = nan", &["scene.toml:2:11", "clouds.sigma_t", "NaN", "expected"]),
        ("[camera]\nposition = [0, nan, 0]", &["camera.position[1]", "NaN", "expected"]),
        ("[clouds]\naltitude = inf", &["clouds.altitude", "inf", "expected"]),
        ("[clouds]\nthickness = -700", &["scene.toml:2:13", "clouds.thickness", "-700", "above 0"]),
        ("[clouds]\nstyle = \"fluffy\"", &["clouds.style", "fluffy", "one of", "pyroclastic"]),
        ("[quality]\npreset = \"ultra\"", &["quality.preset", "ultra", "one of", "medium"]),
        ("[quality]\nrings = 4000000000", &["quality.rings", "4000000000", "from 1 to 8"]),
        ("[clouds\n", &["scene.toml:1:8", "not TOML"]),
        ("[clouds]\nsource = \"particles\"\nfile = \"none.csv\"", &["none.csv", "cannot be read", "clouds.file"]),
    ];
    for (scene, parts) in cases {
        let bench = Bench::new(scene);
        bench.assert_refused(&bench.render(&[]), parts, &[]);
    }
}

#[test]
fn a_scene_that_is_no_text_or_is_not_there_is_named() {
    let bench = Bench::new("");
    fs::write(bench.path("scene.toml"), [0xff, 0xfe, 0, 1]).unwrap();
    bench.assert_refused(&bench.render(&[]), &["scene.toml", "UTF-8"], &[]);
    fs::remove_file(bench.path("scene.toml")).unwrap();
    bench.assert_refused(&bench.render(&[]), &["scene.toml", "cannot be read"], &[]);
    fs::create_dir(bench.path("scene.toml")).unwrap();
    bench.assert_refused(&bench.render(&[]), &["scene.toml", "cannot be read"], &[]);
}

#[test]
fn damaged_pictures_and_lists_are_named() {
    let bench = Bench::new("[clouds]\ncoverage_map = \"map.png\"\n");
    bench.assert_refused(&bench.render(&[]), &["map.png", "cannot be read", "clouds.coverage_map"], &[]);
    fs::write(bench.path("map.png"), b"\x89PNG\r\n\x1a\nand then nothing of the kind").unwrap();
    bench.assert_refused(&bench.render(&[]), &["map.png", "picture", "clouds.coverage_map"], &["map.png"]);

    let bench = Bench::new("[clouds]\nsource = \"particles\"\nfile = \"list.csv\"\n");
    fs::write(bench.path("list.csv"), "0,0,0,1,1,1,0,0,0,1,1\n0,0,0,1,nan,1,0,0,0,1,1\n").unwrap();
    bench.assert_refused(&bench.render(&[]), &["list.csv:2:1", "radii[1]", "NaN", "expected"], &["list.csv"]);
}

#[test]
fn faults_of_the_flags_name_flag_value_and_expectation() {
    let cases: [(&[&str], &[&str]); 20] = [
        (&["--size", "0x0"], &["--size", "0x0", "from 1 to"]),
        (&["--size", "100000x100000"], &["--size", "100000x100000", "from 1 to 16384"]),
        (&["--size", "4000000000x4000000000"], &["--size", "4000000000"]),
        (&["--size=-5x5"], &["--size", "-5x5"]),
        (&["--size", "640"], &["--size", "640", "expected WIDTHxHEIGHT"]),
        (&["--size", "axb"], &["--size", "axb"]),
        (&["--quality", "ultra"], &["--quality", "ultra", "medium"]),
        (&["--blend", "glass"], &["--blend", "glass", "interlock"]),
        (&["--blend", "alpha:4"], &["--blend", "alpha:4"]),
        (&["--blend", "interlock:3"], &["blend", "interlock:3", "1, 2, 4 or 8"]),
        (&["--device", "No Such Device"], &["--device", "No Such Device", "expected part of the name"]),
        (&["--device", "99"], &["--device", "99", "index"]),
        (&["--frames", "5..2"], &["--frames", "5..2", "A below B"]),
        (&["--frames", "x"], &["--frames", "x"]),
        (&["--set", "clouds.coverage=7"], &["--set", "clouds.coverage", "7", "0.0 to 1.0"]),
        (&["--set", "clouds.coverage=nan"], &["--set", "clouds.coverage", "expected a number"]),
        (&["--set", "clouds.covrage=0"], &["--set", "clouds.covrage", "known key"]),
        (&["--set", "coverage"], &["--set", "coverage", "key=value"]),
        (&["--colour"], &["--colour"]),
        (&["--stats", "/nowhere/at/all.json"], &["/nowhere/at/all.json", "no directory"]),
    ];
    for (arguments, parts) in cases {
        let bench = Bench::new(BALL);
        bench.assert_refused(&bench.render(arguments), parts, &[]);
    }
}

#[test]
fn places_that_cannot_be_written_are_named_before_anything_is_made() {
    let bench = Bench::new(BALL);
    let nowhere = bench.path("none/out.png");
    bench.assert_refused(&bench.render(&["-o", &nowhere]), &["none/out.png", "no directory"], &[]);
    let jpeg = bench.path("out.jpg");
    bench.assert_refused(&bench.render(&["-o", &jpeg]), &["out.jpg", ".png, .exr or .npy"], &[]);
}

#[test]
fn a_blend_mode_that_the_device_lacks_is_refused_with_the_reason() {
    if !drivers().contains(&Driver::Distro) {
        return eprintln!("skipped: no device without interlock here");
    }
    let probe = Command::new(root().join("scripts/runner"))
        .arg(root().join(".welkin/probe"))
        .env("WELKIN_DRIVER", "distro")
        .output()
        .unwrap();
    if support::stdout(&probe).contains("cpu interlock") {
        return eprintln!("skipped: the distribution's own lavapipe has interlock");
    }
    let bench = Bench::new(BALL);
    let output = bench.start(welkin_on(Driver::Distro), &["--blend", "interlock"]);
    bench.assert_refused(&output, &["interlock", "VK_EXT_fragment_shader_interlock"], &[]);
    let output = bench.start(welkin_on(Driver::Distro), &[]);
    assert!(output.status.success(), "auto falls back: {}", stderr(&output));
}

#[test]
fn a_full_disk_is_an_error_and_leaves_nothing() {
    // A file system of 16 KiB in a mount namespace of our own, which needs no root where the kernel allows it.
    let possible = Command::new("unshare").args(["-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]).output();
    if !possible.is_ok_and(|output| output.status.success()) {
        return eprintln!("skipped: no mount namespace here; output::write_atomic has a test of its own");
    }
    let script = r#"
        mount -t tmpfs -o size=16k tmpfs "$0" || exit 99
        "$@"; status=$?
        ls -A "$0"
        exit $status
    "#;
    let runner = root().join("scripts/runner");
    // Each makes more than three times what there is room for.
    for (line, file) in [
        ("render --size 64x64 -o", "out.npy"),
        ("reference --size 64x64 --spp 1 -o", "out.state"),
        ("voxelize --resolution 32 -o", "out.npy"),
        ("voxelize --resolution 32 -o", "out.vdb"),
    ] {
        let bench = Bench::new(BALL);
        let disk = bench.path("disk");
        fs::create_dir(&disk).unwrap();
        let output = Command::new("unshare")
            .args(["-rm", "sh", "-c", script, &disk])
            .arg(&runner)
            .arg(env!("CARGO_BIN_EXE_welkin"))
            .args(line.split_whitespace())
            .arg(Path::new(&disk).join(file).with_extension(if file.ends_with("vdb") { "vdb" } else { "npy" }))
            .arg(bench.path("scene.toml"))
            .output()
            .unwrap();
        bench.assert_refused(&output, &[file, "cannot be written", "space"], &["disk"]);
        assert_eq!(support::stdout(&output).trim(), "", "{line}: left on the full disk");
    }
}

#[test]
fn a_damaged_cache_is_told_of_and_mended() {
    let bench = Bench::new(&BALL.replace("lighting = \"flat\"", "lighting = \"tables\""));
    let cache = bench.path("cache");
    let render = || bench.render(&["--tables", "reduced", "--cache", &cache]);
    let picture = |output: &Output| {
        assert!(output.status.success(), "{}", stderr(output));
        fs::read(bench.path("out.png")).unwrap()
    };
    let first = render();
    let expected = picture(&first);
    assert!(!stderr(&first).contains("warning"), "{}", stderr(&first));
    let files: Vec<_> = fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(files.len(), 2, "two tables and no part of one: {files:?}");

    // A changed byte, a lost end, nothing at all: of the table that is quick to make again.
    let table = files.iter().find(|path| path.to_string_lossy().contains("optical-depth")).unwrap();
    let whole = fs::read(table).unwrap();
    let mut changed = whole.clone();
    changed[whole.len() / 2] ^= 1;
    for damaged in [&changed, &whole[..whole.len() - 1], &[]] {
        fs::write(table, damaged).unwrap();
        let output = render();
        assert!(picture(&output) == expected, "the picture changed");
        let message = stderr(&output);
        assert!(message.contains("warning") && message.contains("built anew"), "{message}");
        assert!(message.contains(table.file_name().unwrap().to_str().unwrap()), "{message}");
        assert!(fs::read(table).unwrap() == whole, "the table was not mended");
    }
    let last = render();
    assert!(picture(&last) == expected && !stderr(&last).contains("warning"), "{}", stderr(&last));
}

#[test]
fn a_cache_that_is_no_directory_is_refused() {
    let bench = Bench::new(&BALL.replace("lighting = \"flat\"", "lighting = \"tables\""));
    fs::write(bench.path("cache"), "").unwrap();
    let output = bench.render(&["--cache", &bench.path("cache")]);
    bench.assert_refused(&output, &["--cache", "expected a directory"], &["cache"]);
}

#[test]
fn an_unknown_command_is_an_error() {
    for arguments in [&["paint"][..], &["render"], &[]] {
        let output = welkin().args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains("Usage"), "{}", stderr(&output));
    }
}
