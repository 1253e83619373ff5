//! Which particles lie between a point and the sun: light-space tiles with linked lists, front to back along the light
//! (Yusov 5.3). One 64² grid of tiles for each ring of the particle grid.
//!
//! ```text
//! let tiling = Tiling::new(&gpu, levels, set.capacity(), node_capacity, slots)?;
//! let params = TilingParams::new(to_sun, &Slab { .. }, sigma_t * fill * xi);
//! rec.pass("tiling", |rec| tiling.record(rec, &params, &set))?;
//! ```
//!
//! Two ways to the same lists ([`ListOrder`]): sorted particles rasterized under fragment shader interlock, or insertion by
//! atomic exchange in arbitrary order and a merge sort of each list's links. Either way the lists are a function of the
//! particles alone. Nodes hold what the particle covers of the tile, [`Occluder`]s what a walk needs of a particle.

mod interlock;
pub mod params;

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Feature, Gpu, Recorder};
use crate::grid::{Counters, ParticleSet};
use crate::lists::grown;
use crate::shaders::{tiling_bin_comp as bin, tiling_order_comp as order_lists};

use interlock::Interlocked;

pub use params::{Occluder, Slab, TileNode, TilingParams};

/// Nodes to begin with, per particle that fits.
pub(crate) const NODES_PER_PARTICLE: u32 = 7;

/// How the lists come to be in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListOrder {
    /// Particles are sorted along the light and rasterized over the tiles, farthest from it first; fragment shader
    /// interlock keeps that order within each tile.
    Interlock,
    /// Particles are inserted in any order by atomic exchange, then each list is sorted.
    Sort,
}

#[allow(clippy::large_enum_variant)] // A renderer has one.
enum Insertion {
    Interlock(Box<Interlocked>),
    Sort { bin: ComputePipeline, order: ComputePipeline },
}

/// Builds the lists.
pub struct Tiling {
    insertion: Insertion,
    params: Vec<Buffer>,
    heads: Buffer,
    nodes: Buffer,
    occluders: Buffer,
    particles: u32,
    levels: u32,
    node_capacity: u32,
}

impl Tiling {
    /// Lists for `levels` grids of tiles, `particles` particles and `node_capacity` nodes, with `slots` frames in flight;
    /// ordered by interlock on hardware that has it. A software rasterizer pays for every tiny quad: measured on lavapipe,
    /// the sort takes a fifth of the time.
    pub fn new(gpu: &Arc<Gpu>, levels: u32, particles: u32, node_capacity: u32, slots: usize) -> Result<Self> {
        let interlock = gpu.capabilities().supports(Feature::FragmentShaderInterlock).is_ok();
        let hardware = gpu.capabilities().device_type != "cpu";
        let order = if interlock && hardware { ListOrder::Interlock } else { ListOrder::Sort };
        Self::with_order(gpu, levels, particles, node_capacity, slots, order)
    }

    /// The same with a choice of how lists are ordered.
    pub fn with_order(
        gpu: &Arc<Gpu>,
        levels: u32,
        particles: u32,
        node_capacity: u32,
        slots: usize,
        order: ListOrder,
    ) -> Result<Self> {
        let tiles = levels * params::TILE_DIM * params::TILE_DIM;
        let params = (0..slots)
            .map(|_| Buffer::new(gpu, "tiling params", size_of::<TilingParams>() as u64, BufferKind::Upload))
            .collect::<Result<_>>()?;
        let insertion = match order {
            ListOrder::Interlock => Insertion::Interlock(Box::new(Interlocked::new(gpu, particles)?)),
            ListOrder::Sort => Insertion::Sort {
                bin: ComputePipeline::new(gpu, &bin::PROGRAM, &[])?,
                order: ComputePipeline::new(gpu, &order_lists::PROGRAM, &[])?,
            },
        };
        Ok(Self {
            insertion,
            params,
            heads: Buffer::array::<u32>(gpu, "tile heads", tiles as usize)?,
            nodes: Buffer::array::<TileNode>(gpu, "tile nodes", node_capacity as usize)?,
            occluders: Buffer::array::<Occluder>(gpu, "occluders", particles as usize)?,
            particles,
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

    /// What the light meets of every stored particle ([`Occluder`]).
    #[must_use]
    pub fn occluders(&self) -> &Buffer {
        &self.occluders
    }

    /// Nodes that fit.
    #[must_use]
    pub fn node_capacity(&self) -> u32 {
        self.node_capacity
    }

    /// Makes room for more nodes and more particles if the last frame wanted them; the device must be idle. True if it
    /// did.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters, set: &ParticleSet) -> Result<bool> {
        let mut grew = set.capacity() > self.particles;
        if grew {
            self.particles = set.capacity();
            self.occluders = Buffer::array::<Occluder>(gpu, "occluders", self.particles as usize)?;
        }
        if let Insertion::Interlock(interlocked) = &mut self.insertion {
            grew |= interlocked.grow(gpu, set.capacity())?;
        }
        if counters.tile_nodes > self.node_capacity {
            self.node_capacity = grown(counters.tile_nodes);
            self.nodes = Buffer::array::<TileNode>(gpu, "tile nodes", self.node_capacity as usize)?;
            grew = true;
        }
        Ok(grew)
    }

    /// Records insertion and ordering of all stored particles.
    pub fn record(&self, rec: &mut Recorder<'_>, params: &TilingParams, set: &ParticleSet) -> Result<()> {
        self.record_at(rec, rec.slot(), params, set, set.counters())
    }

    /// The same with the parameters of `slot`, any of those it was made for, and [`Counters`] that count its nodes.
    pub(crate) fn record_at(
        &self,
        rec: &mut Recorder<'_>,
        slot: usize,
        params: &TilingParams,
        set: &ParticleSet,
        counters: &Buffer,
    ) -> Result<()> {
        assert!(params.level_count <= self.levels, "the tiling was made for fewer levels");
        assert!(set.capacity() <= self.particles, "the particle set has grown: call grow() too");
        let params = TilingParams { node_capacity: self.node_capacity, ..*params };
        let buffer = &self.params[slot];
        buffer.write(0, &[params]);
        rec.fill_buffer(&self.heads, 0, self.heads.size(), params::NO_NODE);
        match &self.insertion {
            Insertion::Interlock(interlocked) => {
                interlocked.record(rec, buffer, &params, set, counters, (&self.heads, &self.nodes), &self.occluders)
            }
            Insertion::Sort { bin, order } => {
                rec.dispatch_indirect(
                    bin,
                    &bin::Bindings {
                        params: buffer,
                        particles: set.particles(),
                        counters,
                        tile_heads: &self.heads,
                        tile_nodes: &self.nodes,
                        occluders: &self.occluders,
                    },
                    &(),
                    set.args(),
                    ParticleSet::PARTICLE_ARGS,
                )?;
                rec.dispatch(
                    order,
                    &order_lists::Bindings { tile_heads: &self.heads, tile_nodes: &self.nodes },
                    &params.tile_count(),
                    [params.tile_count(), 1, 1],
                )
            }
        }
    }
}
