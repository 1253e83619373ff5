//! The barriers between uses, from what each command does to its resources.

use super::Recorder;
use crate::gpu::access::Barrier;
use crate::gpu::pipeline::Pipeline;
use crate::gpu::{Access, BindingKind, Image, Resource, Sampled, ShaderStage};
use ash::vk;

/// Every stage, every access: for the rare layout changes, which happen once in an image's life or at the border to a host.
pub(super) const ALL: (vk::PipelineStageFlags2, vk::AccessFlags2) = (
    vk::PipelineStageFlags2::ALL_COMMANDS,
    vk::AccessFlags2::from_raw(vk::AccessFlags2::MEMORY_READ.as_raw() | vk::AccessFlags2::MEMORY_WRITE.as_raw()),
);

impl Recorder<'_> {
    /// Adds what `pipeline` does to `resources` through descriptors. Input attachments are uses of the targets.
    pub(super) fn descriptor_uses(
        &mut self,
        pipeline: &Pipeline,
        resources: &[Resource<'_>],
        uses: &mut Vec<(u64, Access)>,
    ) {
        let program = pipeline.desc.program;
        let compute = program.stages[0].kind == ShaderStage::Compute;
        let descriptors = program.bindings.iter().zip(resources);
        for (binding, resource) in descriptors.filter(|(binding, _)| binding.kind != BindingKind::InputAttachment) {
            let access = match (compute, binding.readable, binding.writable) {
                (true, true, true) => Access::ComputeReadWrite,
                (true, false, true) => Access::ComputeWrite,
                (true, _, false) => Access::ComputeRead,
                (false, true, true) => Access::FragmentReadWrite,
                (false, false, true) => Access::FragmentWrite,
                (false, _, false) => Access::GraphicsRead,
            };
            let id = match resource {
                Resource::Buffer(buffer) => buffer.id,
                Resource::Image(image) | Resource::Sampled(Sampled { image, .. }) => {
                    self.initialise(image);
                    image.id
                }
            };
            uses.push((id, access));
        }
    }

    /// Records the one barrier that must come before a command with these uses.
    pub(super) fn transition(&mut self, command: &str, uses: &[(u64, Access)]) {
        let mut barrier = Barrier::default();
        // One resource may be used in two ways by one command; a write must see all earlier reads, so reads go first.
        for writes in [false, true] {
            for (id, access) in uses.iter().filter(|(_, access)| access.writes() == writes) {
                self.state.tracked.apply(*id, *access, &mut barrier);
            }
        }
        if !barrier.is_empty() {
            self.log(|| format!("  barrier {:?} -> {:?}", barrier.src, barrier.dst));
            let memory = [vk::MemoryBarrier2::default()
                .src_stage_mask(barrier.src.0)
                .src_access_mask(barrier.src.1)
                .dst_stage_mask(barrier.dst.0)
                .dst_access_mask(barrier.dst.1)];
            let dependency = vk::DependencyInfo::default().memory_barriers(&memory);
            // SAFETY: the command buffer is recording, outside a render pass.
            unsafe { self.state.gpu.device().cmd_pipeline_barrier2(self.cmd, &dependency) };
        }
        self.log(|| format!("  {command}"));
    }

    /// Brings a new image to GENERAL layout, once in its life. A lent one comes by `acquire`.
    pub(super) fn initialise(&mut self, image: &Image) {
        if self.state.tracked.set_initialised(image.id, true) {
            assert!(image.owned, "{} is lent: acquire it before a pass uses it", image.name());
            let none = Access::None.masks();
            self.layout(image, none, ALL, vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL);
        }
    }

    pub(super) fn layout(
        &mut self,
        image: &Image,
        src: (vk::PipelineStageFlags2, vk::AccessFlags2),
        dst: (vk::PipelineStageFlags2, vk::AccessFlags2),
        old: vk::ImageLayout,
        new: vk::ImageLayout,
    ) {
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(src.0)
            .src_access_mask(src.1)
            .dst_stage_mask(dst.0)
            .dst_access_mask(dst.1)
            .old_layout(old)
            .new_layout(new)
            .image(image.handle())
            .subresource_range(image.range())];
        let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the command buffer is recording, outside a render pass; the image is alive.
        unsafe { self.state.gpu.device().cmd_pipeline_barrier2(self.cmd, &dependency) };
    }
}
