//! The images that compositing writes, and the formats of images that hold radiance.

use std::sync::Arc;

use ash::vk;

use crate::Result;
use crate::gpu::{Gpu, Image, ImageDesc};
use crate::params::Precision;

/// The images that every mode writes.
pub struct CloudTargets {
    /// In-scattered radiance in rgb [W m⁻² sr⁻¹], transmittance in a.
    pub cloud: Image,
    /// Distance to the first cloud along the ray [m]; 1e30 where there is none.
    pub nearest: Image,
}

impl CloudTargets {
    /// Targets of `extent` pixels.
    pub fn new(gpu: &Arc<Gpu>, extent: [u32; 2], precision: Precision) -> Result<Self> {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::COLOR_ATTACHMENT;
        let image =
            |name, format| Image::new(gpu, &ImageDesc { name, extent: [extent[0], extent[1], 0], format, usage });
        Ok(Self { cloud: image("cloud", cloud_format(precision))?, nearest: image("nearest", NEAREST_FORMAT)? })
    }
}

/// Format of [`CloudTargets::nearest`].
pub(crate) const NEAREST_FORMAT: vk::Format = vk::Format::R32_SFLOAT;

/// Format of images of radiance and transmittance.
pub(crate) fn cloud_format(precision: Precision) -> vk::Format {
    match precision {
        Precision::F16 => vk::Format::R16G16B16A16_SFLOAT,
        Precision::F32 => vk::Format::R32G32B32A32_SFLOAT,
    }
}

/// Value of [`CloudTargets::nearest`] where there is no cloud [m].
pub const NO_CLOUD: f32 = 1e30;
