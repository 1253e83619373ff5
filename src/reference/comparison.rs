//! The scattering tables against truth at random rays, with the certainty of what is found: the figures of
//! docs/table-errors.md and the bounds of the tests.

use super::monte_carlo::{Estimate, Medium, multiple_scattering, next_uniform, parallel};
use super::sphere::RayCoordinates;
use std::f64::consts::PI;

/// A ray as light meets a ball: the sun's direction uniform, the entry point uniform over the disc.
pub fn random_ray(state: &mut u64) -> RayCoordinates {
    let mut u = || next_uniform(state);
    RayCoordinates { theta: (1.0 - 2.0 * u()).acos(), psi: PI * u(), mu: u().sqrt().max(1e-4) }
}

/// A ray through a ball with the radiance of multiple scattering that leaves along it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The ray.
    pub ray: RayCoordinates,
    /// Optical radius of the ball.
    pub optical_radius: f64,
    /// What Monte Carlo finds [1/sr].
    pub truth: Estimate,
}

/// Walks that a ray gets to find out how many more it needs.
const PILOT: u32 = 64;

/// Random rays of balls whose optical radii are spread evenly (in their logarithm) over `from..=to`, with `walks` a ray on
/// average. Rays get them by the spread of walks sent ahead, which are not used again: as σ^(4/3), which makes the noise of
/// a sum of squares least, with two fifths spread evenly lest a rare event be missed.
pub fn random_cases(medium: &Medium, from: f64, to: f64, rays: usize, walks: u32, seed: u64) -> Vec<Case> {
    let at = |i: usize| {
        let mut state = seed.wrapping_mul(1_000_003).wrapping_add(i as u64);
        let ray = random_ray(&mut state);
        let optical_radius = from * (to / from).powf(next_uniform(&mut state));
        (ray, optical_radius, state)
    };
    let pilots = parallel(rays, |i| {
        let (ray, r, state) = at(i);
        multiple_scattering(medium, &ray.ray(), r, None, PILOT, !state).error.powf(4.0 / 3.0)
    });
    let mean = (pilots.iter().sum::<f64>() / rays as f64).max(f64::MIN_POSITIVE);
    parallel(rays, |i| {
        let (ray, optical_radius, state) = at(i);
        let share = 0.4 + 0.6 * pilots[i] / mean;
        let truth =
            multiple_scattering(medium, &ray.ray(), optical_radius, None, (f64::from(walks) * share) as u32, state);
        Case { ray, optical_radius, truth }
    })
}

/// How far a table is from truth over many rays.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deviation {
    /// Relative mean square, weighted by radiance, `Σ (x - t)² / Σ t²`: unbiased, hence negative now and then, since the
    /// known variance of each truth is taken out of its square.
    pub mean_square: Estimate,
    /// `Σ (x - t) / Σ t`.
    pub bias: Estimate,
    /// RMS noise of the truth, which was taken out, relative as `mean_square` is.
    pub noise: f64,
}

/// A ratio of sums with its standard error by the spread over their terms.
fn ratio(terms: &[(f64, f64)]) -> Estimate {
    let (over, under) = terms.iter().fold((0.0, 0.0), |s, t| (s.0 + t.0, s.1 + t.1));
    let mean = over / under;
    let n = terms.len() as f64;
    let square: f64 = terms.iter().map(|(a, b)| (a - mean * b).powi(2)).sum();
    Estimate { mean, error: (square * n / (n - 1.0)).sqrt() / under.abs() }
}

impl Deviation {
    /// From pairs of table and truth.
    pub fn new(pairs: &[(f64, Estimate)]) -> Self {
        let variance = |t: &Estimate| t.error * t.error;
        let terms =
            |f: &dyn Fn(f64, &Estimate) -> (f64, f64)| -> Vec<_> { pairs.iter().map(|(x, t)| f(*x, t)).collect() };
        let squares = terms(&|x, t| ((x - t.mean).powi(2) - variance(t), t.mean * t.mean - variance(t)));
        let noise = ratio(&terms(&|_, t| (variance(t), t.mean * t.mean - variance(t)))).mean.max(0.0).sqrt();
        Self { mean_square: ratio(&squares), bias: ratio(&terms(&|x, t| (x - t.mean, t.mean))), noise }
    }

    /// RMS; 0 where noise alone would give more than was found.
    pub fn rms(&self) -> f64 {
        self.mean_square.mean.max(0.0).sqrt()
    }

    /// What the RMS is below with a probability of 95 %.
    pub fn rms_bound(&self) -> f64 {
        (self.mean_square.mean + 1.645 * self.mean_square.error).max(0.0).sqrt()
    }
}
