//! Extinction of particles at points of space in f64 (`glsl/density/extinction.glsl`, `glsl/detail/displace.glsl`).

use super::detail::{CELLS, billow};
use super::optical_depth::profile_density;
use crate::detail::TILE_SIZE;
use crate::params::Style;
use crate::shared::Particle;
use glam::{DQuat, DVec3};

/// Ratio of successive wavelengths of the detail.
const LACUNARITY: f64 = 2.37;
/// Longest wavelength, in particle radii.
const FIRST: f64 = 1.6;
/// Height of a bump, in wavelengths.
const HEIGHT: f64 = 0.26;
const OCTAVES: i32 = 4;

/// Values of the tile of billow noise, rounded to 16-bit floats.
pub struct Tile(Vec<f64>);

impl Default for Tile {
    fn default() -> Self {
        let n = TILE_SIZE as usize;
        let scale = f64::from(CELLS) / f64::from(TILE_SIZE);
        let value = |i: usize| billow([i % n, i / n % n, i / (n * n)].map(|c| (c as f64 + 0.5) * scale)).0;
        Self((0..n * n * n).map(|i| half::f16::from_f64(value(i)).to_f64()).collect())
    }
}

impl Tile {
    /// A tile with the values that a device has stored, x fastest: which way it rounds to 16 bits is its own business.
    ///
    /// # Panics
    /// If there are not `TILE_SIZE`³ of them.
    #[must_use]
    pub fn stored(values: Vec<f64>) -> Self {
        assert_eq!(values.len(), (TILE_SIZE as usize).pow(3));
        Self(values)
    }

    /// Filtered linearly, repeating; the tile is 1 wide.
    fn sample(&self, p: DVec3) -> f64 {
        let n = TILE_SIZE as usize;
        let texel = p * n as f64 - 0.5;
        let (base, f) = (texel.floor(), texel - texel.floor());
        let mut sum = 0.0;
        for k in 0..8 {
            let step = DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2));
            let at = (base + step).to_array().map(|c| (c as i64).rem_euclid(n as i64) as usize);
            let weight = (1.0 - step + f * (2.0 * step - 1.0)).to_array().iter().product::<f64>();
            sum += weight * self.0[(at[2] * n + at[1]) * n + at[0]];
        }
        sum
    }

    /// How far below an ellipsoid with least semi-axis `radius` \[m\] detail leaves the surface at `position` \[m\], every
    /// octave resolved \[m\].
    #[must_use]
    pub fn depth(&self, position: DVec3, radius: f64) -> f64 {
        let level = (radius * FIRST).ln() / LACUNARITY.ln();
        let (first, blend) = (level.floor(), level - level.floor());
        let mut wavelength = LACUNARITY.powf(first + 1.0);
        let mut depth = 0.0;
        for octave in 0..=OCTAVES {
            let weight = match octave {
                0 => blend,
                OCTAVES => 1.0 - blend,
                _ => 1.0,
            };
            let angle = 1.7 * (first + 1.0 - f64::from(octave));
            let (sin, cos) = angle.sin_cos();
            let turned =
                DVec3::new(cos * position.x - sin * position.z, position.y, sin * position.x + cos * position.z);
            let value = self.sample(turned / (wavelength * f64::from(CELLS)) + angle);
            depth += HEIGHT * weight * wavelength * (1.0 - value);
            wavelength /= LACUNARITY;
        }
        depth
    }

    /// Profile of `particle` at `position` (relative to the floating origin `origin` \[m\]), displaced by detail of strength
    /// `detail`.
    #[must_use]
    pub fn profile(
        &self,
        particle: &Particle,
        position: DVec3,
        origin: DVec3,
        detail: f64,
        style: Style,
        seed: u32,
    ) -> f64 {
        let p_us = to_unit_ball(particle, position);
        if style == Style::Homogeneous || p_us.length() >= 1.0 {
            return f64::from(p_us.length() < 1.0);
        }
        let n = if p_us.length() > 1e-6 { p_us.normalize() } else { DVec3::Y };
        let semi_axes = DVec3::from_array(particle.semi_axes.map(f64::from));
        let surface = DVec3::from_array(particle.centre.map(f64::from)) + rotation(particle) * (n * semi_axes) + origin;
        let size = semi_axes.min_element();
        let radius = 1.0 - (detail * self.depth(surface, size) / size).min(0.6);
        if p_us.length() < radius { profile_density(p_us / radius, style, seed) } else { 0.0 }
    }
}

fn rotation(particle: &Particle) -> DQuat {
    DQuat::from_array(particle.rotation.map(f64::from))
}

/// `position` (relative to the floating origin) with the particle's ellipsoid mapped to the unit sphere.
#[must_use]
pub fn to_unit_ball(particle: &Particle, position: DVec3) -> DVec3 {
    let centre = DVec3::from_array(particle.centre.map(f64::from));
    rotation(particle).conjugate() * (position - centre) / DVec3::from_array(particle.semi_axes.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn detail_takes_from_a_particle_and_never_adds() {
        let tile = Tile::default();
        let particle =
            Particle { semi_axes: [200.0, 150.0, 180.0], rotation: [0.0, 0.6, 0.0, 0.8], ..Particle::zeroed() };
        let origin = DVec3::new(2048.0, 1500.0, -1024.0);
        let mut sums = [0.0; 2];
        for k in 0..2000 {
            let (sin, cos) = (f64::from(k) * 2.399_963).sin_cos();
            let y = 1.0 - f64::from(2 * k + 1) / 2000.0;
            let n = DVec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin);
            let position = n * (f64::from(k % 40) * 5.0);
            let at = |detail| tile.profile(&particle, position, origin, detail, Style::Radial, 1);
            // Radial density falls off outwards but for its noise, so only where the ellipsoid ends is the order strict.
            let (plain, displaced) = (at(0.0), at(1.0));
            assert!(plain > 0.0 || displaced == 0.0, "{position}");
            sums[0] += plain;
            sums[1] += displaced;
        }
        assert!(sums[1] > 0.0 && sums[1] < 0.8 * sums[0], "{sums:?}");
    }
}
