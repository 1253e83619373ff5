//! Stable radix sort of (key, index) pairs, ascending, eight passes of four bits (`glsl/compact/sort_*.comp`). No subgroup
//! size, no forward progress between work groups; the length is known to the device only.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::Result;
use crate::gpu::{Buffer, ComputePipeline, Gpu, Recorder};
use crate::shaders::{
    compact_scan_top_comp as top, compact_sort_count_comp as count_digits, compact_sort_scatter_comp as scatter,
};

use super::scan::{BLOCK, TopPush};

const DIGITS: u32 = 16;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PassPush {
    count_index: u32,
    shift: u32,
}

/// Sorts lists of up to `capacity` pairs.
pub struct Sort {
    count_digits: ComputePipeline,
    top: ComputePipeline,
    scatter: ComputePipeline,
    digits: Buffer,
    total: Buffer,
    keys: Buffer,
    indices: Buffer,
}

impl Sort {
    /// For lists of up to `capacity` pairs.
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        Ok(Self {
            count_digits: ComputePipeline::new(gpu, &count_digits::PROGRAM, &[])?,
            top: ComputePipeline::new(gpu, &top::PROGRAM, &[])?,
            scatter: ComputePipeline::new(gpu, &scatter::PROGRAM, &[])?,
            digits: Buffer::array::<u32>(gpu, "sort digits", (capacity.div_ceil(BLOCK).max(1) * DIGITS) as usize)?,
            total: Buffer::array::<u32>(gpu, "sort total", 1)?,
            keys: Buffer::array::<u32>(gpu, "sort keys", capacity as usize)?,
            indices: Buffer::array::<u32>(gpu, "sort indices", capacity as usize)?,
        })
    }

    /// Sorts `keys` with `indices` in place. `count`: buffer and word that hold the length; `args`: buffer and offset of a
    /// dispatch of one group for 1024 pairs.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        count: (&Buffer, u32),
        args: (&Buffer, u64),
        keys: &Buffer,
        indices: &Buffer,
    ) -> Result<()> {
        self.record_bits(rec, u32::BITS, count, args, keys, indices)
    }

    /// The same for keys of no more than `bits` bits, in fewer passes.
    pub fn record_bits(
        &self,
        rec: &mut Recorder<'_>,
        bits: u32,
        count: (&Buffer, u32),
        args: (&Buffer, u64),
        keys: &Buffer,
        indices: &Buffer,
    ) -> Result<()> {
        let (sort_count, count_index) = count;
        // An even number of passes, so the result ends where it began.
        for pass in 0..2 * bits.div_ceil(8) {
            let (keys_in, indices_in, keys_out, indices_out) = if pass % 2 == 0 {
                (keys, indices, &self.keys, &self.indices)
            } else {
                (&self.keys, &self.indices, keys, indices)
            };
            let push = PassPush { count_index, shift: 4 * pass };
            let bindings = count_digits::Bindings { sort_count, keys: keys_in, digits: &self.digits };
            rec.dispatch_indirect(&self.count_digits, &bindings, &push, args.0, args.1)?;
            rec.dispatch(
                &self.top,
                &top::Bindings { values: &self.digits, scan_total: &self.total, scan_count: sort_count },
                &TopPush { count_index, per: BLOCK, times: DIGITS },
                [64, 1, 1],
            )?;
            let bindings =
                scatter::Bindings { sort_count, keys_in, indices_in, digits: &self.digits, keys_out, indices_out };
            rec.dispatch_indirect(&self.scatter, &bindings, &push, args.0, args.1)?;
        }
        Ok(())
    }
}
