//! `welkin ab`: what it writes, what it refuses, and what it finds.
mod support;

use std::path::Path;
use std::process::Output;

use serde_json::Value;
use support::{root, stderr, stdout, welkin};

/// Two overlapping balls that a moving camera sees change places.
const SCENE: &str = r#"
    [camera]
    position = [-10, 0, 0]
    look_at = [0, 0, -100]
    fov_y = 40
    [clouds]
    source = "particles"
    lighting = "flat"
    style = "homogeneous"
    [[clouds.particle]]
    centre = [-12, 0, -100]
    radii = [20, 20, 20]
    colour = [1, 0.2, 0.1]
    [[clouds.particle]]
    centre = [12, 0, -100]
    radii = [20, 20, 20]
    colour = [0.1, 0.3, 1]
    [quality]
    downscale = 1
    [sky]
    model = "none"
    [animation]
    velocity = [4, 0, 0]
"#;

fn directory() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("scene.toml"), SCENE).unwrap();
    directory
}

/// `welkin ab scene.toml --out out` with the words of `line`, in `directory`.
fn ab(directory: &Path, line: &str) -> Output {
    let mut command = welkin();
    command.args(["ab", "scene.toml", "--out", "out"]).args(line.split_whitespace());
    command.current_dir(directory).output().unwrap()
}

#[track_caller]
fn metrics(directory: &Path, line: &str, status: i32) -> Value {
    let output = ab(directory, line);
    assert_eq!(output.status.code(), Some(status), "{line}: {}", stderr(&output));
    assert_eq!(stdout(&output), "");
    serde_json::from_slice(&std::fs::read(directory.join("out/metrics.json")).unwrap()).unwrap()
}

#[track_caller]
fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number at {pointer}"))
}

/// The paper's merge on this device: through interlock, or where there is none through attachments.
fn one_segment() -> &'static str {
    let report = welkin().args(["devices", "--json"]).output().unwrap();
    let report: Value = serde_json::from_slice(&report.stdout).unwrap();
    let modes = report["devices"][0]["blend"].as_array().unwrap();
    let has = |name: &str| modes.iter().any(|mode| mode["mode"] == name && mode["supported"] == true);
    if has("interlock") { "interlock" } else { "attachment" }
}

#[test]
fn a_sequence_leaves_pictures_metrics_and_a_report() {
    let directory = directory();
    let m = metrics(directory.path(), "--a list --b alpha --reference oracle --frames 2..5 --size 48x32", 0);
    for side in ["a", "b"] {
        for key in ["rmse", "rel_mse", "psnr", "flip_mean", "max_abs", "popping", "frame_gpu_ms"] {
            assert!(number(&m, &format!("/{side}/{key}")) >= 0.0);
        }
        assert_eq!(m[side]["frames"].as_array().unwrap().len(), 3);
    }
    assert_eq!((&m["frames"], &m["passed"], &m["reference"]["used"]), (&[2, 4].into(), &true.into(), &"oracle".into()));
    // The same numbers out of the files.
    let out = directory.path().join("out");
    let layers = std::fs::read(out.join("layers.0002.exr")).unwrap();
    let holds = |name: &[u8]| layers.windows(name.len()).any(|bytes| bytes == name);
    assert!(holds(b"reference_oracle.R\0") && holds(b".B\0") && !holds(b"\0R\0"));
    let pixels = |name: &str| image::open(out.join(name)).unwrap().into_rgb32f().into_raw();
    let (mut sum, mut greatest, mut values) = (0.0, 0.0f64, 0.0);
    let (mut pops, mut pairs) = (0.0, 0.0);
    for frame in 2..5 {
        let [b, r] = ["b", "reference"].map(|name| pixels(&format!("{name}.{frame:04}.exr")));
        for (b, r) in b.iter().zip(&r) {
            let difference = (f64::from(*b) - f64::from(*r)).abs();
            (sum, greatest, values) = (sum + difference * difference, greatest.max(difference), values + 1.0);
        }
        if frame > 2 {
            let [b0, r0] = ["b", "reference"].map(|name| pixels(&format!("{name}.{:04}.exr", frame - 1)));
            let norm = |of: &dyn Fn(usize) -> f64| (0..b.len()).map(|i| of(i).powi(2)).sum::<f64>().sqrt();
            let motion = |i: usize| f64::from(r[i]) - f64::from(r0[i]);
            let change = |i: usize| f64::from(b[i]) - f64::from(b0[i]);
            (pops, pairs) = (pops + norm(&|i| change(i) - motion(i)) / norm(&motion), pairs + 1.0);
        }
    }
    assert!((number(&m, "/b/rmse") - (sum / values).sqrt()).abs() < 1e-9);
    assert!((number(&m, "/b/max_abs") - greatest).abs() < 1e-9);
    assert!((number(&m, "/b/popping") - pops / pairs).abs() < 1e-9);
    for name in ["a.0002.png", "b.0004.png", "reference.0003.png", "flip_a.0002.png", "difference_b.0004.png"] {
        assert!(out.join(name).is_file(), "{name} is missing");
    }
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(report.matches("data:image/png;base64,").count(), 3 * 7);
    for outside in ["http://", "https://", "src=\"", "<link"] {
        assert!(!report.contains(outside), "the report is not on its own: {outside}");
    }
}

/// f32 segments of grazing rays: the chord grows with the square root of the rounding of the closest approach.
const GRAZING: f64 = 1e-3;

#[test]
fn exact_modes_and_the_oracle_agree_and_limits_decide_the_status() {
    let directory = directory();
    let line = "--a list --b alpha --reference oracle --size 48x32";
    let m = metrics(directory.path(), &format!("{line} --max-rmse 1e-3 --max-flip 0.01 --max-abs 1e-3"), 0);
    assert!(number(&m, "/a/max_abs") < GRAZING && number(&m, "/b/max_abs") > 10.0 * GRAZING);
    assert_eq!((&m["a"]["popping"], m["limits"].as_array().unwrap().len()), (&Value::Null, 3));
    let failed = metrics(directory.path(), "--a alpha --b list --reference oracle --size 48x32 --max-rmse 1e-3", 1);
    assert_eq!((&failed["passed"], &failed["limits"][0]["metric"]), (&false.into(), &"rmse".into()));
    let same = metrics(directory.path(), "--a list --b list --reference list --size 48x32", 0);
    assert_eq!((number(&same, "/a/rmse"), &same["b"]["psnr"]), (0.0, &Value::Null));
}

#[test]
fn a_path_traced_reference_tells_its_noise() {
    let directory = directory();
    let m = metrics(directory.path(), "--a list --b alpha --reference path --spp 64 --size 24x16", 0);
    let (rmse, noise) = (number(&m, "/a/rmse"), number(&m, "/a/noise"));
    assert!(noise > 0.0 && (0.5..2.0).contains(&(rmse / noise)), "{rmse} {noise}"); // All that a differs in is noise.
    assert!(number(&m, "/a/rmse_less_noise") < rmse);
    assert!(number(&m, "/b/rmse_less_noise") > 3.0 * number(&m, "/a/rmse_less_noise"));
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let directory = directory();
    for (line, complaint) in [
        ("--a list", "--b <MODE[:K]>"),
        ("--a glass --b list", "'glass' for '--a"),
        ("--a list --b impostor", "--b \"impostor\" is not supported"),
        ("--a list --b list --reference truth", "or exact, path, oracle"),
        ("--a list --b list --spp 8", "--spp = …: expected --reference path beside it"),
        ("--a list --b list --max-rmse=-1", "expected a number that is not negative"),
        ("--a list --b list --max-popping 1", "--max-popping = …: expected --frames A..B"),
        ("--a list --b list --reference oracle --set sky.model=atmosphere", "the exact oracle"),
        (
            "--a list --b list --frames 0..4 --set animation.velocity=[0,1e5,0] --set camera.position=[0,9e5,0] \
          --set sky.model=atmosphere --set camera.look_at=[0,0,1]",
            "camera.position[1]",
        ),
    ] {
        let output = ab(directory.path(), line);
        assert_eq!(output.status.code(), Some(2), "{line}: {}", stderr(&output));
        assert!(stderr(&output).contains(complaint), "{line}: {}", stderr(&output));
        assert!(!directory.path().join("out/metrics.json").exists(), "{line}");
    }
}

/// Figure 13 of Yusov 2014: spheres of opacity near 1, the camera nudged to the right, so that they change order.
#[test]
fn alpha_pops_where_volumes_are_merged_and_exact_modes_do_not() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::copy(root().join("scenes/popping.toml"), directory.path().join("scene.toml")).unwrap();
    let popping = |a: &str| {
        let line = format!("--a {a} --b alpha --reference oracle --frames 0..8 --size 160x90");
        let m = metrics(directory.path(), &line, 0);
        (number(&m, "/a/popping"), number(&m, "/b/popping"))
    };
    let (merged, alpha) = popping(one_segment());
    assert!(alpha > 5.0 * merged, "alpha {alpha}, {} {merged}", one_segment());
    let (exact, alpha) = popping("list");
    assert!(alpha > 50.0 * exact, "alpha {alpha}, list {exact}");
    println!("popping: alpha {alpha:.4}, {} {merged:.4}, list {exact:.2e}", one_segment());
}
