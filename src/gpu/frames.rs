//! Frames in flight on one queue, paced by a timeline semaphore. For programs that have no frame loop of their own.

use super::{Gpu, Recorder, RecorderState};
use crate::{Error, Result};
use ash::vk;
use std::sync::Arc;

/// Command buffers that take turns, and the state that recording carries from frame to frame.
pub struct Frames {
    gpu: Arc<Gpu>,
    queue: vk::Queue,
    pool: vk::CommandPool,
    commands: Vec<vk::CommandBuffer>,
    timeline: vk::Semaphore,
    submitted: u64,
    state: RecorderState,
}

impl Frames {
    /// `slots` frames in flight on `queue`.
    ///
    /// # Safety
    /// `queue` belongs to the device and its family, and nobody else submits to it at the same time.
    pub unsafe fn new(gpu: &Arc<Gpu>, queue: vk::Queue, slots: usize) -> Result<Self> {
        let mut frames = Self {
            gpu: gpu.clone(),
            queue,
            pool: vk::CommandPool::null(),
            commands: Vec::new(),
            timeline: vk::Semaphore::null(),
            submitted: 0,
            state: RecorderState::new(gpu, slots)?,
        };
        let device = gpu.device();
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER)
            .queue_family_index(gpu.capabilities().queue_family);
        // SAFETY: the device is alive as long as `gpu`, here and below.
        frames.pool = unsafe { device.create_command_pool(&info, None) }
            .map_err(|result| gpu.error("vkCreateCommandPool", "frames", result))?;
        let info =
            vk::CommandBufferAllocateInfo::default().command_pool(frames.pool).command_buffer_count(slots as u32);
        // SAFETY: as above.
        frames.commands = unsafe { device.allocate_command_buffers(&info) }
            .map_err(|result| gpu.error("vkAllocateCommandBuffers", "frames", result))?;
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: as above.
        frames.timeline = unsafe { device.create_semaphore(&info, None) }
            .map_err(|result| gpu.error("vkCreateSemaphore", "frames", result))?;
        Ok(frames)
    }

    /// Number of frames in flight.
    pub fn slots(&self) -> usize {
        self.commands.len()
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// The state carried from frame to frame.
    pub fn state(&mut self) -> &mut RecorderState {
        &mut self.state
    }

    /// Waits until the next slot is free, records it with `record` and submits it; returns its slot. When
    /// recording or submission fails, nothing of the frame remains: what it recorded counts as never recorded.
    pub fn submit<T>(&mut self, record: impl FnOnce(&mut Recorder<'_>) -> Result<T>) -> Result<(usize, T)> {
        let slot = (self.submitted % self.commands.len() as u64) as usize;
        if self.submitted >= self.commands.len() as u64 {
            self.wait_for(self.submitted + 1 - self.commands.len() as u64)?;
        }
        let submitted = self.record_and_submit(slot, record);
        if submitted.is_err() {
            self.state.roll_back();
        }
        Ok((slot, submitted?))
    }

    fn record_and_submit<T>(&mut self, slot: usize, record: impl FnOnce(&mut Recorder<'_>) -> Result<T>) -> Result<T> {
        let cmd = self.commands[slot];
        let device = self.gpu.device().clone();
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        self.state.commit();
        // SAFETY: the last submission of this command buffer has ended.
        unsafe { device.begin_command_buffer(cmd, &begin) }
            .map_err(|result| self.gpu.error("vkBeginCommandBuffer", "frame", result))?;
        // SAFETY: `cmd` records; it is submitted below or rolled back; the slot's last frame has ended.
        let recorded = record(&mut unsafe { self.state.begin(cmd, slot) });
        // SAFETY: `cmd` is recording.
        let ended = unsafe { device.end_command_buffer(cmd) };
        let value = recorded?;
        ended.map_err(|result| self.gpu.error("vkEndCommandBuffer", "frame", result))?;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(cmd)];
        let signals = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.timeline)
            .value(self.submitted + 1)
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let submit = vk::SubmitInfo2::default().command_buffer_infos(&commands).signal_semaphore_infos(&signals);
        // SAFETY: the queue is used by nobody else at the same time (see `new`).
        unsafe { device.queue_submit2(self.queue, &[submit], vk::Fence::null()) }
            .map_err(|result| self.lost("vkQueueSubmit2", slot, result))?;
        self.submitted += 1;
        Ok(value)
    }

    /// Waits for everything submitted.
    pub fn wait(&mut self) -> Result<()> {
        self.wait_for(self.submitted)?;
        self.state.end_frames();
        Ok(())
    }

    /// Records, submits and waits.
    pub fn run<T>(&mut self, record: impl FnOnce(&mut Recorder<'_>) -> Result<T>) -> Result<T> {
        let (_, value) = self.submit(record)?;
        self.wait()?;
        Ok(value)
    }

    fn wait_for(&mut self, value: u64) -> Result<()> {
        let (semaphores, values) = ([self.timeline], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is alive.
        let waited = unsafe { self.gpu.device().wait_semaphores(&info, u64::MAX) };
        let slot = (value.max(1) - 1) as usize % self.commands.len();
        waited.map_err(|result| self.lost("vkWaitSemaphores", slot, result))
    }

    fn lost(&self, call: &'static str, slot: usize, result: vk::Result) -> Error {
        if result == vk::Result::ERROR_DEVICE_LOST {
            Error::DeviceLost { last_pass: self.state.last_pass(slot).to_owned() }
        } else {
            self.gpu.error(call, "frame", result)
        }
    }
}

impl Drop for Frames {
    fn drop(&mut self) {
        // SAFETY: waits for the queue, then destroys what was made by this device. Null handles are ignored.
        unsafe {
            let _ = self.gpu.device().queue_wait_idle(self.queue);
            self.gpu.device().destroy_semaphore(self.timeline, None);
            self.gpu.device().destroy_command_pool(self.pool, None);
        }
    }
}
