//! The optical depth table on the device (Yusov 4.1): density from noise, then a march along every ray.
//!
//! `profile.comp` samples the style's density, `optical_depth.comp` fills the table. Recording needs nothing but a command
//! buffer, so a style can be changed between two frames.

use super::axes::OpticalDepthShape;
use crate::Result;
use crate::definitions::REFERENCE_SEED;
use crate::gpu::{ComputePipeline, Gpu, Image, ImageDesc, Recorder, Sampled, Sampler};
use crate::params::Style;
use crate::shaders::{lut_optical_depth_comp as optical_depth, lut_profile_comp as profile};
use crate::shared::constants::lut_profile_glsl as constants;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ProfilePush {
    style: u32,
    seed: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MarchPush {
    steps: u32,
    homogeneous: u32,
}

/// Number of a style in `profile.glsl`.
pub fn style_index(style: Style) -> u32 {
    match style {
        Style::Homogeneous => constants::PROFILE_HOMOGENEOUS,
        Style::Radial => constants::PROFILE_RADIAL,
        Style::Threshold => constants::PROFILE_THRESHOLD,
        Style::Pyroclastic => constants::PROFILE_PYROCLASTIC,
        Style::Gaussian => constants::PROFILE_GAUSSIAN,
        Style::Polynomial => constants::PROFILE_POLYNOMIAL,
    }
}

/// The table and what fills it.
pub struct OpticalDepthTable {
    shape: OpticalDepthShape,
    steps: u32,
    volume: Image,
    table: Image,
    profile: ComputePipeline,
    march: ComputePipeline,
}

impl OpticalDepthTable {
    /// Makes the images and pipelines; [`Self::record`] fills them.
    pub fn new(gpu: &Arc<Gpu>, shape: OpticalDepthShape) -> Result<Self> {
        let coarse = shape.theta < OpticalDepthShape::FULL.theta;
        let (lattice, steps) = if coarse { (48, 24) } else { (96, 48) };
        let usage = vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED;
        let volume = Image::new(
            gpu,
            &ImageDesc { name: "particle density", extent: [lattice; 3], format: vk::Format::R16_SFLOAT, usage },
        )?;
        let extent = shape.image_extent();
        let table = Image::new(
            gpu,
            &ImageDesc { name: "optical depth table", extent, format: vk::Format::R16G16_SFLOAT, usage },
        )?;
        Ok(Self {
            shape,
            steps,
            volume,
            table,
            profile: ComputePipeline::new(gpu, &profile::PROGRAM, &[])?,
            march: ComputePipeline::new(gpu, &optical_depth::PROGRAM, &[])?,
        })
    }

    /// Fills the table for a style.
    pub fn record(&self, rec: &mut Recorder<'_>, style: Style) -> Result<()> {
        rec.pass("optical depth table", |rec| {
            let push = ProfilePush { style: style_index(style), seed: REFERENCE_SEED };
            rec.dispatch(&self.profile, &profile::Bindings { volume: &self.volume }, &push, self.volume.extent())?;
            let bindings =
                optical_depth::Bindings { volume: self.volume.sampled(Sampler::LinearClamp), table: &self.table };
            let push = MarchPush { steps: self.steps, homogeneous: u32::from(style == Style::Homogeneous) };
            rec.dispatch(&self.march, &bindings, &push, self.table.extent())
        })
    }

    /// The table with the sampler that `optical_depth_lookup` needs.
    pub fn sampled(&self) -> Sampled<'_> {
        self.table.sampled(Sampler::LinearRepeatClampRepeat)
    }

    /// The image that holds it.
    pub fn image(&self) -> &Image {
        &self.table
    }

    /// Its shape.
    pub fn shape(&self) -> OpticalDepthShape {
        self.shape
    }
}
