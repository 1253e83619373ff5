//! What is measured, in order of worth, and what each measurement's output says.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::Value;

use super::super::args::ScaleArg;
use super::child::Ended;
use super::report::{Checks, Device, Passes, Report};

/// The scenes of the gallery (scripts/gallery).
const GALLERY: [&str; 6] = ["noon", "above", "silver-lining", "inside", "sparse", "overcast"];

/// Measurements that belong together.
pub struct Step {
    pub name: &'static str,
    pub about: &'static str,
    /// For all of its tasks.
    pub limit: Duration,
    pub tasks: Vec<Task>,
    /// On a CPU driver it shows nothing, for this reason.
    pub gpu_only: Option<&'static str>,
}

/// One process.
pub struct Task {
    pub name: String,
    /// The program; none for `welkin` itself.
    pub program: Option<PathBuf>,
    pub args: Vec<String>,
    pub kind: Kind,
}

/// What a task's output is.
pub enum Kind {
    Devices,
    /// The device in use, from a run of `conform`.
    Device,
    /// A picture, and the one to compare it with.
    Picture {
        file: PathBuf,
        reference: PathBuf,
    },
    Bench {
        size: &'static str,
        preset: &'static str,
    },
    Tables,
    Conform,
    Paths,
    Sort,
    Test,
    Memory {
        size: &'static str,
        preset: &'static str,
    },
}

/// Sizes of everything.
struct Sizes {
    pictures: &'static str,
    picture_preset: &'static str,
    bench: &'static [(&'static str, &'static str)],
    frames: &'static str,
    tables: &'static str,
    conform: &'static [&'static str],
    reference: (&'static str, &'static str),
    sort: &'static str,
    memory: &'static [(&'static str, &'static str)],
    /// Limits of the steps [s].
    limits: [u64; 8],
    scenes: usize,
}

const FULL: Sizes = Sizes {
    pictures: "640x360",
    picture_preset: "high",
    bench: &[
        ("1920x1080", "high"),
        ("3840x2160", "high"),
        ("1280x720", "high"),
        ("1920x1080", "medium"),
        ("1920x1080", "low"),
        ("1280x720", "medium"),
        ("1280x720", "low"),
        ("3840x2160", "medium"),
        ("3840x2160", "low"),
    ],
    frames: "20",
    tables: "full",
    // The short matrix first: whole, whatever comes. `static` has run before.
    conform: &["quick", "interlock.*", "attachment.*", "images.*", "blocks.*"],
    reference: ("1280x720", "32"),
    sort: "100000,1000000,10000000",
    memory: &[
        ("1920x1080", "high"),
        ("3840x2160", "high"),
        ("1280x720", "high"),
        ("1280x720", "medium"),
        ("1280x720", "low"),
    ],
    limits: [20, 45, 110, 20, 90, 35, 45, 25],
    scenes: 6,
};

const MODEST: Sizes = Sizes {
    pictures: "320x180",
    picture_preset: "high",
    bench: &[("320x180", "high")],
    frames: "3",
    tables: "full",
    conform: &["quick"],
    reference: ("160x90", "8"),
    sort: "100000,1000000",
    memory: &[("320x180", "high"), ("640x360", "high"), ("320x180", "low")],
    limits: [60, 120, 300, 300, 180, 90, 180, 90],
    scenes: 6,
};

const TINY: Sizes = Sizes {
    pictures: "96x54",
    picture_preset: "low",
    bench: &[("96x54", "low")],
    frames: "2",
    tables: "reduced",
    conform: &["blocks.append*"],
    reference: ("32x18", "2"),
    sort: "1000,20000",
    memory: &[("96x54", "low")],
    limits: [60, 90, 180, 120, 60, 120, 120, 60],
    scenes: 2,
};

fn sizes(scale: ScaleArg) -> &'static Sizes {
    match scale {
        ScaleArg::Full => &FULL,
        ScaleArg::Modest => &MODEST,
        ScaleArg::Tiny => &TINY,
    }
}

/// Folders that tasks read from and write to.
pub struct Places<'a> {
    pub kit: &'a Path,
    /// For pictures and everything that is printed.
    pub raw: &'a Path,
    pub device: Option<&'a str>,
}

impl Places<'_> {
    fn scene(&self, name: &str) -> String {
        self.kit.join("scenes").join(name).with_extension("toml").display().to_string()
    }

    /// Tables that are ready.
    fn tables(&self) -> String {
        self.kit.join("tables").display().to_string()
    }

    fn reference(&self, sizes: &Sizes, scene: &str) -> PathBuf {
        self.kit.join("pictures").join(sizes.pictures).join(scene).with_extension("png")
    }

    /// `welkin` with `words`, on the device that is asked for.
    fn welkin(&self, name: impl Into<String>, kind: Kind, words: &str, more: &[String]) -> Task {
        let mut args: Vec<String> = words.split_whitespace().map(str::to_owned).chain(more.iter().cloned()).collect();
        if let (Some(device), false) = (self.device, matches!(kind, Kind::Devices)) {
            args.extend(["--device".into(), device.into()]);
        }
        Task { name: name.into(), program: None, args, kind }
    }

    fn picture(&self, sizes: &Sizes, scene: &str, file: PathBuf) -> Task {
        let words = format!("render --quality {} --size {} --tables full", sizes.picture_preset, sizes.pictures);
        let words = if sizes.tables == "reduced" { words.replace("full", "reduced") } else { words };
        let more = [
            self.scene(scene),
            "--set".into(),
            "quality.downscale=1".into(),
            "--cache".into(),
            self.tables(),
            "-o".into(),
            file.display().to_string(),
        ];
        let reference = self.reference(sizes, scene);
        self.welkin(scene, Kind::Picture { file, reference }, &words, &more)
    }
}

/// What fills a kit on a driver that is trusted: the pictures to compare with, and with them the tables.
pub fn fill(scale: ScaleArg, places: &Places<'_>) -> Vec<Task> {
    let sizes = sizes(scale);
    GALLERY[..sizes.scenes].iter().map(|scene| places.picture(sizes, scene, places.reference(sizes, scene))).collect()
}

/// All steps, the most wanted first. `tests` are the test programs that there are.
pub fn plan(scale: ScaleArg, places: &Places<'_>, tests: &[PathBuf]) -> Vec<Step> {
    let sizes = sizes(scale);
    let scene = places.scene("noon");
    let cache = ["--cache".to_owned(), places.tables()];
    let with_tables = |name: String, kind, words: String| {
        let more = [[scene.clone()].as_slice(), &cache].concat();
        let tables = if sizes.tables == "reduced" { "--tables reduced" } else { "--tables full" };
        places.welkin(name, kind, &format!("{words} {tables}"), &more)
    };
    let pictures = GALLERY[..sizes.scenes]
        .iter()
        .map(|scene| places.picture(sizes, scene, places.raw.join(scene).with_extension("png")));
    let bench = sizes.bench.iter().map(|&(size, preset)| {
        let words =
            format!("bench --json --blend alpha --vs all --measure {} --size {size} --quality {preset}", sizes.frames);
        with_tables(format!("{size} {preset}"), Kind::Bench { size, preset }, words)
    });
    let conform = sizes.conform.iter().map(|&part| {
        let more = if part == "quick" { vec!["--quick".into()] } else { vec!["--filter".into(), part.into()] };
        places.welkin(part, Kind::Conform, "conform --json", &more)
    });
    let unordered = places.welkin("without ordering", Kind::Conform, "conform --json --unordered", &[]);
    let (size, spp) = sizes.reference;
    let truth = places.raw.join("reference.npy").display().to_string();
    let paths = places.welkin(
        format!("reference {size}"),
        Kind::Paths,
        &format!("reference --size {size} --spp {spp} --quality {}", sizes.picture_preset),
        &[scene.clone(), "-o".into(), truth],
    );
    let sort = sizes
        .sort
        .split(',')
        .map(|pairs| places.welkin(format!("sort {pairs}"), Kind::Sort, &format!("bench --json --sort {pairs}"), &[]));
    let tests = tests.iter().map(|program| Task {
        name: program.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        program: Some(program.clone()),
        args: Vec::new(),
        kind: Kind::Test,
    });
    let memory = sizes.memory.iter().map(|&(size, preset)| {
        let file = places.raw.join(format!("memory-{size}-{preset}.png")).display().to_string();
        let words = format!("render --stats - --size {size} --quality {preset} -o {file}");
        with_tables(format!("{size} {preset}"), Kind::Memory { size, preset }, words)
    });
    let devices = vec![
        places.welkin("devices", Kind::Devices, "devices --json", &[]),
        places.welkin("device in use", Kind::Device, "conform --json --quick --filter static.*", &[]),
    ];
    let tables =
        vec![places.welkin(sizes.tables, Kind::Tables, &format!("bench --json --cold-tables {}", sizes.tables), &[])];
    let step = |index: usize, name, about, tasks| Step {
        name,
        about,
        limit: Duration::from_secs(sizes.limits[index]),
        tasks,
        gpu_only: None,
    };
    let cpu = "a software rasterizer keeps a pixel's fragments in order even where nobody asks for it";
    let mut rates = vec![paths];
    rates.extend(sort);
    vec![
        step(0, "devices", "devices and capabilities", devices),
        step(1, "pictures", "first picture of each scene, beside that of lavapipe", pictures.collect()),
        step(2, "frames", "noon in every mode, pass by pass", bench.collect()),
        step(3, "tables", "tables from nothing", tables),
        step(4, "conformance", "what a driver must do", conform.collect()),
        Step {
            gpu_only: Some(cpu),
            ..step(4, "ordering", "each check of ordering fails when ordering is taken away", vec![unordered])
        },
        step(5, "rates", "paths and sorted pairs a second", rates),
        step(6, "tests", "quick tests under validation", tests.collect()),
        step(7, "memory", "memory held, device and host", memory.collect()),
    ]
}

/// Puts what a task has printed into the report; an error says what is missing or wrong in it.
pub fn collect(task: &Task, ended: &Ended, report: &mut Report) -> Result<(), String> {
    let json = || -> Result<Value, String> {
        serde_json::from_str(&ended.stdout).map_err(|error| format!("its output is no JSON: {error}"))
    };
    match &task.kind {
        Kind::Devices => {
            let usable = json()?["devices"].as_array().is_some_and(|all| all.iter().any(|d| d["usable"] == true));
            if usable { Ok(()) } else { Err("no device that Welkin can use".into()) }
        }
        Kind::Device => {
            let device = json()?["devices"][0]["device"].take();
            report.device = serde_json::from_value::<Device>(device).map_err(|error| error.to_string())?;
            Ok(())
        }
        Kind::Picture { file, reference } => {
            report.figure(format!("first picture/{}", task.name), Some(ended.seconds), "s");
            let flip = flip(file, reference)?;
            report.figure(format!("flip/{}", task.name), Some(flip), "1");
            Ok(())
        }
        Kind::Bench { size, preset } => bench(&json()?, size, preset, report),
        Kind::Tables => {
            let tables = json()?["tables"].take();
            for (key, what, unit) in [
                ("scattering_seconds", "scattering", "s"),
                ("scattering_again_seconds", "scattering, again", "s"),
                ("optical_depth_ms", "optical depth", "ms"),
                ("optical_depth_again_ms", "optical depth, again", "ms"),
            ] {
                report.figure(format!("tables/{}/{what}", task.name), tables[key].as_f64(), unit);
            }
            Ok(())
        }
        Kind::Conform => {
            let report_of_device = json()?["devices"][0].take();
            let count = |key: &str| report_of_device[key].as_u64().unwrap_or(0);
            let text = |row: &Value, key: &str| row[key].as_str().unwrap_or("").to_owned();
            let rows = report_of_device["rows"].as_array().map(Vec::as_slice).unwrap_or_default();
            let failed = rows.iter().filter(|row| row["result"] == "fail");
            report.checks.push(Checks {
                name: task.name.clone(),
                passed: count("passed"),
                failed: count("failed"),
                skipped: count("skipped"),
                failures: failed.map(|row| (text(row, "id"), text(row, "found"))).collect(),
            });
            report_of_device["error"].as_str().map_or(Ok(()), |error| Err(error.to_owned()))
        }
        Kind::Paths => {
            let rate = ended.stderr.split(", ").find_map(|part| part.strip_suffix(" paths/s")?.parse().ok());
            report.figure(task.name.clone(), rate, "paths/s");
            rate.map(drop).ok_or_else(|| "it does not tell its paths a second".into())
        }
        Kind::Sort => {
            for sorted in json()?["sort"].as_array().into_iter().flatten() {
                let pairs = sorted["pairs"].as_u64().unwrap_or(0);
                report.figure(format!("sort/{pairs}"), sorted["pairs_per_second"].as_f64(), "pairs/s");
            }
            Ok(())
        }
        Kind::Test => {
            // test result: ok. 5 passed; 0 failed; …
            let counts = ended.stdout.lines().find_map(|line| line.strip_prefix("test result: "));
            let counts = counts.ok_or("it does not tell a result")?;
            let number = |what: &str| {
                counts.split(['.', ';']).find_map(|part| part.trim().strip_suffix(what)?.trim().parse::<f64>().ok())
            };
            report.figure(format!("tests/{}/passed", task.name), number("passed"), "tests");
            report.figure(format!("tests/{}/failed", task.name), number("failed"), "tests");
            Ok(())
        }
        Kind::Memory { size, preset } => {
            let stats = json()?;
            let name = format!("memory/{size}/{preset}");
            report.figure(format!("{name}/device"), stats["device_memory_bytes"].as_f64(), "bytes");
            report.figure(format!("{name}/host peak"), ended.host_peak_bytes.map(|bytes| bytes as f64), "bytes");
            match stats["validation_messages"].as_u64() {
                Some(0) | None => Ok(()),
                Some(messages) => Err(format!("{messages} messages of the validation layer")),
            }
        }
    }
}

fn bench(json: &Value, size: &str, preset: &str, report: &mut Report) -> Result<(), String> {
    let number = |key: &str| json[key].as_u64().unwrap_or(0);
    let (width, height) = (number("width"), number("height"));
    let vs = json["vs"].as_array().map(Vec::as_slice).unwrap_or_default();
    for side in std::iter::once(&json["a"]).chain(vs) {
        let mode = side["blend"]["used"].as_str().ok_or("it does not tell its modes")?;
        let name = format!("bench/{size}/{preset}/{mode}");
        report.figure(format!("{name}/frame"), side["frame"]["median_ms"].as_f64(), "ms");
        report.figure(format!("{name}/frame p95"), side["frame"]["p95_ms"].as_f64(), "ms");
        report.figure(format!("{name}/compositing"), side["compositing"]["median_ms"].as_f64(), "ms");
        // `bench` gives alpha over the other, of frames in turns.
        let over = side["ratio"]["frame_in_turns"]["median"].as_f64().map(|ratio| 1.0 / ratio);
        report.figure(format!("{name}/over alpha"), over, "1");
        report.passes.push(Passes {
            width,
            height,
            preset: preset.into(),
            mode: mode.into(),
            passes: side["passes"].clone(),
        });
    }
    Ok(())
}

/// Mean FLIP between two pictures.
fn flip(file: &Path, reference: &Path) -> Result<f64, String> {
    let read =
        |path: &Path| image::open(path).map(|image| image.to_rgb32f()).map_err(|e| format!("{}: {e}", path.display()));
    let (test, reference) = (read(file)?, read(reference)?);
    if test.dimensions() != reference.dimensions() {
        return Err(format!("{:?} pixels, and {:?} to compare with", test.dimensions(), reference.dimensions()));
    }
    let pixels = |image: &image::Rgb32FImage| image.pixels().map(|pixel| pixel.0).collect::<Vec<_>>();
    let width = test.width() as usize;
    let errors = welkin::compare::flip(&pixels(&test), &pixels(&reference), width, welkin::compare::PIXELS_PER_DEGREE);
    Ok(errors.iter().sum::<f64>() / errors.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_most_wanted_comes_first_and_all_of_it_takes_little_more_than_six_minutes() {
        let places = Places { kit: Path::new("k"), raw: Path::new("r"), device: Some("1") };
        let steps = plan(ScaleArg::Full, &places, &["t/blend".into()]);
        let names: Vec<_> = steps.iter().map(|step| step.name).collect();
        let order = ["devices", "pictures", "frames", "tables", "conformance", "ordering", "rates", "tests", "memory"];
        assert_eq!(names, order);
        assert_eq!(steps[2].tasks[0].name, "1920x1080 high"); // what the goals are about
        assert!(steps.iter().map(|step| step.limit.as_secs()).sum::<u64>() <= 480);
        let on_device = |task: &&Task| !matches!(task.kind, Kind::Devices | Kind::Test);
        for task in steps.iter().flat_map(|step| &step.tasks).filter(on_device) {
            assert!(task.args.ends_with(&["--device".into(), "1".into()]), "{}: {:?}", task.name, task.args);
        }
    }

    #[test]
    fn ratios_over_alpha_are_the_inverse_of_what_bench_prints() {
        let json = serde_json::json!({
            "width": 8, "height": 4,
            "a": {"blend": {"used": "alpha"}, "frame": {"median_ms": 2.0, "p95_ms": 3.0}, "compositing": {"median_ms": 1.0}},
            "vs": [{"blend": {"used": "tiled"}, "frame": {"median_ms": 1.0, "p95_ms": 1.0},
                    "compositing": {"median_ms": 1.0}, "ratio": {"frame_in_turns": {"median": 2.0}}}],
        });
        let mut report = Report::default();
        bench(&json, "8x4", "low", &mut report).unwrap();
        assert_eq!(report.figures["bench/8x4/low/tiled/over alpha"].value, 0.5);
        assert_eq!(report.figures["bench/8x4/low/alpha/frame p95"].value, 3.0);
        assert!(bench(&serde_json::json!({}), "8x4", "low", &mut report).is_err());
    }

    #[test]
    fn tests_and_paths_are_read_from_what_is_printed() {
        let printed = |stdout: &str, stderr: &str| Ended {
            status: None,
            seconds: 1.0,
            host_peak_bytes: None,
            stdout: stdout.into(),
            stderr: stderr.into(),
        };
        let task = |kind| Task { name: "n".into(), program: None, args: Vec::new(), kind };
        let mut report = Report::default();
        let text = "running 6 tests\ntest result: FAILED. 5 passed; 1 failed; 0 ignored; 0 measured\n";
        collect(&task(Kind::Test), &printed(text, ""), &mut report).unwrap();
        assert_eq!((report.figures["tests/n/passed"].value, report.figures["tests/n/failed"].value), (5.0, 1.0));
        let text = "welkin: wrote a.npy (8x4, 2 samples a pixel, relative noise 0.1, 12345 paths/s, 3 events)";
        collect(&task(Kind::Paths), &printed("", text), &mut report).unwrap();
        assert_eq!(report.figures["n"].value, 12345.0);
        assert!(collect(&task(Kind::Paths), &printed("", ""), &mut report).is_err());
    }
}
