//! `welkin reference`: what it writes, when it stops, how it goes on, and what it refuses.
mod support;

use std::path::Path;

use support::folder::{BALLS, directory, files, npy, refused, run};
use support::stderr;

/// The values of a picture in f32.
fn exr(path: &Path) -> Vec<f32> {
    let picture = image::open(path).unwrap();
    assert_eq!(picture.color(), image::ColorType::Rgb32F);
    picture.into_rgb32f().into_raw()
}

/// Samples a pixel and relative noise that a run has told of.
fn told(output: &std::process::Output) -> (u32, f64) {
    let text = stderr(output);
    let line = text.lines().find(|line| line.contains("relative noise")).unwrap_or_else(|| panic!("{text}"));
    let number = |before: &str| line[..line.find(before).unwrap()].rsplit(' ').next().unwrap().to_owned();
    let noise = line.split("relative noise ").nth(1).unwrap().split(',').next().unwrap();
    (number(" samples a pixel").parse().unwrap(), noise.parse().unwrap())
}

#[test]
fn every_format_holds_the_same_picture_and_its_variance() {
    let directory = directory(BALLS);
    let (path, line) = (directory.path(), "reference sky.toml --size 16x12 --spp 64");
    let output = run(path, &format!("{line} -o a.exr --aux"));
    assert_eq!(files(path), ["a.exr", "a.state", "a.transmittance.npy", "a.variance.exr"]);
    run(path, &format!("{line} -o b.npy"));
    assert_eq!(files(path)[4..], ["b.npy", "b.state", "b.variance.npy"]);
    let (radiance, variance) = (exr(&path.join("a.exr")), exr(&path.join("a.variance.exr")));
    assert_eq!(npy(&path.join("b.npy")), (vec![12, 16, 3], radiance.clone()));
    assert_eq!(npy(&path.join("b.variance.npy")), (vec![12, 16, 3], variance.clone()));

    // Before black with no air the picture is the clouds' light alone, whose noise the command tells in four digits.
    let sum = |values: &[f32], of: fn(f64) -> f64| values.iter().map(|&v| of(f64::from(v))).sum::<f64>();
    let noise = (sum(&variance, |v| v) / sum(&radiance, |v| v * v)).sqrt();
    let (samples, told) = told(&output);
    assert!(samples == 64 && (told - noise).abs() < 1e-4, "{told}, not {noise}");
    let (shape, transmittance) = npy(&path.join("a.transmittance.npy"));
    assert_eq!(shape, [12, 16]);
    for (pixel, &t) in transmittance.iter().enumerate() {
        let values = pixel * 3..pixel * 3 + 3;
        let dark = radiance[values.clone()].iter().chain(&variance[values]).all(|&v| v == 0.0);
        assert!((0.0..=1.0).contains(&t) && dark == (t == 1.0), "pixel {pixel}: cloud shines, and nothing else");
    }
    assert!(transmittance.contains(&1.0) && transmittance[6 * 16 + 8] < 0.1, "a ball before nothing");

    // Another seed's picture differs by what both variances say. Some 60 pixels of three nearly equal values.
    run(path, &format!("{line} -o c.npy --seed 7"));
    let (other, its) = (npy(&path.join("c.npy")).1, npy(&path.join("c.variance.npy")).1);
    let squares: f64 = radiance.iter().zip(&other).map(|(a, c)| f64::from(a - c).powi(2)).sum();
    let ratio = squares / (sum(&variance, |v| v) + sum(&its, |v| v));
    assert!((0.4..2.5).contains(&ratio), "{ratio}");

    // A picture to look at, from what was gathered for another.
    let output = run(path, &format!("{line} -o d.png --resume a.state"));
    assert!(stderr(&output).contains("going on from 64 samples a pixel"));
    assert_eq!(files(path)[10..], ["d.png", "d.state", "d.variance.npy"]);
    assert_eq!(npy(&path.join("d.variance.npy")).1, variance);
    let shown = image::open(path.join("d.png")).unwrap().into_rgb8();
    assert!(shown.dimensions() == (16, 12) && shown.get_pixel(8, 6).0 > [30; 3] && shown.get_pixel(0, 0).0 == [0; 3]);
}

#[test]
fn it_stops_at_the_samples_or_at_the_noise_asked_for() {
    let directory = directory(BALLS);
    let go = |line: &str| told(&run(directory.path(), &format!("reference sky.toml -o a.npy --size 16x12 {line}")));
    assert_eq!(go("--spp 5").0, 5);
    let (samples, noise) = go("--noise 0.2");
    assert!(noise <= 0.2 && samples > 16, "{samples} {noise}");
    // Passes double while they are short, so that up to twice what is needed is gathered; and noise is not known exactly.
    assert!(noise > 0.2 / 2.0, "{samples} {noise}");
    assert_eq!(go("--noise 1e-9 --spp 20").0, 20);
    assert_eq!(go("--noise 0.99 --spp 3").0, 3);
    // However much noise is allowed, it has to be known.
    let (samples, _) = go("--noise 0.99");
    assert!((16..=64).contains(&samples), "{samples}");
    // Nothing to see: no noise, and an end.
    let (samples, noise) = go("--noise 0.01 --set camera.yaw=180");
    assert!(samples >= 16 && noise == 0.0, "{samples} {noise}");
}

#[test]
fn a_run_that_was_stopped_goes_on_to_the_same_bits() {
    let directory = directory(BALLS);
    let path = directory.path();
    let line = "reference sky.toml --size 17x11 --sun disc --antialias --seed 3";
    run(path, &format!("{line} -o a.exr --spp 41"));
    run(path, &format!("{line} -o b.exr --spp 20"));
    run(path, &format!("{line} -o b.exr --spp 41 --resume"));
    for end in ["exr", "variance.exr", "state"] {
        let read = |name: &str| std::fs::read(path.join(name).with_extension(end)).unwrap();
        assert!(read("a") == read("b"), "{end} differs");
    }
    // Fewer samples than there are: nothing is taken away.
    let output = run(path, &format!("{line} -o c.exr --spp 7 --resume b.state"));
    assert_eq!(told(&output).0, 41);
}

#[test]
fn bad_input_is_named_and_leaves_everything_as_it_was() {
    let directory = directory(BALLS);
    let path = directory.path();
    let line = "reference sky.toml --size 9x7 --spp 4";
    run(path, &format!("{line} -o a.npy"));
    for (flags, parts) in [
        ("-o a.jpg --spp 4", &["a.jpg", ".png, .exr or .npy"][..]),
        ("-o none/a.exr --spp 4", &["none/a.exr", "no directory none"]),
        ("-o . --spp 4", &["names no picture format"]),
        ("-o a.npy --spp 0", &["--spp", "'0'", "1..=100000000"]),
        ("-o a.npy --spp=-3", &["--spp", "-3", "1..=100000000"]),
        ("-o a.npy --spp 4.5", &["--spp", "4.5"]),
        ("-o a.npy --noise=-0.1", &["--noise", "-0.1", "above 0"]),
        ("-o a.npy --noise 0", &["--noise", "'0'", "above 0"]),
        ("-o a.npy --noise nan", &["--noise", "nan", "above 0"]),
        ("-o a.npy", &["--spp <N>", "--noise <ERROR>"]),
        ("-o a.npy --spp 4 --seed=-1", &["--seed", "-1"]),
        ("-o a.npy --spp 4 --sun square", &["--sun", "square", "disc"]),
        ("-o a.npy --spp 4 --size 0x7", &["--size", "0x7"]),
        ("--spp 4", &["--output <OUT.{png,exr,npy}>"]),
        ("-o b.npy --spp 4 --resume", &["--resume = b.state", "cannot be read", "state of welkin reference"]),
        ("-o b.npy --spp 4 --resume=sky.toml", &["--resume = sky.toml", "not one of this version"]),
    ] {
        refused(path, &format!("reference sky.toml {flags}"), parts);
    }
    // A state of another picture, by anything that the picture depends on.
    for other in ["--size 7x9", "--size 9x7 --seed 1", "--size 9x7 --set clouds.sigma_t=0.05"] {
        let line = format!("reference sky.toml -o a.npy --spp 4 --resume {other}");
        let expected = "expected the state of this scene at this size, with this seed";
        refused(path, &line, &["--resume = a.state", expected]);
    }
    // A damaged state: its end is missing, a byte has changed, it is empty.
    let state = std::fs::read(path.join("a.state")).unwrap();
    let mut changed = state.clone();
    changed[state.len() / 2] ^= 1;
    for (damaged, found) in [
        (&state[..state.len() - 64], "checksum"),
        (&state[..state.len() - 1], "checksum"),
        (&changed, "checksum"),
        (&state[..40], "not one of this version"),
        (&[], "not one of this version"),
    ] {
        std::fs::write(path.join("bad.state"), damaged).unwrap();
        refused(
            path,
            &format!("{line} -o a.npy --resume bad.state"),
            &["--resume = bad.state", "expected a state", found],
        );
    }
    // Places that turn out to be directories: found before anything is traced, whichever file it is.
    for name in ["d.npy", "e.state", "f.variance.npy", "g.transmittance.npy"] {
        std::fs::create_dir(path.join(name)).unwrap();
        let output = &name[..1];
        let flags = format!("-o {output}.npy --spp 100000000 --aux");
        refused(path, &format!("reference sky.toml {flags}"), &[name, "it is a directory"]);
    }
}

/// A particle of a billowing style is drawn along rays and traced in space: both must show one body, its silhouette
/// included, where the noise that displaces it is seen most.
#[test]
fn rendered_silhouettes_are_those_of_the_traced_density() {
    let directory = directory(include_str!("../scenes/truth/heap.toml"));
    let line = "--size 128x72 --set sky.model=none --set clouds.lighting=flat -o";
    run(directory.path(), &format!("reference sky.toml --spp 24 {line} truth.npy"));
    run(
        directory.path(),
        &format!(
            "render sky.toml --tables reduced --set quality.downscale=1 --set quality.precision=f32 {line} picture.npy"
        ),
    );
    let [truth, variance, picture] =
        ["truth.npy", "truth.variance.npy", "picture.npy"].map(|name| npy(&directory.path().join(name)).1);
    let sum = |of: &dyn Fn(usize) -> f64| (0..truth.len()).map(of).sum::<f64>();
    let noise = sum(&|i| f64::from(variance[i]));
    let difference = sum(&|i| f64::from(picture[i] - truth[i]).powi(2)) - noise;
    let error = (difference.max(0.0) / (sum(&|i| f64::from(truth[i]).powi(2)) - noise)).sqrt();
    let cover = sum(&|i| picture[i].into()) / sum(&|i| truth[i].into());
    // One look at the noise stands for a search along the ray. Looked up where the ray enters the ellipsoid, 0.29.
    assert!(error < 0.2 && (cover - 1.0).abs() < 0.05, "relative RMSE {error:.3}, cover {cover:.3}");
    println!("relative RMSE {error:.3}, cover {cover:.3}");
}
