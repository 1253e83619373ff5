//! The study behind docs/table-errors.md: full tables of each medium against Monte Carlo and quadrature, at every density
//! level and between, and where their light goes. Prints Markdown.
//!
//! `scripts/table-errors [DIR]` runs it; DIR keeps the tables (about 40 CPU-seconds each without a GPU).

use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::path::PathBuf;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::lut::axes::{DENSITY_LEVELS, STEPS, ScatteringShape};
use welkin::lut::{Detail, TableParams, Tables};
use welkin::params::{Clouds, Style};
use welkin::reference::monte_carlo::{Medium, balance, multiple_scattering, next_uniform, parallel};
use welkin::reference::phase::PhaseFunction::{CornetteShanks, HenyeyGreenstein};
use welkin::reference::scattering::{ScatteringLookup, single_scattering};
use welkin::reference::sphere::RayCoordinates;

const RAYS: usize = 500;

/// Table against truth over many rays.
#[derive(Default)]
struct Sums {
    difference: f64,
    square: f64,
    total: f64,
    energy: f64,
    variance: f64,
}

impl Sums {
    fn add(&mut self, table: f64, truth: f64, error: f64) {
        self.difference += table - truth;
        self.square += (table - truth).powi(2);
        self.total += truth;
        self.energy += truth * truth;
        self.variance += error * error;
    }

    /// Relative RMS weighted by radiance, with the known noise of the truth taken out [%].
    fn rms(&self) -> f64 {
        100.0 * ((self.square - self.variance).max(0.0) / self.energy).sqrt()
    }

    /// The noise that was taken out [%].
    fn noise(&self) -> f64 {
        100.0 * (self.variance / self.energy).sqrt()
    }

    /// Bias and its standard error [%].
    fn bias(&self) -> (f64, f64) {
        (100.0 * self.difference / self.total, 100.0 * self.variance.sqrt() / self.total)
    }
}

/// Rays as light meets a ball: directions of the sun uniform, entry points uniform over the disc.
fn random_ray(state: &mut u64) -> RayCoordinates {
    let mut u = || next_uniform(state);
    RayCoordinates { theta: (1.0 - 2.0 * u()).acos(), psi: PI * u(), mu: u().sqrt().max(1e-4) }
}

/// Single and multiple scattering at rays whose optical radius lies in `from..=to`.
fn compare(lookup: &ScatteringLookup, medium: &Medium, from: f64, to: f64, rays: usize, seed: u64) -> [Sums; 2] {
    let walks = (4800.0 / from).clamp(800.0, 2400.0) as u32;
    let found = parallel(rays, |i| {
        let mut state = seed.wrapping_mul(1_000_003) + i as u64;
        let c = random_ray(&mut state);
        let r = from * (to / from).powf(next_uniform(&mut state));
        let truth = multiple_scattering(medium, &c.ray(), r, None, walks, state);
        (lookup.single(&c, r), single_scattering(&c.ray(), r), lookup.multiple(&c, r), truth)
    });
    let mut sums = [Sums::default(), Sums::default()];
    for (single, single_truth, multiple, truth) in found {
        sums[0].add(single, single_truth, 0.0);
        sums[1].add(multiple, truth.mean, truth.error);
    }
    sums
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
        let lookup = ScatteringLookup::new(tables.scattering.shape(), tables.read_scattering(device.frames())?);
        let Medium { phase, g_sun, g, albedo } = medium;
        println!("\n### {phase:?}, g = {g_sun} at the sun's event and {g} elsewhere, albedo {albedo}\n");
        println!(
            "| R | leaves | expected | single, RMS | bias | multiple, RMS | noise | bias | between: single | bias | multiple | bias |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
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
            print!(
                "| {r:.2} | {:.4} | {expected} | {:.2} % | {:+.2} % ",
                energy.total(),
                single.rms(),
                single.bias().0
            );
            let (bias, error) = multiple.bias();
            print!("| {:.1} % | {:.1} % | {bias:+.2} ± {error:.2} % ", multiple.rms(), multiple.noise());
            if level + 1 < DENSITY_LEVELS {
                let next = ScatteringShape::optical_radius((level + 1) * STEPS);
                let [single, multiple] = compare(&lookup, &medium, r, next, RAYS / 2, seed + 50);
                let (bias, error) = multiple.bias();
                print!("| {:.2} % | {:+.2} % | {:.1} % ", single.rms(), single.bias().0, multiple.rms());
                println!("| {bias:+.2} ± {error:.2} % |");
            } else {
                println!("| | | | |");
            }
        }
    }
    Ok(())
}
