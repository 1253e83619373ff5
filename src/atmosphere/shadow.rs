//! Shadows of the clouds on the ground.

use crate::Result;
use crate::gpu::{ComputePipeline, Gpu, Image, ImageDesc, Recorder};
use crate::shaders::atmosphere_cloud_shadow_comp as shader;
use crate::shared::assert_layout;
use crate::tiling::Tiling;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Half the side of the shadow map's square around the camera \[m\].
pub const SHADOW_EXTENT: f32 = 80e3;

const SIZE: u32 = 384;

/// Asymmetry of cloud droplets for light scattered many times (Bohren 1987).
const ASYMMETRY: f32 = 0.85;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    centre: [f32; 2],
    extent: f32,
    forward: f32,
}
assert_layout!(Push, cloud_shadow_push, { centre: CENTRE, extent: EXTENT, forward: FORWARD });

/// A map of the share of sunlight that the clouds let through to the ground, texels growing with distance from the camera
/// (`glsl/atmosphere/shadow_map.glsl`).
pub struct CloudShadow {
    pipeline: ComputePipeline,
    /// The map: the share of all sunlight in red, of what comes straight from the sun in green.
    pub image: Image,
    centre: [f32; 2],
    extent: f32,
}

impl CloudShadow {
    /// Without shadows until the first [`Self::record`].
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            pipeline: ComputePipeline::new(gpu, &shader::PROGRAM, &[])?,
            image: Image::new(
                gpu,
                &ImageDesc {
                    name: "cloud shadow",
                    extent: [SIZE, SIZE, 0],
                    format: vk::Format::R16G16_SFLOAT,
                    usage: vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE,
                },
            )?,
            centre: [0.0; 2],
            extent: 0.0,
        })
    }

    /// Walks the light tiles of this frame, `camera` being relative to the floating origin.
    pub fn record(&mut self, rec: &mut Recorder<'_>, tiling: &Tiling, camera: [f32; 3]) -> Result<()> {
        (self.centre, self.extent) = ([camera[0], camera[2]], SHADOW_EXTENT);
        let bindings = shader::Bindings {
            params: tiling.params(rec.slot()),
            occluders: tiling.occluders(),
            tile_heads: tiling.heads(),
            tile_nodes: tiling.nodes(),
            cloud_shadow: &self.image,
        };
        let push = Push { centre: self.centre, extent: self.extent, forward: ASYMMETRY };
        rec.pass("cloud shadow", |rec| rec.dispatch(&self.pipeline, &bindings, &push, [SIZE, SIZE, 1]))
    }

    /// One transmittance everywhere around `camera`: a closed deck, or a host without light tiles.
    pub fn record_uniform(&mut self, rec: &mut Recorder<'_>, transmittance: f32, camera: [f32; 3]) {
        (self.centre, self.extent) = ([camera[0], camera[2]], SHADOW_EXTENT);
        rec.clear_image(&self.image, [transmittance; 4]);
    }

    /// Where the map lies: its centre relative to the floating origin, and half its side (0: nothing recorded) \[m\].
    #[must_use]
    pub fn place(&self) -> ([f32; 2], f32) {
        (self.centre, self.extent)
    }
}
