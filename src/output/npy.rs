//! NumPy arrays: f32, C order.

use std::io::{self, Write};
use std::path::Path;

use npyz::WriterBuilder;

use super::atomic::{AtomicFile, write_atomic};
use crate::Result;

/// Writes `values`, the last axis fastest, as an array of `shape`.
pub fn write(path: &Path, shape: &[u64], values: impl IntoIterator<Item = f32>) -> Result<()> {
    write_atomic(path, |file| encode(file, shape, values))
}

/// As [`write`], into `file`.
fn encode(file: &mut dyn Write, shape: &[u64], values: impl IntoIterator<Item = f32>) -> io::Result<()> {
    let mut writer = npyz::WriteOptions::<f32>::new().default_dtype().shape(shape).writer(file).begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}

/// Edge of a brick of voxels.
const BRICK: usize = 8;

/// A volume written as it is made: bricks of 8³ values come layer by layer; one layer is in memory.
pub struct NpyVolume {
    file: AtomicFile,
    size: [usize; 3],
    /// 8 planes, z slowest.
    planes: Vec<f32>,
    layer: usize,
}

impl NpyVolume {
    /// Starts an array of shape (z, y, x), filled with 0 where no brick comes, for `size` values along x, y and z.
    ///
    /// # Errors
    /// [`Error::File`](crate::Error::File) when the file cannot be written.
    pub fn create(path: &Path, size: [u32; 3]) -> Result<Self> {
        let mut file = AtomicFile::create(path)?;
        let shape = [size[2], size[1], size[0]].map(u64::from);
        let header =
            npyz::WriteOptions::<f32>::new().default_dtype().shape(&shape).writer(&mut file).write_header_only();
        header.map(drop).map_err(|error| file.fault(&error))?;
        let size = size.map(|side| side as usize);
        Ok(Self { file, size, planes: vec![0.0; BRICK * size[0] * size[1]], layer: 0 })
    }

    /// Takes the brick at `at` (in bricks); `values`: z fastest, then y, then x. What lies outside the array is dropped.
    ///
    /// # Errors
    /// [`Error::File`](crate::Error::File) when the disk fails.
    ///
    /// # Panics
    /// If a brick of an earlier layer in z comes after one of a later layer.
    pub fn brick(&mut self, at: [u32; 3], values: &[f32]) -> Result<()> {
        let at = at.map(|c| c as usize);
        assert!(at[2] >= self.layer, "brick {at:?} comes after its layer");
        while self.layer < at[2] {
            self.flush()?;
        }
        for (index, &value) in values.iter().enumerate() {
            let [x, y, z] = [at[0] * BRICK + index / 64, at[1] * BRICK + index / 8 % 8, index % 8];
            if x < self.size[0] && y < self.size[1] {
                self.planes[(z * self.size[1] + y) * self.size[0] + x] = value;
            }
        }
        Ok(())
    }

    /// Writes the layer and starts the next one.
    fn flush(&mut self) -> Result<()> {
        let left = self.size[2].saturating_sub(self.layer * BRICK).min(BRICK);
        let values = &self.planes[..left * self.size[0] * self.size[1]];
        // The header names the machine's own order of bytes.
        self.file.write_all(bytemuck::cast_slice(values)).map_err(|error| self.file.fault(&error))?;
        self.planes.fill(0.0);
        self.layer += 1;
        Ok(())
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// [`Error::File`](crate::Error::File) when the disk fails.
    pub fn finish(mut self) -> Result<()> {
        while self.layer * BRICK < self.size[2] {
            self.flush()?;
        }
        self.file.commit()
    }
}
