//! Records passes into a command buffer. Every use of a resource goes through here, so the barriers between uses follow
//! from what the shaders declare; the order of passes is the order of calls.

mod barriers;
mod border;
mod check;
mod descriptors;
mod dispatch;
mod draw;
mod journal;
mod state;
mod transfer;

pub use draw::{Draw, DrawCall, PassState, Target};
pub use journal::Once;
pub use state::RecorderState;

use super::pipeline::Pipeline;
use super::{Access, BindingSet, Gpu};
use crate::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use check::check_bindings;
use std::ffi::CString;
use std::sync::Arc;

/// An open command buffer.
pub struct Recorder<'s> {
    state: &'s mut RecorderState,
    cmd: vk::CommandBuffer,
    slot: usize,
    pass: &'static str,
}

impl Recorder<'_> {
    /// The device that is recorded for.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.state.gpu
    }

    /// The command buffer, for commands of the host's own.
    pub fn command_buffer(&self) -> vk::CommandBuffer {
        self.cmd
    }

    /// The frame slot being recorded.
    pub fn slot(&self) -> usize {
        self.slot
    }

    /// Opens a labelled, timed pass around `record`.
    pub fn pass<T>(&mut self, name: &'static str, record: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let outer = std::mem::replace(&mut self.pass, name);
        self.log(|| format!("pass {name}"));
        self.label(name);
        let index = self.state.timers[self.slot].begin(self.cmd, name);
        let result = record(self);
        self.state.timers[self.slot].end(self.cmd, index);
        if let Some(debug) = self.state.gpu.debug() {
            // SAFETY: closes the label that was opened above.
            unsafe { debug.cmd_end_debug_utils_label(self.cmd) };
        }
        self.pass = outer;
        result
    }

    fn label(&self, name: &str) {
        if let (Some(debug), Ok(name)) = (self.state.gpu.debug(), CString::new(name)) {
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: the command buffer is recording.
            unsafe { debug.cmd_begin_debug_utils_label(self.cmd, &label) };
        }
    }

    fn bind<P: Pod>(
        &mut self,
        pipeline: &Pipeline,
        bindings: &dyn BindingSet,
        push: &P,
        point: vk::PipelineBindPoint,
        extra: &[(u64, Access)],
    ) -> Result<()> {
        check_bindings(pipeline, bindings);
        let resources = bindings.resources();
        let mut uses = extra.to_vec();
        self.descriptor_uses(pipeline, &resources, &mut uses);
        let set = self.state.sets.get(&self.state.gpu, pipeline, &resources)?;
        self.transition(pipeline.desc.program.name, &uses);
        self.bind_set(pipeline, set, bytemuck::bytes_of(push), point);
        Ok(())
    }

    fn bind_set(&mut self, pipeline: &Pipeline, set: vk::DescriptorSet, push: &[u8], point: vk::PipelineBindPoint) {
        let program = pipeline.desc.program;
        let size = program.push_constant_size as usize;
        assert!(push.len() >= size, "{}: {} bytes of push constants, expected {size}", program.name, push.len());
        let device = self.state.gpu.device();
        // SAFETY: pipeline, layout and set belong together; the set's resources outlive the commands.
        unsafe {
            device.cmd_bind_pipeline(self.cmd, point, pipeline.handle);
            device.cmd_bind_descriptor_sets(self.cmd, point, pipeline.layout, 0, &[set], &[]);
            if size > 0 {
                device.cmd_push_constants(self.cmd, pipeline.layout, pipeline.stages, 0, &push[..size]);
            }
        }
    }

    fn log(&mut self, line: impl FnOnce() -> String) {
        if let Some(log) = &mut self.state.log {
            log.push(line());
        }
    }

    /// The error of a lost device, naming the last pass reached.
    pub fn device_lost(&self) -> Error {
        Error::DeviceLost { last_pass: self.state.last_pass(self.slot).to_owned() }
    }
}
