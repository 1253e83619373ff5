//! Where the voxels are.

use crate::params::check;
use crate::{Error, Result};

/// Voxels along the longest side at most.
pub const MAX_RESOLUTION: u32 = 4096;

/// A regular grid of cubic voxels, aligned with the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelGrid {
    /// Least corner of the first voxel [m].
    pub corner: [f64; 3],
    /// Edge of a voxel [m].
    pub voxel: f64,
    /// Voxels along x, y and z.
    pub size: [u32; 3],
}

impl VoxelGrid {
    /// A grid with `resolution` voxels along the longest side of the box from `bounds[0]` to `bounds[1]` [m]; the other
    /// sides are filled up to whole voxels. `margin`: empty voxels wanted on each side of the box, counted in the
    /// resolution.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] for a resolution or bounds out of range.
    pub fn covering(bounds: [[f64; 3]; 2], resolution: u32, margin: u32) -> Result<Self> {
        check::within("resolution", resolution, 2 + 2 * margin..=MAX_RESOLUTION, "voxels along the longest side")?;
        let [least, greatest] = bounds;
        let side: [f64; 3] = std::array::from_fn(|axis| greatest[axis] - least[axis]);
        let inside = |corner: &[f64; 3]| corner.iter().all(|c| c.abs() <= check::MAX_COORDINATE);
        // A voxel of 1 mm is as fine as f32 positions are near the origin.
        if !inside(&least) || !inside(&greatest) || !side.iter().all(|&s| s >= 1.0e-3) {
            let given: Vec<_> = bounds.iter().flatten().map(f64::to_string).collect();
            let expected = "x0,y0,z0,x1,y1,z1 in metres within ±1e7, each second corner at least 0.001 above the first";
            return Err(Error::invalid("bounds", given.join(","), expected));
        }
        let longest = side.iter().copied().fold(0.0, f64::max);
        let voxel = longest / f64::from(resolution - 2 * margin);
        // A side of whole voxels shall not gain one by rounding.
        let count = |side: f64| ((side / voxel - 1.0e-9).ceil() as u32).max(1) + 2 * margin;
        Ok(Self { corner: least.map(|c| c - voxel * f64::from(margin)), voxel, size: side.map(count) })
    }

    /// Bricks along each side.
    pub(crate) fn bricks(&self) -> [u32; 3] {
        self.size.map(|voxels| voxels.div_ceil(super::BRICK))
    }

    /// Greatest corner of the last voxel [m].
    #[must_use]
    pub fn end(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.corner[axis] + self.voxel * f64::from(self.size[axis]))
    }

    /// Number of voxels.
    #[must_use]
    pub fn voxels(&self) -> u64 {
        self.size.iter().map(|&side| u64::from(side)).product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_side_has_the_resolution_and_the_others_are_filled_up() {
        let grid = VoxelGrid::covering([[-100.0, 0.0, 10.0], [100.0, 35.0, 60.0]], 20, 0).unwrap();
        assert_eq!(grid, VoxelGrid { corner: [-100.0, 0.0, 10.0], voxel: 10.0, size: [20, 4, 5] });
        assert_eq!(grid.end(), [100.0, 40.0, 60.0]);
        let grid = VoxelGrid::covering([[-100.0, 0.0, 10.0], [100.0, 35.0, 60.0]], 22, 1).unwrap();
        assert_eq!(grid, VoxelGrid { corner: [-110.0, -10.0, 0.0], voxel: 10.0, size: [22, 6, 7] });
        // 0.1 · 3 is more than 0.3 in f64.
        assert_eq!(VoxelGrid::covering([[0.0; 3], [0.1 * 3.0, 0.1, 0.1]], 3, 0).unwrap().size, [3, 1, 1]);
    }

    #[test]
    fn bad_values_are_named() {
        let message = |bounds, resolution| VoxelGrid::covering(bounds, resolution, 0).unwrap_err().to_string();
        assert!(message([[0.0; 3], [1.0; 3]], 1).starts_with("resolution = 1: expected"));
        assert!(message([[0.0; 3], [1.0; 3]], 5000).starts_with("resolution = 5000: expected"));
        assert!(message([[0.0; 3], [1.0, -1.0, 1.0]], 8).starts_with("bounds = 0,0,0,1,-1,1: expected"));
        assert!(message([[0.0; 3], [f64::NAN, 1.0, 1.0]], 8).starts_with("bounds = 0,0,0,NaN,1,1: expected"));
        assert!(message([[0.0; 3], [1e12, 1.0, 1.0]], 8).starts_with("bounds"));
    }
}
