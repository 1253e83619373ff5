//! Timestamps around passes, and a trail of passes reached for when a device is lost.

use super::{Buffer, BufferKind, Feature, Gpu};
use crate::Result;
use ash::vk;
use std::sync::Arc;

/// Most passes that one frame may have.
const MAX_PASSES: usize = 256;

/// Time that the device spent in one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTime {
    /// Name of the pass.
    pub name: &'static str,
    /// From the start of its first command to the end of its last [ms].
    pub gpu_ms: f64,
}

/// Timestamps and trail of one frame slot.
pub(crate) struct Timer {
    gpu: Arc<Gpu>,
    pool: Option<vk::QueryPool>,
    trail: Buffer,
    names: Vec<&'static str>,
}

impl Timer {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let mut timer = Self {
            gpu: gpu.clone(),
            pool: None,
            trail: Buffer::new(gpu, "pass trail", (MAX_PASSES * 4) as u64, BufferKind::Readback)?,
            names: Vec::new(),
        };
        if gpu.capabilities().supports(Feature::Timestamps).is_ok() {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(2 * MAX_PASSES as u32);
            // SAFETY: the device is alive as long as `gpu`.
            let pool = unsafe { gpu.device().create_query_pool(&info, None) }
                .map_err(|result| gpu.error("vkCreateQueryPool", "pass timestamps", result))?;
            timer.pool = Some(pool);
        }
        Ok(timer)
    }

    /// Forgets the last frame of this slot, which must have ended.
    pub(crate) fn reset(&mut self, cmd: vk::CommandBuffer) {
        self.names.clear();
        self.trail.write(0, &[0u32; MAX_PASSES]);
        if let Some(pool) = self.pool {
            // SAFETY: the command buffer is recording, outside a render pass; the pool's last use has ended.
            unsafe { self.gpu.device().cmd_reset_query_pool(cmd, pool, 0, 2 * MAX_PASSES as u32) };
        }
    }

    /// Marks the start of a pass; the returned index goes to [`end`](Self::end).
    pub(crate) fn begin(&mut self, cmd: vk::CommandBuffer, name: &'static str) -> usize {
        let index = self.names.len();
        if index >= MAX_PASSES {
            return index; // More passes than slots go untimed.
        }
        self.names.push(name);
        // SAFETY: the command buffer is recording, outside a render pass. Each pass has its own word of the trail, so
        // these writes are never ordered against each other; the host reads them only after the frame has ended.
        unsafe { self.gpu.device().cmd_fill_buffer(cmd, self.trail.handle(), 4 * index as u64, 4, 1) };
        self.write(cmd, 2 * index, vk::PipelineStageFlags2::ALL_COMMANDS);
        index
    }

    pub(crate) fn end(&self, cmd: vk::CommandBuffer, index: usize) {
        if index < MAX_PASSES {
            self.write(cmd, 2 * index + 1, vk::PipelineStageFlags2::ALL_COMMANDS);
        }
    }

    fn write(&self, cmd: vk::CommandBuffer, query: usize, stage: vk::PipelineStageFlags2) {
        if let Some(pool) = self.pool {
            // SAFETY: the query was reset at the start of the frame and is written once.
            unsafe { self.gpu.device().cmd_write_timestamp2(cmd, stage, pool, query as u32) };
        }
    }

    /// The frame is not submitted: there is nothing to read.
    pub(crate) fn clear(&mut self) {
        self.names.clear();
    }

    /// Times of the frame that has ended, passes of one name added up, in order of first appearance.
    pub(crate) fn read(&self) -> Vec<PassTime> {
        let Some(pool) = self.pool else { return Vec::new() };
        if self.names.is_empty() {
            return Vec::new();
        }
        let mut ticks = vec![0u64; 2 * self.names.len()];
        // SAFETY: as many queries as elements are read.
        let read =
            unsafe { self.gpu.device().get_query_pool_results(pool, 0, &mut ticks, vk::QueryResultFlags::TYPE_64) };
        if read.is_err() {
            return Vec::new();
        }
        let milliseconds = f64::from(self.gpu.capabilities().timestamp_period) * 1e-6;
        let mut times: Vec<PassTime> = Vec::new();
        for (name, pair) in self.names.iter().zip(ticks.chunks_exact(2)) {
            let gpu_ms = pair[1].saturating_sub(pair[0]) as f64 * milliseconds;
            match times.iter_mut().find(|time| time.name == *name) {
                Some(time) => time.gpu_ms += gpu_ms,
                None => times.push(PassTime { name, gpu_ms }),
            }
        }
        times
    }

    /// The last pass that the device had begun.
    pub(crate) fn last_pass(&self) -> &'static str {
        let reached: Vec<u32> = self.trail.read(0, MAX_PASSES);
        let last = reached.iter().zip(&self.names).rev().find(|(flag, _)| **flag != 0);
        last.map_or("none", |(_, name)| name)
    }
}

impl Drop for Timer {
    fn drop(&mut self) {
        if let Some(pool) = self.pool.take() {
            // SAFETY: made by this device; the owner has made sure that the device is done with it.
            unsafe { self.gpu.device().destroy_query_pool(pool, None) };
        }
    }
}
