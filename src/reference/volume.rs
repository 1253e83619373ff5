//! Light that diffuses through voxels (`glsl/lighting/tables/diffusion/`), in `f64` and to convergence.

use crate::lighting::tables::volume::VolumeParams;

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

    /// Radiance of every voxel per irradiance of the sun [1/sr], with the share of sunlight that thick voxels scatter for the
    /// first time (`glsl/lighting/tables/diffusion/store.comp`). `fluence` is [`Self::fluence`]'s or the device's.
    #[must_use]
    pub fn radiance(&self, matter: &[[u32; 2]], fluence: &[f64]) -> Vec<f64> {
        let p = self.0;
        let (albedo, g, vacuum) = (f64::from(p.medium.albedo), f64::from(p.medium.asymmetry), f64::from(p.vacuum));
        let mut radiance = vec![0.0; fluence.len()];
        for level in 0..p.levels as usize {
            for index in self.voxels(level).map(|voxel| self.index(level, voxel)) {
                let [sigma, lit] = extinction(matter[index]);
                let thickness = (sigma * (1.0 - albedo * g)).max(vacuum) * self.size(level)[0];
                let share = thickness * thickness / (1.0 + thickness * thickness);
                let fluence = fluence[index] + share * (lit / sigma.max(vacuum)).min(0.5 * fluence[index]);
                radiance[index] = fluence.max(0.0) / (4.0 * std::f64::consts::PI);
            }
        }
        radiance
    }

    /// `radiance` at a point [m, floating origin], and its slope along the axes [1/(m sr)]: of the finest level that reaches
    /// so far, passing into the next coarser one towards its border (`glsl/lighting/tables/diffusion/seen.comp`).
    #[must_use]
    pub fn look_up(&self, radiance: &[f64], point: [f64; 3]) -> (f64, [f64; 3]) {
        let last = self.0.levels as usize - 1;
        let inside = |level: usize| {
            let [across, _, along] = self.position(level, point);
            across.min(along).min(f64::from(self.0.dim) - across.max(along)) - 1.5
        };
        let level = (0..last).find(|&level| inside(level) > 0.0).unwrap_or(last);
        let (value, slope) = self.interpolate(radiance, point, level);
        let own = inside(level) / 4.0;
        if own >= 1.0 || level == last {
            return (value, slope);
        }
        let (coarser, coarser_slope) = self.interpolate(radiance, point, level + 1);
        let mix = |coarser: f64, value: f64| coarser + (value - coarser) * own;
        (mix(coarser, value), std::array::from_fn(|axis| mix(coarser_slope[axis], slope[axis])))
    }

    /// Where a point [m, floating origin] lies in a level [voxels].
    fn position(&self, level: usize, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let p = self.0;
        let [width, height] = self.size(level);
        let [dx, dz] = [x - f64::from(p.bend[0]), z - f64::from(p.bend[1])];
        let above = y - f64::from(p.base) + (dx * dx + dz * dz) * f64::from(p.inverse_diameter);
        let [corner_x, corner_z, ..] = p.corner[level].map(f64::from);
        [(x - corner_x) / width, above / height, (z - corner_z) / width]
    }

    fn interpolate(&self, radiance: &[f64], point: [f64; 3], level: usize) -> (f64, [f64; 3]) {
        let (dim, layers) = (self.0.dim as i32, self.stack(level)[3]);
        let [width, height] = self.size(level);
        let at = self.position(level, point);
        let (mut first, mut part) = ([0i32; 3], [0.0f64; 3]);
        for (axis, voxels) in [dim, layers, dim].into_iter().enumerate() {
            let place = at[axis].clamp(0.5, f64::from(voxels) - 0.5) - 0.5;
            first[axis] = (place.floor() as i32).min(voxels - 2);
            part[axis] = place - f64::from(first[axis]);
        }
        let (mut value, mut slope) = (0.0, [0.0; 3]);
        for corner in 0..8 {
            let far = [0, 1, 2].map(|axis| corner >> axis & 1);
            let here = radiance[self.index(level, [0, 1, 2].map(|axis| first[axis] + far[axis]))];
            let weight = [0, 1, 2].map(|axis| if far[axis] == 1 { part[axis] } else { 1.0 - part[axis] });
            value += weight.iter().product::<f64>() * here;
            for (axis, slope) in slope.iter_mut().enumerate() {
                let others: f64 = (0..3).filter(|&other| other != axis).map(|other| weight[other]).product();
                *slope += (if far[axis] == 1 { here } else { -here }) * others / [width, height, width][axis];
            }
        }
        (value, slope)
    }
}
