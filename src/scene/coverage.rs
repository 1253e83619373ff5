//! The coverage picture: an 8- or 16-bit grey image, black for a clear sky and white for an overcast one.

use std::path::Path;

use image::DynamicImage;

use crate::params::CoverageMap;
use crate::{Error, Result};

/// Reads the picture at `path`; its width measures `extent` metres.
pub fn load(path: &Path, extent: f32) -> Result<CoverageMap> {
    let fault = |reason: String| Error::file(path, format!("{reason} (clouds.coverage_map)"));
    let reader = image::ImageReader::open(path).map_err(|error| fault(format!("cannot be read: {error}")))?;
    let reader = reader.with_guessed_format().map_err(|error| fault(format!("cannot be read: {error}")))?;
    let picture = reader.decode().map_err(|error| fault(format!("is no readable picture: {error}")))?;
    let (width, height) = (picture.width(), picture.height());
    let values = match picture {
        DynamicImage::ImageLuma8(grey) => grey.into_raw().into_iter().map(|v| f32::from(v) / 255.0).collect(),
        DynamicImage::ImageLuma16(grey) => grey.into_raw().into_iter().map(|v| f32::from(v) / 65_535.0).collect(),
        other => return Err(fault(format!("is {:?}: expected an 8- or 16-bit grey picture", other.color()))),
    };
    Ok(CoverageMap { width, height, values, extent })
}
