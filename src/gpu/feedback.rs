//! Attachments that a draw both writes and reads, its fragments taking turns in drawing order
//! (`VK_EXT_rasterization_order_attachment_access`): read-modify-write of a pixel without storage images or interlock.
//!
//! A fragment shader declares `layout(input_attachment_index = i, binding = b) uniform subpassInput name` (or
//! `subpassInputMS`), reads colour attachment `i` by `subpassLoad(name)` and writes output location `i`. The pipeline's
//! [`GraphicsState::feedback`] says by which of two ways, and [`Recorder::draw`](super::Recorder::draw) does the rest: it
//! checks that the image bound to `name` is the target `i`, opens the render pass and derives the barriers before it. Every
//! target of such a draw needs `INPUT_ATTACHMENT` usage beside `COLOR_ATTACHMENT`.

use super::{Gpu, GraphicsState, Target};
use crate::Result;
use ash::vk;
use std::collections::HashMap;
use std::sync::Arc;

/// How the fragments of a draw read the attachments that they write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feedback {
    /// What Vulkan sees.
    pub path: FeedbackPath,
    /// Whether a pixel's fragments take turns in drawing order. Without it no fragment may read what another of the same
    /// pass has written.
    pub ordered: bool,
}

impl Feedback {
    /// What asks for order in a subpass; [`FeedbackPath::LocalRead`] has none.
    #[must_use]
    pub fn subpass_flags(self) -> vk::SubpassDescriptionFlags {
        if self.ordered {
            vk::SubpassDescriptionFlags::RASTERIZATION_ORDER_ATTACHMENT_COLOR_ACCESS_EXT
        } else {
            vk::SubpassDescriptionFlags::empty()
        }
    }

    /// What asks for order in a pipeline.
    #[must_use]
    pub fn blend_flags(self) -> vk::PipelineColorBlendStateCreateFlags {
        if self.ordered {
            vk::PipelineColorBlendStateCreateFlags::RASTERIZATION_ORDER_ATTACHMENT_ACCESS_EXT
        } else {
            vk::PipelineColorBlendStateCreateFlags::empty()
        }
    }
}

/// The two ways in which Vulkan lets a fragment read an attachment that is being drawn into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeedbackPath {
    /// Dynamic rendering with `VK_KHR_dynamic_rendering_local_read`.
    LocalRead,
    /// A render pass object whose one subpass has every attachment as colour and as input attachment: any Vulkan 1.3 device.
    Subpass,
}

/// A render pass for pipelines of `state`: each attachment is colour attachment and input attachment `i` of the only
/// subpass, in `GENERAL` layout throughout; those in the bit mask `clear` start cleared, the others keep their contents. A
/// pipeline may be built with any mask. The caller destroys it. Engines that build [`FeedbackPath::Subpass`] pipelines in a
/// [`PipelineFactory`](super::PipelineFactory) of their own build them for this pass.
pub fn create_render_pass(gpu: &Gpu, state: &GraphicsState, clear: u32) -> Result<vk::RenderPass> {
    let attachments: Vec<_> = (0u32..)
        .zip(&state.attachments)
        .map(|(i, attachment)| {
            let cleared = clear & (1 << i) != 0;
            vk::AttachmentDescription2::default()
                .format(attachment.format)
                .samples(state.samples)
                .load_op(if cleared { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD })
                .store_op(vk::AttachmentStoreOp::STORE)
                .stencil_load_op(vk::AttachmentLoadOp::DONT_CARE)
                .stencil_store_op(vk::AttachmentStoreOp::DONT_CARE)
                .initial_layout(vk::ImageLayout::GENERAL)
                .final_layout(vk::ImageLayout::GENERAL)
        })
        .collect();
    let references: Vec<_> = (0..attachments.len() as u32)
        .map(|attachment| {
            vk::AttachmentReference2::default()
                .attachment(attachment)
                .layout(vk::ImageLayout::GENERAL)
                .aspect_mask(vk::ImageAspectFlags::COLOR)
        })
        .collect();
    let flags = state.feedback.map_or(vk::SubpassDescriptionFlags::empty(), Feedback::subpass_flags);
    let subpasses = [vk::SubpassDescription2::default()
        .flags(flags)
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&references)
        .input_attachments(&references)];
    // Without order, a barrier inside the pass is what lets one draw read what another has written.
    let dependencies = [vk::SubpassDependency2::default()
        .src_subpass(0)
        .dst_subpass(0)
        .src_stage_mask(vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT)
        .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
        .dst_stage_mask(vk::PipelineStageFlags::FRAGMENT_SHADER)
        .dst_access_mask(vk::AccessFlags::INPUT_ATTACHMENT_READ)
        .dependency_flags(vk::DependencyFlags::BY_REGION)];
    let dependencies = if flags.is_empty() { &dependencies[..] } else { &[] };
    let info =
        vk::RenderPassCreateInfo2::default().attachments(&attachments).subpasses(&subpasses).dependencies(dependencies);
    // SAFETY: the device is alive; every pointer in the description is too.
    unsafe { gpu.device().create_render_pass2(&info, None) }
        .map_err(|result| gpu.error("vkCreateRenderPass2", "a pass with attachment feedback", result))
}

/// Render passes with their framebuffers, made when first drawn into.
#[derive(Default)]
pub(super) struct Framebuffers {
    made: HashMap<Key, (vk::RenderPass, vk::Framebuffer)>,
}

/// Images, mask of the cleared ones, whether ordered.
type Key = (Vec<u64>, u32, bool);

impl Framebuffers {
    /// Begins the render pass into `targets`, which match `state`.
    pub fn begin(
        &mut self,
        gpu: &Arc<Gpu>,
        cmd: vk::CommandBuffer,
        state: &GraphicsState,
        targets: &[Target<'_>],
        area: vk::Rect2D,
    ) -> Result<()> {
        let clear = (0..).zip(targets).map(|(i, t)| u32::from(t.clear.is_some()) << i).fold(0, |mask, bit| mask | bit);
        let ordered = state.feedback.is_some_and(|feedback| feedback.ordered);
        let key = (targets.iter().map(|target| target.image.id).collect(), clear, ordered);
        let (render_pass, framebuffer) = match self.made.get(&key) {
            Some(made) => *made,
            None => {
                let made = make(gpu, state, targets, clear)?;
                *self.made.entry(key).or_insert(made)
            }
        };
        let clears: Vec<_> = targets
            .iter()
            .map(|t| vk::ClearValue { color: vk::ClearColorValue { float32: t.clear.unwrap_or_default() } })
            .collect();
        let info = vk::RenderPassBeginInfo::default()
            .render_pass(render_pass)
            .framebuffer(framebuffer)
            .render_area(area)
            .clear_values(&clears);
        // SAFETY: the command buffer is recording, outside a render pass; barriers are recorded.
        unsafe { gpu.device().cmd_begin_render_pass(cmd, &info, vk::SubpassContents::INLINE) };
        Ok(())
    }

    /// Destroys all of them; the device is done with them.
    pub fn clear(&mut self, gpu: &Gpu) {
        for (_, (render_pass, framebuffer)) in self.made.drain() {
            // SAFETY: made by this device, which is done with them.
            unsafe {
                gpu.device().destroy_framebuffer(framebuffer, None);
                gpu.device().destroy_render_pass(render_pass, None);
            }
        }
    }
}

fn make(
    gpu: &Arc<Gpu>,
    state: &GraphicsState,
    targets: &[Target<'_>],
    clear: u32,
) -> Result<(vk::RenderPass, vk::Framebuffer)> {
    let render_pass = create_render_pass(gpu, state, clear)?;
    let views: Vec<_> = targets.iter().map(|target| target.image.view()).collect();
    let least = |i: usize| targets.iter().map(|target| target.image.extent()[i]).min().unwrap_or(1);
    let info = vk::FramebufferCreateInfo::default()
        .render_pass(render_pass)
        .attachments(&views)
        .width(least(0))
        .height(least(1))
        .layers(1);
    // SAFETY: pass and views belong to this device and are alive.
    match unsafe { gpu.device().create_framebuffer(&info, None) } {
        Ok(framebuffer) => Ok((render_pass, framebuffer)),
        Err(result) => {
            // SAFETY: made above, never used.
            unsafe { gpu.device().destroy_render_pass(render_pass, None) };
            Err(gpu.error("vkCreateFramebuffer", "a pass with attachment feedback", result))
        }
    }
}
