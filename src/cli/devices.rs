//! `welkin devices`: what there is, and what each device can do.

use std::fmt::Write;

use serde::Serialize;
use welkin::Result;
use welkin::frame::{Output, OutputKind};
use welkin::gpu::standalone;
use welkin::gpu::{Capabilities, Feature};
use welkin::params::{BLENDS, Blend, Params, SOURCES, WINDOWS, lightings_of};
use welkin::renderer::Renderer;

use super::args::DevicesArgs;
use super::validation;

#[derive(Serialize)]
struct Report {
    devices: Vec<Device>,
    /// What every device can have in clouds: each source with its lighting methods.
    sources: Vec<SourceReport>,
    /// Descriptions, if asked for.
    pipelines: Option<Vec<String>>,
}

#[derive(Serialize)]
struct SourceReport {
    source: &'static str,
    lighting: Vec<&'static str>,
}

#[derive(Serialize)]
struct Device {
    index: usize,
    name: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    kind: &'static str,
    driver: String,
    api: String,
    usable: bool,
    /// What keeps Welkin from running on it.
    missing: Vec<String>,
    /// The mode that `auto` takes; none on a device that cannot be used.
    auto: Option<String>,
    /// The mode that `exact` takes; none on a device that cannot be used.
    exact: Option<String>,
    blend: Vec<Mode>,
    timestamps: Answer,
}

#[derive(Serialize)]
struct Mode {
    mode: &'static str,
    #[serde(flatten)]
    answer: Answer,
    /// The windows K that the mode can have here; null for a mode without one.
    windows: Option<Vec<u32>>,
}

#[derive(Serialize, Clone)]
struct Answer {
    supported: bool,
    /// Why not; null where it is supported.
    reason: Option<String>,
}

impl From<Result<(), String>> for Answer {
    fn from(answer: Result<(), String>) -> Self {
        Self { supported: answer.is_ok(), reason: answer.err() }
    }
}

pub fn run(args: &DevicesArgs) -> Result<()> {
    let devices = standalone::devices()?;
    let report = Report {
        devices: devices.iter().enumerate().map(|(index, device)| describe(index, device)).collect(),
        sources: sources(),
        pipelines: if args.pipelines { Some(pipelines()?) } else { None },
    };
    if args.json { super::print_json(&report) } else { super::print(&text(&report)) }
}

/// The sources of this version.
fn sources() -> Vec<SourceReport> {
    let here = SOURCES.iter().filter(|row| row.here);
    here.map(|row| SourceReport {
        source: row.name,
        lighting: lightings_of(row.value).iter().map(|method| method.axis.name).collect(),
    })
    .collect()
}

/// Every pipeline of a frame of the default scene, on the device that `render` takes by default.
fn pipelines() -> Result<Vec<String>> {
    let device = validation::open(None, false)?;
    let _renderer = Renderer::new(device.gpu(), &Params::default(), [64, 64], 1)?;
    let _output = Output::new(device.gpu(), OutputKind::Picture, ash::vk::Format::B8G8R8A8_UNORM)?;
    Ok(device.gpu().described_pipelines())
}

fn describe(index: usize, device: &Capabilities) -> Device {
    let modes = BLENDS.iter().filter(|row| !matches!(row.value, Blend::Auto | Blend::Exact));
    let taken = |by: Blend| {
        let choice = device.missing.is_empty().then(|| welkin::blend::choose(by, device).ok());
        choice.flatten().map(|choice| choice.used.to_string())
    };
    let blend: Vec<_> = modes
        .map(|row| {
            let windows = |of: fn(u32) -> Blend| {
                Some(WINDOWS.into_iter().filter(|k| supports(device, of(*k), row.here).is_ok()).collect())
            };
            Mode {
                mode: row.name,
                answer: supports(device, row.value, row.here).into(),
                windows: match row.value {
                    Blend::Interlock(_) => windows(Blend::Interlock),
                    Blend::Attachment(_) => windows(Blend::Attachment),
                    Blend::Auto | Blend::Exact | Blend::List | Blend::Tiled | Blend::Alpha | Blend::Impostor => None,
                },
            }
        })
        .collect();
    Device {
        index,
        name: device.device_name.clone(),
        kind: device.device_type,
        driver: device.driver.clone(),
        api: device.api.clone(),
        usable: device.missing.is_empty(),
        missing: device.missing.clone(),
        auto: taken(Blend::Auto),
        exact: taken(Blend::Exact),
        blend,
        timestamps: device.supports(Feature::Timestamps).map_err(str::to_owned).into(),
    }
}

/// Whether `device` can composite by `blend`, or why not.
fn supports(device: &Capabilities, blend: Blend, here: bool) -> Result<(), String> {
    if !device.missing.is_empty() {
        return Err(format!("the device lacks {}", device.missing.join(", ")));
    }
    if !here {
        return Err("not in this version of Welkin yet".into());
    }
    welkin::blend::supports(blend, device)
}

fn text(report: &Report) -> String {
    let mut text = String::new();
    if report.devices.is_empty() {
        text.push_str("no Vulkan device\n");
    }
    for device in &report.devices {
        let Device { index, name, kind, driver, api, .. } = device;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{index}: {name} ({kind}, Vulkan {api}, {driver})");
        for Mode { mode, answer, windows } in &device.blend {
            let windows = windows.as_ref().filter(|windows| !windows.is_empty());
            let windows = windows.map(|windows| format!(", K of {windows:?}")).unwrap_or_default();
            let _ = writeln!(text, "   {mode:<12} {}{windows}", answer_text(answer));
        }
        let _ = writeln!(text, "   {:<12} {}", "auto", device.auto.as_deref().unwrap_or("none"));
        let _ = writeln!(text, "   {:<12} {}", "exact", device.exact.as_deref().unwrap_or("none"));
        let _ = writeln!(text, "   {:<12} {}", "timestamps", answer_text(&device.timestamps));
    }
    let _ = writeln!(text, "Clouds:");
    for SourceReport { source, lighting } in &report.sources {
        let _ = writeln!(text, "   {source:<12} lit by {}", lighting.join(", "));
    }
    for pipeline in report.pipelines.iter().flatten() {
        let _ = writeln!(text, "\n{pipeline}");
    }
    text
}

fn answer_text(answer: &Answer) -> String {
    answer.reason.as_ref().map_or("yes".into(), |reason| format!("no: {reason}"))
}
