//! Which particles lie between a point and the sun: light-space tiles with linked lists, front to back along the light
//! (Yusov 5.3). One 64² grid of tiles for each ring of the particle grid.
//!
//! ```text
//! let tiling = Tiling::new(&gpu, levels, node_capacity, slots)?;
//! let params = TilingParams::new(to_sun, &Slab { .. }, sigma_t * fill * xi);
//! rec.pass("tiling", |rec| tiling.record(rec, &params, &set))?;
//! ```
//!
//! Insertion is by atomic exchange and therefore in arbitrary order; a merge sort on each list's links makes the lists a
//! function of the particles alone.

pub mod params;

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Gpu, Recorder};
use crate::grid::{Counters, ParticleSet};
use crate::shaders::{tiling_bin_comp as bin, tiling_order_comp as order};

pub use params::{Slab, TileNode, TilingParams};

/// Builds the lists.
pub struct Tiling {
    bin: ComputePipeline,
    order: ComputePipeline,
    params: Vec<Buffer>,
    heads: Buffer,
    nodes: Buffer,
    levels: u32,
    node_capacity: u32,
}

impl Tiling {
    /// Lists for `levels` grids of tiles and `node_capacity` nodes, with `slots` frames in flight.
    pub fn new(gpu: &Arc<Gpu>, levels: u32, node_capacity: u32, slots: usize) -> Result<Self> {
        let tiles = levels * params::TILE_DIM * params::TILE_DIM;
        let params = (0..slots)
            .map(|_| Buffer::new(gpu, "tiling params", size_of::<TilingParams>() as u64, BufferKind::Upload))
            .collect::<Result<_>>()?;
        Ok(Self {
            bin: ComputePipeline::new(gpu, &bin::PROGRAM, &[])?,
            order: ComputePipeline::new(gpu, &order::PROGRAM, &[])?,
            params,
            heads: Buffer::array::<u32>(gpu, "tile heads", tiles as usize)?,
            nodes: Buffer::array::<TileNode>(gpu, "tile nodes", node_capacity as usize)?,
            levels,
            node_capacity,
        })
    }

    /// This frame's parameters, for the stages that walk the lists.
    #[must_use]
    pub fn params(&self, slot: usize) -> &Buffer {
        &self.params[slot]
    }

    /// First node of every tile.
    #[must_use]
    pub fn heads(&self) -> &Buffer {
        &self.heads
    }

    /// All nodes.
    #[must_use]
    pub fn nodes(&self) -> &Buffer {
        &self.nodes
    }

    /// Nodes that fit.
    #[must_use]
    pub fn node_capacity(&self) -> u32 {
        self.node_capacity
    }

    /// Makes room for more nodes if the last frame wanted them; the device must be idle. True if it did.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        if counters.tile_nodes <= self.node_capacity {
            return Ok(false);
        }
        self.node_capacity = counters.tile_nodes.saturating_add(counters.tile_nodes / 4);
        self.nodes = Buffer::array::<TileNode>(gpu, "tile nodes", self.node_capacity as usize)?;
        Ok(true)
    }

    /// Records insertion and ordering of all stored particles.
    pub fn record(&self, rec: &mut Recorder<'_>, params: &TilingParams, set: &ParticleSet) -> Result<()> {
        assert!(params.level_count <= self.levels, "the tiling was made for fewer levels");
        let params = TilingParams { node_capacity: self.node_capacity, ..*params };
        let buffer = &self.params[rec.slot()];
        buffer.write(0, &[params]);
        rec.fill_buffer(&self.heads, 0, self.heads.size(), params::NO_NODE);
        rec.dispatch_indirect(
            &self.bin,
            &bin::Bindings {
                params: buffer,
                particles: set.particles(),
                counters: set.counters(),
                tile_heads: &self.heads,
                tile_nodes: &self.nodes,
            },
            &(),
            set.args(),
            ParticleSet::PARTICLE_ARGS,
        )?;
        rec.dispatch(
            &self.order,
            &order::Bindings { counters: set.counters(), tile_heads: &self.heads, tile_nodes: &self.nodes },
            &params.tile_count(),
            [params.tile_count(), 1, 1],
        )
    }
}
