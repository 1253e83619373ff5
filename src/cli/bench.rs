//! `welkin bench`: GPU time per pass, and other modes and settings measured in turns with the first so that all see the same
//! machine.

use std::fmt::Write;

use serde::Serialize;
use welkin::output::{BlendStats, DeviceStats};
use welkin::params::{BLENDS, Blend, Params};
use welkin::{Error, Result};

use super::args::{BenchArgs, Versus};
use super::progress::{Progress, note};
use super::session::{Device, Session};
use super::summary::{PassTimes, median, median_bounds, p95};
use super::{bench_parts, scenes, serial_forward};

#[derive(Serialize)]
struct Report {
    scene: String,
    width: u32,
    height: u32,
    device: DeviceStats,
    warmup_frames: u32,
    measured_frames: u32,
    a: Side,
    /// The first opponent.
    b: Option<Side>,
    ratio: Option<Ratio>,
    /// The modes of `--vs`, and the scene under `--vs-set`.
    vs: Vec<Opponent>,
}

#[derive(Serialize, Clone)]
struct Opponent {
    #[serde(flatten)]
    side: Side,
    ratio: Ratio,
}

#[derive(Serialize, Clone)]
struct Side {
    blend: BlendStats,
    /// What `--vs-set` replaced.
    set: Vec<String>,
    /// Size of the tables that lit the last frame.
    tables: Option<String>,
    frame: Times,
    compositing: Times,
    passes: Vec<Pass>,
}

#[derive(Serialize, Clone)]
struct Pass {
    name: String,
    #[serde(flatten)]
    times: Times,
}

/// Over the measured frames [ms].
#[derive(Serialize, Clone, Copy)]
struct Times {
    median_ms: f64,
    p95_ms: f64,
}

/// Medians of a divided by those of b.
#[derive(Serialize, Clone)]
struct Ratio {
    frame: f64,
    frame_in_turns: Option<InTurns>,
    compositing: f64,
    /// Passes that both have.
    passes: Vec<PassRatio>,
}

/// Ratios of frames that were rendered one after the other, which drifts of the machine's speed leave alone.
#[derive(Serialize, Clone, Copy)]
struct InTurns {
    median: f64,
    /// The median of endlessly many lies between these with 95 %.
    low: f64,
    high: f64,
}

#[derive(Serialize, Clone)]
struct PassRatio {
    name: String,
    ratio: f64,
}

/// The passes of a frame that differ between modes.
const COMPOSITING: &[&str] = &["bin", "blend", "resolve"];

/// One mode under measurement.
struct Contender {
    session: Session,
    params: Params,
    set: Vec<String>,
    totals: Vec<f64>,
    compositing: Vec<f64>,
    passes: PassTimes,
}

impl Contender {
    fn open(device: &mut Device, params: Params, args: &BenchArgs) -> Result<Self> {
        let session = Session::open(device, &params, &args.picture)?;
        let (totals, compositing, passes) = (Vec::new(), Vec::new(), PassTimes::default());
        Ok(Self { session, params, set: Vec::new(), totals, compositing, passes })
    }

    fn measure(&mut self, device: &mut Device, frame: u32, counts: bool) -> Result<()> {
        let times = self.session.time_frame(device, &self.params.at_frame(frame))?;
        if counts {
            let total = times.gpu_ms.ok_or_else(|| Error::Unsupported {
                needed: "measuring: timestamp queries".into(),
                by: device.stats().name,
            })?;
            self.totals.push(total);
            let compositing = times.passes.iter().filter(|pass| COMPOSITING.contains(&pass.name.as_str()));
            self.compositing.push(compositing.map(|pass| pass.gpu_ms).sum());
            times.passes.iter().for_each(|pass| self.passes.add(&pass.name, pass.gpu_ms));
        }
        Ok(())
    }

    fn side(&self) -> Side {
        let passes = self.passes.iter().map(|(name, values)| Pass { name: name.into(), times: times(values) });
        Side {
            blend: self.session.blend(),
            set: self.set.clone(),
            tables: self.session.tables().map(|tables| tables.size),
            frame: times(&self.totals),
            compositing: times(&self.compositing),
            passes: passes.collect(),
        }
    }
}

pub fn run(args: &BenchArgs) -> Result<()> {
    let Some(scene) = &args.scene else { return bench_parts::run(args) };
    if args.serial_forward {
        return serial_forward::run(args, scene);
    }
    let params = scenes::load(scene, &args.picture)?;
    let first = scenes::blended(params.clone(), args.blend, "--blend")?;
    let named = args.vs.iter().filter_map(|versus| match versus {
        Versus::Mode(blend) => Some(scenes::blended(params.clone(), Some(*blend), "--vs")),
        Versus::All => None,
    });
    let mut others = named.collect::<Result<Vec<_>>>()?;
    let replaced = match args.vs_set.as_slice() {
        [] => None,
        values => {
            let params = scenes::load_replaced(scene, &args.picture, "--vs-set", values)?;
            Some(scenes::blended(params, args.blend, "--blend")?)
        }
    };
    let mut device = Device::open(&args.picture.scene, false)?;
    let mut contenders = vec![Contender::open(&mut device, first, args)?];
    if args.vs.contains(&Versus::All) {
        let mut taken: Vec<String> = others.iter().map(|params| params.quality.blend.to_string()).collect();
        taken.push(contenders[0].session.blend().used);
        let more = every_mode(&device, &params);
        others.extend(more.into_iter().filter(|params| !taken.contains(&params.quality.blend.to_string())));
    }
    for params in others {
        contenders.push(Contender::open(&mut device, params, args)?);
    }
    if let Some(params) = replaced {
        let contender = Contender::open(&mut device, params, args)?;
        contenders.push(Contender { set: args.vs_set.clone(), ..contender });
    }

    let mut progress = Progress::start("bench", u64::from(args.warmup) + u64::from(args.measure));
    for frame in 0..args.warmup + args.measure {
        for contender in &mut contenders {
            contender.measure(&mut device, frame, frame >= args.warmup)?;
        }
        progress.set(u64::from(frame) + 1);
    }
    drop(progress);

    let Some((first, others)) = contenders.split_first() else { return Ok(()) };
    let a = first.side();
    let vs: Vec<_> = others
        .iter()
        .map(|other| {
            let side = other.side();
            Opponent {
                ratio: Ratio { frame_in_turns: in_turns(&first.totals, &other.totals), ..ratio(&a, &side) },
                side,
            }
        })
        .collect();
    let report = Report {
        scene: scene.display().to_string(),
        width: args.picture.size.width,
        height: args.picture.size.height,
        device: device.stats(),
        warmup_frames: args.warmup,
        measured_frames: args.measure,
        a,
        b: vs.first().map(|opponent| opponent.side.clone()),
        ratio: vs.first().map(|opponent| opponent.ratio.clone()),
        vs,
    };
    if args.json { super::print_json(&report) } else { super::print(&text(&report)) }
}

/// The scene in every mode that this version and the device have, windows included; others are named with the reason.
fn every_mode(device: &Device, params: &Params) -> Vec<Params> {
    let mut all = Vec::new();
    for row in BLENDS.iter().filter(|row| row.here && !matches!(row.value, Blend::Auto | Blend::Exact)) {
        let windows = match row.value {
            Blend::Interlock(_) => [1, 2, 4, 8].map(Blend::Interlock).to_vec(),
            Blend::Attachment(_) => [1, 2, 4, 8].map(Blend::Attachment).to_vec(),
            other => vec![other],
        };
        for blend in windows {
            let mut params = params.clone();
            params.quality.blend = blend;
            let answer = params.validate().map_err(|error| error.to_string()).and_then(|()| device.supports(blend));
            match answer {
                Ok(()) => all.push(params),
                Err(reason) => note(&format!("without {blend}: {reason}")),
            }
        }
    }
    all
}

fn times(values: &[f64]) -> Times {
    Times { median_ms: median(values).unwrap_or(0.0), p95_ms: p95(values).unwrap_or(0.0) }
}

fn in_turns(a: &[f64], b: &[f64]) -> Option<InTurns> {
    let ratios: Vec<f64> = a.iter().zip(b).map(|(a, b)| a / b).filter(|ratio| ratio.is_finite()).collect();
    let [low, high] = median_bounds(&ratios)?;
    Some(InTurns { median: median(&ratios)?, low, high })
}

fn ratio(a: &Side, b: &Side) -> Ratio {
    let passes = a.passes.iter().filter_map(|pass| {
        let other = b.passes.iter().find(|other| other.name == pass.name)?;
        let ratio = pass.times.median_ms / other.times.median_ms;
        ratio.is_finite().then(|| PassRatio { name: pass.name.clone(), ratio })
    });
    Ratio {
        frame: a.frame.median_ms / b.frame.median_ms,
        frame_in_turns: None,
        compositing: a.compositing.median_ms / b.compositing.median_ms,
        passes: passes.collect(),
    }
}

fn text(report: &Report) -> String {
    let sides: Vec<&Side> = std::iter::once(&report.a).chain(report.vs.iter().map(|opponent| &opponent.side)).collect();
    let mut names: Vec<&str> = Vec::new();
    for pass in sides.iter().flat_map(|side| &side.passes) {
        if !names.contains(&pass.name.as_str()) {
            names.push(&pass.name);
        }
    }
    let mut text = format!("{} at {}x{} on {}\n", report.scene, report.width, report.height, report.device.name);
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{} frames after {}, modes in turns\n", report.measured_frames, report.warmup_frames);
    let mut row = |name: &str, cells: Vec<String>| {
        let _ = write!(text, "{name:<16}");
        cells.iter().for_each(|cell| {
            let _ = write!(text, "{cell:>14}");
        });
        text.push('\n');
    };
    let ms = |value: f64| format!("{value:.3}");
    let title = |side: &Side| if side.set.is_empty() { side.blend.used.clone() } else { "--vs-set".into() };
    row("median [ms]", sides.iter().map(|side| title(side)).collect());
    for name in names {
        let cell =
            |side: &&Side| side.passes.iter().find(|pass| pass.name == name).map(|pass| ms(pass.times.median_ms));
        row(&format!("  {name}"), sides.iter().map(|side| cell(side).unwrap_or_else(|| "-".into())).collect());
    }
    row("compositing", sides.iter().map(|side| ms(side.compositing.median_ms)).collect());
    row("frame", sides.iter().map(|side| ms(side.frame.median_ms)).collect());
    row("frame, p95", sides.iter().map(|side| ms(side.frame.p95_ms)).collect());
    if !report.vs.is_empty() {
        let ratios = |of: fn(&Ratio) -> f64| {
            let others = report.vs.iter().map(|opponent| format!("{:.3}", of(&opponent.ratio)));
            std::iter::once(String::new()).chain(others).collect()
        };
        row(
            &format!("{} over", report.a.blend.used),
            sides.iter().skip(1).fold(vec![String::new()], |mut cells, side| {
                cells.push(title(side));
                cells
            }),
        );
        row("  compositing", ratios(|ratio| ratio.compositing));
        row("  frame", ratios(|ratio| ratio.frame));
        let in_turns = |of: fn(InTurns) -> f64| {
            let cell = |opponent: &Opponent| {
                opponent.ratio.frame_in_turns.map_or_else(|| "-".into(), |turns| format!("{:.3}", of(turns)))
            };
            std::iter::once(String::new()).chain(report.vs.iter().map(cell)).collect()
        };
        row("  in turns", in_turns(|turns| turns.median));
        row("    95 % from", in_turns(|turns| turns.low));
        row("    95 % to", in_turns(|turns| turns.high));
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
            set: Vec::new(),
            tables: None,
            frame: times(1.0 + blend_ms),
            compositing: times(blend_ms),
            passes: passes.into_iter().map(|(name, ms)| Pass { name: name.into(), times: times(ms) }).collect(),
        }
    }

    #[test]
    fn ratios_are_of_a_over_b() {
        let ratio = ratio(&side_of("interlock", 5.0), &side_of("alpha", 2.0));
        assert_eq!((ratio.frame, ratio.compositing), (2.0, 2.5));
        let passes: Vec<_> = ratio.passes.iter().map(|pass| (pass.name.as_str(), pass.ratio)).collect();
        assert_eq!(passes, [("grid", 1.0), ("blend", 2.5)]);
    }

    #[test]
    fn frames_in_turns_see_the_same_machine() {
        // A machine that becomes three times slower half way: the ratio of medians would be anything from 0.5 to 2.
        let b: Vec<f64> = (0..20).map(|i| if i < 10 { 1.0 } else { 3.0 }).collect();
        let a: Vec<f64> = b.iter().map(|b| 1.25 * b).collect();
        let turns = in_turns(&a, &b).unwrap();
        assert_eq!((turns.median, turns.low, turns.high), (1.25, 1.25, 1.25));
        assert!(in_turns(&[], &[]).is_none());
    }
}
