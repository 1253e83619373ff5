//! Path tracing of homogeneous ellipsoids in sunlight, in `f64` and one path at a time.
//!
//! Nothing is shared with the device's tracer but the phase function, not even the method: every ray is cut by all
//! ellipsoids, free flights invert the optical depth of the pieces (regular tracking, no null collisions), and the
//! transmittance towards the sun is exp(-Σ τ) instead of an estimate.

use super::monte_carlo::{Medium, next_uniform};
use super::scene::Scene;
use glam::DVec3;

/// Ellipsoids in a parallel beam of unit irradiance.
#[derive(Clone, Debug)]
pub struct Sunlit {
    /// Where there is matter.
    pub scene: Scene,
    /// Phase functions and albedo.
    pub medium: Medium,
    /// Unit vector towards the sun.
    pub to_sun: DVec3,
}

impl Sunlit {
    /// Optical depth from `origin` along `dir` to infinity.
    fn optical_depth(&self, origin: DVec3, dir: DVec3) -> f64 {
        self.scene.segments(origin, dir, f64::INFINITY).iter().map(|s| s.optical_depth).sum()
    }

    /// Where an optical depth of `tau` has been flown through \[m\]; none if the ray leaves first.
    fn flight(&self, origin: DVec3, dir: DVec3, tau: f64) -> Option<f64> {
        let segments = self.scene.segments(origin, dir, f64::INFINITY);
        let mut events: Vec<f64> = segments.iter().flat_map(|s| [s.t_enter, s.t_exit]).collect();
        events.sort_by(f64::total_cmp);
        let mut left = tau;
        for piece in events.windows(2) {
            let middle = 0.5 * (piece[0] + piece[1]);
            let there = segments.iter().filter(|s| s.t_enter < middle && middle < s.t_exit);
            let extinction: f64 = there.map(|s| s.optical_depth / (s.t_exit - s.t_enter)).sum();
            let depth = extinction * (piece[1] - piece[0]);
            if left < depth {
                return Some(piece[0] + left / extinction);
            }
            left -= depth;
        }
        None
    }

    /// Radiance that one path brings back along the ray, in units of the sun's irradiance \[1/sr\]: its mean over many is the
    /// scattered sunlight. `random`: state of [`next_uniform`].
    pub fn path(&self, origin: DVec3, dir: DVec3, random: &mut u64) -> f64 {
        let (mut origin, mut dir) = (origin, dir);
        let (mut throughput, mut radiance) = (1.0, 0.0);
        while let Some(t) = self.flight(origin, dir, -(1.0 - next_uniform(random)).ln()) {
            origin += t * dir;
            throughput *= self.medium.albedo;
            let phase = self.medium.phase.eval(dir.dot(self.to_sun), self.medium.g_sun);
            radiance += throughput * phase * (-self.optical_depth(origin, self.to_sun)).exp();
            // Absorbed paths end by chance once they carry little.
            if throughput < 0.1 {
                if next_uniform(random) < 0.5 {
                    break;
                }
                throughput *= 2.0;
            }
            let cosine = self.medium.phase.sample(self.medium.g, || next_uniform(random));
            let (a, b) = dir.any_orthonormal_pair();
            let (sin, cos) = (std::f64::consts::TAU * next_uniform(random)).sin_cos();
            dir = (cosine * dir + (1.0 - cosine * cosine).max(0.0).sqrt() * (cos * a + sin * b)).normalize();
        }
        radiance
    }
}
