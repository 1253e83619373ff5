//! Which particles touch which brick: by the host, in two steps, so that only one region's lists exist at a time.

use super::gather::{Gathered, half_extent};
use super::{BRICK, VoxelBrick, VoxelGrid};
use crate::shared::Particle;
use glam::{DQuat, DVec3};

/// The order that bricks come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Layer by layer of bricks along z, so that a dense array with z slowest can be written as they come.
    Layers,
    /// As the leaves of an OpenVDB tree: by nodes of 16³ bricks, x slowest, then by brick, x slowest.
    Tree,
}

/// Bricks along the edge of an OpenVDB node above the leaves.
const NODE: u32 = 16;

/// Bricks that are binned together, and the particles whose boxes touch their box.
pub(super) struct Region {
    first: [u32; 3],
    count: [u32; 3],
    particles: Vec<u32>,
}

/// Bricks of a region that particles touch, in order, each with its run of `entries`.
pub(super) struct Binned {
    pub bricks: Vec<VoxelBrick>,
    pub entries: Vec<u32>,
}

/// The ellipsoid of a particle in the grid's own coordinates: bricks, from the grid's corner.
struct Body {
    centre: DVec3,
    /// Half of its bounding box.
    half: DVec3,
    to_local: DQuat,
    semi_axes: DVec3,
}

impl Body {
    fn new(particle: &Particle, gathered: &Gathered, grid: &VoxelGrid) -> Self {
        let edge = grid.voxel * f64::from(BRICK);
        let offset = DVec3::from_array(std::array::from_fn(|axis| gathered.origin[axis] - grid.corner[axis]));
        let centre = DVec3::from_array(particle.centre.map(f64::from)) + offset;
        let rotation = DQuat::from_array(particle.rotation.map(f64::from)).normalize();
        let semi_axes = DVec3::from_array(particle.semi_axes.map(f64::from));
        // The device works in f32: a ten-thousandth of slack covers its rounding.
        Self {
            centre: centre / edge,
            half: half_extent(rotation, semi_axes) / edge * 1.0001,
            to_local: rotation.conjugate(),
            semi_axes: semi_axes / edge,
        }
    }

    /// First brick and the one behind the last that the bounding box touches, within `[0, limit]`.
    fn range(&self, limit: [u32; 3]) -> [[u32; 2]; 3] {
        std::array::from_fn(|axis| {
            let clamped = |v: f64| v.clamp(0.0, f64::from(limit[axis])) as u32;
            [clamped((self.centre - self.half)[axis].floor()), clamped((self.centre + self.half)[axis].ceil())]
        })
    }

    /// Whether the brick may meet the ellipsoid; exact up to the difference between the brick and its bounding sphere.
    fn touches(&self, brick: [u32; 3]) -> bool {
        let centre = DVec3::from_array(brick.map(|c| f64::from(c) + 0.5));
        let in_ball = (self.to_local * (centre - self.centre)) / self.semi_axes;
        in_ball.length() <= 1.0001 + 0.75f64.sqrt() / self.semi_axes.min_element()
    }
}

/// The regions of `grid` that particles touch, in `order`.
pub(super) fn regions(gathered: &Gathered, grid: &VoxelGrid, order: Order) -> Vec<Region> {
    let bricks = grid.bricks();
    let shape = match order {
        Order::Layers => [bricks[0], bricks[1], 1],
        Order::Tree => [NODE; 3],
    };
    let count: [u32; 3] = std::array::from_fn(|axis| bricks[axis].div_ceil(shape[axis]));
    let mut particles = vec![Vec::new(); count.iter().map(|&c| c as usize).product()];
    for (index, particle) in gathered.particles.iter().enumerate() {
        if particle.density * particle.fade <= 0.0 {
            continue;
        }
        let range = Body::new(particle, gathered, grid).range(bricks);
        if range.iter().any(|[from, to]| from >= to) {
            continue;
        }
        let [x, y, z] = std::array::from_fn(|axis| {
            let [from, to] = range[axis];
            from / shape[axis]..(to - 1) / shape[axis] + 1
        });
        for (x, y, z) in product(x, y, z) {
            particles[((x * count[1] + y) * count[2] + z) as usize].push(index as u32);
        }
    }
    product(0..count[0], 0..count[1], 0..count[2])
        .zip(particles)
        .filter(|(_, particles)| !particles.is_empty())
        .map(|((x, y, z), particles)| {
            let first = [x * shape[0], y * shape[1], z * shape[2]];
            let count = std::array::from_fn(|axis| shape[axis].min(bricks[axis] - first[axis]));
            Region { first, count, particles }
        })
        .collect()
}

/// All triples, x slowest.
fn product(
    x: std::ops::Range<u32>,
    y: std::ops::Range<u32>,
    z: std::ops::Range<u32>,
) -> impl Iterator<Item = (u32, u32, u32)> {
    x.flat_map(move |x| {
        let z = z.clone();
        y.clone().flat_map(move |y| z.clone().map(move |z| (x, y, z)))
    })
}

impl Region {
    /// Work in it, roughly.
    pub fn weight(&self) -> f64 {
        self.particles.len() as f64
    }

    /// Finds the particles of every brick.
    pub fn bin(&self, gathered: &Gathered, grid: &VoxelGrid) -> Binned {
        let slot = |[x, y, z]: [u32; 3]| {
            let [x, y, z] = [x - self.first[0], y - self.first[1], z - self.first[2]];
            ((x * self.count[1] + y) * self.count[2] + z) as usize
        };
        let mut pairs: Vec<(u32, u32)> = Vec::new(); // slot, particle
        let limit = std::array::from_fn(|axis| self.first[axis] + self.count[axis]);
        for &index in &self.particles {
            let body = Body::new(&gathered.particles[index as usize], gathered, grid);
            let range = body.range(limit);
            let [x, y, z] = std::array::from_fn(|axis| range[axis][0].max(self.first[axis])..range[axis][1]);
            let touched = product(x, y, z).map(|(x, y, z)| [x, y, z]).filter(|&brick| body.touches(brick));
            pairs.extend(touched.map(|brick| (slot(brick) as u32, index)));
        }
        pairs.sort_unstable();
        let mut bricks: Vec<VoxelBrick> = Vec::new();
        let mut last = None;
        for (first, &(slot, _)) in pairs.iter().enumerate() {
            if last != Some(slot) {
                let (z, rest) = (slot % self.count[2], slot / self.count[2]);
                let [x, y, z] =
                    [rest / self.count[1] + self.first[0], rest % self.count[1] + self.first[1], z + self.first[2]];
                bricks.push(VoxelBrick { x: x * BRICK, y: y * BRICK, z: z * BRICK, first: first as u32, count: 0 });
                last = Some(slot);
            }
            if let Some(brick) = bricks.last_mut() {
                brick.count += 1;
            }
        }
        Binned { bricks, entries: pairs.into_iter().map(|(_, particle)| particle).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn gathered() -> Gathered {
        let particle = |centre, semi_axes, rotation| Particle {
            centre,
            semi_axes,
            rotation,
            density: 1.0,
            fade: 1.0,
            ..Particle::zeroed()
        };
        let particles = vec![
            particle([30.0, 40.0, 50.0], [25.0, 5.0, 60.0], [0.5, -0.5, 0.5, 0.5]),
            particle([150.0, 20.0, 150.0], [30.0, 20.0, 10.0], [0.0, 0.6, 0.0, 0.8]),
            particle([-500.0, 0.0, 0.0], [10.0; 3], [0.0, 0.0, 0.0, 1.0]),
            Particle { density: 0.0, ..particle([20.0; 3], [10.0; 3], [0.0, 0.0, 0.0, 1.0]) },
        ];
        Gathered { particles, origin: [1024.0, 0.0, 0.0], endless: false }
    }

    #[test]
    fn every_point_of_a_particle_lies_in_a_brick_that_lists_it_and_both_orders_list_the_same() {
        let gathered = gathered();
        let grid = VoxelGrid { corner: [1024.0 - 50.0, -50.0, -50.0], voxel: 1.0, size: [300, 200, 350] };
        let mut of_orders = [Order::Layers, Order::Tree].map(|order| {
            let mut lists = Vec::new();
            for region in regions(&gathered, &grid, order) {
                let binned = region.bin(&gathered, &grid);
                for brick in binned.bricks {
                    let list = &binned.entries[brick.first as usize..][..brick.count as usize];
                    assert!(list.windows(2).all(|pair| pair[0] < pair[1]), "ascending");
                    lists.push(([brick.x, brick.y, brick.z].map(|c| c / BRICK), list.to_vec()));
                }
            }
            lists
        });
        let layer = |lists: &[([u32; 3], Vec<u32>)]| lists.windows(2).all(|pair| pair[0].0[2] <= pair[1].0[2]);
        assert!(layer(&of_orders[0]));
        let tree = |at: [u32; 3]| (at.map(|c| c / NODE), at);
        assert!(of_orders[1].windows(2).all(|pair| tree(pair[0].0) < tree(pair[1].0)));
        of_orders.iter_mut().for_each(|lists| lists.sort());
        assert_eq!(of_orders[0], of_orders[1]);
        let lists: std::collections::HashMap<_, _> = of_orders[0].iter().cloned().collect();
        assert_eq!(lists.values().flatten().max(), Some(&1), "neither the far one nor the empty one");

        for (index, particle) in gathered.particles.iter().enumerate().take(2) {
            let rotation = DQuat::from_array(particle.rotation.map(f64::from));
            let semi_axes = DVec3::from_array(particle.semi_axes.map(f64::from));
            for k in 0..5000 {
                // A spiral over the surface.
                let y = 1.0 - f64::from(2 * k + 1) / 5000.0;
                let (sin, cos) = (f64::from(k) * 2.399_963).sin_cos();
                let n = DVec3::new((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin);
                let at = DVec3::from_array(particle.centre.map(f64::from)) + rotation * (n * semi_axes) + 50.0;
                let brick = [at.x, at.y, at.z].map(|c| (c / 8.0).floor() as u32);
                assert!(lists[&brick].contains(&(index as u32)), "{brick:?} lacks {index}");
            }
        }
    }
}
