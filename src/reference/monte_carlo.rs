//! Monte Carlo truth for the homogeneous unit ball in a parallel beam of unit irradiance.
//!
//! Analogue random walks; nothing is shared with the solver but the phase functions. Every number comes with its standard
//! error. Work is split over threads in fixed blocks with a seed each, so a result does not depend on their number.

use super::phase::PhaseFunction;
use super::sphere::{LitRay, distance_to_surface};
pub use crate::threads::parallel;
use glam::DVec3;
use std::f64::consts::PI;

/// The scattering medium of the tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Which phase function.
    pub phase: PhaseFunction,
    /// Asymmetry of the event that meets the sun.
    pub g_sun: f64,
    /// Asymmetry of every other event.
    pub g: f64,
    /// Single-scattering albedo, 0..=1.
    pub albedo: f64,
}

/// Mean of a quantity with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean.
    pub error: f64,
}

/// The next number in [0, 1) of a SplitMix64 sequence.
pub fn next_uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Turns a unit vector by an angle of the given cosine about a uniform azimuth, given by a unit vector of the plane.
fn turn(dir: DVec3, cos: f64, azimuth: (f64, f64)) -> DVec3 {
    let (a, b) = dir.any_orthonormal_pair();
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let turned = cos * dir + sin * (azimuth.0 * a + azimuth.1 * b);
    turned * (1.5 - 0.5 * turned.length_squared()) // normalised: rounding must not pile up over thousands of events
}

/// A uniformly distributed azimuth: cosine and sine.
fn random_azimuth(state: &mut u64) -> (f64, f64) {
    loop {
        let (x, y) = (2.0 * next_uniform(state) - 1.0, 2.0 * next_uniform(state) - 1.0);
        let square = x * x + y * y;
        if square <= 1.0 && square > 1e-12 {
            let scale = square.sqrt().recip();
            return (x * scale, y * scale);
        }
    }
}

/// Batches into which the walks of an estimate are split; their spread is its standard error.
const BATCHES: u32 = 16;

/// Additive recurrence in four dimensions (the inverse powers of the root of x⁵ = x + 1): each of its first n points has a
/// stratum nearly of its own.
const RECURRENCE: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_908_6, 0.538_597_257_225_920_1];

/// Radiance from light scattered twice or more, leaving along `ray` towards the eye [1/sr].
///
/// Walks go backwards from the eye, the first of their free paths conditioned on an event inside the chord. Every vertex
/// sends out a probe: a last segment to the event that meets the sun, its direction drawn from the mixture of the phase
/// functions at its two ends (either alone would now and then miss the other's peak), its length conditioned on an event.
/// The walk itself goes on by the phase function and ends at the surface. Deep inside, where no probe can bring back more
/// than e^(-depth), only some are sent. The first vertex and the first probe of a batch are stratified.
pub fn multiple_scattering(
    medium: &Medium,
    ray: &LitRay,
    optical_radius: f64,
    orders: Option<u32>,
    walks: u32,
    seed: u64,
) -> Estimate {
    let mut state = seed.wrapping_mul(0xd129_0d3a_61ab_b4f5) ^ 0x5851_f42d_4c95_7f2d;
    let opacity = -(-optical_radius * distance_to_surface(ray.entry, ray.dir)).exp_m1();
    let per_batch = walks.div_ceil(BATCHES);
    let (mut sum, mut sum_squares) = (0.0, 0.0);
    for _ in 0..BATCHES {
        let shift: [f64; 4] = std::array::from_fn(|_| next_uniform(&mut state));
        let mut batch = 0.0;
        for walk in 0..per_batch {
            let first: [f64; 4] = std::array::from_fn(|k| (shift[k] + f64::from(walk) * RECURRENCE[k]).fract());
            let start = ray.entry + ray.dir * (-(-first[0] * opacity).ln_1p() / optical_radius);
            let probe = [first[1], first[2], first[3]];
            batch += follow(medium, ray, optical_radius, orders, start, opacity * medium.albedo, probe, &mut state);
        }
        let mean = batch / f64::from(per_batch);
        sum += mean;
        sum_squares += mean * mean;
    }
    let n = f64::from(BATCHES);
    let mean = sum / n;
    Estimate { mean, error: ((sum_squares / n - mean * mean).max(0.0) / (n - 1.0)).sqrt() }
}

/// What one walk finds that has its first event at `point`; `first` are the random numbers of its first probe.
fn follow(
    medium: &Medium,
    ray: &LitRay,
    optical_radius: f64,
    orders: Option<u32>,
    mut point: DVec3,
    mut weight: f64,
    first: [f64; 3],
    state: &mut u64,
) -> f64 {
    let mut dir = ray.dir;
    let mut radiance = 0.0;
    for order in 2.. {
        if orders.is_some_and(|n| order > n) {
            break;
        }
        let deep = optical_radius * (1.0 - point.length());
        let sent = if order == 2 { 1.0 } else { (PROBE_ALWAYS * (-deep).exp()).min(1.0) };
        if sent >= 1.0 || next_uniform(state) < sent {
            let [lobe, azimuth, length] = if order == 2 { first } else { std::array::from_fn(|_| next_uniform(state)) };
            let (axis, g) = if lobe < 0.5 { (ray.to_sun, medium.g_sun) } else { (dir, medium.g) };
            // The cosine's first number is what is left of the one that chose the lobe.
            let mut left = Some(2.0 * lobe % 1.0);
            let cos = medium.phase.sample(g, || left.take().unwrap_or_else(|| next_uniform(state)));
            let (sin_azimuth, cos_azimuth) = (2.0 * PI * azimuth).sin_cos();
            let probe = turn(axis, cos, (cos_azimuth, sin_azimuth));
            let (here, there) =
                (medium.phase.eval(dir.dot(probe), medium.g), medium.phase.eval(ray.to_sun.dot(probe), medium.g_sun));
            let opacity = -(-optical_radius * distance_to_surface(point, probe)).exp_m1();
            let end = point - probe * ((-length * opacity).ln_1p() / optical_radius);
            let attenuation = (-optical_radius * distance_to_surface(end, ray.to_sun)).exp();
            radiance += weight / sent * medium.albedo * opacity * attenuation * here * there / (0.5 * (here + there));
        }
        let cos = medium.phase.sample(medium.g, || next_uniform(state));
        dir = turn(dir, cos, random_azimuth(state));
        point -= dir * ((1.0 - next_uniform(state)).ln() / optical_radius);
        if point.length_squared() >= 1.0 {
            break;
        }
        weight *= medium.albedo;
        if weight < 0.05 {
            // Russian roulette.
            if next_uniform(state) < 0.5 {
                break;
            }
            weight *= 2.0;
        }
    }
    radiance
}

/// Probes are sent always up to the depth at which this times e^(-depth) is 1 (tuned: least variance for the time).
const PROBE_ALWAYS: f64 = 20.0;

/// Where the light of the beam goes, as fractions of the light that meets the ball.
#[derive(Clone, Copy, Debug, Default)]
pub struct Balance {
    /// Crosses without an event.
    pub transmitted: Estimate,
    /// Leaves after one or more events.
    pub scattered: Estimate,
    /// Mean cosine between the beam and the scattered light.
    pub mean_cosine: Estimate,
    /// Mean path inside the ball of everything that leaves, in radii.
    pub path_length: Estimate,
}

/// Follows `photons` of the beam through the ball (forward, so here `g_sun` belongs to the first event).
pub fn balance(medium: &Medium, optical_radius: f64, photons: u32, seed: u64) -> Balance {
    let blocks = 64;
    let sums = parallel(blocks, |block| {
        let mut state = seed ^ (block as u64 + 1).wrapping_mul(0xa076_1d64_78bd_642f);
        let mut sums = [[0.0f64; 2]; 4];
        for _ in 0..photons / blocks as u32 {
            let (u, v) = (next_uniform(&mut state), 2.0 * PI * next_uniform(&mut state));
            let mut dir = DVec3::Z;
            let mut point = DVec3::new(u.sqrt() * v.cos(), u.sqrt() * v.sin(), -(1.0 - u).sqrt());
            let (mut weight, mut path, mut events) = (1.0, 0.0, 0);
            loop {
                let free = -(1.0 - next_uniform(&mut state)).ln() / optical_radius;
                let exit = distance_to_surface(point, dir);
                path += free.min(exit);
                if free >= exit {
                    break;
                }
                point += dir * free;
                weight *= medium.albedo;
                let g = if events == 0 { medium.g_sun } else { medium.g };
                let cos = medium.phase.sample(g, || next_uniform(&mut state));
                dir = turn(dir, cos, random_azimuth(&mut state));
                events += 1;
            }
            let scattered = if events > 0 { weight } else { 0.0 };
            let values = [f64::from(u8::from(events == 0)), scattered, scattered * dir.z, path * weight];
            for (sum, value) in sums.iter_mut().zip(values) {
                sum[0] += value;
                sum[1] += value * value;
            }
        }
        sums
    });
    let n = f64::from(photons / blocks as u32 * blocks as u32);
    let estimate = |k: usize| {
        let (s, s2) = sums.iter().fold((0.0, 0.0), |a, b| (a.0 + b[k][0], a.1 + b[k][1]));
        let mean = s / n;
        Estimate { mean, error: ((s2 / n - mean * mean).max(0.0) / n).sqrt() }
    };
    let (scattered, cosine) = (estimate(1), estimate(2));
    Balance {
        transmitted: estimate(0),
        scattered,
        mean_cosine: Estimate { mean: cosine.mean / scattered.mean, error: cosine.error / scattered.mean },
        path_length: estimate(3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::scattering::{MEAN_PATH_LENGTH, directly_transmitted};

    const ISOTROPIC: Medium = Medium { phase: PhaseFunction::HenyeyGreenstein, g_sun: 0.0, g: 0.0, albedo: 1.0 };

    fn assert_within(estimate: Estimate, truth: f64, what: &str) {
        assert!((estimate.mean - truth).abs() < 4.0 * estimate.error + 1e-4, "{what}: {estimate:?}, not {truth}");
    }

    #[test]
    fn the_walk_agrees_with_closed_forms_for_isotropic_scattering() {
        for (r, cosine, at_09) in [(1.0, -0.0416, 0.5810), (2.0, -0.1085, 0.6681), (5.0, -0.2444, 0.6035)] {
            let lossless = balance(&ISOTROPIC, r, 200_000, 7);
            assert_within(lossless.transmitted, directly_transmitted(r), "transmitted");
            assert_within(lossless.mean_cosine, cosine, "mean cosine");
            assert_within(lossless.path_length, MEAN_PATH_LENGTH, "path length");
            assert_within(balance(&Medium { albedo: 0.9, ..ISOTROPIC }, r, 200_000, 8).scattered, at_09, "albedo 0.9");
        }
    }

    #[test]
    fn the_mean_path_does_not_depend_on_the_phase_function() {
        // One phase function for all events: the law needs a reciprocal medium, which the paper's mixture is not.
        let medium = Medium { phase: PhaseFunction::CornetteShanks, g_sun: 0.7, g: 0.7, albedo: 1.0 };
        assert_within(balance(&medium, 4.0, 200_000, 3).path_length, MEAN_PATH_LENGTH, "path length");
    }
}
