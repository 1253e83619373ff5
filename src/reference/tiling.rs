//! Lists of occluders per light tile (`glsl/tiling/`).

use glam::{DQuat, DVec3};

use crate::shared::Particle;
use crate::tiling::TilingParams;

/// Depth towards the light, bit for bit [m].
#[must_use]
pub fn light_depth(centre: [f32; 3], t: &TilingParams) -> f32 {
    let [x, y, z] = std::array::from_fn(|i| centre[i] - t.centre[i]);
    (x * t.to_sun[0] + y * t.to_sun[1]) + z * t.to_sun[2]
}

/// The key that sorts what is nearest the light first.
#[must_use]
pub fn light_key(depth: f32) -> u32 {
    let bits = depth.to_bits();
    !(if bits >> 31 != 0 { !bits } else { bits | 0x8000_0000 })
}

/// Order of a list: front to back along the light, ties by particle.
#[must_use]
pub fn in_list_order(mut list: Vec<u32>, particles: &[Particle], t: &TilingParams) -> Vec<u32> {
    list.sort_unstable_by_key(|&i| (light_key(light_depth(particles[i as usize].centre, t)), i));
    list
}

fn vec(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// Whether the particle's exact footprint rectangle, shrunk by `margin` metres, touches the tile. A list must hold every
/// particle with `margin` 0; it may hold those whose rectangle misses by 1 % of its size and 1 m.
#[must_use]
pub fn covers_tile(particle: &Particle, level: u32, tile: [u32; 2], margin: f64, t: &TilingParams) -> bool {
    let rotation = DQuat::from_array(particle.rotation.map(f64::from));
    let relative = vec(particle.centre) - vec(t.centre);
    let rect = t.level_rect[level as usize].map(f64::from);
    [t.u_axis, t.v_axis].iter().enumerate().all(|(axis, &direction)| {
        let direction = vec(direction);
        let at = relative.dot(direction);
        let extent = (vec(particle.semi_axes) * (rotation.inverse() * direction)).length() - margin;
        let tile_least = rect[axis] + f64::from(tile[axis]) / rect[axis + 2];
        let tile_greatest = rect[axis] + f64::from(tile[axis] + 1) / rect[axis + 2];
        at - extent <= tile_greatest && at + extent >= tile_least
    })
}

/// Level of a receiver at `p`, as the shader picks it; none outside all.
#[must_use]
pub fn receiver_level(p: [f32; 3], t: &TilingParams) -> Option<u32> {
    let distance = (p[0] - t.centre[0]).abs().max((p[2] - t.centre[2]).abs());
    (0..t.level_count).find(|&level| distance <= t.level_range[level as usize][1])
}
