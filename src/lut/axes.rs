//! Shapes and coordinate mappings of the tables, with exact inverses; domain ends lie on texel centres.
//!
//! GLSL twins: `glsl/lut/scattering_lookup.glsl` and `glsl/lut/optical_depth_lookup.glsl`, where the meaning of every
//! coordinate is told.

use super::transport::grid::interpolation;
use crate::reference::sphere::RayCoordinates;
use std::f64::consts::PI;

/// Shape of the optical depth table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpticalDepthShape {
    /// Azimuth of the entry point; wraps, texel centres at i + ½.
    pub phi_s: u32,
    /// Zenith of the entry point and of the direction (the same number of both).
    pub theta: u32,
    /// Azimuth of the direction; wraps, texel centres at i + ½.
    pub phi_v: u32,
}

impl OpticalDepthShape {
    /// 64 × 32 × 64 × 32 (Yusov 5.1).
    pub const FULL: Self = Self { phi_s: 64, theta: 32, phi_v: 64 };
    /// For a first picture.
    pub const COARSE: Self = Self { phi_s: 32, theta: 16, phi_v: 32 };

    /// Extent of the 3D image that holds it: zenith slices of the direction are tiled along y.
    pub fn image_extent(self) -> [u32; 3] {
        [self.phi_s, self.theta * self.theta, self.phi_v]
    }

    /// Azimuth of texel `i` of `n` [rad].
    pub fn azimuth(i: u32, n: u32) -> f64 {
        2.0 * PI * (f64::from(i) + 0.5) / f64::from(n)
    }

    /// Zenith of the entry point at texel `i` [rad], 0..=π.
    pub fn theta_s(self, i: u32) -> f64 {
        PI * f64::from(i) / f64::from(self.theta - 1)
    }

    /// Zenith of the direction at texel `i` [rad], 0..=π/2.
    pub fn theta_v(self, i: u32) -> f64 {
        0.5 * PI * f64::from(i) / f64::from(self.theta - 1)
    }
}

/// Shape and range of the scattering tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatteringShape {
    /// Scattering angle.
    pub theta: u32,
    /// Azimuth to the sun about the ray.
    pub psi: u32,
    /// Zenith cosine of the ray.
    pub mu: u32,
}

/// Number of levels of optical radius that the table holds: look-ups are linear between them.
pub const LEVELS: u32 = STEPS * (DENSITY_LEVELS - 1) + 1;
/// Number of levels that an octave of density apart would be: those of the paper, and of exported tables.
pub const DENSITY_LEVELS: u32 = 8;
/// Levels of the table from one density level to the next.
pub const STEPS: u32 = 4;
/// Optical radius of the first level; the thinnest ring-0 particle of the paper (0.07 1/m · 92 m · 2^-4).
pub const R_MIN: f64 = 0.4;
/// Optical radius of the last level. Colours are constant beyond.
pub const R_MAX: f64 = 102.4;
/// Optical depth up to which chords are spaced evenly, above it geometrically (tuned: least interpolation error).
pub const MU_SCALE: f64 = 50.0;
/// Zenith cosine at which the spacing changes from chords to impact parameters, which then are even: the middle of the
/// ball, seen from the eye, is a disc like any other. The impact parameter there is 0.66.
pub const MU_SPLIT: f64 = 0.75;
/// Share of the axis that lies below [`MU_SPLIT`].
const MU_SPLIT_AT: f64 = 0.75;

/// Axis position 0..=1 of a zenith cosine.
fn mu_to_axis(mu: f64, optical_radius: f64) -> f64 {
    let full = 2.0 * optical_radius * MU_SPLIT / MU_SCALE;
    if mu <= MU_SPLIT {
        MU_SPLIT_AT * (full * mu / MU_SPLIT).asinh() / full.asinh()
    } else {
        1.0 - (1.0 - MU_SPLIT_AT) * (1.0 - mu * mu).max(0.0).sqrt() / (1.0 - MU_SPLIT * MU_SPLIT).sqrt()
    }
}

/// Inverse of [`mu_to_axis`].
fn axis_to_mu(t: f64, optical_radius: f64) -> f64 {
    let full = 2.0 * optical_radius * MU_SPLIT / MU_SCALE;
    if t <= MU_SPLIT_AT {
        MU_SPLIT * (t / MU_SPLIT_AT * full.asinh()).sinh() / full
    } else {
        let b = (1.0 - MU_SPLIT * MU_SPLIT).sqrt() * (1.0 - t) / (1.0 - MU_SPLIT_AT);
        (1.0 - b * b).sqrt()
    }
}

impl ScatteringShape {
    /// 32 × 64 × 16 (× 8 levels), as in Yusov 5.1.
    pub const FULL: Self = Self { theta: 32, psi: 64, mu: 16 };
    /// For a first picture.
    pub const COARSE: Self = Self { theta: 16, psi: 24, mu: 10 };

    /// Extent of the 3D image that holds it: levels are stacked along z.
    pub fn image_extent(self) -> [u32; 3] {
        [self.theta, self.psi, self.mu * LEVELS]
    }

    /// Number of texels of one level.
    pub fn level_len(self) -> usize {
        (self.theta * self.psi * self.mu) as usize
    }

    /// Optical radius of a level, evenly spaced in log2.
    pub fn optical_radius(level: u32) -> f64 {
        R_MIN * (R_MAX / R_MIN).powf(f64::from(level) / f64::from(LEVELS - 1))
    }

    /// Whether a level is solved; the others are filled in by a cubic through four that are.
    pub fn solved(level: u32) -> bool {
        level.is_multiple_of(2)
    }

    /// The levels that fill in one that is not solved, and their weights: Lagrange's cubic in log2 of the optical radius.
    pub fn filled_from(level: u32) -> ([u32; 4], [f64; 4]) {
        let solved: Vec<u32> = (0..LEVELS).filter(|&level| Self::solved(level)).collect();
        let nodes: Vec<f64> = solved.iter().map(|&level| f64::from(level)).collect();
        let (first, weights) = interpolation(&nodes, f64::from(level));
        (std::array::from_fn(|k| solved[first + k]), weights)
    }

    /// Level of an optical radius, a real number in `0..=LEVELS - 1`; inverse of [`Self::optical_radius`].
    pub fn level(optical_radius: f64) -> f64 {
        (optical_radius.clamp(R_MIN, R_MAX) / R_MIN).ln() / (R_MAX / R_MIN).ln() * f64::from(LEVELS - 1)
    }

    /// Ray of the texel (i, j, k) at an optical radius.
    pub fn coordinates(self, texel: [u32; 3], optical_radius: f64) -> RayCoordinates {
        let t = |i: u32, n: u32| f64::from(i) / f64::from(n - 1);
        RayCoordinates {
            theta: PI * t(texel[0], self.theta).powi(2),
            psi: PI * t(texel[1], self.psi),
            mu: axis_to_mu(t(texel[2], self.mu), optical_radius),
        }
    }

    /// Real texel position of a ray; inverse of [`Self::coordinates`].
    pub fn texel(self, c: &RayCoordinates, optical_radius: f64) -> [f64; 3] {
        let t = [(c.theta / PI).sqrt(), c.psi / PI, mu_to_axis(c.mu, optical_radius)];
        [t[0] * f64::from(self.theta - 1), t[1] * f64::from(self.psi - 1), t[2] * f64::from(self.mu - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texel_centres_map_back_to_themselves_and_domain_ends_are_texels() {
        for shape in [ScatteringShape::FULL, ScatteringShape::COARSE] {
            for level in 0..LEVELS {
                let r = ScatteringShape::optical_radius(level);
                assert!((ScatteringShape::level(r) - f64::from(level)).abs() < 1e-12);
                for i in 0..shape.theta {
                    for (j, k) in [(0, 0), (shape.psi / 2, shape.mu / 2), (shape.psi - 1, shape.mu - 1)] {
                        let back = shape.texel(&shape.coordinates([i, j, k], r), r);
                        let error = (back[0] - f64::from(i)).abs()
                            + (back[1] - f64::from(j)).abs()
                            + (back[2] - f64::from(k)).abs();
                        assert!(error < 1e-11, "{shape:?} {level} {i} {j} {k}: {back:?}");
                    }
                }
                let first = shape.coordinates([0, 0, 0], r);
                let last = shape.coordinates([shape.theta - 1, shape.psi - 1, shape.mu - 1], r);
                assert_eq!(first, RayCoordinates { theta: 0.0, psi: 0.0, mu: 0.0 });
                assert_eq!(last, RayCoordinates { theta: PI, psi: PI, mu: 1.0 });
            }
        }
        assert_eq!(ScatteringShape::optical_radius(0), R_MIN);
        assert_eq!(ScatteringShape::optical_radius(LEVELS - 1), R_MAX);
    }

    #[test]
    fn density_levels_are_solved_and_cubics_are_filled_in_exactly() {
        assert!((0..DENSITY_LEVELS).all(|level| ScatteringShape::solved(level * STEPS)));
        let cubic = |level: u32| (f64::from(level) * 0.1 - 1.0).powi(3);
        for level in (0..LEVELS).filter(|&level| !ScatteringShape::solved(level)) {
            let (levels, weights) = ScatteringShape::filled_from(level);
            assert!(levels.iter().all(|&level| ScatteringShape::solved(level)), "{level}: {levels:?}");
            let filled: f64 = levels.iter().zip(weights).map(|(&level, weight)| weight * cubic(level)).sum();
            assert!((filled - cubic(level)).abs() < 1e-12, "{level}: {levels:?} {weights:?}");
        }
    }

    #[test]
    fn zeniths_of_the_optical_depth_table_end_on_texels() {
        let shape = OpticalDepthShape::FULL;
        assert_eq!((shape.theta_s(0), shape.theta_v(0)), (0.0, 0.0));
        assert_eq!((shape.theta_s(31), shape.theta_v(31)), (PI, 0.5 * PI));
        assert_eq!(shape.image_extent(), [64, 1024, 64]);
    }
}
