//! Mode `attachment`: the volume-aware merge in colour attachments that fragments read back, ordered by
//! `VK_EXT_rasterization_order_attachment_access` (`glsl/blend/attachment.frag`).

use super::{BlendInputs, CloudTargets, OPTICAL_DEPTH_SAMPLER, Shading};
use crate::Result;
use crate::gpu::{
    Attachment, BlendState, Capabilities, ComputePipeline, Draw, Feature, Feedback, FeedbackPath, Gpu,
    GraphicsPipeline, GraphicsState, Image, ImageDesc, Recorder, Sampler, Target,
};
use crate::shaders::{blend_attachment_frag as shader, blend_resolve_comp as resolve};
use ash::vk;
use std::sync::Arc;

const FORMATS: [(&str, vk::Format); 3] = [
    ("attachment committed", vk::Format::R32G32B32A32_SFLOAT),
    ("attachment pending", vk::Format::R32G32B32A32_SFLOAT),
    ("attachment extent", vk::Format::R32G32_SFLOAT),
];

pub(super) struct AttachmentMode {
    pipeline: GraphicsPipeline,
    resolve: ComputePipeline,
    state: Vec<Image>,
}

/// How this device lets fragments read what they draw into.
pub(super) fn path(capabilities: &Capabilities) -> FeedbackPath {
    match capabilities.supports(Feature::DynamicRenderingLocalRead) {
        Ok(()) => FeedbackPath::LocalRead,
        Err(_) => FeedbackPath::Subpass,
    }
}

impl AttachmentMode {
    pub(super) fn new(gpu: &Arc<Gpu>, shading: Shading, extent: [u32; 2]) -> Result<Self> {
        let state = GraphicsState {
            attachments: FORMATS.map(|(_, format)| Attachment { format, blend: BlendState::Replace }).to_vec(),
            feedback: Some(Feedback { path: path(gpu.capabilities()), ordered: true }),
            ..GraphicsState::default()
        };
        let usage = vk::ImageUsageFlags::STORAGE
            | vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::INPUT_ATTACHMENT;
        let image =
            |(name, format)| Image::new(gpu, &ImageDesc { name, extent: [extent[0], extent[1], 0], format, usage });
        Ok(Self {
            pipeline: GraphicsPipeline::new(gpu, &shader::PROGRAM, &shading.specialization(), state)?,
            resolve: ComputePipeline::new(gpu, &resolve::PROGRAM, &[])?,
            state: FORMATS.into_iter().map(image).collect::<Result<_>>()?,
        })
    }

    pub(super) fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        extent: [u32; 2],
    ) -> Result<()> {
        let [committed_state, pending_state, extent_state] = [&self.state[0], &self.state[1], &self.state[2]];
        rec.pass("blend", |rec| {
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
                committed_state,
                pending_state,
                extent_state,
            };
            let draw = Draw::Indirect { args: inputs.draw_args, offset: inputs.draw_args_offset };
            // Optical depth 0: nothing pending, nothing committed.
            let state: Vec<_> = self.state.iter().map(|image| Target { image, clear: Some([0.0; 4]) }).collect();
            rec.draw(&self.pipeline, &bindings, &(), extent, &state, draw)
        })?;
        rec.pass("resolve", |rec| {
            let bindings = resolve::Bindings {
                committed_state,
                pending_state,
                extent_state,
                cloud: &targets.cloud,
                nearest: &targets.nearest,
            };
            rec.dispatch(&self.resolve, &bindings, &(), [extent[0], extent[1], 1])
        })
    }
}
