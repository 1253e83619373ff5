//! Insertion ordered by fragment shader interlock: particles are sorted along the light, then each is rasterized over the
//! tiles that it covers, one pixel a tile (`glsl/tiling/insert.*`).

use std::sync::Arc;

use crate::Result;
use crate::compact::Sort;
use crate::gpu::{Buffer, ComputePipeline, Draw, Gpu, GraphicsPipeline, GraphicsState, Recorder};
use crate::grid::{Counters, ParticleSet};
use crate::shaders::{tiling_args_comp as args, tiling_insert_frag as insert, tiling_keys_comp as keys};

use super::params::{TILE_DIM, TilingParams};

/// Byte offsets in the arguments: the sort's dispatch, the draw.
const SORT_ARGS: u64 = 0;
const DRAW_ARGS: u64 = 16;

/// Sorts, then draws.
pub(super) struct Interlocked {
    keys_pipeline: ComputePipeline,
    args_pipeline: ComputePipeline,
    insert: GraphicsPipeline,
    sort: Sort,
    keys: Buffer,
    order: Buffer,
    args: Buffer,
    capacity: u32,
}

impl Interlocked {
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        Ok(Self {
            keys_pipeline: ComputePipeline::new(gpu, &keys::PROGRAM, &[])?,
            args_pipeline: ComputePipeline::new(gpu, &args::PROGRAM, &[])?,
            insert: GraphicsPipeline::new(gpu, &insert::PROGRAM, &[], GraphicsState::default())?,
            sort: Sort::new(gpu, capacity)?,
            keys: Buffer::array::<u32>(gpu, "light keys", capacity as usize)?,
            order: Buffer::array::<u32>(gpu, "light order", capacity as usize)?,
            args: Buffer::array::<[u32; 4]>(gpu, "tiling args", 2)?,
            capacity,
        })
    }

    /// Makes room for `capacity` particles. True if there was too little.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, capacity: u32) -> Result<bool> {
        if capacity <= self.capacity {
            return Ok(false);
        }
        *self = Self::new(gpu, capacity)?;
        Ok(true)
    }

    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        buffer: &Buffer,
        params: &TilingParams,
        set: &ParticleSet,
        counters: &Buffer,
        (tile_heads, tile_nodes): (&Buffer, &Buffer),
        occluders: &Buffer,
    ) -> Result<()> {
        assert!(set.capacity() <= self.capacity, "the particle set has grown: call grow() too");
        let bindings = args::Bindings { params: buffer, counters, tiling_args: &self.args };
        rec.dispatch(&self.args_pipeline, &bindings, &(), [1, 1, 1])?;
        rec.dispatch_indirect(
            &self.keys_pipeline,
            &keys::Bindings {
                params: buffer,
                particles: set.particles(),
                counters,
                keys: &self.keys,
                indices: &self.order,
                occluders,
            },
            &(),
            set.args(),
            ParticleSet::PARTICLE_ARGS,
        )?;
        self.sort.record(rec, (counters, Counters::STORED), (&self.args, SORT_ARGS), &self.keys, &self.order)?;
        rec.draw(
            &self.insert,
            &insert::Bindings {
                params: buffer,
                particles: set.particles(),
                light_order: &self.order,
                counters,
                tile_heads,
                tile_nodes,
            },
            &(),
            [TILE_DIM, TILE_DIM * params.level_count],
            &[],
            Draw::Indirect { args: &self.args, offset: DRAW_ARGS },
        )
    }
}
