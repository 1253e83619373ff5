//! Light that reaches each particle: the sun's, dimmed by the particles in front (Yusov 5.3), and the sky's.
//!
//! ```text
//! let occlusion = Occlusion::new(&gpu, set.capacity())?;
//! rec.pass("lighting", |rec| occlusion.record(rec, &tiling, &set, Some(&grid), &clouds, voxel))?;
//! ```
//!
//! Other shaders get shadows at any point from `glsl/lighting/sun_optical_depth.glsl`.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::Result;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Gpu, Recorder};
use crate::grid::{Grid, GridParams, ParticleSet};
use crate::params::{Clouds, Transfer};
use crate::shaders::{lighting_tables_smooth_comp as smooth, lighting_tables_sun_comp as sun};
use crate::shared::ParticleLight;
use crate::shared::constants::lighting_tables_transfer_glsl as constants;
use crate::tiling::Tiling;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SunPush {
    xi: f32,
    transfer: u32,
    voxel: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SmoothPush {
    smoothing: f32,
}

/// Computes [`ParticleLight`] for every stored particle.
pub struct Occlusion {
    sun: ComputePipeline,
    smooth: ComputePipeline,
    sun_light: Buffer,
    lights: Buffer,
    sun_depths: Buffer,
    /// Stand-ins for the grid's lists when particles come from a list.
    no_grid: [Buffer; 3],
    capacity: u32,
}

impl Occlusion {
    /// For lists of `capacity` particles.
    pub fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        let no_grid = [
            Buffer::new(gpu, "no grid params", size_of::<GridParams>() as u64, BufferKind::Upload)?,
            Buffer::array::<[f32; 4]>(gpu, "no cell shapes", 1)?,
            Buffer::array::<u32>(gpu, "no cell first", 1)?,
        ];
        no_grid[0].write(0, &[GridParams::zeroed()]);
        Ok(Self {
            sun: ComputePipeline::new(gpu, &sun::PROGRAM, &[])?,
            smooth: ComputePipeline::new(gpu, &smooth::PROGRAM, &[])?,
            sun_light: Buffer::array::<ParticleLight>(gpu, "sun light", capacity as usize)?,
            lights: Buffer::array::<ParticleLight>(gpu, "particle lights", capacity as usize)?,
            sun_depths: Buffer::array::<[f32; 4]>(gpu, "sun depths", capacity as usize)?,
            no_grid,
            capacity,
        })
    }

    /// [`ParticleLight`] of every particle.
    #[must_use]
    pub fn lights(&self) -> &Buffer {
        &self.lights
    }

    /// [`ParticleLight`] of every particle before smoothing, without the sky.
    #[must_use]
    pub fn sun_light(&self) -> &Buffer {
        &self.sun_light
    }

    /// Of every particle the optical depths of others towards the sun at the pole that faces it, at its centre and at its far
    /// pole, and its own diameter's.
    #[must_use]
    pub fn sun_depths(&self) -> &Buffer {
        &self.sun_depths
    }

    /// Follows a [`ParticleSet`] that has grown; the device must be idle. True if it did.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, set: &ParticleSet) -> Result<bool> {
        if set.capacity() <= self.capacity {
            return Ok(false);
        }
        *self = Self::new(gpu, set.capacity())?;
        Ok(true)
    }

    /// Records occlusion and smoothing. `grid` is none for explicit particles, which are not smoothed and see the whole
    /// sky. `voxel`: edge of the voxels in which light diffuses ([`super::volume::LightVolume::voxel_edge`]) [m].
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        tiling: &Tiling,
        set: &ParticleSet,
        grid: Option<&Grid>,
        clouds: &Clouds,
        voxel: f32,
    ) -> Result<()> {
        assert!(set.capacity() <= self.capacity, "the particle set has grown: call grow() too");
        let slot = rec.slot();
        rec.dispatch_indirect(
            &self.sun,
            &sun::Bindings {
                params: tiling.params(slot),
                occluders: tiling.occluders(),
                tile_heads: tiling.heads(),
                tile_nodes: tiling.nodes(),
                counters: set.counters(),
                sun: &self.sun_light,
                sun_depths: &self.sun_depths,
            },
            &SunPush { xi: clouds.xi, transfer: transfer(clouds.transfer), voxel },
            set.args(),
            ParticleSet::PARTICLE_ARGS,
        )?;
        let [no_params, no_shapes, no_first] = &self.no_grid;
        rec.dispatch_indirect(
            &self.smooth,
            &smooth::Bindings {
                params: grid.map_or(no_params, |grid| grid.params(slot)),
                counters: set.counters(),
                particles: set.particles(),
                particle_cells: set.cells(),
                cell_shapes: grid.map_or(no_shapes, Grid::cell_shapes),
                cell_first: grid.map_or(no_first, Grid::cell_first),
                sun: &self.sun_light,
                particle_lights: &self.lights,
            },
            &SmoothPush { smoothing: clouds.smoothing },
            set.args(),
            ParticleSet::PARTICLE_ARGS,
        )
    }
}

/// Number of a transfer in `glsl/lighting/tables/transfer.glsl`.
fn transfer(transfer: Transfer) -> u32 {
    match transfer {
        Transfer::Diffusion => constants::TRANSFER_DIFFUSION,
        Transfer::Exponential => constants::TRANSFER_EXPONENTIAL,
    }
}
