//! Compute commands.

use super::Recorder;
use crate::Result;
use crate::gpu::{Access, BindingSet, Buffer, ComputePipeline};
use ash::vk;
use bytemuck::Pod;

impl Recorder<'_> {
    /// Runs at least `threads` invocations of `pipeline`, rounded up to whole groups.
    pub fn dispatch<P: Pod>(
        &mut self,
        pipeline: &ComputePipeline,
        bindings: &dyn BindingSet,
        push: &P,
        threads: [u32; 3],
    ) -> Result<()> {
        let group = pipeline.0.desc.program.group_size;
        self.bind(&pipeline.0, bindings, push, vk::PipelineBindPoint::COMPUTE, &[])?;
        let [x, y, z] = [0, 1, 2].map(|i| threads[i].div_ceil(group[i]));
        // SAFETY: pipeline and descriptors are bound, barriers recorded.
        unsafe { self.state.gpu.device().cmd_dispatch(self.cmd, x, y, z) };
        Ok(())
    }

    /// Runs as many groups of `pipeline` as the `VkDispatchIndirectCommand` at `offset` of `args` says.
    pub fn dispatch_indirect<P: Pod>(
        &mut self,
        pipeline: &ComputePipeline,
        bindings: &dyn BindingSet,
        push: &P,
        args: &Buffer,
        offset: u64,
    ) -> Result<()> {
        self.bind(&pipeline.0, bindings, push, vk::PipelineBindPoint::COMPUTE, &[(args.id, Access::IndirectRead)])?;
        // SAFETY: as above; the argument buffer holds a command at `offset`.
        unsafe { self.state.gpu.device().cmd_dispatch_indirect(self.cmd, args.handle(), offset) };
        Ok(())
    }
}
