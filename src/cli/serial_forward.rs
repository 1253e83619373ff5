//! `welkin bench --serial-forward`: lighting `forward` against the same as the papers have it, with one draw and one read-back
//! for each particle (Harris 2.3; the first line of Shimada's Table 1).

use serde::Serialize;
use welkin::grid::ParticleList;
use welkin::lighting::forward::serial::Serial;
use welkin::output::DeviceStats;
use welkin::params::{Light, Lighting, Params, Source};
use welkin::tiling::{Slab, TilingParams};
use welkin::{Error, Result};

use super::args::BenchArgs;
use super::progress::Progress;
use super::scenes;
use super::session::{Device, Session};
use super::summary::median;

/// Texels along an edge of the light buffer (Harris 2, Stoian 3).
const RESOLUTION: u32 = 32;
/// Passes of a frame that find the light of particles.
const LIGHT_PASSES: &[&str] = &["tiling", "lighting"];

#[derive(Serialize)]
struct Report {
    scene: String,
    device: DeviceStats,
    particles: u32,
    resolution: u32,
    /// One draw and one read-back for each particle: wall time, the median over the measured runs [ms].
    serial_ms: f64,
    /// Lists of occluders and the walk through them: device time, the same.
    forward_ms: f64,
    ratio: f64,
}

pub fn run(args: &BenchArgs, scene: &std::path::Path) -> Result<()> {
    let params = scenes::load(scene, &args.picture)?;
    let Source::Particles(particles) = &params.clouds.source else {
        let by = "--serial-forward (it lights lists of particles)".into();
        return Err(Error::Unsupported { needed: "a scene without clouds.source = \"particles\"".into(), by });
    };
    let mut params = Params { ..params.clone() };
    params.clouds.lighting = Lighting::Forward;
    params.clouds.forward.lights = vec![Light::SUN];
    params.validate()?;

    let mut device = Device::open(&args.picture.scene, false)?;
    let mut session = Session::open(&mut device, &params, &args.picture)?;
    let gpu = device.frames().gpu().clone();
    let list = ParticleList::new(&gpu, particles, 1)?;
    let [least, greatest] = list.bounds();
    let slab = Slab {
        centre: std::array::from_fn(|axis| 0.5 * (least[axis] + greatest[axis])),
        base: least[1],
        thickness: greatest[1] - least[1],
        half_widths: &[(0.5 * (greatest[0] - least[0])).max(0.5 * (greatest[2] - least[2]))],
        greatest_extent: list.greatest_extent(),
        planet_radius: f64::INFINITY,
    };
    let tiles = TilingParams::new(params.sun.to_sun(), &slab, params.clouds.sigma_t);
    let origin = [0.0; 3];
    let relative: Vec<_> = (0..particles.len()).map(|index| list.particle(index, origin)).collect();
    let serial = Serial::new(&gpu, RESOLUTION)?;

    let (mut serial_ms, mut forward_ms) = (Vec::new(), Vec::new());
    let mut progress = Progress::start("serial forward", u64::from(args.warmup) + u64::from(args.measure));
    for turn in 0..args.warmup + args.measure {
        let times = session.time_frame(&mut device, &params)?;
        let (_, wall) = serial.run(device.frames(), &relative, &tiles, &params.clouds)?;
        if turn >= args.warmup {
            let passes = times.passes.iter().filter(|pass| LIGHT_PASSES.contains(&pass.name.as_str()));
            forward_ms.push(passes.map(|pass| pass.gpu_ms).sum());
            serial_ms.push(wall.as_secs_f64() * 1e3);
        }
        progress.set(u64::from(turn) + 1);
    }
    drop(progress);

    let [serial_ms, forward_ms] = [&serial_ms, &forward_ms].map(|times| median(times).unwrap_or(f64::NAN));
    let report = Report {
        scene: scene.display().to_string(),
        device: device.stats(),
        particles: list.count(),
        resolution: RESOLUTION,
        serial_ms,
        forward_ms,
        ratio: serial_ms / forward_ms,
    };
    if args.json { super::print_json(&report) } else { super::print(&text(&report)) }
}

fn text(report: &Report) -> String {
    format!(
        "{} on {}: {} particles, light buffer of {resolution}²\n\
         one draw and one read-back a particle  {:>12.3} ms\n\
         lighting forward, without read-back    {:>12.3} ms\n\
         ratio                                  {:>12.1}\n",
        report.scene,
        report.device.name,
        report.particles,
        report.serial_ms,
        report.forward_ms,
        report.ratio,
        resolution = report.resolution,
    )
}
