//! What is known of the homogeneous unit ball in a parallel beam of unit irradiance without a solver, and the look-up of
//! its tables.

use super::monte_carlo::{Medium, parallel};
use super::quadrature::gauss_legendre;
use super::sphere::{LitRay, RayCoordinates, distance_to_surface};
use crate::lut::axes::{LEVELS, R_MAX, R_MIN, ScatteringShape};
use std::f64::consts::PI;

/// Single scattering without phase function (Yusov, Eq. 9) by numerical quadrature [1], albedo 1.
///
/// `∫ exp(-R s) exp(-R q(s)) R ds` over the chord, s from the eye's side, q towards the sun. The integrand is analytic on
/// the chord but varies over optical depth 1 at either end, so the chord is cut geometrically towards both.
pub fn single_scattering(ray: &LitRay, optical_radius: f64) -> f64 {
    let chord = 2.0 * (-ray.entry.dot(ray.dir)).max(0.0);
    let (nodes, weights) = gauss_legendre(8);
    let half_pieces = 4 + (optical_radius * chord + 1.0).log2().ceil() as i32;
    let mut cuts: Vec<f64> = (0..half_pieces).map(|k| 0.5 * chord * 0.5f64.powi(half_pieces - 1 - k)).collect();
    cuts.insert(0, 0.0);
    let mirrored: Vec<f64> = cuts.iter().rev().skip(1).map(|c| chord - c).collect();
    cuts.extend(mirrored);
    let mut sum = 0.0;
    for piece in cuts.windows(2) {
        let half = 0.5 * (piece[1] - piece[0]);
        for (x, w) in nodes.iter().zip(&weights) {
            let s = piece[0] + half * (1.0 + x);
            let q = distance_to_surface(ray.entry + s * ray.dir, ray.to_sun);
            sum += w * half * optical_radius * (-optical_radius * (s + q)).exp();
        }
    }
    sum
}

/// Fraction of the beam that crosses the ball without an event: `[1 - (1 + 2R) e^(-2R)] / (2R²)`.
pub fn directly_transmitted(optical_radius: f64) -> f64 {
    let x = 2.0 * optical_radius;
    if x < 1e-2 {
        return 1.0 - x * (2.0 / 3.0 - x * (0.25 - x / 15.0)); // the closed form cancels; series of 2 (1 - (1+x) e^-x) / x²
    }
    2.0 * (1.0 - (1.0 + x) * (-x).exp()) / (x * x)
}

/// Mean distance that light travels inside a ball of unit radius without absorption, whatever the phase function: 4V/S.
pub const MEAN_PATH_LENGTH: f64 = 4.0 / 3.0;

/// 1 - e^(-tau).
pub fn opacity(tau: f64) -> f64 {
    -(-tau).exp_m1()
}

/// Mean source function of single scattering, nearly, in closed form. GLSL twin: `single_scattering_model`, where it is told.
pub fn single_scattering_model(ray: &LitRay, optical_radius: f64) -> f64 {
    const INSET: f64 = 0.1;
    const SCALE: f64 = 0.5;
    let mu = (-ray.entry.dot(ray.dir)).clamp(0.0, 1.0);
    let tau = 2.0 * optical_radius * mu;
    if tau < 1e-4 {
        return 1.0;
    }
    let end = |k: i32| if k == 3 { tau } else { SCALE * (f64::from(k) / 3.0 * (tau / SCALE).asinh()).sinh() };
    let q = |t: f64| {
        let s = t / optical_radius;
        let b = ray.entry.dot(ray.to_sun) + s * ray.dir.dot(ray.to_sun);
        optical_radius * ((b * b + (s * (2.0 * mu - s)).max(0.0)).sqrt() - b)
    };
    let mut sum = 0.0;
    for k in 0..3 {
        let (start, width) = (end(k), end(k + 1) - end(k));
        let (near, far) = (q(start + INSET * width), q(start + (1.0 - INSET) * width));
        let slope = (far - near) / (1.0 - 2.0 * INSET);
        let x = width + slope;
        let mean_decay = if x.abs() < 1e-4 { 1.0 - 0.5 * x } else { opacity(x) / x };
        sum += (-(start + near - INSET * slope).max(0.0)).exp() * width * mean_decay;
    }
    sum / opacity(tau)
}

/// What multiple scattering is nearly proportional to. GLSL twin: `multiple_scattering_model`, where it is told.
pub fn multiple_scattering_model(ray: &LitRay, optical_radius: f64) -> f64 {
    let (cos_sun, cos_theta) = (ray.entry.dot(ray.to_sun), ray.dir.dot(ray.to_sun));
    let mu = (-ray.entry.dot(ray.dir)).clamp(0.0, 1.0);
    let thin = optical_radius.recip();
    let lit = cos_sun + (cos_sun * cos_sun + thin * (1.6 * thin + 0.4 * mu)).sqrt();
    let sum = lit + 0.5 * mu + 0.005;
    (0.1 * sum + lit * (mu + 0.035) * (1.1 - cos_theta).powf(-1.5)) / (sum * (1.0 + 2.0 * thin))
}

/// Fraction of the beam that leaves after exactly one event: Eq. 9 times the phase function over all rays.
pub fn single_fraction(medium: &Medium, optical_radius: f64) -> f64 {
    let (x, w) = gauss_legendre(16);
    let (cosines, cosine_weights) = gauss_legendre(64);
    let full = 2.0 * optical_radius;
    let rows = parallel(x.len(), |i| {
        // mu = sinh(a t) / 2R with t uniform: rays where the chord's optical depth is about 1 count most.
        let t = 0.5 * (1.0 + x[i]);
        let a = full.asinh();
        let (mu, slope) = ((a * t).sinh() / full, 0.5 * w[i] * a * (a * t).cosh() / full);
        let mut sum = 0.0;
        for (c, cw) in cosines.iter().zip(&cosine_weights) {
            for (p, pw) in x.iter().zip(&w) {
                let coordinates = RayCoordinates { theta: c.acos(), psi: 0.5 * PI * (1.0 + p), mu };
                let value = medium.phase.eval(*c, medium.g_sun) * single_scattering(&coordinates.ray(), optical_radius);
                sum += 0.25 * cw * pw * value;
            }
        }
        8.0 * PI * mu * slope * sum
    });
    medium.albedo * rows.iter().sum::<f64>()
}

/// The scattering table as a look-up sees it: twin of `scattering_lookup.glsl` in f64.
pub struct ScatteringLookup {
    shape: ScatteringShape,
    values: Vec<[f32; 2]>,
}

impl ScatteringLookup {
    /// Wraps a table as it lies in memory.
    pub fn new(shape: ScatteringShape, values: Vec<[f32; 2]>) -> Self {
        assert_eq!(values.len(), shape.level_len() * LEVELS as usize, "the table has another shape");
        Self { shape, values }
    }

    fn level(&self, texel: [f64; 3], level: usize) -> [f64; 2] {
        let n = [self.shape.theta, self.shape.psi, self.shape.mu].map(|n| n as usize);
        let base: [usize; 3] = std::array::from_fn(|a| (texel[a].floor().max(0.0) as usize).min(n[a] - 2));
        let mut sum = [0.0; 2];
        for corner in 0..8usize {
            let mut weight = 1.0;
            let at: [usize; 3] = std::array::from_fn(|a| {
                let bit = corner >> a & 1;
                let f = (texel[a] - base[a] as f64).clamp(0.0, 1.0);
                weight *= if bit == 1 { f } else { 1.0 - f };
                base[a] + bit
            });
            let value = self.values[((level * n[2] + at[2]) * n[1] + at[1]) * n[0] + at[0]];
            sum = [sum[0] + weight * f64::from(value[0]), sum[1] + weight * f64::from(value[1])];
        }
        sum
    }

    fn fetch(&self, c: &RayCoordinates, optical_radius: f64) -> [f64; 2] {
        let r = optical_radius.clamp(R_MIN, R_MAX);
        let level = ScatteringShape::level(r);
        let lower = level.floor().min(f64::from(LEVELS - 2));
        let texel = self.shape.texel(c, r);
        let (a, b) = (self.level(texel, lower as usize), self.level(texel, lower as usize + 1));
        [0, 1].map(|i| a[i] + (level - lower) * (b[i] - a[i]))
    }

    /// Single scattering without phase function and albedo [1].
    pub fn single(&self, c: &RayCoordinates, optical_radius: f64) -> f64 {
        let rest = self.fetch(c, optical_radius)[0] * (optical_radius / R_MIN).min(1.0);
        (single_scattering_model(&c.ray(), optical_radius) + rest).max(0.0) * opacity(2.0 * optical_radius * c.mu)
    }

    /// Radiance of light scattered twice or more, for unit irradiance [1/sr].
    pub fn multiple(&self, c: &RayCoordinates, optical_radius: f64) -> f64 {
        let model = multiple_scattering_model(&c.ray(), optical_radius.clamp(R_MIN, R_MAX));
        let source = model * self.fetch(c, optical_radius)[1] * (optical_radius / R_MIN).min(1.0);
        source.max(0.0) * opacity(2.0 * optical_radius * c.mu)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_into_the_sun_single_scattering_is_tau_times_transmittance() {
        for optical_radius in [0.1, 1.0, 10.0, 100.0] {
            for mu in [0.001, 0.02, 0.5, 1.0] {
                let tau = 2.0 * optical_radius * mu;
                let value = single_scattering(&RayCoordinates { theta: 0.0, psi: 0.0, mu }.ray(), optical_radius);
                assert!((value - tau * (-tau).exp()).abs() < 1e-7 * tau, "{optical_radius} {mu} {value}");
            }
        }
    }

    #[test]
    fn lit_from_behind_the_eye_through_the_centre_single_scattering_is_half_of_an_absorbed_round_trip() {
        for optical_radius in [0.1, 1.0, 10.0, 100.0] {
            let ray = RayCoordinates { theta: std::f64::consts::PI, psi: 0.0, mu: 1.0 }.ray();
            let expected = 0.5 * (1.0 - (-4.0f64 * optical_radius).exp());
            assert!((single_scattering(&ray, optical_radius) - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn direct_transmission_agrees_with_quadrature_over_the_disc() {
        let (nodes, weights) = gauss_legendre(64);
        for optical_radius in [0.003, 0.1, 2.0, 30.0] {
            // ∫ 2 mu e^(-2 R mu) dmu over mu in [0, 1].
            let sum: f64 = (nodes.iter().zip(&weights))
                .map(|(x, w)| {
                    let mu = 0.5 * (1.0 + x);
                    0.5 * w * 2.0 * mu * (-2.0 * optical_radius * mu).exp()
                })
                .sum();
            assert!((sum - directly_transmitted(optical_radius)).abs() < 1e-10);
        }
    }
}
