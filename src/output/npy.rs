//! NumPy arrays: f32, little-endian, C order.

use std::io::{self, Write};
use std::path::Path;

use npyz::WriterBuilder;

use super::write_atomic;
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
