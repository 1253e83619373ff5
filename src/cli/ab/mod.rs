//! `welkin ab`: one scene by two modes, both against a reference.

mod reference;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use welkin::compare::{Difference, FrameMetrics, HeatMap, Report, ReportSide, Scale, Series, Summary};
use welkin::output::{
    BlendStats, DeviceStats, ExrOptions, PassStats, Picture, PngDepth, exr_colour, numbered, write_exr, write_json,
};
use welkin::params::Params;
use welkin::{Error, Result};

use reference::Judge;
pub use reference::trace;

use super::args::{AbArgs, ReferenceArg};
use super::progress::{Progress, note};
use super::session::{Device, Session, Times};
use super::summary::{PassTimes, median};
use super::{places, scenes};

/// What `metrics.json` holds (docs/json.md).
#[derive(Serialize)]
struct Metrics {
    scene: String,
    width: u32,
    height: u32,
    device: DeviceStats,
    /// First and last frame.
    frames: [u32; 2],
    reference: BlendStats,
    a: SideMetrics,
    b: SideMetrics,
    limits: Vec<Limit>,
    passed: bool,
}

#[derive(Serialize)]
struct SideMetrics {
    blend: BlendStats,
    #[serde(flatten)]
    summary: Summary,
    frame_gpu_ms: Option<f64>,
    passes: Vec<PassStats>,
    frames: Vec<FrameMetrics>,
}

/// A bound on a metric of a.
#[derive(Serialize)]
struct Limit {
    metric: &'static str,
    limit: f64,
    /// None where the metric has no value.
    value: Option<f64>,
    passed: bool,
}

/// A mode that is compared.
struct Side {
    session: Session,
    series: Series,
    passes: PassTimes,
    totals: Vec<f64>,
}

impl Side {
    fn open(name: &str, device: &mut Device, params: &Params, args: &AbArgs) -> Result<Self> {
        let session = Session::open(device, params, &args.picture)?;
        Ok(Self { session, series: Series::new(name), passes: PassTimes::default(), totals: Vec::new() })
    }

    fn render(&mut self, device: &mut Device, params: &Params) -> Result<Arc<Picture>> {
        let made = self.session.frame(device, params)?;
        let Times { passes, gpu_ms, .. } = made.times;
        passes.iter().for_each(|pass| self.passes.add(&pass.name, pass.gpu_ms));
        self.totals.extend(gpu_ms);
        Ok(Arc::new(made.picture))
    }

    fn metrics(&self) -> SideMetrics {
        let pass = |(name, times): (&str, &[f64])| Some(PassStats { name: name.into(), gpu_ms: median(times)? });
        SideMetrics {
            blend: self.session.blend(),
            summary: self.series.summary(),
            frame_gpu_ms: median(&self.totals),
            passes: self.passes.iter().filter_map(pass).collect(),
            frames: self.series.frames().to_vec(),
        }
    }
}

/// Whether every limit was kept.
pub fn run(args: &AbArgs) -> Result<bool> {
    let range = args.frames.as_ref().map_or(0..1, |range| range.0.clone());
    if args.max_popping.is_some() && range.len() < 2 {
        return Err(Error::invalid("--max-popping", "…", "--frames A..B with two frames or more beside it"));
    }
    if args.spp.is_some() && args.reference != ReferenceArg::Path {
        return Err(Error::invalid("--spp", "…", "--reference path beside it"));
    }
    let params = scenes::load_precise(&args.scene, &args.picture)?;
    for frame in range.clone() {
        params.at_frame(frame).validate()?;
    }
    let a = scenes::blended(params.clone(), Some(args.a), "--a")?;
    let b = scenes::blended(params.clone(), Some(args.b), "--b")?;
    let out = Places::make(&args.out)?;
    let mut device = Device::open(&args.picture.scene, false)?;
    let mut sides = [Side::open("a", &mut device, &a, args)?, Side::open("b", &mut device, &b, args)?];
    let compared = [sides[0].session.blend().used, sides[1].session.blend().used];
    let mut judge = Judge::open(args, &mut device, &params, [&compared[0], &compared[1]])?;

    let size = args.picture.size;
    let scene = args.scene.display().to_string();
    let mut report = Report::new(&scene, &device.stats().name, [size.width, size.height], &judge.choice().used);
    let mut progress = (range.len() > 1).then(|| Progress::start("ab", range.len() as u64));
    for (done, frame) in range.clone().enumerate() {
        let at = params.at_frame(frame);
        let truth = Arc::new(judge.frame(&mut device, &at, frame)?);
        let [a, b] = &mut sides;
        let pictures = [a.render(&mut device, &at)?, b.render(&mut device, &at)?];
        let differences = [a.series.add(frame, &pictures[0], &truth)?, b.series.add(frame, &pictures[1], &truth)?];
        let [a, b] = &pictures;
        let number = args.frames.is_some().then_some(frame);
        out.write(
            &scene,
            number,
            [("a", a), ("b", b), ("reference", &truth.picture)],
            [&compared[0], &compared[1], &judge.choice().used],
            [("a", &differences[0]), ("b", &differences[1])],
        )?;
        report.add(frame, [a, b, &truth.picture], [&differences[0], &differences[1]])?;
        if let Some(progress) = &mut progress {
            progress.set(done as u64 + 1);
        }
    }
    drop(progress);

    let [a, b] = [sides[0].metrics(), sides[1].metrics()];
    let limits = limits(args, &a);
    let metrics = Metrics {
        scene,
        width: size.width,
        height: size.height,
        device: device.stats(),
        frames: [range.start, range.end - 1],
        reference: judge.choice().clone(),
        passed: limits.iter().all(|limit| limit.passed),
        limits,
        a,
        b,
    };
    write_json(&out.file("metrics.json"), &metrics)?;
    let side = |side: &'_ SideMetrics| (side.blend.used.clone(), side.frame_gpu_ms);
    let (names, times): (Vec<_>, Vec<_>) = [side(&metrics.a), side(&metrics.b)].into_iter().unzip();
    let report_side = |i: usize| ReportSide { name: &names[i], series: &sides[i].series, frame_gpu_ms: times[i] };
    report.write(&out.file("report.html"), [report_side(0), report_side(1)])?;
    summarise(&metrics, &out);
    Ok(metrics.passed)
}

fn limits(args: &AbArgs, a: &SideMetrics) -> Vec<Limit> {
    let limit = |metric, limit: Option<f64>, value: Option<f64>| {
        // Without a value there is nothing to hold a limit against: that is no pass.
        limit.map(|limit| Limit { metric, limit, value, passed: value.is_some_and(|value| value <= limit) })
    };
    let all = [
        limit("rmse", args.max_rmse, Some(a.summary.metrics.rmse)),
        limit("flip_mean", args.max_flip, Some(a.summary.metrics.flip_mean)),
        limit("max_abs", args.max_abs, Some(a.summary.metrics.max_abs)),
        limit("popping", args.max_popping, a.summary.popping),
    ];
    all.into_iter().flatten().collect()
}

/// A few lines on standard error.
fn summarise(metrics: &Metrics, out: &Places) {
    for (name, side) in [("a", &metrics.a), ("b", &metrics.b)] {
        let Summary { metrics: m, popping, .. } = &side.summary;
        let popping = popping.map(|p| format!(", popping {p:.3e}")).unwrap_or_default();
        let psnr = m.psnr.map_or("infinite".into(), |psnr| format!("{psnr:.1} dB"));
        note(&format!(
            "{name} ({}): RMSE {:.3e}, PSNR {psnr}, FLIP {:.4}, greatest difference {:.3e}{popping}",
            side.blend.used, m.rmse, m.flip_mean, m.max_abs
        ));
    }
    for limit in metrics.limits.iter().filter(|limit| !limit.passed) {
        let value = limit.value.map_or("has no value".into(), |value| format!("is {value:.3e}"));
        note(&format!("failed: {} of a {value}, above {:.3e}", limit.metric, limit.limit));
    }
    note(&format!("wrote {} (reference: {})", out.file("report.html").display(), metrics.reference.used));
}

/// The directory for everything that is written.
struct Places(PathBuf);

impl Places {
    fn make(out: &Path) -> Result<Self> {
        places::directory(out)?;
        Ok(Self(out.to_owned()))
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// A frame's pictures and heat maps; `number` is that of a frame of a sequence.
    fn write(
        &self,
        scene: &str,
        number: Option<u32>,
        pictures: [(&str, &Picture); 3],
        modes: [&str; 3],
        differences: [(&str, &Difference); 2],
    ) -> Result<()> {
        let file = |name: String| number.map_or(self.file(&name), |frame| numbered(&self.file(&name), frame));
        for (name, picture) in pictures {
            picture.write(&file(format!("{name}.png")), PngDepth::Eight)?;
            picture.write(&file(format!("{name}.exr")), PngDepth::Eight)?;
        }
        // All three in one, a layer each, named after its part and its mode: a_interlock.R.
        let layers = pictures.iter().zip(modes);
        let channels = layers.flat_map(|((name, picture), mode)| {
            exr_colour(&format!("{name}_{}", mode.replace([':', '.', ' '], "_")), &picture.radiance)
        });
        let [(_, Picture { width, height, .. }), ..] = pictures;
        let options = ExrOptions { scene: Some(scene.to_owned()), ..ExrOptions::default() };
        write_exr(&file("layers.exr".into()), [*width, *height], channels.collect(), &options)?;
        let width = *width;
        for (name, difference) in differences {
            HeatMap::new(Scale::Flip, difference, width).write(&file(format!("flip_{name}.png")))?;
            HeatMap::new(Scale::Radiance, difference, width).write(&file(format!("difference_{name}.png")))?;
        }
        Ok(())
    }
}
