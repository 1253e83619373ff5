//! `welkin reference`: the path-traced truth of a scene.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use welkin::output::{Format, Picture, PngDepth, transmittance_path, write_atomic};
use welkin::pathtrace::{PathOptions, PathTracer, State, SunShape, Truth};
use welkin::{Error, Result};

use super::args::{ReferenceArgs, SunArg};
use super::interrupt::{Interrupt, Signal};
use super::progress::{Progress, note};
use super::session::Device;
use super::{Outcome, places, scenes};

/// The state is written about this often, and at the end.
const KEEP_INTERVAL: Duration = Duration::from_secs(20);

/// How long a pass may go on when the command has been asked to end. Passes take about two seconds, but one sample of each
/// pixel can take minutes, and systems that shut down do not wait for long.
const GRACE: Duration = Duration::from_secs(5);

/// `--noise` ends nothing below this: with fewer samples it is not known well, and 0 where no path has met a cloud yet.
const LEAST_SAMPLES: u32 = 16;

/// The files of a run.
struct Files {
    variance: PathBuf,
    state: PathBuf,
    transmittance: Option<PathBuf>,
}

impl Files {
    /// Those beside the picture of `args`; all can be written.
    fn of(args: &ReferenceArgs) -> Result<Self> {
        // `OUT.variance.exr` beside `OUT.exr`, `OUT.variance.npy` beside anything else.
        let exr = Format::of(&args.output)? == Format::Exr;
        let files = Self {
            variance: args.output.with_extension(if exr { "variance.exr" } else { "variance.npy" }),
            state: args.output.with_extension("state"),
            transmittance: args.aux.then(|| transmittance_path(&args.output)),
        };
        let all = [&args.output, &files.variance, &files.state].into_iter().chain(&files.transmittance);
        all.map(PathBuf::as_path).try_for_each(places::writable)?;
        Ok(files)
    }
}

pub fn run(args: &ReferenceArgs) -> Result<Outcome> {
    let interrupt = Interrupt::watch()?;
    let files = Files::of(args)?;
    let params = scenes::load_with_quality(&args.scene, args.quality, &args.args)?.at_frame(0);
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
    let from = args.resume.as_ref().map(|file| file.as_ref().unwrap_or(&files.state));
    let resumed = from.map(|file| Ok((file, read_state(file)?))).transpose()?;
    let mut device = Device::open(&args.args, false)?;
    let mut tracer = PathTracer::new(device.frames(), &params, [size.width, size.height], &options)?;
    if let Some((file, state)) = resumed {
        tracer.restore(state).map_err(|error| about_state(file, error))?;
        note(&format!("going on from {} samples a pixel", tracer.samples()));
    }

    let (started, first) = (Instant::now(), tracer.samples());
    let stopped = trace(args, &mut device, &mut tracer, &files.state, &interrupt)?;
    if let (Some(signal), 0) = (stopped, tracer.samples()) {
        note(&format!("stopped by {signal} before every pixel had a sample: nothing is written"));
        return Ok(Outcome::Stopped(signal));
    }
    write_state(&tracer, &files.state)?;
    let truth = tracer.develop(device.frames())?;
    write(args, &files, &truth)?;
    let seconds = started.elapsed().as_secs_f64();
    let paths = f64::from(tracer.samples() - first) * f64::from(size.width) * f64::from(size.height);
    note(&format!(
        "wrote {} ({}x{}, {} samples a pixel, relative noise {:.4}, {:.0} paths/s, {:.0} events and {:.0} steps a path, \
         {:.0} % null collisions)",
        args.output.display(),
        size.width,
        size.height,
        tracer.samples(),
        tracer.noise(),
        paths / seconds.max(1e-9),
        tracer.work().events as f64 / paths.max(1.0),
        tracer.work().steps as f64 / paths.max(1.0),
        100.0 * tracer.work().null_collisions(),
    ));
    let Some(signal) = stopped else { return Ok(Outcome::Done) };
    let state = files.state.display();
    note(&format!("stopped by {signal}: the same command with --resume {state} goes on from here"));
    Ok(Outcome::Stopped(signal))
}

/// Passes until there are samples enough, or noise is little enough, or a signal has come, which is the answer. What is
/// lost when the program is ended is what came after the last state written.
fn trace(
    args: &ReferenceArgs,
    device: &mut Device,
    tracer: &mut PathTracer,
    state_file: &Path,
    interrupt: &Interrupt,
) -> Result<Option<Signal>> {
    const STEPS: f64 = 1000.0;
    let most = args.spp.unwrap_or(u32::MAX);
    let mut bar = Progress::start("reference", STEPS as u64);
    let mut kept = Instant::now();
    let mut asked = None;
    loop {
        let (samples, noise) = (tracer.samples(), tracer.noise());
        if samples >= most || args.noise.is_some_and(|wanted| noise <= wanted && samples >= LEAST_SAMPLES.min(most)) {
            return Ok(None);
        }
        // Noise falls with the root of the samples; where both ends are given, the nearer one counts.
        let by_noise = args
            .noise
            .filter(|_| samples > 1)
            .map_or(f64::INFINITY, |wanted| f64::from(samples) * (noise / wanted).powi(2));
        let wanted = f64::from(most).min(by_noise);
        let _ = tracer.run_pass(device.frames(), most, &mut |progress| {
            let done = f64::from(progress.samples) + f64::from(progress.pass) * f64::from(progress.pass_samples);
            bar.set((done / wanted * STEPS).min(STEPS) as u64);
            if let (Some(signal), None) = (interrupt.signal(), asked) {
                bar.note(&format!("{signal}: ending this pass first; a second signal ends the program at once"));
                asked = Some(Instant::now());
            }
            match asked {
                Some(since) if since.elapsed() > GRACE => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        })?;
        if let Some(signal) = interrupt.signal() {
            return Ok(Some(signal));
        }
        if kept.elapsed() >= KEEP_INTERVAL {
            write_state(tracer, state_file)?;
            kept = Instant::now();
        }
    }
}

fn read_state(file: &Path) -> Result<State> {
    let bytes = std::fs::read(file).map_err(|error| {
        Error::invalid("--resume", file.display(), format!("a state of welkin reference (it cannot be read: {error})"))
    })?;
    State::from_bytes(&bytes).map_err(|error| about_state(file, error))
}

/// `error` about the state in `file`, named as the flag that chose it.
fn about_state(file: &Path, error: Error) -> Error {
    match error {
        Error::InvalidParam { expected, .. } => Error::invalid("--resume", file.display(), expected),
        other => other,
    }
}

fn write_state(tracer: &PathTracer, file: &Path) -> Result<()> {
    write_atomic(file, |out| out.write_all(&tracer.state().to_bytes()))
}

/// The picture, the variance of its values, and the transmittance if it is asked for.
fn write(args: &ReferenceArgs, files: &Files, truth: &Truth) -> Result<()> {
    let [width, height] = truth.extent;
    let picture = Picture {
        width,
        height,
        radiance: truth.radiance.clone(),
        transmittance: Some(truth.transmittance.clone()),
        display: truth.display.clone(),
    };
    picture.write(&args.output, PngDepth::Eight)?;
    if let Some(file) = &files.transmittance {
        picture.write_transmittance(file)?;
    }
    Picture { radiance: truth.variance.clone(), ..picture }.write(&files.variance, PngDepth::Eight)
}
