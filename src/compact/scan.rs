//! Exclusive prefix sum in three dispatches: block sums, their scan, and the blocks on top (`glsl/compact/scan_*.comp`).

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::Result;
use crate::gpu::{Buffer, ComputePipeline, Gpu, Recorder};
use crate::shaders::{
    compact_scan_apply_comp as apply, compact_scan_reduce_comp as reduce, compact_scan_top_comp as top,
};

/// Numbers that one work group sums.
pub(super) const BLOCK: u32 = 1024;

/// Push constants of `scan_top.comp`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct TopPush {
    /// Word that holds the length, or the length itself with the top bit set.
    pub count_index: u32,
    /// Items to a unit of length.
    pub per: u32,
    /// Numbers to a unit.
    pub times: u32,
}

/// Exclusive prefix sums of lists of up to `capacity` numbers.
pub struct Scan {
    reduce: ComputePipeline,
    top: ComputePipeline,
    apply: ComputePipeline,
    block_sums: Buffer,
    capacity: u32,
}

impl Scan {
    /// For lists of up to `capacity` numbers.
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        Ok(Self {
            reduce: ComputePipeline::new(gpu, &reduce::PROGRAM, &[])?,
            top: ComputePipeline::new(gpu, &top::PROGRAM, &[])?,
            apply: ComputePipeline::new(gpu, &apply::PROGRAM, &[])?,
            block_sums: Buffer::array::<u32>(gpu, "scan block sums", capacity.div_ceil(BLOCK) as usize)?,
            capacity,
        })
    }

    /// `scanned[i]` = sum of `values[..i]`; `total[0]` = sum of all `count`.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        values: &Buffer,
        count: u32,
        scanned: &Buffer,
        total: &Buffer,
    ) -> Result<()> {
        assert!(count <= self.capacity, "the scan was made for fewer numbers");
        let blocks = count.div_ceil(BLOCK);
        let groups = [blocks * 64, 1, 1]; // work groups of 64 threads
        rec.dispatch(&self.reduce, &reduce::Bindings { values, block_sums: &self.block_sums }, &count, groups)?;
        rec.dispatch(
            &self.top,
            &top::Bindings { values: &self.block_sums, scan_total: total, scan_count: values },
            &TopPush { count_index: blocks | 1 << 31, per: 1, times: 1 },
            [64, 1, 1],
        )?;
        rec.dispatch(&self.apply, &apply::Bindings { values, block_sums: &self.block_sums, scanned }, &count, groups)
    }
}
