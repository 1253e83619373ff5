//! `welkin render`: scenes in, pictures and statistics out.

use std::path::{Path, PathBuf};

use welkin::Result;
use welkin::output::{FrameStats, PassStats, PngDepth, Stats, numbered, transmittance_path, write_json};
use welkin::params::Params;

use super::args::RenderArgs;
use super::progress::{Progress, note};
use super::session::{Device, Session};
use super::summary::{PassTimes, median};
use super::{places, scenes};

/// What `--stats` takes for standard output.
const TO_STDOUT: &str = "-";

/// A scene that has been found good, and where its pictures go.
struct Job<'a> {
    scene: &'a Path,
    params: Params,
    output: PathBuf,
}

pub fn run(args: &RenderArgs) -> Result<()> {
    let outputs = places::pictures(&args.scenes, args.output.as_deref())?;
    args.stats.as_deref().filter(|file| *file != TO_STDOUT).map_or(Ok(()), places::writable)?;
    let jobs = args
        .scenes
        .iter()
        .zip(outputs)
        .map(|(scene, output)| {
            let params = scenes::blended(scenes::load(scene, &args.picture)?, args.blend, "--blend")?;
            Ok(Job { scene, params, output })
        })
        .collect::<Result<Vec<_>>>()?;
    let mut device = Device::open(&args.picture.scene, args.stats.is_some())?;
    let mut reports = Vec::with_capacity(jobs.len());
    for job in &jobs {
        reports.push(render(args, job, &mut device)?);
    }
    let Some(file) = &args.stats else { return Ok(()) };
    let to_stdout = file == TO_STDOUT;
    match (&reports[..], to_stdout) {
        ([one], true) => super::print_json(one),
        ([one], false) => write_json(file, one),
        (several, true) => super::print_json(&several),
        (several, false) => write_json(file, &several),
    }
}

/// Renders every frame of a scene.
fn render(args: &RenderArgs, job: &Job<'_>, device: &mut Device) -> Result<Stats> {
    let size = args.picture.size;
    let mut session = Session::open(device, &job.params, &args.picture)?;
    let depth = if args.png16 { PngDepth::Sixteen } else { PngDepth::Eight };
    let exr = args.exr_options(job.scene);
    let frames = args.frames.as_ref().map_or(0..1, |range| range.0.clone());
    let mut progress =
        (frames.len() > 1).then(|| Progress::start(job.scene.display().to_string(), frames.len() as u64));
    let mut stats = Stats {
        scene: job.scene.display().to_string(),
        width: size.width,
        height: size.height,
        blend: session.blend(),
        ..Stats::default()
    };
    let (mut passes, mut totals) = (PassTimes::default(), Vec::new());
    for (done, frame) in frames.enumerate() {
        let output = match args.frames {
            Some(_) => numbered(&job.output, frame),
            None => job.output.clone(),
        };
        let params = job.params.at_frame(frame);
        params.validate()?;
        let made = session.frame(device, &params)?;
        made.picture.write_with(&output, depth, &exr)?;
        if args.aux {
            made.picture.write_transmittance(&transmittance_path(&output))?;
        }
        let times = made.times;
        times.passes.iter().for_each(|pass| passes.add(&pass.name, pass.gpu_ms));
        totals.extend(times.gpu_ms);
        stats.particles = made.particles;
        stats.capacity = made.capacity;
        let output = output.display().to_string();
        stats.tables = session.tables();
        let tables = stats.tables.as_ref().map(|tables| tables.size.clone());
        stats.frames.push(FrameStats { frame, output, gpu_ms: times.gpu_ms, wall_ms: times.wall_ms, tables });
        if let Some(progress) = &mut progress {
            progress.set(done as u64 + 1);
        }
    }
    drop(progress);
    stats.output = stats.frames.first().map(|frame| frame.output.clone()).unwrap_or_default();
    stats.passes = passes
        .iter()
        .filter_map(|(name, times)| Some(PassStats { name: name.into(), gpu_ms: median(times)? }))
        .collect();
    stats.frame_gpu_ms = median(&totals);
    stats.device = device.stats();
    stats.device_memory_bytes = session.memory_bytes(device);
    stats.validation_messages = device.validation_messages();
    report(&stats);
    Ok(stats)
}

/// One line on what has been made.
fn report(stats: &Stats) {
    let time = stats.frame_gpu_ms.map(|ms| format!(", {ms:.1} ms on the device")).unwrap_or_default();
    let more = match stats.frames.len() {
        0 | 1 => String::new(),
        n => format!(" and {} more", n - 1),
    };
    note(&format!("wrote {}{more} ({}x{}, {}{time})", stats.output, stats.width, stats.height, stats.blend.used));
}
