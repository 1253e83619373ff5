//! Pictures, tables and numbers into files.
//!
//! Every file is written beside its place and moved there when it is whole, so that a failure leaves no part of one.
//! `.exr` and `.npy` hold linear scene radiance before tone mapping; `.png` holds the toned picture.

mod atomic;
mod exr;
mod npy;
mod particles;
mod picture;
mod stats;
mod table;
mod vdb;

use std::path::Path;

pub use atomic::{AtomicFile, write_atomic};
pub use exr::{ExrChannel, ExrCompression, ExrOptions, ExrType, colour as exr_colour, write as write_exr};
pub use npy::NpyVolume;
pub use particles::write_particles;
pub(crate) use picture::encode_png;
pub use picture::{Format, Picture, PngDepth, numbered, transmittance_path};
pub use stats::{BlendStats, CapacityStats, DeviceStats, FrameStats, ParticleStats, PassStats, Stats, TableStats};
pub use table::{Axis, AxisValues, Table, write_tables};
pub use vdb::{LEAF_VOXELS, VdbGrid, VdbWriter};

use crate::{Error, Result};

/// Writes `value` as indented JSON with a final newline.
///
/// # Errors
/// [`Error::File`] when the file cannot be written.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let text = to_json(value).map_err(|reason| Error::file(path, reason))?;
    write_atomic(path, |file| file.write_all(text.as_bytes()))
}

/// `value` as indented JSON with a final newline.
///
/// # Errors
/// A sentence on what JSON cannot hold.
pub fn to_json(value: &impl serde::Serialize) -> std::result::Result<String, String> {
    serde_json::to_string_pretty(value)
        .map(|text| text + "\n")
        .map_err(|error| format!("cannot be put as JSON: {error}"))
}
