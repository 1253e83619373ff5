//! `welkin accuracy`: how far each way of lighting and compositing is from path-traced truth, over a suite of scenes.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use welkin::compare::{Difference, Reference, magma};
use welkin::output::{DeviceStats, Picture, PngDepth, write_atomic, write_json};
use welkin::params::{Blend, Params};
use welkin::{Error, Result};

use super::ab::trace;
use super::args::{AccuracyArgs, PictureArgs, Size};
use super::progress::note;
use super::session::{Device, Session};
use super::{places, scenes};

/// Pixels of which the clouds take at least this share are compared: elsewhere the background is the same by construction.
const LEAST_COVER: f32 = 0.01;

/// A suite file: what is rendered how. Scenes are relative to it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Suite {
    /// Paths a pixel, if a case says nothing else.
    spp: u32,
    /// Pixels of a picture, if a case says nothing else.
    size: [u32; 2],
    #[serde(rename = "case")]
    cases: Vec<Case>,
    #[serde(rename = "variant")]
    variants: Vec<Variant>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    scene: PathBuf,
    #[serde(default)]
    set: Vec<String>,
    spp: Option<u32>,
    size: Option<[u32; 2]>,
}

/// A way to render every case. The first one is shown in the pictures.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Variant {
    name: String,
    #[serde(default)]
    set: Vec<String>,
    blend: Option<String>,
}

/// What `accuracy.json` holds (docs/json.md).
#[derive(Serialize)]
struct Report {
    device: DeviceStats,
    variants: Vec<String>,
    cases: Vec<CaseReport>,
}

#[derive(Serialize)]
struct CaseReport {
    name: String,
    width: u32,
    height: u32,
    spp: u32,
    /// Root mean square noise of the truth over that of its radiance, where clouds are.
    noise: f64,
    /// In the order of `variants`; none where the device lacks the mode.
    errors: Vec<Option<CaseError>>,
}

#[derive(Clone, Copy, Serialize)]
struct CaseError {
    /// Root mean square difference over root mean square truth, where clouds are, noise taken off both.
    relative_rmse: f64,
    /// Mean radiance over that of the truth, less 1, where clouds are.
    bias: f64,
}

pub fn run(args: &AccuracyArgs) -> Result<()> {
    let suite = read(&args.suite)?;
    places::directory(&args.out)?;
    let base = args.suite.parent().unwrap_or(Path::new("."));
    let mut device = Device::open(&args.picture.scene, false)?;
    let wanted = |case: &&Case| args.only.is_empty() || args.only.contains(&case.name);
    let mut report = Report {
        device: device.stats(),
        variants: suite.variants.iter().map(|variant| variant.name.clone()).collect(),
        cases: Vec::new(),
    };
    for case in suite.cases.iter().filter(wanted) {
        let made = examine(&mut device, &suite, case, base, args)?;
        let shown = made.errors.first().copied().flatten().map_or(f64::NAN, |error| error.relative_rmse);
        note(&format!("{}: relative RMSE {shown:.3} (noise {:.3})", case.name, made.noise));
        report.cases.push(made);
    }
    if report.cases.is_empty() {
        let names: Vec<_> = suite.cases.iter().map(|case| case.name.as_str()).collect();
        return Err(Error::invalid("--only", args.only.join(", "), format!("one of {}", names.join(", "))));
    }
    write_json(&args.out.join("accuracy.json"), &report)?;
    let table = table(&report);
    write_atomic(&args.out.join("accuracy.md"), |out| out.write_all(table.as_bytes()))?;
    super::print(&table)
}

fn read(path: &Path) -> Result<Suite> {
    let text = std::fs::read_to_string(path).map_err(|error| Error::file(path, format!("cannot be read: {error}")))?;
    let suite: Suite = toml::from_str(&text).map_err(|error| Error::file(path, error.to_string().trim().to_owned()))?;
    match () {
        () if suite.cases.is_empty() => Err(Error::file(path, "a suite needs a [[case]]".to_owned())),
        () if suite.variants.is_empty() => Err(Error::file(path, "a suite needs a [[variant]]".to_owned())),
        () => Ok(suite),
    }
}

/// The truth of a case, and every variant against it.
fn examine(device: &mut Device, suite: &Suite, case: &Case, base: &Path, args: &AccuracyArgs) -> Result<CaseReport> {
    let [width, height] = case.size.unwrap_or(suite.size);
    let spp = args.spp.unwrap_or(case.spp.unwrap_or(suite.spp)).max(2);
    let scene = base.join(&case.scene);
    let with = |set: &[String]| {
        let mut picture = args.picture.clone();
        picture.size = Size { width, height };
        // The command line has the last word.
        picture.scene.set = [&["quality.downscale=1".to_owned()], &case.set[..], set, &args.picture.scene.set].concat();
        picture
    };
    let plain = with(&[]);
    let truth = trace(device, &scenes::load_precise(&scene, &plain)?, [width, height], spp, 0)?;
    let clouds = Clouds::of(&truth)?;
    let mut errors = Vec::new();
    for variant in &suite.variants {
        let made = render(device, &scene, variant, &with(&variant.set))?;
        if let (0, Some(picture)) = (errors.len(), &made) {
            strip(picture, &truth, &args.out.join(format!("{}.png", case.name.replace(' ', "-"))))?;
        }
        errors.push(made.map(|picture| clouds.error(&picture)));
    }
    Ok(CaseReport { name: case.name.clone(), width, height, spp, noise: clouds.noise(), errors })
}

/// A case by a variant; none where the device cannot.
fn render(device: &mut Device, scene: &Path, variant: &Variant, args: &PictureArgs) -> Result<Option<Picture>> {
    let blend = variant.blend.as_ref().map(|name| name.parse::<Blend>()).transpose()?;
    if blend.is_some_and(|blend| device.supports(blend).is_err()) {
        return Ok(None);
    }
    let params: Params = scenes::blended(scenes::load_precise(scene, args)?, blend, "blend")?;
    let picture = Session::open(device, &params, args)?.frame(device, &params)?.picture;
    match picture.fault() {
        Some(fault) => Err(Error::invalid(&variant.name, fault, "a picture")),
        None => Ok(Some(picture)),
    }
}

/// The pixels of the truth in which there are clouds.
struct Clouds<'a> {
    truth: &'a Picture,
    pixels: Vec<usize>,
    /// Sum of squares of the radiance, and of its variance, over those pixels.
    squares: f64,
    variance: f64,
}

impl<'a> Clouds<'a> {
    fn of(reference: &'a Reference) -> Result<Self> {
        let truth = &reference.picture;
        let (Some(transmittance), Some(variance)) = (&truth.transmittance, &reference.variance) else {
            return Err(Error::invalid("truth", "no transmittance or variance", "a path-traced picture"));
        };
        let pixels: Vec<usize> = (0..transmittance.len()).filter(|&i| transmittance[i] < 1.0 - LEAST_COVER).collect();
        let sum = |of: &dyn Fn(usize, usize) -> f64| -> f64 {
            pixels.iter().map(|&i| (0..3).map(|c| of(i, c)).sum::<f64>()).sum()
        };
        let squares = sum(&|i, c| f64::from(truth.radiance[i][c]).powi(2));
        let variance = sum(&|i, c| f64::from(variance[i][c]));
        Ok(Self { truth, pixels, squares, variance })
    }

    /// The square of a noisy mean is too great by its variance.
    fn signal(&self) -> f64 {
        (self.squares - self.variance).max(f64::MIN_POSITIVE)
    }

    fn noise(&self) -> f64 {
        (self.variance / self.signal()).sqrt()
    }

    fn error(&self, picture: &Picture) -> CaseError {
        let (mut squares, mut sum, mut sum_truth) = (0.0, 0.0, 0.0);
        for &i in &self.pixels {
            for c in 0..3 {
                let (value, truth) = (f64::from(picture.radiance[i][c]), f64::from(self.truth.radiance[i][c]));
                squares += (value - truth).powi(2);
                sum += value;
                sum_truth += truth;
            }
        }
        CaseError {
            relative_rmse: ((squares - self.variance).max(0.0) / self.signal()).sqrt(),
            bias: sum / f64::max(sum_truth, f64::MIN_POSITIVE) - 1.0,
        }
    }
}

/// Picture, truth and their ꟻLIP difference side by side.
fn strip(picture: &Picture, truth: &Reference, path: &Path) -> Result<()> {
    let difference = Difference::of("picture", picture, truth)?;
    let (width, height) = (picture.width as usize, picture.height as usize);
    let heat =
        |i: usize| magma((255.0 * difference.flip[i].clamp(0.0, 1.0)).round() as u8).map(|v| f32::from(v) / 255.0);
    let mut display = Vec::with_capacity(3 * width * height);
    for row in 0..height {
        let range = row * width..(row + 1) * width;
        display.extend_from_slice(&picture.display[range.clone()]);
        display.extend_from_slice(&truth.picture.display[range.clone()]);
        display.extend(range.map(heat));
    }
    let strip = Picture {
        width: 3 * picture.width,
        height: picture.height,
        radiance: display.clone(),
        transmittance: None,
        display,
    };
    strip.write(path, PngDepth::Eight)
}

/// The relative errors as a Markdown table.
fn table(report: &Report) -> String {
    let mut text = format!(
        "| case | noise | {} |\n|---|---|{}\n",
        report.variants.join(" | "),
        "---|".repeat(report.variants.len())
    );
    for case in &report.cases {
        let errors: Vec<_> = case
            .errors
            .iter()
            .map(|error| error.map_or("–".into(), |e| format!("{:.3} ({:+.0} %)", e.relative_rmse, 100.0 * e.bias)))
            .collect();
        let _ = writeln!(text, "| {} | {:.3} | {} |", case.name, case.noise, errors.join(" | "));
    }
    text
}
