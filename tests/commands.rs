//! What the commands make: pictures, sequences, statistics, measurements, tables.
mod support;

use std::process::Output;
use support::folder::{command, directory, files, json, npy, refused, run};
use support::{stderr, stdout};

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
    colour = [1, 0.5, 0.25]
    [quality]
    downscale = 1
    [sky]
    model = "none"
    [animation]
    velocity = [0, 0, -20]
"#;

#[test]
fn devices_says_why_a_mode_cannot_be_used() {
    let directory = directory("");
    let report: serde_json::Value = serde_json::from_str(&stdout(&run(directory.path(), "devices --json"))).unwrap();
    let devices = report["devices"].as_array().unwrap();
    assert!(!devices.is_empty());
    for mode in devices.iter().flat_map(|device| device["blend"].as_array().unwrap()) {
        assert_ne!(mode["supported"].as_bool().unwrap(), mode["reason"].is_string(), "{mode}");
        let windows = mode["windows"].as_array();
        assert_eq!(windows.is_some(), mode["mode"] == "interlock" || mode["mode"] == "attachment", "{mode}");
        assert!(windows.is_none_or(|k| k.is_empty() != mode["supported"].as_bool().unwrap()), "{mode}");
    }
    assert!(report["pipelines"].is_null());
    assert!(stdout(&run(directory.path(), "devices")).contains("interlock"));
}

#[test]
fn devices_prints_every_pipeline_of_a_frame() {
    let directory = directory("");
    let output = run(directory.path(), "devices --json --pipelines");
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let pipelines: Vec<_> = report["pipelines"].as_array().unwrap().iter().map(|p| p.as_str().unwrap()).collect();
    for stage in ["grid/", "compact/", "tiling/", "lighting/", "detail/", "atmosphere/", "blend/", "film/"] {
        assert!(pipelines.iter().any(|pipeline| pipeline.starts_with(stage)), "{stage}: {pipelines:?}");
    }
    let text = stdout(&run(directory.path(), "devices --pipelines"));
    assert!(pipelines.iter().all(|pipeline| text.contains(pipeline)), "{text}");
}

#[test]
fn a_picture_its_transmittance_and_its_statistics() {
    let directory = directory(FLAT);
    let path = |name| directory.path().join(name);
    run(directory.path(), "render sky.toml -o a.exr --size 40x30 --aux --stats s.json");
    assert_eq!(files(directory.path()), ["a.exr", "a.transmittance.npy", "s.json"]);

    let picture = image::open(path("a.exr")).unwrap().to_rgb32f();
    assert_eq!(picture.dimensions(), (40, 30));
    // Through the middle of the ellipsoid τ = 0.07 · 200: Eq. 8 with T = 8e-7 leaves its own colour alone.
    let middle = picture.get_pixel(20, 15).0;
    let bound = 1e-3; // half-float targets hold three digits
    assert!(middle.iter().zip([1.0, 0.5, 0.25]).all(|(v, c)| (v - c).abs() < bound), "{middle:?}");
    assert_eq!(picture.get_pixel(0, 0).0, [0.0; 3]);

    let (shape, transmittance) = npy(&path("a.transmittance.npy"));
    assert_eq!(shape, [30, 40]);
    assert_eq!(transmittance[0], 1.0);
    assert!(transmittance[15 * 40 + 20] < 1e-3);

    let stats = json(&path("s.json"));
    assert_eq!((&stats["particles"]["generated"], &stats["particles"]["visible"]), (&1.into(), &1.into()));
    assert_eq!(stats["blend"]["requested"], "auto");
    assert!(stats["blend"]["used"] == "interlock" || stats["blend"]["reason"].as_str().unwrap().contains("interlock"));
    assert_eq!(stats["validation_messages"], 0);
    assert!(stats["tables"].is_null(), "nothing here reads tables");
    let passes = stats["passes"].as_array().unwrap();
    let sum: f64 = passes.iter().map(|pass| pass["gpu_ms"].as_f64().unwrap()).sum();
    assert!(
        !passes.is_empty() && (stats["frame_gpu_ms"].as_f64().unwrap() - sum).abs() < 1e-5,
        "up to rounding to 1 ns"
    );
}

/// Every test starts commands under validation. That a message is seen shows where the layer is told to give advice too.
#[test]
fn a_message_of_the_validation_layer_is_an_error() {
    let directory = directory(FLAT);
    for line in [
        "bench sky.toml --size 8x8 --blend alpha --measure 1 --warmup 0",
        "ab sky.toml --a alpha --b alpha --reference list --size 8x8 --out out",
        "reference sky.toml -o a.exr --size 8x8 --spp 1",
    ] {
        let mut command = command(directory.path(), line);
        command.env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_BEST_PRACTICES_EXT");
        let output = command.output().unwrap();
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{line}: {message}");
        assert!(message.contains("welkin: validation: "), "{line}: {message}");
        assert!(message.contains("expected no message from the validation layer"), "{line}: {message}");
    }
}

#[test]
fn a_sequence_is_numbered_and_moves() {
    let directory = directory(FLAT);
    run(directory.path(), "render sky.toml -o a.npy --size 160x80 --frames 3..5");
    assert_eq!(files(directory.path()), ["a.0003.npy", "a.0004.npy"]);
    let read = |name| std::fs::read(directory.path().join(name)).unwrap();
    assert!(read("a.0003.npy") != read("a.0004.npy"), "the camera moved 20 m, the picture did not change");
    // A frame of a sequence is the picture of the scene with the camera there.
    run(directory.path(), "render sky.toml -o b.npy --size 160x80 --set camera.position=[0,0,-60]");
    assert!(read("a.0003.npy") == read("b.npy"));
}

#[test]
fn several_scenes_go_into_a_directory_with_one_list_of_statistics() {
    let directory = directory(FLAT);
    std::fs::write(directory.path().join("b.toml"), FLAT).unwrap();
    let output = run(directory.path(), "render sky.toml b.toml -o out/ --size 16x8 --png16 --stats");
    assert_eq!(files(&directory.path().join("out")), ["b.png", "sky.png"]);
    let stats: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(stats.as_array().unwrap().len(), 2);
    let picture = image::open(directory.path().join("out/sky.png")).unwrap();
    assert_eq!((picture.color(), picture.width(), picture.height()), (image::ColorType::Rgb16, 16, 8));
}

#[test]
fn bench_compares_two_modes_in_one_run() {
    let directory = directory(FLAT);
    let line = "bench sky.toml --size 32x16 --blend alpha --vs alpha --measure 2 --warmup 1 --json";
    let report: serde_json::Value = serde_json::from_str(&stdout(&run(directory.path(), line))).unwrap();
    assert_eq!((&report["a"]["blend"]["used"], &report["b"]["blend"]["used"]), (&"alpha".into(), &"alpha".into()));
    assert!(report["ratio"]["frame"].as_f64().unwrap() > 0.0);
    let passes = report["a"]["passes"].as_array().unwrap();
    assert!(passes.iter().any(|pass| pass["name"] == "blend" && pass["p95_ms"].as_f64() >= pass["median_ms"].as_f64()));
}

#[test]
fn bench_compares_values_of_the_scene_in_one_run() {
    let directory = directory(FLAT);
    let line = "bench sky.toml --size 32x16 --vs alpha --vs-set clouds.coverage=0 --vs-set film.exposure_ev=1 --measure 2 --warmup 0 --json";
    let report: serde_json::Value = serde_json::from_str(&stdout(&run(directory.path(), line))).unwrap();
    let opponents = report["vs"].as_array().unwrap();
    let sets: Vec<_> = opponents.iter().map(|opponent| opponent["set"].clone()).collect();
    assert_eq!(sets, [serde_json::json!([]), serde_json::json!(["clouds.coverage=0", "film.exposure_ev=1"])]);
    let turns = &opponents[1]["ratio"]["frame_in_turns"];
    let [low, median, high] = ["low", "median", "high"].map(|key| turns[key].as_f64().unwrap());
    assert!(0.0 < low && low <= median && median <= high, "{turns}");

    let line = "bench sky.toml --size 32x16 --vs-set clouds.covrage=0";
    refused(directory.path(), line, &["--vs-set", "clouds.covrage", "known key"]);
}

#[test]
fn bench_measures_forward_scattering_against_one_read_back_a_particle() {
    let directory = directory(FLAT);
    let line = "bench sky.toml --size 32x16 --serial-forward --measure 2 --warmup 0 --json";
    let report: serde_json::Value = serde_json::from_str(&stdout(&run(directory.path(), line))).unwrap();
    let [serial, forward, ratio] = ["serial_ms", "forward_ms", "ratio"].map(|key| report[key].as_f64().unwrap());
    assert!(report["particles"] == 1 && serial > 0.0 && forward > 0.0 && (ratio * forward / serial - 1.0).abs() < 1e-9);

    std::fs::write(directory.path().join("sky.toml"), "").unwrap();
    refused(directory.path(), "bench sky.toml --serial-forward", &["--serial-forward", "lists of particles"]);
}

#[test]
fn tables_are_made_once_read_from_the_cache_and_made_anew_when_damaged() {
    let directory = directory("");
    let cache = directory.path().join("cache");
    let made = |output: &Output| stderr(output).contains("made the tables");
    let line = "precompute --reduced --out out";
    assert!(made(&run(directory.path(), line)));

    let out = directory.path().join("out");
    assert_eq!(files(&out), ["first_matter.npy", "multiple.npy", "optical_depth.npy", "single.npy", "tables.json"]);
    let index = json(&out.join("tables.json"));
    for table in index["tables"].as_array().unwrap() {
        let (shape, values) = npy(&out.join(table["file"].as_str().unwrap()));
        assert_eq!(serde_json::json!(shape), table["shape"]);
        assert!(
            values.iter().all(|&v| (0.0..=10.0).contains(&v)),
            "mean densities and source functions are of order 1"
        );
    }
    let first = std::fs::read(out.join("multiple.npy")).unwrap();

    assert!(!made(&run(directory.path(), line)), "the cache was not used");
    for file in files(&cache) {
        let path = cache.join(file);
        let mut bytes = std::fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(&path, bytes).unwrap();
    }
    let again = run(directory.path(), line);
    assert!(made(&again) && stderr(&again).contains("warning"), "{}", stderr(&again));
    assert!(std::fs::read(out.join("multiple.npy")).unwrap() == first, "rebuilt tables differ");
}

#[test]
fn a_sequence_may_start_on_reduced_tables_and_leaves_the_cache_whole() {
    let directory = directory(&FLAT.replace("\"flat\"", "\"tables\""));
    let path = directory.path();
    run(path, "render sky.toml --size 32x24 --frames 0..3 --tables progressive --stats s.json -o out.png");
    let stats = json(&path.join("s.json"));
    let lit: Vec<_> = stats["frames"].as_array().unwrap().iter().map(|frame| frame["tables"].clone()).collect();
    // No machine makes full tables before the first frame is recorded; the command ends without waiting for them.
    assert_eq!((lit.len(), &lit[0]), (3, &serde_json::json!("reduced")));
    assert_eq!(stats["tables"]["size"], lit[2]);
    assert_eq!(stats["validation_messages"], 0);
    let names = files(&path.join("cache"));
    assert!(names.len() >= 2 && names.iter().all(|name| name.ends_with(".table")), "{names:?}");

    let output = run(path, "render sky.toml --size 32x24 --tables reduced --stats s.json -o out.png");
    assert!(!stderr(&output).contains("warning"), "{}", stderr(&output));
    assert_eq!(json(&path.join("s.json"))["tables"]["from"], "cache");
}
