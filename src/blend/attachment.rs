//! Mode `attachment`: the merges of `interlock` in colour attachments that fragments read back, ordered by
//! `VK_EXT_rasterization_order_attachment_access` (`glsl/blend/attachment*.frag`).

use super::{BlendInputs, CloudTargets, Compositor, Kind, Setting};
use crate::Result;
use crate::gpu::{
    Attachment, BlendState, Capabilities, ComputePipeline, Draw, Feature, Feedback, FeedbackPath, GraphicsPipeline,
    GraphicsState, Image, ImageDesc, Recorder, Sampler, Target,
};
use crate::shaders::{
    blend_attachment_frag as one, blend_attachment_resolve_comp as resolve, blend_attachment2_frag as two,
    blend_attachment4_frag as four,
};
use ash::vk;

pub(super) const KIND: Kind = Kind { supports, open: |setting, k| Ok(Box::new(AttachmentMode::new(setting, k)?)) };

struct AttachmentMode {
    pipeline: GraphicsPipeline,
    resolve: ComputePipeline,
    state: Vec<Image>,
}

/// Attachments that a window of `k` segments is kept in: what is committed, `k` colours with optical depth, and two segments'
/// ends in each of the rest.
fn attachment_count(k: u32) -> u32 {
    1 + k + k.div_ceil(2)
}

/// Whether a device can keep a window of `k` segments in attachments, or a sentence why not.
fn supports(k: u32, capabilities: &Capabilities) -> Result<(), String> {
    capabilities.supports(Feature::RasterizationOrderAttachmentAccess).map_err(str::to_owned)?;
    let (needed, most) = (attachment_count(k), capabilities.max_feedback_attachments);
    if k > 4 {
        // No driver known has so many.
        return Err(format!(
            "attachment keeps 4 segments at most: {k} would take {needed} attachments, {most} can be read"
        ));
    }
    if needed > most {
        return Err(format!("{k} segments take {needed} attachments, of which the device lets {most} be read"));
    }
    Ok(())
}

/// How a device lets fragments read what they draw into.
fn path(capabilities: &Capabilities) -> FeedbackPath {
    match capabilities.supports(Feature::DynamicRenderingLocalRead) {
        Ok(()) => FeedbackPath::LocalRead,
        Err(_) => FeedbackPath::Subpass,
    }
}

impl AttachmentMode {
    fn new(setting: &Setting<'_>, k: u32) -> Result<Self> {
        let Setting { gpu, shading, extent, .. } = *setting;
        let lighting = shading.lighting.name();
        let count = attachment_count(k) as usize;
        let mut formats = vec![vk::Format::R32G32B32A32_SFLOAT; count];
        if k == 1 {
            formats[2] = vk::Format::R32G32_SFLOAT;
        }
        let usage = vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::INPUT_ATTACHMENT;
        let image = |(i, format): (usize, &vk::Format)| {
            let name = &format!("attachment state {i}");
            Image::new(gpu, &ImageDesc { name, extent: [extent[0], extent[1], 0], format: *format, usage })
        };
        let state = GraphicsState {
            attachments: formats.iter().map(|&format| Attachment { format, blend: BlendState::Replace }).collect(),
            feedback: Some(Feedback { path: path(gpu.capabilities()), ordered: true }),
            ..GraphicsState::default()
        };
        let program = match k {
            1 => one::program(lighting),
            2 => two::program(lighting),
            4 => four::program(lighting),
            other => panic!("no attachments keep a window of {other} segments"),
        };
        Ok(Self {
            pipeline: GraphicsPipeline::new(gpu, program, &shading.specialization(), state)?,
            resolve: ComputePipeline::new(gpu, &resolve::PROGRAM, &[("WINDOW", k)])?,
            state: formats.iter().enumerate().map(image).collect::<Result<_>>()?,
        })
    }
}

impl Compositor for AttachmentMode {
    fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        extent: [u32; 2],
    ) -> Result<()> {
        // Optical depth 0: nothing pending, nothing committed.
        let state: Vec<_> = self.state.iter().map(|image| Target { image, clear: Some([0.0; 4]) }).collect();
        let draw = Draw::Indirect { args: inputs.draw_args, offset: inputs.draw_args_offset };
        rec.pass("blend", |rec| match &self.state[..] {
            [state_0, state_1, state_2] => {
                let bindings = scene_bindings!(one, inputs, { state_0: state_0, state_1: state_1, state_2: state_2, });
                rec.draw(&self.pipeline, &bindings, &(), extent, &state, draw)
            }
            [state_0, state_1, state_2, state_3] => {
                let bindings = scene_bindings!(two, inputs, {
                    state_0: state_0, state_1: state_1, state_2: state_2, state_3: state_3,
                });
                rec.draw(&self.pipeline, &bindings, &(), extent, &state, draw)
            }
            [state_0, state_1, state_2, state_3, state_4, state_5, state_6] => {
                let bindings = scene_bindings!(four, inputs, {
                    state_0: state_0, state_1: state_1, state_2: state_2, state_3: state_3,
                    state_4: state_4, state_5: state_5, state_6: state_6,
                });
                rec.draw(&self.pipeline, &bindings, &(), extent, &state, draw)
            }
            other => unreachable!("no window is kept in {} attachments", other.len()),
        })?;
        rec.pass("resolve", |rec| {
            let state = |i: usize| self.state.get(i).unwrap_or(&self.state[0]).sampled(Sampler::NearestClamp);
            let bindings = resolve::Bindings {
                state_0: state(0),
                state_1: state(1),
                state_2: state(2),
                state_3: state(3),
                state_4: state(4),
                state_5: state(5),
                cloud: &targets.cloud,
                nearest: &targets.nearest,
            };
            rec.dispatch(&self.resolve, &bindings, &(), [extent[0], extent[1], 1])
        })
    }
}
