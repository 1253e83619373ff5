//! What is dropped while frames that may use it are in flight is destroyed when those have ended.

use super::Gpu;
use super::memory::Allocation;
use ash::vk;
use std::collections::{HashMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Handles that nobody will record again.
pub(crate) enum Garbage {
    Buffer(vk::Buffer, Option<Allocation>),
    Image(vk::Image, vk::ImageView, Option<Allocation>),
    Pipeline(vk::Pipeline, vk::PipelineLayout, vk::DescriptorSetLayout),
}

/// Garbage in the order of its retirement, and the frames that it waits for.
#[derive(Default)]
pub(crate) struct Retirement(Mutex<Queue>);

#[derive(Default)]
struct Queue {
    /// Number of frames begun so far.
    begun: u64,
    /// Number of the frame in each slot of each recorder state that has not ended, as far as is known.
    in_flight: HashMap<(u64, usize), u64>,
    /// With the number of frames begun before: none begun later can use it.
    garbage: VecDeque<(u64, Garbage)>,
}

impl Retirement {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Queue {
    /// What no frame in flight was begun early enough to use.
    fn take_free(&mut self) -> Vec<Garbage> {
        let oldest = self.in_flight.values().min().copied();
        let free = self.garbage.partition_point(|(begun, _)| oldest.is_none_or(|oldest| *begun < oldest));
        self.garbage.drain(..free).map(|(_, garbage)| garbage).collect()
    }
}

impl Gpu {
    /// Destroys `garbage` once the frames in flight have ended.
    pub(crate) fn retire(&self, garbage: Garbage) {
        let mut queue = self.retirement.lock();
        let begun = queue.begun;
        queue.garbage.push_back((begun, garbage));
        self.destroy(queue);
    }

    /// A frame begins in `slot` of recorder state `state`, where the last one has ended.
    pub(crate) fn begin_frame(&self, state: u64, slot: usize) {
        self.end_frame(state, slot);
        let mut queue = self.retirement.lock();
        queue.begun += 1;
        let begun = queue.begun;
        queue.in_flight.insert((state, slot), begun);
    }

    /// The frame in `slot` of `state` has ended, or will never be submitted.
    pub(crate) fn end_frame(&self, state: u64, slot: usize) {
        let mut queue = self.retirement.lock();
        queue.in_flight.remove(&(state, slot));
        self.destroy(queue);
    }

    /// Every frame of `state` has ended.
    pub(crate) fn end_frames(&self, state: u64) {
        let mut queue = self.retirement.lock();
        queue.in_flight.retain(|(of, _), _| *of != state);
        self.destroy(queue);
    }

    /// Every frame has ended: the last user of the device is gone.
    pub(crate) fn end_all_frames(&self) {
        let mut queue = self.retirement.lock();
        queue.in_flight.clear();
        self.destroy(queue);
    }

    fn destroy(&self, mut queue: MutexGuard<'_, Queue>) {
        let free = queue.take_free();
        drop(queue); // An allocator of the host's may do as it likes.
        for garbage in free {
            // SAFETY: made by this device; their owner has dropped them, and every frame begun before has ended. Null
            // handles are ignored.
            let allocation = unsafe {
                match garbage {
                    Garbage::Buffer(buffer, allocation) => {
                        self.device().destroy_buffer(buffer, None);
                        allocation
                    }
                    Garbage::Image(image, view, allocation) => {
                        self.device().destroy_image_view(view, None);
                        self.device().destroy_image(image, None);
                        allocation
                    }
                    Garbage::Pipeline(pipeline, layout, set_layout) => {
                        self.device().destroy_pipeline(pipeline, None);
                        self.device().destroy_pipeline_layout(layout, None);
                        self.device().destroy_descriptor_set_layout(set_layout, None);
                        None
                    }
                }
            };
            if let Some(allocation) = allocation {
                self.memory().free(allocation);
            }
        }
    }
}
