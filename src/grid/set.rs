//! The list of particles that every later stage reads, and the counts of a frame.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::Result;
use crate::gpu::{Buffer, BufferKind, Gpu, Recorder};
use crate::lists::grown;
use crate::shared::{Particle, assert_layout};

/// Counts of one frame (`glsl/grid/counters.glsl`). A list counts what it was asked to hold, also past its capacity.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Counters {
    /// Cells classified.
    pub cells: u32,
    /// Cells that hold cloud.
    pub valid_cells: u32,
    /// Particles wanted.
    pub generated: u32,
    /// Particles that fit.
    pub stored: u32,
    /// Particles in the view frustum.
    pub visible: u32,
    /// Light list nodes wanted.
    pub tile_nodes: u32,
    /// Light list nodes that one receiver visited, at most.
    pub longest_walk: u32,
    /// Receivers whose walk through a light list hit the traversal limit.
    pub truncated: u32,
    /// List nodes that the blend mode wanted at one time: segments, or pairs of particle and tile.
    pub blend_nodes: u32,
}

assert_layout!(Counters, counters, {
    cells: CELLS, valid_cells: VALID_CELLS, generated: GENERATED, stored: STORED, visible: VISIBLE,
    tile_nodes: TILE_NODES, longest_walk: LONGEST_WALK, truncated: TRUNCATED,
    blend_nodes: BLEND_NODES,
});

impl Counters {
    /// Word of [`Counters::stored`] in the buffer.
    pub const STORED: u32 = 3;
    /// Word of [`Counters::visible`] in the buffer.
    pub const VISIBLE: u32 = 4;
    /// Word of [`Counters::tile_nodes`] in the buffer.
    pub const TILE_NODES: u32 = 5;
}

/// Particles, their cells, their counts and the arguments of dispatches over them.
pub struct ParticleSet {
    particles: Buffer,
    cells: Buffer,
    counters: Buffer,
    args: Buffer,
    capacity: u32,
}

impl ParticleSet {
    /// Room for `capacity` particles.
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        let capacity = capacity.max(1);
        let count = capacity as usize;
        Ok(Self {
            particles: Buffer::array::<Particle>(gpu, "particles", count)?,
            cells: Buffer::array::<u32>(gpu, "particle cells", count)?,
            counters: Buffer::array::<Counters>(gpu, "counters", 1)?,
            args: Buffer::array::<[u32; 4]>(gpu, "particle args", 2)?,
            capacity,
        })
    }

    /// Byte offset, in [`ParticleSet::args`], of the dispatch over all stored particles, 64 to a group.
    pub const PARTICLE_ARGS: u64 = 16;

    /// The particles ([`Particle`]).
    #[must_use]
    pub fn particles(&self) -> &Buffer {
        &self.particles
    }

    /// `cell << 5 | layer` of each particle; `u32::MAX` for explicit ones.
    #[must_use]
    pub fn cells(&self) -> &Buffer {
        &self.cells
    }

    /// The frame's [`Counters`].
    #[must_use]
    pub fn counters(&self) -> &Buffer {
        &self.counters
    }

    /// Indirect dispatches: over valid cells, then over particles.
    #[must_use]
    pub fn args(&self) -> &Buffer {
        &self.args
    }

    /// Particles that fit.
    #[must_use]
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Zeroes the counters: first thing in a frame.
    pub fn clear_counters(&self, rec: &mut Recorder<'_>) {
        rec.fill_buffer(&self.counters, 0, size_of::<Counters>() as u64, 0);
    }

    /// Makes the list longer if the last frame wanted more particles; the device must be idle. True if it did.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        if counters.generated <= self.capacity {
            return Ok(false);
        }
        *self = Self::new(gpu, grown(counters.generated))?;
        Ok(true)
    }
}

/// Copies a frame's counters to the host.
pub struct CounterReadback {
    slots: Vec<Buffer>,
}

impl CounterReadback {
    /// For `slots` frames in flight.
    pub fn new(gpu: &Arc<Gpu>, slots: usize) -> Result<Self> {
        let slots = (0..slots)
            .map(|_| Buffer::new(gpu, "counters readback", size_of::<Counters>() as u64, BufferKind::Readback))
            .collect::<Result<_>>()?;
        Ok(Self { slots })
    }

    /// Records the copy, at the end of a frame.
    pub fn record(&self, rec: &mut Recorder<'_>, set: &ParticleSet) {
        let readback = &self.slots[rec.slot()];
        rec.copy_buffer(set.counters(), readback, size_of::<Counters>() as u64);
        rec.make_visible_to_host(readback);
    }

    /// The counters of the last frame of `slot`, which must have ended on the device.
    #[must_use]
    pub fn read(&self, slot: usize) -> Counters {
        self.slots[slot].read(0, 1)[0]
    }
}
