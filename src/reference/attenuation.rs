//! Optical depths towards the sun in the attenuation volume (`glsl/lighting/attenuation/`), in `f64`; the exact ones are
//! [`sun_optical_depth`](super::lighting::sun_optical_depth)'s.

use glam::{DQuat, DVec3};

use crate::lighting::attenuation::volume::AttenuationParams;
use crate::shared::Particle;

/// No particle dims by more than exp(-256).
const GREATEST_DEPTH: f64 = 256.0;
/// Voxels at the border of a level that are not looked at, and those over which it passes into the next coarser one.
const RIM: f64 = 1.0;
const BLEND: f64 = 4.0;

fn vec(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// A particle as the columns of a level meet it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    centre: DVec3,
    reach: [f64; 2],
    outline: [f64; 3],
    shear: [f64; 2],
    half_depth: f64,
    depth: f64,
}

impl Shadow {
    /// Begin and end of the light's way through a column [voxels], and its optical depth.
    #[must_use]
    pub fn column(&self, at: [f64; 2]) -> [f64; 3] {
        let (x, y) = (at[0] - self.centre.x, at[1] - self.centre.y);
        let q = self.outline[0] * x * x + 2.0 * self.outline[1] * x * y + self.outline[2] * y * y;
        if q >= 1.0 {
            return [0.0; 3];
        }
        let (chord, middle) = ((1.0 - q).sqrt(), self.centre.z + self.shear[0] * x + self.shear[1] * y);
        [middle - self.half_depth * chord, middle + self.half_depth * chord, self.depth * chord]
    }
}

/// The volume of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Attenuation<'a>(pub &'a AttenuationParams);

impl Attenuation<'_> {
    /// Place of a point in a level [voxels].
    #[must_use]
    pub fn place(&self, level: usize, point: DVec3) -> DVec3 {
        let from = point - vec(self.0.anchor);
        let along = |row: [f32; 4]| vec([row[0], row[1], row[2]]).dot(from) + f64::from(row[3]);
        DVec3::new(along(self.0.row_u[level]), along(self.0.row_v[level]), along(self.0.row_w[level]))
    }

    /// A particle in a level: an ellipsoid of shape matrix S, widened across the light by 2 / (1 + S).
    #[must_use]
    pub fn shadow(&self, level: usize, particle: &Particle) -> Shadow {
        let p = self.0;
        let turn = DQuat::from_array(particle.rotation.map(f64::from)).inverse();
        let axes = f64::from(p.body) * vec(particle.semi_axes);
        let of = |row: [f32; 4]| axes * (turn * vec([row[0], row[1], row[2]]));
        let (u, v, w) = (of(p.row_u[level]), of(p.row_v[level]), of(p.row_w[level]));
        let volume = u.cross(v).dot(w).abs();
        let (uu, uv, vv) = (u.dot(u) + 2.0 / (1.0 + u.dot(u)), u.dot(v), v.dot(v) + 2.0 / (1.0 + v.dot(v)));
        let across = uu * vv - uv * uv;
        let outline = [vv / across, -uv / across, uu / across];
        let (b0, b1) = (u.dot(w), v.dot(w));
        let shear = [outline[0] * b0 + outline[1] * b1, outline[1] * b0 + outline[2] * b1];
        // What is left of S along the light once the column is known (Schur complement).
        let half_depth = (w.dot(w) - shear[0] * b0 - shear[1] * b1).sqrt();
        let metres = -1.0 / vec([p.row_w[level][0], p.row_w[level][1], p.row_w[level][2]]).dot(vec(p.to_sun));
        let sigma = f64::from(p.extinction) * f64::from(particle.density) * f64::from(particle.fade);
        let depth = (sigma * metres * 2.0 * volume / across.sqrt()).min(GREATEST_DEPTH);
        Shadow {
            centre: self.place(level, vec(particle.centre)),
            reach: [uu.sqrt(), vv.sqrt()],
            outline,
            shear,
            half_depth,
            depth,
        }
    }

    /// Position of a voxel in memory.
    #[must_use]
    pub fn index(&self, level: usize, [u, v, w]: [usize; 3]) -> usize {
        let (dim, depth) = (self.0.dim as usize, self.0.depth as usize);
        ((level * depth + w) * dim + v) * dim + u
    }

    /// Optical depth between the middle of each voxel and the light, particle by particle and voxel by voxel, as Shimada adds
    /// them: no differences, no sums along the light, no rounding.
    #[must_use]
    pub fn depths(&self, particles: &[Particle]) -> Vec<f64> {
        let (dim, depth) = (self.0.dim as i64, self.0.depth as usize);
        let mut depths = vec![0.0f64; (dim * dim) as usize * depth * self.0.levels as usize];
        for level in 0..self.0.levels as usize {
            for particle in particles.iter().filter(|p| p.density * p.fade > 0.0) {
                let shadow = self.shadow(level, particle);
                let range = |axis: usize| {
                    let (centre, reach) = (shadow.centre[axis], shadow.reach[axis]);
                    let clamp = |x: f64| x.clamp(0.0, dim as f64) as i64;
                    clamp((centre - reach - 0.5).ceil())..clamp((centre + reach - 0.5).floor() + 1.0)
                };
                for v in range(1) {
                    for u in range(0) {
                        let [begin, end, total] = shadow.column([u as f64 + 0.5, v as f64 + 0.5]);
                        let last = (depth - 3) as f64;
                        let begin = (begin - 0.5).clamp(0.0, last);
                        let end = (end - 0.5).clamp(begin, last);
                        for w in 0..depth {
                            let way = w as f64 - begin;
                            let share = if way <= 0.0 { 0.0 } else { (way / (end - begin).max(1e-9)).min(1.0) };
                            depths[self.index(level, [u as usize, v as usize, w])] += total * share;
                        }
                    }
                }
            }
        }
        depths
    }

    /// Trilinear interpolation of `depths` in a level.
    fn interpolate(&self, depths: &[f64], level: usize, place: DVec3) -> f64 {
        let size = [self.0.dim, self.0.dim, self.0.depth].map(|n| n as usize);
        let at: [f64; 3] = std::array::from_fn(|axis| (place[axis] - 0.5).clamp(0.0, (size[axis] - 1) as f64));
        let first: [usize; 3] = std::array::from_fn(|axis| (at[axis] as usize).min(size[axis] - 2));
        let mut sum = 0.0;
        for corner in 0..8 {
            let bit = |axis: usize| corner >> axis & 1;
            let weight: f64 = (0..3)
                .map(|axis| {
                    let t = at[axis] - first[axis] as f64;
                    if bit(axis) == 1 { t } else { 1.0 - t }
                })
                .product();
            sum += weight * depths[self.index(level, std::array::from_fn(|axis| first[axis] + bit(axis)))];
        }
        sum
    }

    /// Optical depth between a point and the light, from the finest level that holds it.
    #[must_use]
    pub fn look_up(&self, depths: &[f64], point: DVec3) -> f64 {
        let last = self.0.levels as usize - 1;
        let room = |level: usize| {
            let place = self.place(level, point);
            place.x.min(place.y).min(f64::from(self.0.dim) - place.x.max(place.y)) - RIM
        };
        let level = (0..last).find(|&level| room(level) > 0.0).unwrap_or(last);
        let fine = self.interpolate(depths, level, self.place(level, point));
        if level == last {
            return fine;
        }
        let share = (room(level) / BLEND).min(1.0);
        let coarse = self.interpolate(depths, level + 1, self.place(level + 1, point));
        share * fine + (1.0 - share) * coarse
    }
}

/// Share of diffuse light that a layer lets through (`glsl/lighting/attenuation/streams.glsl`).
#[must_use]
pub fn streams_transmittance(tau: f64, g: f64) -> f64 {
    1.0 / (1.0 + 0.75 * (1.0 - g) * tau)
}

/// Mean radiance of light scattered more than once, per irradiance of the sun [1/sr], `tau` deep in a layer of optical depth
/// `column`.
#[must_use]
pub fn streams_radiance(tau: f64, column: f64, g: f64) -> f64 {
    let gamma = 0.75 * (1.0 - g);
    let streams = (1.0 + 2.0 * gamma * (column - tau)) / (1.0 + gamma * column);
    2.0 * (streams - (-(1.0 - g) * tau).exp()) / (4.0 * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The streams solve dF↓/dτ = dF↑/dτ = -γ (F↓ - F↑) with F↓ = 1 above and F↑ = 0 below.
    #[test]
    fn two_streams_conserve_energy_and_meet_their_boundaries() {
        let (g, column) = (0.757, 40.0);
        let gamma = 0.75 * (1.0 - g);
        let through = streams_transmittance(column, g);
        let unscattered = |tau: f64| (-(1.0 - g) * tau).exp();
        let sum = |tau: f64| streams_radiance(tau, column, g) * 2.0 * std::f64::consts::PI + unscattered(tau);
        assert!((sum(0.0) - (2.0 - through)).abs() < 1e-12, "1 and the light that comes back");
        assert!((sum(column) - through).abs() < 1e-12, "what is let through and nothing from below");
        let slope = (sum(20.01) - sum(19.99)) / 0.02;
        assert!((slope + 2.0 * gamma * through).abs() < 1e-9, "{slope}");
    }
}
