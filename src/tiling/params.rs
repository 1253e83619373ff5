//! Geometry of the light-space tiles of one frame (`glsl/tiling/params.glsl`).

use bytemuck::{Pod, Zeroable};

use crate::shared::assert_layout;

/// Levels that the device's struct holds.
pub const LEVEL_CAPACITY: usize = crate::shared::constants::tiling_params_glsl::TILE_LEVELS as usize;
/// Ends a list; also "no tile".
pub const NO_NODE: u32 = crate::shared::constants::tiling_params_glsl::NO_NODE;
/// Tiles along the edge of a level (Yusov 5.3).
pub const TILE_DIM: u32 = 64;
/// Nodes that one receiver visits at most: far beyond any sensible list, so that a degenerate scene ends too.
pub const TRAVERSAL_LIMIT: u32 = 1 << 16;

/// What the tiling and lighting stages need of a frame (`glsl/tiling/params.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TilingParams {
    /// Unit vector towards the light.
    pub to_sun: [f32; 3],
    /// Cloud base at the centre [m, floating origin].
    pub base: f32,
    /// Horizontal unit vector perpendicular to the light.
    pub u_axis: [f32; 3],
    /// Thickness of the slab that holds every receiver [m].
    pub thickness: f32,
    /// `to_sun` × `u_axis`.
    pub v_axis: [f32; 3],
    /// 1 / (2 · planet radius) [1/m]; 0 is a flat world.
    pub inverse_diameter: f32,
    /// The camera: levels are squares around it [m, floating origin].
    pub centre: [f32; 3],
    /// Longest horizontal way of light through the slab [m].
    pub reach: f32,
    /// Least u, least v [m]; tiles per metre along u, v.
    pub level_rect: [[f32; 4]; LEVEL_CAPACITY],
    /// Least and greatest Chebyshev distance of a level's receivers from the centre [m].
    pub level_range: [[f32; 4]; LEVEL_CAPACITY],
    /// Levels in use.
    pub level_count: u32,
    /// Tiles along an edge.
    pub tile_dim: u32,
    /// Nodes that fit.
    pub node_capacity: u32,
    /// Nodes that one receiver visits at most.
    pub traversal_limit: u32,
    /// sigma_t · mean fill of a particle: extinction at relative density 1 [1/m].
    pub extinction: f32,
    /// No particle reaches farther from its centre [m].
    pub greatest_extent: f32,
    /// Levels that one particle's shadow reaches at most.
    pub levels_per_particle: u32,
    /// Not used.
    pub unused: u32,
}

assert_layout!(TilingParams, tiling_params, {
    to_sun: TO_SUN, base: BASE, u_axis: U_AXIS, thickness: THICKNESS, v_axis: V_AXIS,
    inverse_diameter: INVERSE_DIAMETER, centre: CENTRE, reach: REACH, level_rect: LEVEL_RECT,
    level_range: LEVEL_RANGE, level_count: LEVEL_COUNT, tile_dim: TILE_DIM, node_capacity: NODE_CAPACITY,
    traversal_limit: TRAVERSAL_LIMIT, extinction: EXTINCTION, greatest_extent: GREATEST_EXTENT,
    levels_per_particle: LEVELS_PER_PARTICLE,
});

/// One occluder in one tile's list (`glsl/tiling/params.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct TileNode {
    /// Next node, or [`NO_NODE`].
    pub next: u32,
    /// What the particle covers of the tile, in 128ths of its edges: least u, least v, 127 - greatest u, 127 - greatest v,
    /// 8 bits each.
    pub bounds: u32,
    /// The particle.
    pub particle: u32,
    /// Sorts what is nearest the light first.
    pub key: u32,
}
assert_layout!(TileNode, tile_node, { particle: PARTICLE, next: NEXT, key: KEY, bounds: BOUNDS });

/// How a particle dims light that passes it (`glsl/tiling/params.glsl`): lengths of ways through an ellipsoid along the
/// light, by where they pass its centre.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Occluder {
    /// Centre, relative to the floating origin [m].
    pub centre: [f32; 3],
    /// Half the way along the light through the centre [m].
    pub half_chord: f32,
    /// Maps a place in the plane perpendicular to the light, relative to the centre, such that the ellipsoid's outline
    /// becomes the unit circle [1/m]: (x u + y v, z v).
    pub outline: [f32; 3],
    /// Relative density · fade.
    pub density: f32,
    /// Metres by which the middle of a way moves away from the light per metre along u and v.
    pub shear: [f32; 2],
    /// Not used.
    pub unused: [u32; 2],
}
assert_layout!(Occluder, occluder, {
    centre: CENTRE, half_chord: HALF_CHORD, outline: OUTLINE, density: DENSITY, shear: SHEAR,
});

/// The layer of cloud that the tiles have to cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab<'a> {
    /// Centre of the levels, usually the camera [m, floating origin].
    pub centre: [f64; 3],
    /// Least height of anything at the centre [m].
    pub base: f64,
    /// Greatest height above `base` [m].
    pub thickness: f64,
    /// Half the edge of each level's square of receivers [m], ascending.
    pub half_widths: &'a [f64],
    /// No particle reaches farther from its centre [m].
    pub greatest_extent: f32,
    /// Of the planet that the slab follows [m]; infinite for a flat world.
    pub planet_radius: f64,
}

impl TilingParams {
    /// Tiles for light from `to_sun` (unit). `extinction` = sigma_t · mean fill [1/m].
    #[must_use]
    pub fn new(to_sun: [f64; 3], slab: &Slab<'_>, extinction: f32) -> Self {
        assert!(slab.half_widths.len() <= LEVEL_CAPACITY, "too many levels");
        let horizontal = to_sun[0].hypot(to_sun[2]);
        // Horizontal, so that a low sun squeezes one axis only.
        let u_axis =
            if horizontal > 1e-6 { [-to_sun[2] / horizontal, 0.0, to_sun[0] / horizontal] } else { [1.0, 0.0, 0.0] };
        let v_axis = cross(to_sun, u_axis);
        let mut params = Self::zeroed();
        let f32s = |v: [f64; 3]| v.map(|c| c as f32);
        (params.to_sun, params.u_axis, params.v_axis) = (f32s(to_sun), f32s(u_axis), f32s(v_axis));
        params.centre = f32s(slab.centre);
        params.inverse_diameter = (0.5 / slab.planet_radius) as f32;
        params.base = slab.base as f32;
        params.thickness = slab.thickness as f32;
        let widest = slab.half_widths.iter().fold(0.0f64, |a, &b| a.max(b));
        // Occluders and receivers lie in the slab, thickened by a particle at each side. Light below the horizon or
        // along it passes at most the whole width.
        let through = slab.thickness + 2.0 * f64::from(slab.greatest_extent);
        let reach = if to_sun[1] > 1e-3 { through * horizontal / to_sun[1] } else { f64::INFINITY };
        params.reach = reach.min(2.0 * widest) as f32;
        let mut inner = 0.0;
        for (level, &half) in slab.half_widths.iter().enumerate() {
            let drop = half * half / slab.planet_radius; // at a corner: (√2 half)² / 2R
            let (low, high) = (slab.base - drop, slab.base + slab.thickness);
            let mut least = [f64::INFINITY; 2];
            let mut greatest = [f64::NEG_INFINITY; 2];
            for corner in 0..8u32 {
                let sign = |bit: u32| if corner >> bit & 1 == 1 { half } else { -half };
                let y = (if corner >> 2 & 1 == 1 { high } else { low }) - slab.centre[1];
                let at = [sign(0), y, sign(1)];
                for (axis, direction) in [u_axis, v_axis].iter().enumerate() {
                    let along: f64 = (0..3).map(|i| at[i] * direction[i]).sum();
                    least[axis] = least[axis].min(along);
                    greatest[axis] = greatest[axis].max(along);
                }
            }
            // A metre of margin, for receivers on the border. A low sun squeezes the level in v: tiles stay at least a
            // quarter as high as wide, or every particle would cover many; some are then left over.
            let mut per_metre = [0, 1].map(|i| f64::from(TILE_DIM) / (greatest[i] - least[i] + 2.0));
            per_metre[1] = per_metre[1].min(4.0 * per_metre[0]);
            params.level_rect[level] =
                [least[0] - 1.0, least[1] - 1.0, per_metre[0], per_metre[1]].map(|value| value as f32);
            params.level_range[level] = [inner as f32, half as f32, 0.0, 0.0];
            inner = half;
        }
        // A particle's shadow spans a range of Chebyshev distances no longer than this. It crosses most borders between
        // levels where they are densest: from just inside the first one outwards.
        let span = f64::from(params.reach) + 2.0 * f64::from(slab.greatest_extent) + 4.0;
        let borders = slab.half_widths.iter().rev().skip(1).filter(|&&border| border < slab.half_widths[0] + span);
        params.levels_per_particle = 1 + borders.count() as u32;
        params.level_count = slab.half_widths.len() as u32;
        params.tile_dim = TILE_DIM;
        params.traversal_limit = TRAVERSAL_LIMIT;
        params.extinction = extinction;
        params.greatest_extent = slab.greatest_extent;
        params
    }

    /// Tiles of all levels.
    #[must_use]
    pub fn tile_count(&self) -> u32 {
        self.level_count * self.tile_dim * self.tile_dim
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
