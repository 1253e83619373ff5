//! Sunlight and skylight at particles (`glsl/lighting/`), in `f64` and by brute force: no tiles, every pair.

use glam::{DQuat, DVec3};

use crate::grid::GridParams;
use crate::params::Transfer;
use crate::reference::grid::{Grid, puff_host};
use crate::shared::Particle;

fn vec(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// Length of the ray's way through the ellipsoid in front of its start [m].
#[must_use]
pub fn chord_ahead(particle: &Particle, start: DVec3, direction: DVec3) -> f64 {
    let inverse = DQuat::from_array(particle.rotation.map(f64::from)).inverse();
    let axes = vec(particle.semi_axes);
    let o = inverse * (start - vec(particle.centre)) / axes;
    let d = inverse * direction / axes;
    let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - 1.0);
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 {
        return 0.0;
    }
    let root = discriminant.sqrt();
    ((-b + root) / a).max(0.0) - ((-b - root) / a).max(0.0)
}

/// Optical depth of other particles from `start` towards the light; each occluder has its own density. `extinction`: at
/// relative density 1 [1/m].
#[must_use]
pub fn sun_optical_depth(
    particles: &[Particle],
    start: DVec3,
    to_sun: DVec3,
    extinction: f64,
    this: Option<usize>,
) -> f64 {
    let others = particles.iter().enumerate().filter(|&(i, _)| Some(i) != this);
    extinction
        * others.map(|(_, p)| f64::from(p.density) * f64::from(p.fade) * chord_ahead(p, start, to_sun)).sum::<f64>()
}

/// Sunlight at a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunShares {
    /// Share that feeds what the particle scatters many times, at the pole facing the sun, the centre, the far pole.
    pub diffuse: [f64; 3],
    /// How much it sees of what its neighbours scatter.
    pub crowd: f64,
    /// Share that comes straight from the sun, at the same points.
    pub direct: [f64; 3],
}

/// What of the sunlight reaches the points of a particle that have `tau` of others in front: the pole facing the sun, the
/// centre, the far pole. `own`: the particle's own optical depth from pole to pole; `voxel`: edge
/// of the voxels in which light diffuses, in half chords of the particle along the light.
#[must_use]
pub fn sun_shares(tau: [f64; 3], own: f64, xi: f64, voxel: f64, transfer: Transfer) -> SunShares {
    let fading = tau.map(|tau| (-xi * tau).exp());
    match transfer {
        Transfer::Exponential => SunShares { diffuse: fading, crowd: 0.0, direct: fading },
        Transfer::Diffusion => {
            let alone = own / ((tau[2] - tau[0]).max(0.0) + own).max(1e-6);
            let large = (1.0 / (voxel * voxel)).min(1.0);
            let kept = voxel.min(1.0) + alone.powi(4) * (1.0 - voxel.min(1.0));
            SunShares {
                diffuse: fading.map(|share| kept * share),
                crowd: 1.0 - large * alone.powi(6),
                direct: tau.map(|tau| (-tau).exp()),
            }
        }
    }
}

fn sky_openness(above: f64) -> f64 {
    (-above.max(0.0) / 450.0).exp()
}

/// Distance from the centre to the pole that faces the sun [m].
#[must_use]
pub fn reach(particle: &Particle, to_sun: DVec3) -> f64 {
    let local = DQuat::from_array(particle.rotation.map(f64::from)).inverse() * to_sun;
    1.0 / (local / vec(particle.semi_axes)).length()
}

/// Smoothed share of sunlight and open share of the sky of particle `index` of the grid.
#[must_use]
pub fn smooth(grid: &Grid, p: &GridParams, share_of_sun: &[f64], smoothing: f64, index: usize) -> (f64, f64) {
    let packed = grid.cell_and_layer[index];
    let (cell, within) = ((packed >> 5) as usize, packed & 31);
    let dim = p.ring_dim as i64;
    let (shape, particle) = (grid.shapes[cell], &grid.particles[index]);
    let puff = within >= shape.layers;
    let layer = if puff { puff_host(particle.id, &shape, (cell as i64 / (dim * dim)) as u32, p) } else { within };
    let away = vec(particle.centre) - vec(p.camera);
    let base = f64::from(p.altitude) - (away.x * away.x + away.z * away.z) * f64::from(p.inverse_diameter);
    let height = f64::from(particle.centre[1]) - base;
    let local = [cell as i64 % dim, cell as i64 / dim % dim];
    let neighbour = |dx: i64, dz: i64| {
        let inside = (0..dim).contains(&(local[0] + dx)) && (0..dim).contains(&(local[1] + dz));
        inside.then(|| (cell as i64 + dz * dim + dx) as usize)
    };
    let mut slots = vec![(index, 1.0)];
    if puff {
        slots.push(((grid.first[cell] + layer) as usize, smoothing));
    } else if layer > 0 {
        slots.push((index - 1, smoothing));
    }
    if !puff && layer + 1 < shape.layers {
        slots.push((index + 1, smoothing));
    }
    for (dx, dz) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
        if let Some(other) = neighbour(dx, dz).filter(|&other| !puff && layer < grid.shapes[other].layers) {
            let share = if dx == 0 || dz == 0 { 1.0 } else { 0.5 };
            slots.push((grid.first[other] as usize + layer as usize, share * smoothing));
        }
    }
    let (mut weighted, mut weights) = (0.0, 0.0);
    for (slot, share) in slots {
        let weight = share * f64::from(grid.particles[slot].density) * f64::from(grid.particles[slot].fade);
        weighted += weight * share_of_sun[slot];
        weights += weight;
    }
    let mut open = 0.0;
    for dz in -1..=1 {
        for dx in -1..=1 {
            let top = neighbour(dx, dz).map_or(shape.height, |other| grid.shapes[other].height);
            open += sky_openness(f64::from(top) - height);
        }
    }
    (if weights > 0.0 { weighted / weights } else { share_of_sun[index] }, open / 9.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alone_a_particle_keeps_all_its_light_and_in_shade_less_and_less() {
        for transfer in [Transfer::Diffusion, Transfer::Exponential] {
            let xi = f64::from(transfer.xi());
            let alone = SunShares { diffuse: [1.0; 3], crowd: 0.0, direct: [1.0; 3] };
            assert_eq!(sun_shares([0.0; 3], 5.0, xi, 0.2, transfer), alone);
            let mut before = f64::INFINITY;
            for tau in [0.1, 1.0, 10.0, 100.0] {
                // The same in front of all three points: nobody overlaps.
                let SunShares { diffuse, crowd, direct } = sun_shares([tau; 3], 5.0, xi, 0.2, transfer);
                assert!(diffuse[0] == diffuse[1] && diffuse[1] == diffuse[2] && crowd == 0.0);
                assert!(diffuse[0] < before && diffuse[0] >= direct[0] && direct[0] > 0.0, "{transfer:?} {tau}");
                before = diffuse[0];
            }
        }
    }
}
