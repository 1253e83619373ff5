//! `welkin bench`: GPU time per pass, and a second mode measured in turns with the first so that both see the same machine.

use std::fmt::Write;

use serde::Serialize;
use welkin::output::{BlendStats, DeviceStats};
use welkin::{Error, Result};

use super::args::BenchArgs;
use super::progress::Progress;
use super::scenes;
use super::session::{Device, Session};
use super::summary::{PassTimes, median, p95};

#[derive(Serialize)]
struct Report {
    scene: String,
    width: u32,
    height: u32,
    device: DeviceStats,
    warmup_frames: u32,
    measured_frames: u32,
    a: Side,
    /// The mode of `--vs`.
    b: Option<Side>,
    ratio: Option<Ratio>,
}

#[derive(Serialize)]
struct Side {
    blend: BlendStats,
    /// Size of the tables that lit the last frame.
    tables: Option<String>,
    frame: Times,
    passes: Vec<Pass>,
}

#[derive(Serialize)]
struct Pass {
    name: String,
    #[serde(flatten)]
    times: Times,
}

/// Over the measured frames [ms].
#[derive(Serialize)]
struct Times {
    median_ms: f64,
    p95_ms: f64,
}

/// Medians of a divided by those of b.
#[derive(Serialize)]
struct Ratio {
    frame: f64,
    /// Passes that both have.
    passes: Vec<PassRatio>,
}

#[derive(Serialize)]
struct PassRatio {
    name: String,
    ratio: f64,
}

/// One mode under measurement.
struct Contender {
    session: Session,
    params: welkin::Params,
    totals: Vec<f64>,
    passes: PassTimes,
}

pub fn run(args: &BenchArgs) -> Result<()> {
    let params = scenes::load(&args.scene, &args.picture)?;
    let mut modes = vec![scenes::blended(params.clone(), args.blend, "--blend")?];
    if args.vs.is_some() {
        modes.push(scenes::blended(params, args.vs, "--vs")?);
    }
    let mut device = Device::open(&args.picture.scene, false)?;
    let mut contenders = modes
        .into_iter()
        .map(|params| {
            let session = Session::open(&mut device, &params, &args.picture)?;
            Ok(Contender { session, params, totals: Vec::new(), passes: PassTimes::default() })
        })
        .collect::<Result<Vec<_>>>()?;

    let mut progress = Progress::start("bench", u64::from(args.warmup) + u64::from(args.measure));
    for frame in 0..args.warmup + args.measure {
        for contender in &mut contenders {
            let times = contender.session.time_frame(&mut device, &contender.params.at_frame(frame))?;
            if frame < args.warmup {
                continue;
            }
            let total = times.gpu_ms.ok_or_else(|| Error::Unsupported {
                needed: "measuring: timestamp queries".into(),
                by: device.stats().name,
            })?;
            contender.totals.push(total);
            times.passes.iter().for_each(|pass| contender.passes.add(&pass.name, pass.gpu_ms));
        }
        progress.set(u64::from(frame) + 1);
    }
    drop(progress);

    let mut sides = contenders.iter().map(side);
    let (a, b) = (sides.next(), sides.next());
    let Some(a) = a else { return Ok(()) };
    let report = Report {
        scene: args.scene.display().to_string(),
        width: args.picture.size.width,
        height: args.picture.size.height,
        device: device.stats(),
        warmup_frames: args.warmup,
        measured_frames: args.measure,
        ratio: b.as_ref().map(|b| ratio(&a, b)),
        a,
        b,
    };
    if args.json { super::print_json(&report) } else { super::print(&text(&report)) }
}

fn side(contender: &Contender) -> Side {
    let times = |values: &[f64]| Times { median_ms: median(values).unwrap_or(0.0), p95_ms: p95(values).unwrap_or(0.0) };
    let passes = contender.passes.iter().map(|(name, values)| Pass { name: name.into(), times: times(values) });
    let tables = contender.session.tables().map(|tables| tables.size);
    Side { blend: contender.session.blend(), tables, frame: times(&contender.totals), passes: passes.collect() }
}

fn ratio(a: &Side, b: &Side) -> Ratio {
    let passes = a.passes.iter().filter_map(|pass| {
        let other = b.passes.iter().find(|other| other.name == pass.name)?;
        let ratio = pass.times.median_ms / other.times.median_ms;
        ratio.is_finite().then(|| PassRatio { name: pass.name.clone(), ratio })
    });
    Ratio { frame: a.frame.median_ms / b.frame.median_ms, passes: passes.collect() }
}

fn text(report: &Report) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{} at {}x{} on {}", report.scene, report.width, report.height, report.device.name);
    let _ = writeln!(text, "{} frames after {}; times in ms", report.measured_frames, report.warmup_frames);
    for side in [Some(&report.a), report.b.as_ref()].into_iter().flatten() {
        let _ = writeln!(text, "\n{:<16}{:>10}{:>10}", side.blend.used, "median", "p95");
        for pass in &side.passes {
            let _ = writeln!(text, "  {:<14}{:>10.3}{:>10.3}", pass.name, pass.times.median_ms, pass.times.p95_ms);
        }
        let _ = writeln!(text, "  {:<14}{:>10.3}{:>10.3}", "frame", side.frame.median_ms, side.frame.p95_ms);
    }
    if let (Some(ratio), Some(b)) = (&report.ratio, &report.b) {
        let _ = writeln!(text, "\n{} / {}, medians", report.a.blend.used, b.blend.used);
        for pass in &ratio.passes {
            let _ = writeln!(text, "  {:<14}{:>10.3}", pass.name, pass.ratio);
        }
        let _ = writeln!(text, "  {:<14}{:>10.3}", "frame", ratio.frame);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(median_ms: f64) -> Times {
        Times { median_ms, p95_ms: median_ms * 2.0 }
    }

    fn side_of(used: &str, blend_ms: f64) -> Side {
        let passes = [("grid", 1.0), ("blend", blend_ms)];
        Side {
            blend: BlendStats { requested: used.into(), used: used.into(), reason: "asked for".into() },
            tables: None,
            frame: times(1.0 + blend_ms),
            passes: passes.into_iter().map(|(name, ms)| Pass { name: name.into(), times: times(ms) }).collect(),
        }
    }

    #[test]
    fn ratios_are_of_a_over_b() {
        let ratio = ratio(&side_of("interlock", 5.0), &side_of("alpha", 2.0));
        assert_eq!(ratio.frame, 2.0);
        let passes: Vec<_> = ratio.passes.iter().map(|pass| (pass.name.as_str(), pass.ratio)).collect();
        assert_eq!(passes, [("grid", 1.0), ("blend", 2.5)]);
    }
}
