//! Particles from a procedural layer of cumulus, in nested rings of cells around the camera (Yusov 5.2), or from a list.
//!
//! ```text
//! let design = GridDesign::new(&clouds, &quality, planet_radius);
//! let mut grid = Grid::new(&gpu, &design, &clouds.coverage, slots)?;
//! let mut set = ParticleSet::new(&gpu, design.particle_estimate())?;   // or ParticleList::new(...)
//! rec.pass("grid", |rec| grid.record(rec, &params, &set))?;            // params = design.frame(camera, origin, ...)
//! ```
//!
//! The list of valid cells is appended to in arbitrary order, but a particle's slot comes from a prefix sum over cells:
//! equal parameters give bit-equal particles. Cells are anchored to the world and their seeds are absolute lattice
//! indices, so nothing moves with the camera.

mod list;
pub mod params;
mod set;

use std::sync::Arc;

use crate::Result;
use crate::compact::Scan;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Gpu, Recorder};
use crate::lists::grown;
use crate::params::Coverage;
use crate::shaders::{grid_args_comp as args, grid_classify_comp as classify, grid_emit_comp as emit};

pub use list::ParticleList;
pub use params::{GridDesign, GridParams};
pub use set::{CounterReadback, Counters, ParticleSet};

/// Byte offset, in [`Grid::args`], of the dispatch over valid cells.
const EMIT_ARGS: u64 = 0;

/// Classifies cells and emits their particles.
pub struct Grid {
    classify: ComputePipeline,
    args: ComputePipeline,
    emit: ComputePipeline,
    scan: Scan,
    params: Vec<Buffer>,
    coverage_map: Buffer,
    cell_particles: Buffer,
    cell_shapes: Buffer,
    cell_first: Buffer,
    valid_cells: Buffer,
    scan_total: Buffer,
    cell_count: u32,
    valid_cell_capacity: u32,
}

impl Grid {
    /// Pipelines and lists for the grid of `design`, with `slots` frames in flight.
    pub fn new(gpu: &Arc<Gpu>, design: &GridDesign, coverage: &Coverage, slots: usize) -> Result<Self> {
        let cells = design.cell_count();
        let capacity = design.valid_cell_estimate();
        let texels: &[f32] = match coverage {
            Coverage::Uniform(_) => &[0.0],
            Coverage::Map(map) => &map.values,
        };
        let params = (0..slots)
            .map(|_| Buffer::new(gpu, "grid params", size_of::<GridParams>() as u64, BufferKind::Upload))
            .collect::<Result<_>>()?;
        Ok(Self {
            classify: ComputePipeline::new(gpu, &classify::PROGRAM, &[])?,
            args: ComputePipeline::new(gpu, &args::PROGRAM, &[])?,
            emit: ComputePipeline::new(gpu, &emit::PROGRAM, &[])?,
            scan: Scan::new(gpu, cells)?,
            params,
            coverage_map: Buffer::upload(gpu, "coverage map", texels)?,
            cell_particles: Buffer::array::<u32>(gpu, "cell particles", cells as usize)?,
            cell_shapes: Buffer::array::<[f32; 4]>(gpu, "cell shapes", cells as usize)?,
            cell_first: Buffer::array::<u32>(gpu, "cell first", cells as usize)?,
            valid_cells: Buffer::array::<u32>(gpu, "valid cells", capacity as usize)?,
            scan_total: Buffer::array::<u32>(gpu, "grid total", 1)?,
            cell_count: cells,
            valid_cell_capacity: capacity,
        })
    }

    /// Cells that the list of valid ones holds.
    #[must_use]
    pub fn valid_cell_capacity(&self) -> u32 {
        self.valid_cell_capacity
    }

    /// This frame's parameters, for the stages that read the grid too.
    #[must_use]
    pub fn params(&self, slot: usize) -> &Buffer {
        &self.params[slot]
    }

    /// Height, body, weight and counts (layers + 64 · puffs) of every cell.
    #[must_use]
    pub fn cell_shapes(&self) -> &Buffer {
        &self.cell_shapes
    }

    /// First particle of every cell.
    #[must_use]
    pub fn cell_first(&self) -> &Buffer {
        &self.cell_first
    }

    /// Makes the list of valid cells longer if the last frame wanted more; the device must be idle. True if it did.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        if counters.valid_cells <= self.valid_cell_capacity {
            return Ok(false);
        }
        self.valid_cell_capacity = grown(counters.valid_cells).min(self.cell_count);
        self.valid_cells = Buffer::array::<u32>(gpu, "valid cells", self.valid_cell_capacity as usize)?;
        Ok(true)
    }

    /// Records classification, prefix sum and emission into `set`, whose counters are cleared first.
    pub fn record(&self, rec: &mut Recorder<'_>, params: &GridParams, set: &ParticleSet) -> Result<()> {
        assert_eq!(params.cell_count(), self.cell_count, "the grid was made for another design");
        let params =
            &GridParams { particle_capacity: set.capacity(), valid_cell_capacity: self.valid_cell_capacity, ..*params };
        let slot = rec.slot();
        self.params[slot].write(0, std::slice::from_ref(params));
        set.clear_counters(rec);
        rec.dispatch(
            &self.classify,
            &classify::Bindings {
                params: &self.params[slot],
                coverage_map: &self.coverage_map,
                counters: set.counters(),
                cell_particles: &self.cell_particles,
                cell_shapes: &self.cell_shapes,
                valid_cells: &self.valid_cells,
            },
            &(),
            [self.cell_count, 1, 1],
        )?;
        self.scan.record(rec, &self.cell_particles, self.cell_count, &self.cell_first, &self.scan_total)?;
        rec.dispatch(
            &self.args,
            &args::Bindings {
                params: &self.params[slot],
                scan_total: &self.scan_total,
                counters: set.counters(),
                grid_args: set.args(),
            },
            &(),
            [1, 1, 1],
        )?;
        rec.dispatch_indirect(
            &self.emit,
            &emit::Bindings {
                params: &self.params[slot],
                counters: set.counters(),
                valid_cells: &self.valid_cells,
                cell_shapes: &self.cell_shapes,
                cell_first: &self.cell_first,
                particles: set.particles(),
                particle_cells: set.cells(),
            },
            &(),
            set.args(),
            EMIT_ARGS,
        )
    }
}
