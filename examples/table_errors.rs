//! The study behind docs/table-errors.md: full tables of each medium against Monte Carlo and quadrature, at every density
//! level and between, and where their light goes. Prints Markdown.
//!
//! `scripts/table-errors [DIR]` runs it; DIR keeps the tables (26 to 59 CPU-seconds each without a GPU).

use std::ops::ControlFlow;
use std::path::PathBuf;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::lut::axes::{DENSITY_LEVELS, STEPS, ScatteringShape};
use welkin::lut::{Detail, TableParams, Tables};
use welkin::params::{Clouds, Style};
use welkin::reference::comparison::{Case, Deviation, random_cases};
use welkin::reference::monte_carlo::{Estimate, Medium, balance, parallel};
use welkin::reference::phase::PhaseFunction::{CornetteShanks, HenyeyGreenstein};
use welkin::reference::scattering::{ScatteringLookup, single_scattering};

const RAYS: usize = 500;

/// Walks a ray on average: what brings the noise of 500 rays to some 2 % up to R = 4 and 3 % beyond.
fn walks(optical_radius: f64) -> u32 {
    let at = [(0.4, 1000.0), (2.0, 2000.0), (4.3, 3000.0), (9.5, 3500.0), (46.0, 2400.0), (102.4, 1800.0)];
    let k = at[1..at.len() - 1].iter().take_while(|(r, _)| *r < optical_radius).count();
    let ((r0, n0), (r1, n1)) = (at[k], at[k + 1]);
    (n0 * f64::powf(n1 / n0, (optical_radius / r0).ln() / f64::ln(r1 / r0))) as u32
}

/// Single and multiple scattering at rays whose optical radius lies in `from..=to`.
fn compare(lookup: &ScatteringLookup, medium: &Medium, from: f64, to: f64, rays: usize, seed: u64) -> [Deviation; 2] {
    let cases = random_cases(medium, from, to, rays, walks((from * to).sqrt()), seed);
    let pairs = |table: &(dyn Fn(&Case) -> (f64, Estimate) + Sync)| parallel(rays, |i| table(&cases[i]));
    let single = |c: &Case| {
        let truth = single_scattering(&c.ray.ray(), c.optical_radius);
        (lookup.single(&c.ray, c.optical_radius), Estimate { mean: truth, error: 0.0 })
    };
    let multiple = |c: &Case| (lookup.multiple(&c.ray, c.optical_radius), c.truth);
    [Deviation::new(&pairs(&single)), Deviation::new(&pairs(&multiple))]
}

/// `RMS | its bound | bias |` in per cent; the RMS alone where truth has no noise.
fn cells(d: &Deviation) -> String {
    let (bias, error) = (100.0 * d.bias.mean, 100.0 * d.bias.error);
    if d.noise == 0.0 {
        return format!("{:.2} | {bias:+.2} |", 100.0 * d.rms());
    }
    format!("{:.1} | {:.1} | {bias:+.2} ± {error:.2} |", 100.0 * d.rms(), 100.0 * d.rms_bound())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let cache = std::env::args().nth(1).map_or_else(|| std::env::temp_dir().join("welkin-table-errors"), PathBuf::from);
    let only: Option<usize> = std::env::args().nth(2).map(|n| n.parse()).transpose()?;
    let mut device = Standalone::new(Options::default())?;
    let mut media = Vec::new();
    for albedo in [1.0, 0.9] {
        for phase in [CornetteShanks, HenyeyGreenstein] {
            media.extend([(0.9, 0.7), (0.7, 0.7), (0.85, 0.85)].map(|(g_sun, g)| Medium { phase, g_sun, g, albedo }));
        }
    }
    for (index, medium) in media.into_iter().enumerate().filter(|(index, _)| only.is_none_or(|n| n == *index)) {
        let style = Style::Homogeneous;
        let params = TableParams { medium, style, ..TableParams::new(&Clouds::default(), Detail::Full) };
        let go_on = &mut |_| ControlFlow::Continue(());
        let tables = Tables::load_or_build(device.frames(), &params, Some(&cache), go_on)?.ok_or("stopped")?;
        eprintln!("tables of medium {index}: {:.1} s", tables.seconds());
        let lookup = ScatteringLookup::new(tables.scattering.shape(), tables.read_scattering(device.frames())?);
        let Medium { phase, g_sun, g, albedo } = medium;
        println!("\n### {phase:?}, g = {g_sun} at the sun's event and {g} elsewhere, albedo {albedo}\n");
        println!(
            "| R | leaves | expected | single: RMS | bias | multiple: RMS | < | bias | between: single | bias | multiple | < | bias |"
        );
        println!("|{}", "---|".repeat(13));
        for (level, energy) in (0..DENSITY_LEVELS).zip(tables.energy()) {
            let r = ScatteringShape::optical_radius(level * STEPS);
            let seed = 100 * index as u64 + u64::from(level);
            let [single, multiple] = compare(&lookup, &medium, r, r, RAYS, seed);
            // Without absorption everything leaves; with it, forward walks tell how much.
            let expected = if albedo < 1.0 {
                let walks = balance(&medium, r, (1.0e7 / r.max(6.0)) as u32, seed);
                let (mean, error) = (walks.scattered.mean + energy.transmitted, walks.scattered.error);
                format!("{mean:.4} ± {error:.4}")
            } else {
                "1".into()
            };
            print!("| {r:.2} | {:.4} | {expected} | {} {} ", energy.total(), cells(&single), cells(&multiple));
            if level + 1 < DENSITY_LEVELS {
                let next = ScatteringShape::optical_radius((level + 1) * STEPS);
                let [single, multiple] = compare(&lookup, &medium, r, next, RAYS / 2, seed + 50);
                println!("{} {}", cells(&single), cells(&multiple));
            } else {
                println!("| | | | |");
            }
        }
    }
    Ok(())
}
