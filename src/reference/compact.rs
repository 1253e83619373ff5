//! Visibility and draw order (`glsl/compact/`).

use glam::{DQuat, DVec3};

use crate::shared::Particle;

/// Distance in `f64` by which the ellipsoid reaches into the frustum past its worst plane [m]; negative: outside.
///
/// The shader tests with 0.1 % + 0.05 m of slack: it sees everything for which this is positive.
#[must_use]
pub fn reach_into(particle: &Particle, planes: &[[f32; 4]; 5]) -> f64 {
    let rotation = DQuat::from_array(particle.rotation.map(f64::from));
    let axes = DVec3::from_array(particle.semi_axes.map(f64::from));
    let centre = DVec3::from_array(particle.centre.map(f64::from));
    let reach = planes.iter().map(|plane| {
        let n = DVec3::new(plane[0].into(), plane[1].into(), plane[2].into());
        let extent = (axes * (rotation.inverse() * n)).length();
        n.dot(centre) + f64::from(plane[3]) + extent
    });
    reach.fold(f64::INFINITY, f64::min)
}

/// The key that sorts far particles first, bit for bit.
#[must_use]
pub fn back_to_front_key(centre: [f32; 3], camera: [f32; 3]) -> u32 {
    let [x, y, z] = std::array::from_fn(|i| centre[i] - camera[i]);
    !((x * x + y * y) + z * z).to_bits()
}

/// Indices of the flagged particles, farthest first; equal distances in the list's order.
#[must_use]
pub fn draw_order(particles: &[Particle], visible: &[bool], camera: [f32; 3]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..particles.len() as u32).filter(|&i| visible[i as usize]).collect();
    order.sort_by_key(|&i| back_to_front_key(particles[i as usize].centre, camera));
    order
}
