//! Light that diffuses through voxels (`glsl/volume/`), in `f64` and to convergence.

use crate::lighting::volume::VolumeParams;

/// Extinction and extinction × sunlight of a voxel [1/m], from what the device has summed.
#[must_use]
pub fn extinction(matter: [u32; 2]) -> [f64; 2] {
    matter.map(|units| f64::from(units) / f64::from(1u32 << 20))
}

/// The voxels of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Volume<'a>(pub &'a VolumeParams);

impl Volume<'_> {
    fn stack(&self, level: usize) -> [i32; 4] {
        self.0.stack[level]
    }

    /// Position in memory.
    #[must_use]
    pub fn index(&self, level: usize, [x, y, z]: [i32; 3]) -> usize {
        let dim = self.0.dim as i32;
        (((self.stack(level)[2] + y) * dim + z) * dim + x) as usize
    }

    /// Width and height of a voxel [m].
    #[must_use]
    pub fn size(&self, level: usize) -> [f64; 2] {
        [f64::from(self.0.corner[level][2]), f64::from(self.0.height) * f64::from(1u32 << level.saturating_sub(1))]
    }

    /// All voxels of a level.
    pub fn voxels(&self, level: usize) -> impl Iterator<Item = [i32; 3]> + use<> {
        let (dim, layers) = (self.0.dim as i32, self.stack(level)[3]);
        (0..layers).flat_map(move |y| (0..dim).flat_map(move |z| (0..dim).map(move |x| [x, y, z])))
    }

    /// The voxel of the next coarser level that a voxel lies in, or a place beside the box.
    fn parent(&self, level: usize, [x, y, z]: [i32; 3]) -> [i32; 3] {
        let [begin_x, begin_z, ..] = self.stack(level + 1);
        [(x >> 1) + begin_x, y >> u32::from(level > 0), (z >> 1) + begin_z]
    }

    /// Fluence per irradiance of the sun in every voxel, by Gauss–Seidel until nothing changes by more than 1e-9.
    #[must_use]
    pub fn fluence(&self, matter: &[[u32; 2]]) -> Vec<f64> {
        let p = self.0;
        let (albedo, g, vacuum) = (f64::from(p.medium.albedo), f64::from(p.medium.asymmetry), f64::from(p.vacuum));
        let reduced = |index: usize| extinction(matter[index])[0] * (1.0 - albedo * g);
        let stiffness = |index: usize| reduced(index).max(vacuum);
        let mut phi = vec![0.0f64; matter.len()];
        for level in (0..p.levels as usize).rev() {
            let [width, height] = self.size(level);
            let (dim, layers) = (p.dim as i32, self.stack(level)[3]);
            loop {
                let mut change = 0.0f64;
                for voxel in self.voxels(level) {
                    let index = self.index(level, voxel);
                    let [sigma, lit] = extinction(matter[index]);
                    let mut give = albedo * (1.0 - g) * lit;
                    let mut take = 0.75 * (vacuum - reduced(index)).max(0.0) + sigma * (1.0 - albedo);
                    for axis in 0..3 {
                        for step in [-1, 1] {
                            let mut there = voxel;
                            there[axis] += step;
                            let inside = (0..if axis == 1 { layers } else { dim }).contains(&there[axis]);
                            let distance = if axis == 1 { height } else { width };
                            let own = stiffness(index);
                            let between =
                                |s: f64, farther: f64| 2.0 / (3.0 * (own + s)) / (distance * distance * farther);
                            let (value, conductance) = match inside {
                                true => {
                                    (phi[self.index(level, there)], between(stiffness(self.index(level, there)), 1.0))
                                }
                                false if axis == 1 || level + 1 == p.levels as usize => {
                                    (0.0, 1.0 / (distance * (1.5 * own * distance + 2.0)))
                                }
                                false => {
                                    let parent = self.index(level + 1, self.parent(level, there));
                                    (phi[parent], between(stiffness(parent), 1.5))
                                }
                            };
                            give += conductance * value;
                            take += conductance;
                        }
                    }
                    let new = give / take;
                    change = change.max((new - phi[index]).abs());
                    phi[index] = new;
                }
                if change < 1e-9 {
                    break;
                }
            }
        }
        phi
    }
}
