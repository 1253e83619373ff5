//! Numbers about the homogeneous unit ball in a parallel beam of unit irradiance that are known without a solver.

use super::quadrature::gauss_legendre;
use super::sphere::{LitRay, distance_to_surface};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::sphere::RayCoordinates;

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
