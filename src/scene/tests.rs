use super::*;
use crate::params::{Aim, Blend, Coverage, Light, Lighting, Quality, Source, Splat, Style, SunPosition};

fn read(text: &str, overrides: &[&str]) -> Result<Params> {
    let overrides: Vec<_> =
        overrides.iter().map(|o| Override { flag: "--set".into(), assignment: (*o).into() }).collect();
    parse(text, Path::new("sky.toml"), &overrides)
}

fn complaint(text: &str, overrides: &[&str]) -> String {
    read(text, overrides).unwrap_err().to_string()
}

#[test]
fn an_empty_file_is_the_default_sky() {
    assert_eq!(read("", &[]).unwrap(), Params::default());
    assert_eq!(read("[clouds]\n[sky]\n", &[]).unwrap(), Params::default());
}

#[test]
fn every_section_is_read() {
    let text = r#"
        [camera]
        position = [1, 2.5, 3]
        look_at = [1, 2.5, -7]
        fov_y = 45
        [sun]
        time = 2026-06-21T16:00:00+02:00
        latitude = 48.5
        longitude = 9
        [clouds]
        source = "particles"
        lighting = "flat"
        style = "homogeneous"
        seed = 7
        sigma_t = 0.02
        [[clouds.particle]]
        centre = [0, 10, -100]
        radii = [10, 20, 30]
        rotation = [0, 0, 0, 4]
        colour = [0.5, 0.25, 1]
        [quality]
        preset = "low"
        layers = 3
        blend = "alpha"
        [sky]
        model = "none"
        [film]
        exposure_ev = -1
        [animation]
        velocity = [0, 0, -5]
    "#;
    let params = read(text, &[]).unwrap();
    assert_eq!(params.camera.aim, Aim::LookAt([1.0, 2.5, -7.0]));
    let expected = SunPosition::Time { unix_seconds: 1_782_050_400.0, latitude: 48.5, longitude: 9.0 };
    assert_eq!(params.sun.position, expected);
    assert_eq!((params.clouds.lighting, params.clouds.style), (Lighting::Flat, Style::Homogeneous));
    let Source::Particles(list) = &params.clouds.source else { panic!("not particles") };
    assert_eq!((list.len(), list[0].rotation, list[0].density), (1, [0.0, 0.0, 0.0, 1.0], 1.0));
    let expected = Quality { cells: 104, layers: 3, blend: Blend::Alpha, ..Quality::default() };
    assert_eq!(params.quality, expected);
    assert_eq!(params.animation.velocity, [0.0, 0.0, -5.0]);
}

#[test]
fn faults_point_at_line_and_column() {
    let cases = [
        ("[clouds]\n  coverage = -1", "sky.toml:2:14: clouds.coverage = -1: expected a number from 0.0 to 1.0"),
        ("[clouds]\ncoverage = nan", "sky.toml:2:12: clouds.coverage = NaN: expected"),
        ("[clouds]\ncoverage = \"lots\"", "sky.toml:2:12: clouds.coverage = \"lots\": expected a number"),
        ("[clouds]\nseed = -1", "sky.toml:2:8: clouds.seed = -1: expected a whole number"),
        ("\n[clouds]\ncovrage = 0.5", "sky.toml:3:1: clouds.covrage: expected a known key (one of source, "),
        ("[weather]\n", "sky.toml:1:2: weather: expected a known key (one of camera, sun, "),
        ("[camera]\nposition = [1, 2]", "sky.toml:2:12: camera.position = [1, 2]: expected a list of 3 numbers"),
        ("[camera]\nposition = [1, inf, 2]", "sky.toml:2:16: camera.position[1] = inf: expected"),
        (
            "[camera]\nposition = [1,2,3]\nlook_at = [1,2,3]",
            "sky.toml:3:11: camera.look_at = [1.0, 2.0, 3.0]: expected a point",
        ),
        ("[camera]\nyaw = 1\nlook_at = [1,2,3]", "sky.toml:3:11: camera.look_at"),
        ("[clouds]\nstyle = \"fluffy\"", "sky.toml:2:9: clouds.style = fluffy: expected one of pyroclastic, radial"),
        ("[quality]\nblend = \"glass\"", "sky.toml:2:9: quality.blend = glass: expected one of auto, "),
        (
            "[sun]\ntime = 2026-06-21\nlatitude = 1\nlongitude = 1",
            "sky.toml:2:8: sun.time = 2026-06-21: expected a date and time",
        ),
        ("[sun]\ntime = 2026-06-21T12:00:00Z", "sky.toml:2:8: sun.time = 2026-06-21T12:00:00Z: expected sun.latitude"),
        ("[clouds]\nsource = \"particles\"", "sky.toml:2:10: clouds.source = particles: expected clouds.file or"),
        (
            "[clouds]\ncoverage_map_offset = [1,2]",
            "sky.toml:2:23: clouds.coverage_map_offset = [1.0, 2.0]: expected clouds.",
        ),
        ("[clouds]\ncoverage_map_rotation = 5", "sky.toml:2:25: clouds.coverage_map_rotation = 5: expected clouds."),
        (
            "[clouds]\ncoverage_map_offset = [1]",
            "sky.toml:2:23: clouds.coverage_map_offset = [1]: expected a list of 2",
        ),
        ("[clouds\n", "sky.toml:1:8: not TOML: "),
        ("a = 1\na = 2", "sky.toml:2:1: not TOML: duplicate key"),
    ];
    for (text, expected) in cases {
        let message = complaint(text, &[]);
        assert!(message.starts_with(expected), "{text:?} gave {message:?}, not {expected:?}…");
    }
}

#[test]
fn a_bad_particle_is_pointed_at() {
    let text = "[clouds]\nsource = \"particles\"\n[[clouds.particle]]\ncentre = [0,0,0]\nradii = [1, 0, 1]\n";
    let message = complaint(text, &[]);
    assert!(message.starts_with("sky.toml:5:13: clouds.particle[0].radii[1] = 0: expected"), "{message}");
    let message = complaint(&text.replace("radii", "radius"), &[]);
    assert!(message.starts_with("sky.toml:5:1: clouds.particle[0].radius: expected a known key"), "{message}");
    let message = complaint(&text.replace("radii = [1, 0, 1]", ""), &[]);
    assert!(message.starts_with("sky.toml:3:1: clouds.particle[0]: expected the key radii"), "{message}");
}

#[test]
fn overrides_replace_values_in_order() {
    let text = "[clouds]\ncoverage = 0.9\nthickness = 500\n";
    let params =
        read(text, &["clouds.coverage=0.1", "clouds.style=radial", "camera.position=[1,2,3]", "clouds.coverage=0.2"]);
    let params = params.unwrap();
    assert_eq!(params.clouds.coverage, Coverage::Uniform(0.2));
    assert_eq!(params.clouds.style, Style::Radial);
    assert_eq!((params.clouds.thickness, params.camera.position), (500.0, [1.0, 2.0, 3.0]));
}

#[test]
fn faults_of_overrides_name_the_flag() {
    let cases = [
        ("clouds.coverage=2", "--set clouds.coverage = 2: expected a number from 0.0 to 1.0"),
        ("clouds.coverage=lots", "--set clouds.coverage = lots: expected a number"),
        ("clouds.covrage=0.2", "--set clouds.covrage = 0.2: expected a known key (one of source"),
        ("clouds.coverage", "--set = clouds.coverage: expected key=value"),
        ("=3", "--set = =3: expected key=value"),
        ("clouds coverage=3", "--set = clouds coverage=3: expected key=value"),
        ("clouds=3", "--set clouds = 3: expected"),
    ];
    for (assignment, expected) in cases {
        let message = complaint("[clouds]\ncoverage = 0.5\n", &[assignment]);
        assert!(message.starts_with(expected), "{assignment:?} gave {message:?}, not {expected:?}…");
    }
    // A fault of the file stays one, whatever is overridden.
    assert!(complaint("[clouds]\nseed = 0.5\n", &["clouds.xi=0.1"]).starts_with("sky.toml:2:8: clouds.seed = 0.5"));
}

#[test]
fn choices_of_later_versions_are_unsupported() {
    let error = read("[clouds]\nlighting = \"march\"", &[]).unwrap_err();
    assert!(matches!(error, Error::Unsupported { .. }));
    let expected =
        "clouds.lighting = \"march\" is not supported by this version yet (it has tables, flat, forward, attenuation)";
    assert_eq!(error.to_string(), expected);
}

#[test]
fn lights_are_read_and_bad_ones_are_pointed_at() {
    let text = "[clouds]\nlighting = \"forward\"\nsplat = \"polynomial\"\n[[clouds.light]]\nfrom = \"sun\"\n\
                [[clouds.light]]\nelevation = 0\nazimuth = 90\ncolour = [1, 0.5, 0.2]\n";
    let forward = read(text, &[]).unwrap().clouds.forward;
    assert_eq!((forward.lights.len(), forward.lights[0], forward.splat), (2, Light::SUN, Splat::Polynomial));
    let to_light = forward.lights[1].direction.unwrap();
    assert!((to_light[0] - 1.0).abs() < 1e-12 && forward.lights[1].colour == [1.0, 0.5, 0.2]); // f64 rounding
    let cases = [
        ("from = \"moon\"", "sky.toml:3:8: clouds.light[0].from = moon: expected one of own, sun, sky"),
        ("direction = [0, 0, 0]", "sky.toml:3:13: clouds.light[0].direction = [0.0, 0.0, 0.0]: expected a unit vector"),
        ("direction = [0, 2, 0]", "sky.toml:3:13: clouds.light[0].direction = [0.0, 2.0, 0.0]: expected a unit vector"),
        ("from = \"own\"", "sky.toml:3:8: clouds.light[0].from = own: expected direction or elevation and azimuth"),
        ("elevation = 91", "sky.toml:3:13: clouds.light[0].elevation = 91: expected a number from -90.0 to 90.0"),
        (
            "from = \"sun\"\ncolour = [1, -1, 1]",
            "sky.toml:4:14: clouds.light[0].colour[1] = -1: expected a number from 0.0",
        ),
        ("glow = 1", "sky.toml:3:1: clouds.light[0].glow: expected a known key"),
    ];
    for (keys, expected) in cases {
        let message = complaint(&format!("[clouds]\n[[clouds.light]]\n{keys}\n"), &[]);
        assert!(message.starts_with(expected), "{keys:?} gave {message:?}, not {expected:?}…");
    }
    let five = "[[clouds.light]]\nfrom = \"sun\"\n".repeat(5);
    let message = complaint(&format!("[clouds]\n{five}"), &[]);
    assert!(message.contains("clouds.light = 5 lights: expected 1 to 4 lights"), "{message}");
    let message = complaint("[clouds]\nsplat = \"cube\"\n", &[]);
    assert!(message.contains("clouds.splat = cube: expected one of gaussian, polynomial"), "{message}");
}

#[test]
fn files_are_relative_to_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("sky.toml");
    let grey = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(2, 1, |x, _| image::Luma([65_535 * x as u16]));
    grey.save(dir.path().join("map.png")).unwrap();
    std::fs::write(&scene, "[clouds]\ncoverage_map = \"map.png\"\ncoverage_map_extent = 5e4\n").unwrap();
    let Coverage::Map(map) = load(&scene, &[]).unwrap().clouds.coverage else { panic!("not a map") };
    assert_eq!((map.width, map.height, map.values, map.extent), (2, 1, vec![0.0, 1.0], 5.0e4));
    assert_eq!((map.offset, map.rotation), ([0.0, 0.0], 0.0));
    let bad = [("offset = [0, 2e7]", "offset[1] = 20000000: expected"), ("rotation = 361", "rotation = 361: expected")];
    for (key, expected) in bad {
        std::fs::write(&scene, format!("[clouds]\ncoverage_map = \"map.png\"\ncoverage_map_{key}\n")).unwrap();
        let message = load(&scene, &[]).unwrap_err().to_string();
        assert!(message.contains("sky.toml:3:") && message.contains(expected), "{message}");
    }

    std::fs::write(dir.path().join("cloud.csv"), "0,0,0,1,1,1,0,0,0,1,1\n0,0,0,1,1,1,0,0,0,1\n").unwrap();
    std::fs::write(&scene, "[clouds]\nsource = \"particles\"\nfile = \"cloud.csv\"\n").unwrap();
    let message = load(&scene, &[]).unwrap_err().to_string();
    assert!(message.contains("cloud.csv:2:1: 10 columns"), "{message}");
    std::fs::write(&scene, "[clouds]\nsource = \"particles\"\nfile = \"none.csv\"\n").unwrap();
    let message = load(&scene, &[]).unwrap_err().to_string();
    assert!(message.contains("none.csv: cannot be read: ") && message.contains("clouds.file"), "{message}");
}

#[test]
fn a_missing_scene_file_is_named() {
    let message = load(Path::new("no/such.toml"), &[]).unwrap_err().to_string();
    assert!(message.starts_with("no/such.toml: cannot be read: "), "{message}");
}

#[test]
fn the_scenes_of_the_repository_are_valid() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut count = 0;
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            match load(&path, &[]) {
                Ok(_) => count += 1,
                // Lists of many particles are made, not kept; the scene tells how.
                Err(error) if std::fs::read_to_string(&path).unwrap().contains("welkin scatter -o scenes/") => {
                    let message = error.to_string();
                    assert!(message.contains(".csv") && message.contains("`welkin scatter` makes"), "{message}");
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
    assert!(count >= 7, "{count} scenes");
}
