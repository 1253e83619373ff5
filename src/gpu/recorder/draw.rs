//! Draws and the passes around them.

use super::Recorder;
use super::check::{check_bindings, check_inputs, check_targets, graphics_state};
use crate::Result;
use crate::gpu::{Access, BindingSet, Buffer, FeedbackPath, GraphicsPipeline, Image};
use ash::vk;
use bytemuck::Pod;
use std::collections::HashSet;

/// A colour attachment of a draw.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// The image.
    pub image: &'a Image,
    /// Value that it is cleared to first; none keeps what is there.
    pub clear: Option<[f32; 4]>,
}

/// How many vertices and instances to draw.
#[derive(Clone, Copy)]
pub enum Draw<'a> {
    /// Known to the host.
    Direct {
        /// Vertices of each instance.
        vertices: u32,
        /// Instances.
        instances: u32,
    },
    /// A `VkDrawIndirectCommand` in a buffer.
    Indirect {
        /// The buffer.
        args: &'a Buffer,
        /// Where in it the command lies [bytes].
        offset: u64,
    },
}

/// One draw of several that share their targets.
#[derive(Clone, Copy)]
pub struct DrawCall<'a> {
    /// What draws.
    pub pipeline: &'a GraphicsPipeline,
    /// What it reads and writes through descriptors.
    pub bindings: &'a dyn BindingSet,
    /// Its push constants.
    pub push: &'a [u8],
    /// How much.
    pub draw: Draw<'a>,
}

/// What a render pass has beside its colour attachments.
#[derive(Clone, Copy, Default)]
pub struct PassState<'a> {
    /// Depth attachment and the value that it is cleared to; its contents are gone afterwards.
    pub depth: Option<(&'a Image, f32)>,
    /// Whether each call may read as input attachments what those before it have written: a barrier between them. Pipelines
    /// with ordered feedback do without.
    pub separated: bool,
    /// First row to draw and the first not to; none draws all.
    pub rows: Option<(u32, u32)>,
}

impl Recorder<'_> {
    /// Draws into `targets` (none is allowed), over the whole of `extent`.
    pub fn draw<P: Pod>(
        &mut self,
        pipeline: &GraphicsPipeline,
        bindings: &dyn BindingSet,
        push: &P,
        extent: [u32; 2],
        targets: &[Target<'_>],
        draw: Draw<'_>,
    ) -> Result<()> {
        self.draw_all(extent, targets, &[DrawCall { pipeline, bindings, push: bytemuck::bytes_of(push), draw }])
    }

    /// Records `calls`, in order, into the same targets: one render pass, with no barrier between them. What one writes
    /// through descriptors, another may touch only under interlock.
    ///
    /// # Panics
    /// If pipelines are described for other attachments than `targets` or for different ways to read them, or if an input
    /// attachment is bound to another image than the target of its index.
    pub fn draw_all(&mut self, extent: [u32; 2], targets: &[Target<'_>], calls: &[DrawCall<'_>]) -> Result<()> {
        self.draw_pass(extent, targets, PassState::default(), calls)
    }

    /// As [`draw_all`](Self::draw_all), in a pass with more `state`.
    ///
    /// # Panics
    /// As [`draw_all`](Self::draw_all).
    pub fn draw_pass(
        &mut self,
        extent: [u32; 2],
        targets: &[Target<'_>],
        pass: PassState<'_>,
        calls: &[DrawCall<'_>],
    ) -> Result<()> {
        let Some(first) = calls.first() else { return Ok(()) };
        let state = graphics_state(first.pipeline);
        let mut uses: Vec<(u64, Access)> = Vec::new();
        let mut sets = Vec::with_capacity(calls.len());
        for call in calls {
            check_targets(call.pipeline, targets);
            assert_eq!(state.feedback, graphics_state(call.pipeline).feedback, "pipelines of one pass read alike");
            check_bindings(&call.pipeline.0, call.bindings);
            let resources = call.bindings.resources();
            check_inputs(call.pipeline, &resources, targets);
            self.descriptor_uses(&call.pipeline.0, &resources, &mut uses);
            if let Draw::Indirect { args, .. } = call.draw {
                uses.push((args.id, Access::IndirectRead));
            }
            sets.push(self.state.sets.get(&self.state.gpu, &call.pipeline.0, &resources)?);
        }
        let access = if state.feedback.is_some() { Access::AttachmentFeedback } else { Access::ColorAttachment };
        for target in targets {
            self.initialise(target.image);
            uses.push((target.image.id, access));
        }
        if let Some((image, _)) = pass.depth {
            self.initialise(image);
            uses.push((image.id, Access::DepthAttachment));
        }
        let mut seen = HashSet::new();
        uses.retain(|one| seen.insert(*one));
        self.transition(first.pipeline.0.desc.program.name, &uses);
        let [width, height] = extent;
        let (first_row, end_row) = pass.rows.unwrap_or((0, height));
        let area = vk::Rect2D {
            offset: vk::Offset2D { x: 0, y: first_row as i32 },
            extent: vk::Extent2D { width, height: end_row - first_row },
        };
        let in_render_pass = state.feedback.is_some_and(|feedback| feedback.path == FeedbackPath::Subpass);
        if in_render_pass {
            self.state.framebuffers.begin(&self.state.gpu, self.cmd, state, targets, area)?;
        } else {
            self.begin_rendering(targets, pass.depth, area);
        }
        let viewport =
            vk::Viewport { x: 0.0, y: 0.0, width: width as f32, height: height as f32, min_depth: 0.0, max_depth: 1.0 };
        for (index, (call, set)) in calls.iter().zip(sets).enumerate() {
            if pass.separated && index > 0 {
                self.separate();
            }
            self.bind_set(&call.pipeline.0, set, call.push, vk::PipelineBindPoint::GRAPHICS);
            let device = self.state.gpu.device();
            // SAFETY: pipeline and descriptors are bound, barriers recorded, attachments in GENERAL layout.
            unsafe {
                device.cmd_set_viewport(self.cmd, 0, &[viewport]);
                device.cmd_set_scissor(self.cmd, 0, &[area]);
                match call.draw {
                    Draw::Direct { vertices, instances } => device.cmd_draw(self.cmd, vertices, instances, 0, 0),
                    Draw::Indirect { args, offset } => device.cmd_draw_indirect(self.cmd, args.handle(), offset, 1, 16),
                }
            }
        }
        let device = self.state.gpu.device();
        // SAFETY: closes what was opened above.
        unsafe {
            if in_render_pass {
                device.cmd_end_render_pass(self.cmd);
            } else {
                device.cmd_end_rendering(self.cmd);
            }
        }
        Ok(())
    }

    /// Inside a pass: what has been written to colour attachments can be read as input attachments of the same pixels.
    fn separate(&mut self) {
        let memory = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
            .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::FRAGMENT_SHADER)
            .dst_access_mask(vk::AccessFlags2::INPUT_ATTACHMENT_READ)];
        let dependency =
            vk::DependencyInfo::default().dependency_flags(vk::DependencyFlags::BY_REGION).memory_barriers(&memory);
        // SAFETY: inside a pass whose pipelines read their attachments, which has this dependency on itself.
        unsafe { self.state.gpu.device().cmd_pipeline_barrier2(self.cmd, &dependency) };
        self.log(|| "  barrier within the pass".to_owned());
    }

    fn begin_rendering(&mut self, targets: &[Target<'_>], depth: Option<(&Image, f32)>, area: vk::Rect2D) {
        let attachments: Vec<_> = targets
            .iter()
            .map(|target| {
                let attachment = vk::RenderingAttachmentInfo::default()
                    .image_view(target.image.view())
                    .image_layout(vk::ImageLayout::GENERAL)
                    .store_op(vk::AttachmentStoreOp::STORE);
                match target.clear {
                    None => attachment.load_op(vk::AttachmentLoadOp::LOAD),
                    Some(float32) => attachment
                        .load_op(vk::AttachmentLoadOp::CLEAR)
                        .clear_value(vk::ClearValue { color: vk::ClearColorValue { float32 } }),
                }
            })
            .collect();
        let depth = depth.map(|(image, depth)| {
            vk::RenderingAttachmentInfo::default()
                .image_view(image.view())
                .image_layout(vk::ImageLayout::GENERAL)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .clear_value(vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth, stencil: 0 } })
        });
        let mut rendering =
            vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&attachments);
        if let Some(depth) = &depth {
            rendering = rendering.depth_attachment(depth);
        }
        // SAFETY: the command buffer is recording, outside a render pass; attachments are in GENERAL layout.
        unsafe { self.state.gpu.device().cmd_begin_rendering(self.cmd, &rendering) };
    }
}
