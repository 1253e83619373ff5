//! Cells and particles of the nested rings (`glsl/grid/`).
//!
//! Everything that decides whether, where in the list and how many particles there are is `f32` in the shader's order of
//! operations, hence bit-equal. A particle's own floats agree to rounding: shaders may divide and normalise with a few
//! units in the last place.

use crate::grid::params::{GridParams, LAYER_CAPACITY};
use crate::reference::density::{
    coverage_field, hash_lattice, pcg, signed_float, turned_lattice_point, turret_field, unit_float,
};
use crate::shared::Particle;

/// A cell's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPlace {
    /// Ring.
    pub ring: u32,
    /// Index within the ring.
    pub local: [i32; 2],
    /// Lattice index in the world, for this ring's cell size.
    pub absolute: [i32; 2],
    /// Centre x, z [m, floating origin].
    pub centre: [f32; 2],
}

/// The column of cloud on a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellShape {
    /// Layers of balls; 0: no cloud.
    pub layers: u32,
    /// Small billows on top of them.
    pub puffs: u32,
    /// Height [m].
    pub height: f32,
    /// 0 at a cloud's outline, 1 well inside.
    pub body: f32,
    /// Cross-fade between levels of detail, 0 to 1.
    pub weight: f32,
}

/// Where cell `cell_id` lies.
#[must_use]
pub fn cell_place(cell_id: u32, p: &GridParams) -> CellPlace {
    let per_ring = p.ring_dim * p.ring_dim;
    let (ring, within) = (cell_id / per_ring, cell_id % per_ring);
    let local = [(within % p.ring_dim) as i32, (within / p.ring_dim) as i32];
    let [x, z, edge, _] = p.ring_frame[ring as usize];
    let first = p.ring_first[ring as usize];
    CellPlace {
        ring,
        local,
        absolute: [first[0] + local[0], first[1] + local[1]],
        centre: [x + (local[0] as f32 + 0.5) * edge, z + (local[1] as f32 + 0.5) * edge],
    }
}

fn smooth_unit(t: f32) -> f32 {
    let c = t.clamp(0.0, 1.0);
    (c * c) * (3.0 - c * 2.0)
}

fn ring_reach(centre: [f32; 2], ring: u32, p: &GridParams) -> f32 {
    let (x, z) = (centre[0] - p.camera[0], centre[1] - p.camera[2]);
    if ring + 1 == p.ring_count {
        let relative = (x * x + z * z) * p.inverse_cutoff_squared;
        return 1.0 - smooth_unit((relative - 0.8) * 6.25);
    }
    let cells = x.abs().max(z.abs()) * p.ring_frame[ring as usize][3];
    let start = (p.ring_dim / 2) as f32 - 5.0;
    1.0 - smooth_unit((cells - start) * 0.25)
}

/// Share of the cloud that ring `ring` shows at `centre`; the shares of all rings add up to 1 within the cut-off, not
/// counting the cores that ring 1 keeps inside the bodies of ring 0.
#[must_use]
pub fn ring_weight(centre: [f32; 2], ring: u32, p: &GridParams) -> f32 {
    let reach = ring_reach(centre, ring, p);
    if ring > 0 { reach * (1.0 - ring_reach(centre, ring - 1, p)) } else { reach }
}

/// Field value above which a share `coverage` of the world lies.
#[must_use]
pub fn coverage_threshold(coverage: f32, p: &GridParams) -> f32 {
    let knots = coverage.clamp(0.0, 1.0) * 64.0;
    let knot = (knots as usize).min(63);
    let t = knots - knot as f32;
    let at = |i: usize| p.threshold[i >> 2][i & 3];
    at(knot) + t * (at(knot + 1) - at(knot))
}

/// Coverage wanted at a cell: uniform, or from the image, bilinear and repeated.
#[must_use]
pub fn coverage_at(place: &CellPlace, map: &[f32], p: &GridParams) -> f32 {
    if p.map_width == 0 {
        return p.coverage;
    }
    let position = cell_position(place, p);
    let relative = [position[0].wrapping_sub(p.map_centre_x), position[1].wrapping_sub(p.map_centre_z)];
    let half_texels = [p.map_width as i32 - 1, p.map_height as i32 - 1];
    let at = turned_lattice_point(relative, p.frequency_map_along, p.frequency_map_across, half_texels);
    let texel = |dx: i32, dz: i32| {
        let x = at.cell[0].wrapping_add(dx).rem_euclid(p.map_width as i32) as usize;
        let z = at.cell[1].wrapping_add(dz).rem_euclid(p.map_height as i32) as usize;
        map[z * p.map_width as usize + x]
    };
    let (a, b, c, d) = (texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1));
    let [u, v] = at.fraction;
    let ab = a + u * (b - a);
    let cd = c + u * (d - c);
    ab + v * (cd - ab)
}

fn cell_position(place: &CellPlace, p: &GridParams) -> [i32; 2] {
    let steps = p.ring_first[place.ring as usize][3];
    place.absolute.map(|axis| axis.wrapping_mul(steps).wrapping_add(steps >> 1))
}

/// The column on a cell.
#[must_use]
pub fn cell_shape(place: &CellPlace, coverage: f32, p: &GridParams) -> CellShape {
    let weight = ring_weight(place.centre, place.ring, p);
    let empty = CellShape { weight, ..CellShape::default() };
    if (weight <= 0.0 && place.ring != 1) || coverage <= 0.0 {
        return empty;
    }
    let position = cell_position(place, p);
    let f = p.frequencies();
    let excess =
        coverage_field(position, f, p.seed, p.ring_layer[place.ring as usize][2]) - coverage_threshold(coverage, p);
    if excess <= 0.0 {
        return empty;
    }
    let inside = (excess * 1.0).min(1.0);
    let left = 1.0 - inside;
    let shoulder = 1.0 - left * left;
    let resolved = (turret_field(position, f, p.seed) - 0.4) * p.ring_layer[place.ring as usize][2];
    let tower = (resolved + 0.4) * 0.62 + 0.38;
    let fraction = (shoulder * tower) * 0.92 + 0.08;
    let mut height = fraction * p.thickness;
    let steps_up = height * p.ring_layer[place.ring as usize][1];
    let layers = (steps_up.ceil() as i32).clamp(1, p.ring_first[place.ring as usize][2]) as u32;
    let mut body = (excess * 5.0).min(1.0);
    let near = p.ring_frame[place.ring as usize][2] < 400.0;
    let chance = hash_lattice(place.absolute, p.seed.wrapping_add(15)) & 1;
    let puffs = match (near, body < 1.0) {
        (false, _) => 0,
        (true, true) => 2,
        (true, false) => chance,
    };
    let mut weight = weight;
    if place.ring == 1 {
        let core = ring_reach(place.centre, 1, p) * smooth_unit((excess - 0.22) * 4.0);
        let over = ((core - weight) * 4.0).clamp(0.0, 1.0);
        height *= 1.0 - over * 0.12;
        body *= 1.0 - over * 0.4;
        weight = weight.max(core);
        if weight <= 0.0 {
            return CellShape { height, body, weight, ..CellShape::default() };
        }
    }
    let mut layers = layers;
    if p.evolving != 0 {
        weight *= smooth_unit(excess * 20.0);
        let steps_now = height * p.ring_layer[place.ring as usize][1];
        layers = (steps_now.ceil() as i32).clamp(1, p.ring_first[place.ring as usize][2]) as u32;
        if weight <= 0.0 {
            return CellShape { height, body, weight, ..CellShape::default() };
        }
    }
    CellShape { layers, puffs, height, body, weight }
}

fn column_steps(place: &CellPlace, shape: &CellShape, p: &GridParams) -> f32 {
    shape.height * p.ring_layer[place.ring as usize][1]
}

fn column_lean(up: f32, p: &GridParams) -> [f32; 2] {
    if p.lean_count < 2 {
        return [0.0; 2];
    }
    let knots = up.clamp(0.0, 1.0) * (p.lean_count - 1) as f32;
    let knot = (knots as u32).min(p.lean_count - 2);
    let at = |i: u32, axis: usize| p.lean[i as usize / 2][i as usize % 2 * 2 + axis];
    [0, 1].map(|axis| {
        let t = knots - knot as f32;
        at(knot, axis) * (1.0 - t) + at(knot + 1, axis) * t
    })
}

fn layer_fade(place: &CellPlace, shape: &CellShape, layer: u32, p: &GridParams) -> f32 {
    if p.evolving == 0 || layer == 0 || layer + 1 < shape.layers {
        return 1.0;
    }
    (column_steps(place, shape, p) - layer as f32).clamp(0.0, 1.0)
}

fn puff_fade(place: &CellPlace, shape: &CellShape, index: u32, id: u32, p: &GridParams) -> f32 {
    if p.evolving == 0 {
        return 1.0;
    }
    let host = id % p.ring_first[place.ring as usize][2] as u32;
    if host >= shape.layers {
        return 0.0;
    }
    let stays = index == shape.layers && hash_lattice(place.absolute, p.seed.wrapping_add(15)) & 1 == 1;
    layer_fade(place, shape, host, p) * if stays { 1.0 } else { 1.0 - shape.body }
}

fn quaternion_multiply(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [
        a[3] * b[0] + b[3] * a[0] + (a[1] * b[2] - a[2] * b[1]),
        a[3] * b[1] + b[3] * a[1] + (a[2] * b[0] - a[0] * b[2]),
        a[3] * b[2] + b[3] * a[2] + (a[0] * b[1] - a[1] * b[0]),
        a[3] * b[3] - (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]),
    ]
}

/// A column's ball before it is turned.
struct Ball {
    centre: [f32; 3],
    across: f32,
    tall: f32,
    id: u32,
    hash: u32,
}

fn hashes<const N: usize>(id: u32) -> [u32; N] {
    let mut h = [pcg(id); N];
    for i in 1..N {
        h[i] = pcg(h[i - 1]);
    }
    h
}

fn ball_id(place: &CellPlace, shape: &CellShape, index: u32, p: &GridParams) -> u32 {
    let index = if p.evolving != 0 && index >= shape.layers { index + LAYER_CAPACITY - shape.layers } else { index };
    let cell = hash_lattice(place.absolute, p.seed.wrapping_add(16).wrapping_add(place.ring));
    pcg(cell.wrapping_add(index.wrapping_mul(0x9e37_79b9)))
}

fn column_ball(place: &CellPlace, shape: &CellShape, layer: u32, p: &GridParams) -> Ball {
    let id = ball_id(place, shape, layer, p);
    let h: [u32; 6] = hashes(id);
    let edge = p.ring_frame[place.ring as usize][2];
    let mut step = shape.height / shape.layers as f32;
    let mut up = (layer as f32 + 0.5) / shape.layers as f32;
    if p.evolving != 0 {
        if shape.layers > 1 {
            step = p.ring_layer[place.ring as usize][0];
        }
        up = ((layer as f32 + 0.5) / column_steps(place, shape, p).max(1.0)).min(1.0);
    }

    let rare = (h[0] & 255) as f32 / 256.0;
    let large = if place.ring == 0 { 1.1 * rare * rare * rare } else { 0.6 * rare * rare };
    let size = 0.62 + 0.4 * unit_float(h[0]) + large;
    let across = edge * 1.2 * (1.0 - 0.42 * up * up) * (0.62 + 0.38 * shape.body) * size;
    let tall = (0.62 * step).max(0.8 * across) * (0.9 + 0.25 * unit_float(h[1]));
    let tall = if layer == 0 { tall.min(0.8 * step) } else { tall };

    let jitter = if layer == 0 { 0.03 } else { 0.15 };
    let up_metres = if layer == 0 { (0.5 * step).max(0.8 * tall) } else { (layer as f32 + 0.5) * step };
    let rise = up_metres + signed_float(h[4]) * jitter * 2.0 * tall;
    let lean = column_lean(rise / p.thickness, p);
    let x = place.centre[0] + signed_float(h[2]) * (0.4 * edge) + lean[0];
    let z = place.centre[1] + signed_float(h[3]) * (0.4 * edge) + lean[1];
    let (dx, dz) = (x - p.camera[0], z - p.camera[2]);
    let base = p.altitude - (dx * dx + dz * dz) * p.inverse_diameter;
    let y = base + rise;
    Ball { centre: [x, y, z], across, tall, id, hash: h[5] }
}

/// Layer that carries a puff with hash `id`.
#[must_use]
pub fn puff_host(id: u32, shape: &CellShape, ring: u32, p: &GridParams) -> u32 {
    if p.evolving != 0 {
        return (id % p.ring_first[ring as usize][2] as u32).min(shape.layers - 1);
    }
    if shape.body < 1.0 { id % shape.layers } else { shape.layers - 1 }
}

fn puff_ball(place: &CellPlace, shape: &CellShape, index: u32, p: &GridParams) -> Ball {
    let id = ball_id(place, shape, index, p);
    let h: [u32; 5] = hashes(id);
    let host = column_ball(place, shape, puff_host(id, shape, place.ring, p), p);
    let side = [signed_float(h[0]), 0.15 + unit_float(h[1]), signed_float(h[2])];
    let length = side.iter().map(|c| c * c).sum::<f32>().sqrt();
    let across = host.across * (0.42 + 0.26 * unit_float(h[3]));
    let sizes = [host.across, host.tall, host.across];
    let centre = std::array::from_fn(|i| host.centre[i] + side[i] / length * sizes[i] * 0.82);
    Ball { centre, across, tall: across * 0.9, id, hash: h[4] }
}

/// Particle `index` of a column: its layers from the base up, then its puffs.
#[must_use]
pub fn column_particle(place: &CellPlace, shape: &CellShape, index: u32, p: &GridParams) -> Particle {
    let (ball, fade) = if index >= shape.layers {
        let ball = puff_ball(place, shape, index, p);
        let fade = puff_fade(place, shape, index, ball.id, p);
        (ball, fade)
    } else {
        (column_ball(place, shape, index, p), layer_fade(place, shape, index, p))
    };
    let (h1, h2) = (pcg(ball.hash), pcg(pcg(ball.hash)));
    let axes = [ball.across * (0.88 + 0.24 * unit_float(h1)), ball.tall, ball.across];

    let t = signed_float(h2);
    let yaw = [0.0, 2.0 * t, 0.0, 1.0 - t * t].map(|c| c / (1.0 + t * t));
    let (tx, tz) = (0.16 * signed_float(pcg(h2)), 0.16 * signed_float(pcg(h2.wrapping_add(1))));
    let length = (tx * tx + tz * tz + 1.0).sqrt();
    let upright = quaternion_multiply([tx / length, 0.0, tz / length, 1.0 / length], yaw);
    const HALF_ROOT: f32 = std::f32::consts::FRAC_1_SQRT_2;
    let (rotation, semi_axes) = match ball.hash % 3 {
        0 => (upright, axes),
        1 => (quaternion_multiply(upright, [HALF_ROOT, 0.0, 0.0, HALF_ROOT]), [axes[0], axes[2], axes[1]]),
        _ => (quaternion_multiply(upright, [0.0, 0.0, HALF_ROOT, HALF_ROOT]), [axes[1], axes[0], axes[2]]),
    };
    Particle {
        centre: ball.centre,
        density: p.density * (0.1 + 0.9 * shape.body * (0.4 + 0.6 * shape.body)),
        rotation,
        semi_axes,
        fade: shape.weight * fade,
        colour: [1.0; 3],
        id: ball.id,
    }
}

/// What the grid stages produce.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    /// Shape of every cell.
    pub shapes: Vec<CellShape>,
    /// First particle of every cell.
    pub first: Vec<u32>,
    /// The particles, cell by cell: layers from the base up, then puffs.
    pub particles: Vec<Particle>,
    /// `cell << 5 | index within the column` of every particle.
    pub cell_and_layer: Vec<u32>,
}

/// Generates all particles.
#[must_use]
pub fn generate(p: &GridParams, map: &[f32]) -> Grid {
    let mut grid = Grid::default();
    for cell in 0..p.cell_count() {
        let place = cell_place(cell, p);
        let shape = cell_shape(&place, coverage_at(&place, map, p), p);
        grid.first.push(grid.particles.len() as u32);
        grid.shapes.push(shape);
        for index in 0..shape.layers + shape.puffs {
            grid.particles.push(column_particle(&place, &shape, index, p));
            grid.cell_and_layer.push(cell << 5 | index);
        }
    }
    grid
}
