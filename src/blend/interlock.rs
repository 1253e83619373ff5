//! Mode `interlock`: the volume-aware merge, ordered per pixel by `VK_EXT_fragment_shader_interlock`
//! (`glsl/blend/interlock.frag`, Yusov 5.5).

use super::{BlendInputs, CloudTargets, OPTICAL_DEPTH_SAMPLER, Shading};
use crate::Result;
use crate::gpu::{ComputePipeline, Draw, Gpu, GraphicsPipeline, GraphicsState, Image, ImageDesc, Recorder, Sampler};
use crate::shaders::{blend_interlock_frag as shader, blend_resolve_comp as resolve};
use ash::vk;
use std::sync::Arc;

pub(super) struct Interlock {
    pipeline: GraphicsPipeline,
    resolve: ComputePipeline,
    committed: Image,
    pending: Image,
    extent_state: Image,
}

impl Interlock {
    pub(super) fn new(gpu: &Arc<Gpu>, shading: Shading, extent: [u32; 2]) -> Result<Self> {
        let image = |name, format| {
            let usage = vk::ImageUsageFlags::STORAGE;
            Image::new(gpu, &ImageDesc { name, extent: [extent[0], extent[1], 0], format, usage })
        };
        Ok(Self {
            pipeline: GraphicsPipeline::new(
                gpu,
                &shader::PROGRAM,
                &shading.specialization(),
                GraphicsState::default(),
            )?,
            resolve: ComputePipeline::new(gpu, &resolve::PROGRAM, &[])?,
            committed: image("interlocked committed", vk::Format::R32G32B32A32_SFLOAT)?,
            pending: image("interlocked pending", vk::Format::R32G32B32A32_SFLOAT)?,
            extent_state: image("interlocked extent", vk::Format::R32G32_SFLOAT)?,
        })
    }

    pub(super) fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        extent: [u32; 2],
    ) -> Result<()> {
        rec.pass("blend", |rec| {
            for image in [&self.committed, &self.pending, &self.extent_state] {
                rec.clear_image(image, [0.0; 4]); // Optical depth 0: nothing pending, nothing committed.
            }
            let bindings = shader::Bindings {
                frame: inputs.frame,
                particles: inputs.particles,
                order: inputs.order,
                lights: inputs.lights,
                medium: inputs.medium,
                sky_light: inputs.sky_light,
                optical_depth_lut: inputs.optical_depth_lut.sampled(OPTICAL_DEPTH_SAMPLER),
                scattering_lut: inputs.scattering_lut.sampled(Sampler::LinearClamp),
                detail_tile: inputs.detail_tile.sampled(Sampler::LinearRepeat),
                opaque_distance: inputs.opaque_distance.sampled(Sampler::NearestClamp),
                interlocked_committed: &self.committed,
                interlocked_pending: &self.pending,
                interlocked_extent: &self.extent_state,
            };
            let draw = Draw::Indirect { args: inputs.draw_args, offset: inputs.draw_args_offset };
            rec.draw(&self.pipeline, &bindings, &(), extent, &[], draw)
        })?;
        rec.pass("resolve", |rec| {
            let bindings = resolve::Bindings {
                committed_state: &self.committed,
                pending_state: &self.pending,
                extent_state: &self.extent_state,
                cloud: &targets.cloud,
                nearest: &targets.nearest,
            };
            rec.dispatch(&self.resolve, &bindings, &(), [extent[0], extent[1], 1])
        })
    }
}
