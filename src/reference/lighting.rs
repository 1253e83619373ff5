//! Sunlight and skylight at particles (`glsl/lighting/`), in `f64` and by brute force: no tiles, every pair.

use glam::{DQuat, DVec3};

use crate::grid::GridParams;
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

/// Optical depth that counts for occlusion from `start` towards the light; each occluder has its own density.
#[must_use]
pub fn sun_optical_depth(
    particles: &[Particle],
    start: DVec3,
    to_sun: DVec3,
    occlusion: f64,
    this: Option<usize>,
) -> f64 {
    let others = particles.iter().enumerate().filter(|&(i, _)| Some(i) != this);
    occlusion
        * others.map(|(_, p)| f64::from(p.density) * f64::from(p.fade) * chord_ahead(p, start, to_sun)).sum::<f64>()
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

/// Smoothed transmittance and sky visibility of particle `index` of the grid.
#[must_use]
pub fn smooth(grid: &Grid, p: &GridParams, transmittance: &[f64], smoothing: f64, index: usize) -> (f64, f64) {
    let packed = grid.cell_and_layer[index];
    let (cell, within) = ((packed >> 5) as usize, packed & 31);
    let dim = p.ring_dim as i64;
    let (shape, particle) = (grid.shapes[cell], &grid.particles[index]);
    let puff = within >= shape.layers;
    let layer = if puff { puff_host(particle.id, &shape) } else { within };
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
        weighted += weight * transmittance[slot];
        weights += weight;
    }
    let mut open = 0.0;
    for dz in -1..=1 {
        for dx in -1..=1 {
            let top = neighbour(dx, dz).map_or(shape.height, |other| grid.shapes[other].height);
            open += sky_openness(f64::from(top) - height);
        }
    }
    (if weights > 0.0 { weighted / weights } else { transmittance[index] }, 0.22 + 0.78 * open / 9.0)
}
