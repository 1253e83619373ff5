//! `welkin reference`: the path-traced truth of a scene.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use welkin::output::{Format, Picture, PngDepth, transmittance_path, write_atomic};
use welkin::pathtrace::{PathOptions, PathTracer, State, SunShape, Truth};
use welkin::{Error, Result};

use super::args::{ReferenceArgs, SunArg};
use super::progress::{Progress, note};
use super::session::Device;
use super::{places, scenes};

/// The state is written about this often, and at the end.
const KEEP_INTERVAL: Duration = Duration::from_secs(20);

pub fn run(args: &ReferenceArgs) -> Result<()> {
    Format::of(&args.output)?;
    places::in_directory(&args.output)?;
    let params = scenes::load_with_quality(&args.scene, args.quality, &args.args)?;
    let size = args.size;
    let options = PathOptions {
        seed: args.seed,
        sun: match args.sun {
            SunArg::Direction => SunShape::Direction,
            SunArg::Disc => SunShape::Disc,
        },
        antialias: args.antialias,
        ..PathOptions::default()
    };
    let state_file = args.output.with_extension("state");
    let resumed = args.resume.as_deref().map(|file| read_state(file, &state_file)).transpose()?;
    let mut device = Device::open(&args.args, false)?;
    let mut tracer = PathTracer::new(device.frames(), &params, [size.width, size.height], &options)?;
    if let Some(state) = resumed {
        tracer.restore(state)?;
        note(&format!("going on from {} samples a pixel", tracer.samples()));
    }

    let (started, first) = (Instant::now(), tracer.samples());
    let most = args.spp.unwrap_or(u32::MAX);
    trace(args, &mut device, &mut tracer, most, &state_file)?;
    write_state(&tracer, &state_file)?;
    let truth = tracer.develop(device.frames())?;
    write(args, &truth)?;
    let seconds = started.elapsed().as_secs_f64();
    let paths = f64::from(tracer.samples() - first) * f64::from(size.width) * f64::from(size.height);
    note(&format!(
        "wrote {} ({}x{}, {} samples a pixel, relative noise {:.4}, {:.0} paths/s, {:.0} events and {:.0} steps a path)",
        args.output.display(),
        size.width,
        size.height,
        tracer.samples(),
        tracer.noise(),
        paths / seconds.max(1e-9),
        tracer.work().events as f64 / paths.max(1.0),
        tracer.work().steps as f64 / paths.max(1.0),
    ));
    Ok(())
}

/// Passes until there are samples enough or noise is little enough. What is lost when the program is ended is what came
/// after the last state written.
fn trace(
    args: &ReferenceArgs,
    device: &mut Device,
    tracer: &mut PathTracer,
    most: u32,
    state_file: &Path,
) -> Result<()> {
    const STEPS: f64 = 1000.0;
    let mut bar = Progress::start("reference", STEPS as u64);
    let mut kept = Instant::now();
    loop {
        let (samples, noise) = (tracer.samples(), tracer.noise());
        if samples >= most || args.noise.is_some_and(|wanted| noise <= wanted) {
            return Ok(());
        }
        // Noise falls with the root of the samples; where both ends are given, the nearer one counts.
        let by_noise = args
            .noise
            .filter(|_| samples > 1)
            .map_or(f64::INFINITY, |wanted| f64::from(samples) * (noise / wanted).powi(2));
        let wanted = f64::from(most).min(by_noise);
        let ControlFlow::Continue(()) = tracer.run_pass(device.frames(), most, &mut |progress| {
            let done = f64::from(progress.samples) + f64::from(progress.pass) * f64::from(progress.pass_samples);
            bar.set((done / wanted * STEPS).min(STEPS) as u64);
            ControlFlow::Continue(())
        })?
        else {
            return Ok(());
        };
        if kept.elapsed() >= KEEP_INTERVAL {
            write_state(tracer, state_file)?;
            kept = Instant::now();
        }
    }
}

fn read_state(asked: &Path, by_default: &Path) -> Result<State> {
    let file = if asked.as_os_str().is_empty() { by_default } else { asked };
    let bytes = std::fs::read(file).map_err(|error| Error::file(file, format!("cannot be read: {error}")))?;
    State::from_bytes(&file.display().to_string(), &bytes)
}

fn write_state(tracer: &PathTracer, file: &Path) -> Result<()> {
    write_atomic(file, |out| out.write_all(&tracer.state().to_bytes()))
}

/// The picture, the variance of its values, and the transmittance if it is asked for.
fn write(args: &ReferenceArgs, truth: &Truth) -> Result<()> {
    let [width, height] = truth.extent;
    let picture = Picture {
        width,
        height,
        radiance: truth.radiance.clone(),
        transmittance: Some(truth.transmittance.clone()),
        display: truth.display.clone(),
    };
    picture.write(&args.output, PngDepth::Eight)?;
    if args.aux {
        picture.write_transmittance(&transmittance_path(&args.output))?;
    }
    Picture { radiance: truth.variance.clone(), ..picture }.write(&variance_path(&args.output)?, PngDepth::Eight)
}

/// `OUT.variance.exr` beside `OUT.exr`, `OUT.variance.npy` beside anything else.
fn variance_path(picture: &Path) -> Result<PathBuf> {
    let exr = Format::of(picture)? == Format::Exr;
    Ok(picture.with_extension(if exr { "variance.exr" } else { "variance.npy" }))
}
