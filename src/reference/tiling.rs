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

/// First and last tile (u, v) of the level that the particle's bounding rectangle touches, grown by `margin` times its
/// size + `margin` × 100 m; clamped to the level's tiles. Empty if a last is below its first.
///
/// A list must hold what touches with `margin` 0; it may hold what touches with 0.02 (the shader adds 1 % and 0.5 m).
#[must_use]
pub fn tile_range(particle: &Particle, level: u32, margin: f64, t: &TilingParams) -> [[i64; 2]; 2] {
    let rotation = DQuat::from_array(particle.rotation.map(f64::from));
    let relative = vec(particle.centre) - vec(t.centre);
    let rect = t.level_rect[level as usize].map(f64::from);
    let mut range = [[0; 2]; 2];
    for (axis, &direction) in [t.u_axis, t.v_axis].iter().enumerate() {
        let at = relative.dot(vec(direction)) - rect[axis];
        let extent = (vec(particle.semi_axes) * (rotation.inverse() * vec(direction))).length();
        let reach = extent * (1.0 + margin) + margin * 100.0;
        let last = i64::from(t.tile_dim) - 1;
        range[0][axis] = (((at - reach) * rect[axis + 2]).floor() as i64).max(0);
        range[1][axis] = (((at + reach) * rect[axis + 2]).floor() as i64).min(last);
    }
    range
}

/// Level of a receiver at `p`, as the shader picks it; none outside all.
#[must_use]
pub fn receiver_level(p: [f32; 3], t: &TilingParams) -> Option<u32> {
    let distance = (p[0] - t.centre[0]).abs().max((p[2] - t.centre[2]).abs());
    (0..t.level_count).find(|&level| distance <= t.level_range[level as usize][1])
}
