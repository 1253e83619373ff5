//! From the list of all particles to the visible ones, back to front, with an indirect draw.
//!
//! Visibility flags → prefix sum → order-preserving scatter → stable radix sort by distance. Equal distances keep the
//! list's order, so the draw order is a function of the particles alone: bit-equal on every run.
//!
//! ```text
//! let compact = Compact::new(&gpu, set.capacity())?;
//! rec.pass("compact", |rec| compact.record(rec, &set, &frustum_planes(&frame), frame.camera))?;
//! // draw: compact.args() at Compact::DRAW_ARGS, instance i is particle compact.order()[i]
//! ```

mod scan;
mod sort;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::Result;
use crate::gpu::{Buffer, ComputePipeline, Gpu, Recorder};
use crate::grid::{Counters, ParticleSet};
use crate::shaders::{compact_args_comp as args, compact_scatter_comp as scatter, compact_visible_comp as visible};
use crate::shared::FrameParams;

pub use scan::Scan;
pub use sort::Sort;

/// Vertices that a particle's instance has: the quad around its silhouette as a triangle strip.
pub const VERTICES_PER_PARTICLE: u32 = 4;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct VisiblePush {
    plane: [[f32; 4]; 5],
    capacity: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ScatterPush {
    camera: [f32; 3],
    capacity: u32,
}

/// The view frustum: left, right, bottom, top, and the plane through the eye; (n, d) with n·x + d ≥ 0 inside.
#[must_use]
pub fn frustum_planes(frame: &FrameParams) -> [[f32; 4]; 5] {
    let tan_y = frame.tan_half_fov_y;
    let tan_x = tan_y * frame.aspect;
    // A side plane holds the eye, the side's edge direction and one axis of the image.
    let side = |axis: [f32; 3], tangent: f32| {
        let n: [f32; 3] = std::array::from_fn(|i| axis[i] + tangent * frame.forward[i]);
        let length = n.iter().map(|c| c * c).sum::<f32>().sqrt();
        n.map(|c| c / length)
    };
    let minus = |v: [f32; 3]| v.map(|c| -c);
    [
        side(frame.right, tan_x),
        side(minus(frame.right), tan_x),
        side(frame.up, tan_y),
        side(minus(frame.up), tan_y),
        frame.forward,
    ]
    .map(|n| [n[0], n[1], n[2], -(0..3).map(|i| n[i] * frame.camera[i]).sum::<f32>()])
}

/// Finds, packs and sorts the visible particles.
pub struct Compact {
    visible: ComputePipeline,
    scatter: ComputePipeline,
    args_pipeline: ComputePipeline,
    scan: Scan,
    sort: Sort,
    flags: Buffer,
    slots: Buffer,
    total: Buffer,
    keys: Buffer,
    order: Buffer,
    args: Buffer,
    capacity: u32,
}

impl Compact {
    /// Byte offset in [`Compact::args`] of the dispatch over visible particles, 64 to a group.
    pub const VISIBLE_ARGS: u64 = 0;
    /// Byte offset in [`Compact::args`] of the dispatch over blocks of 1024 visible particles.
    pub const SORT_ARGS: u64 = 16;
    /// Byte offset in [`Compact::args`] of the `VkDrawIndirectCommand`: one instance a particle.
    pub const DRAW_ARGS: u64 = 32;

    /// For lists of `capacity` particles.
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        let count = capacity as usize;
        Ok(Self {
            visible: ComputePipeline::new(gpu, &visible::PROGRAM, &[])?,
            scatter: ComputePipeline::new(gpu, &scatter::PROGRAM, &[])?,
            args_pipeline: ComputePipeline::new(gpu, &args::PROGRAM, &[])?,
            scan: Scan::new(gpu, capacity)?,
            sort: Sort::new(gpu, capacity)?,
            flags: Buffer::array::<u32>(gpu, "visible flags", count)?,
            slots: Buffer::array::<u32>(gpu, "visible slots", count)?,
            total: Buffer::array::<u32>(gpu, "visible total", 1)?,
            keys: Buffer::array::<u32>(gpu, "distance keys", count)?,
            order: Buffer::array::<u32>(gpu, "draw order", count)?,
            args: Buffer::array::<[u32; 4]>(gpu, "visible args", 3)?,
            capacity,
        })
    }

    /// Indices of the visible particles, farthest first.
    #[must_use]
    pub fn order(&self) -> &Buffer {
        &self.order
    }

    /// Indirect arguments; see the constants.
    #[must_use]
    pub fn args(&self) -> &Buffer {
        &self.args
    }

    /// Follows a [`ParticleSet`] that has grown; the device must be idle. True if it did.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, set: &ParticleSet) -> Result<bool> {
        if set.capacity() <= self.capacity {
            return Ok(false);
        }
        *self = Self::new(gpu, set.capacity())?;
        Ok(true)
    }

    /// Records everything; afterwards `counters.visible`, [`Compact::order`] and [`Compact::args`] are valid.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        set: &ParticleSet,
        planes: &[[f32; 4]; 5],
        camera: [f32; 3],
    ) -> Result<()> {
        let capacity = set.capacity();
        assert!(capacity <= self.capacity, "the particle set has grown: call grow() too");
        let threads = [capacity, 1, 1];
        rec.dispatch(
            &self.visible,
            &visible::Bindings { counters: set.counters(), particles: set.particles(), flags: &self.flags },
            &VisiblePush { plane: *planes, capacity },
            threads,
        )?;
        self.scan.record(rec, &self.flags, capacity, &self.slots, &self.total)?;
        rec.dispatch(
            &self.args_pipeline,
            &args::Bindings { scan_total: &self.total, counters: set.counters(), visible_args: &self.args },
            &VERTICES_PER_PARTICLE,
            [1, 1, 1],
        )?;
        rec.dispatch(
            &self.scatter,
            &scatter::Bindings {
                particles: set.particles(),
                flags: &self.flags,
                slots: &self.slots,
                keys: &self.keys,
                indices: &self.order,
            },
            &ScatterPush { camera, capacity },
            threads,
        )?;
        let count = (set.counters(), Counters::VISIBLE);
        self.sort.record(rec, count, (&self.args, Self::SORT_ARGS), &self.keys, &self.order)
    }
}
