//! What recording carries from frame to frame.

use super::Recorder;
use super::descriptors::DescriptorSets;
use super::journal::Tracked;
use crate::Result;
use crate::gpu::feedback::Framebuffers;
use crate::gpu::id::next_id;
use crate::gpu::timing::Timer;
use crate::gpu::{Gpu, PassTime};
use ash::vk;
use std::sync::Arc;

/// What has to be remembered between frames: the last access of each resource, descriptor sets, timers.
pub struct RecorderState {
    pub(super) gpu: Arc<Gpu>,
    pub(super) tracked: Tracked,
    pub(super) sets: DescriptorSets,
    pub(super) framebuffers: Framebuffers,
    pub(super) timers: Vec<Timer>,
    id: u64,
    slot: usize,
    pub(super) log: Option<Vec<String>>,
}

impl RecorderState {
    /// State for `slots` frames in flight. A host keeps one for all renderers that record into its command buffers: two
    /// states know nothing of each other's accesses.
    pub fn new(gpu: &Arc<Gpu>, slots: usize) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            tracked: Tracked::default(),
            sets: DescriptorSets::default(),
            framebuffers: Framebuffers::default(),
            timers: (0..slots).map(|_| Timer::new(gpu)).collect::<Result<_>>()?,
            id: next_id(),
            slot: 0,
            log: None,
        })
    }

    /// Starts recording frame slot `slot` into `cmd`, which may already hold commands of the host's; the host goes on with
    /// it when the [`Recorder`] is gone. State that the recording changes: bound pipelines and descriptor sets of both bind
    /// points, push constants, viewport and scissor.
    ///
    /// What is recorded counts as submitted. A host that drops the command buffer instead says so by
    /// [`roll_back`](Self::roll_back) before it begins another.
    ///
    /// # Safety
    /// - `cmd` is a primary command buffer in the recording state, outside a render pass, with no query active, and is
    ///   submitted, once, to a queue of the device's family before what this state records later, unless it is
    ///   [rolled back](Self::roll_back).
    /// - The last frame of this slot has ended on the device.
    /// - Lent images that are recorded, and this state, stay alive until the frame has ended on the device. Buffers, images
    ///   and pipelines of Welkin's may be dropped any time: they are kept until the frame's slot is begun again.
    ///
    /// # Panics
    /// If there is no such slot.
    pub unsafe fn begin(&mut self, cmd: vk::CommandBuffer, slot: usize) -> Recorder<'_> {
        self.tracked.begin();
        self.slot = slot;
        self.gpu.begin_frame(self.id, slot);
        self.timers[slot].reset(cmd);
        Recorder { state: self, cmd, slot, pass: "" }
    }

    /// Every frame recorded so far has ended.
    pub(crate) fn end_frames(&mut self) {
        self.gpu.end_frames(self.id);
    }

    /// What was recorded so far stays, whatever becomes of the next recording.
    pub(crate) fn commit(&mut self) {
        self.tracked.begin();
    }

    /// Takes back what was recorded since the last [`begin`](Self::begin): its command buffer is not submitted. Layouts,
    /// accesses and what is [recorded once](Recorder::once) are again as the device has them.
    pub fn roll_back(&mut self) {
        self.tracked.roll_back();
        self.gpu.end_frame(self.id, self.slot);
        if let Some(timer) = self.timers.get_mut(self.slot) {
            timer.clear();
        }
    }

    /// Time of each pass of the last frame in `slot`, which must have ended; empty without timestamps.
    pub fn times(&self, slot: usize) -> Vec<PassTime> {
        self.timers[slot].read()
    }

    /// The last pass that the device had begun in `slot`: where to look when the device was lost.
    pub fn last_pass(&self, slot: usize) -> &'static str {
        self.timers[slot].last_pass()
    }

    /// Forgets descriptor sets and states, after resources have been replaced or lent images have gone. The device must
    /// be done with every frame recorded so far.
    pub fn forget(&mut self) {
        self.end_frames();
        self.sets.clear(&self.gpu);
        self.tracked.forget_accesses();
        self.framebuffers.clear(&self.gpu);
    }

    /// From now on keeps a line of text for each command and each barrier, for tests and for people.
    pub fn start_log(&mut self) {
        self.log = Some(Vec::new());
    }

    /// What [`start_log`](Self::start_log) has collected.
    pub fn take_log(&mut self) -> Vec<String> {
        self.log.take().unwrap_or_default()
    }
}

impl Drop for RecorderState {
    fn drop(&mut self) {
        self.forget();
    }
}
