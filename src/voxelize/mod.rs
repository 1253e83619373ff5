//! The cloud as voxels: its extinction on a regular grid, for other renderers.
//!
//! The particles are those of a frame (an explicit list, or the grid's around the camera), the density inside each is that
//! of `glsl/density/extinction.glsl`: style and detail noise included. A voxel holds the mean over its volume.
//!
//! The host bins particles into bricks of 8³ voxels, a region of bricks at a time; the device (`glsl/voxelize/bricks.comp`)
//! evaluates the bricks that any particle touches. Memory is bounded by the region, whatever the resolution.

mod bricks;
mod gather;
mod geometry;

use crate::Result;
use crate::blend::medium::MediumParams;
use crate::definitions::REFERENCE_SEED;
use crate::detail::DetailTile;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Frames, Gpu, Sampler};
use crate::lut::style_index;
use crate::params::Params;
use crate::shaders::voxelize_bricks_comp as shader;
use crate::shared::{Particle, assert_layout};
use bricks::{Binned, Region, regions};
use bytemuck::{Pod, Zeroable};
use std::ops::ControlFlow;
use std::sync::Arc;

pub use bricks::Order;
pub use gather::Gathered;
pub use geometry::{MAX_RESOLUTION, VoxelGrid};

/// Voxels along the edge of a brick: an OpenVDB leaf has as many.
pub const BRICK: u32 = 8;
/// Voxels of a brick.
pub const BRICK_VOXELS: usize = 512;

/// Bricks that are evaluated at once.
const BATCH: usize = 2048;
/// Particles in the lists of those, unless one brick alone has more: bounds the time of one submission.
const BATCH_ENTRIES: usize = 8192;

/// A brick and the particles that touch it (`glsl/voxelize/bricks.comp`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(crate) struct VoxelBrick {
    x: u32,
    y: u32,
    z: u32,
    first: u32,
    count: u32,
}
assert_layout!(VoxelBrick, voxel_brick, { x: X, y: Y, z: Z, first: FIRST, count: COUNT });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct VoxelPush {
    corner: [f32; 3],
    edge: f32,
    origin: [f32; 3],
    sigma_t: f32,
    detail: f32,
    style: u32,
    seed: u32,
    samples: u32,
}

/// A brick of finished voxels.
pub struct Brick<'a> {
    /// Its place, in bricks.
    pub at: [u32; 3],
    /// Mean extinction of each voxel [1/m], z fastest, then y, then x.
    pub sigma_t: &'a [f32],
}

/// Evaluates the extinction of one scene's particles on the device.
pub struct Voxelizer {
    pipeline: ComputePipeline,
    tile: DetailTile,
    particles: Buffer,
    bricks: Buffer,
    lists: Buffer,
    values: Buffer,
    readback: Buffer,
    push: VoxelPush,
    gathered: Gathered,
}

impl Voxelizer {
    /// For the particles `gathered` from the scene of `params`; `samples`³ points are averaged in each voxel, more where
    /// particles are smaller than voxels.
    pub fn new(gpu: &Arc<Gpu>, params: &Params, gathered: Gathered, samples: u32) -> Result<Self> {
        let clouds = &params.clouds;
        let push = VoxelPush {
            corner: [0.0; 3],
            edge: 0.0,
            origin: params.animation.clouds().detail_origin(gathered.origin).map(|c| c as f32),
            sigma_t: clouds.sigma_t,
            detail: MediumParams::new(clouds).detail,
            style: style_index(clouds.style),
            seed: REFERENCE_SEED,
            samples,
        };
        let bytes = (BATCH * BRICK_VOXELS * size_of::<f32>()) as u64;
        let particles: &[Particle] =
            if gathered.particles.is_empty() { &[Particle::zeroed()] } else { &gathered.particles };
        Ok(Self {
            pipeline: ComputePipeline::new(gpu, &shader::PROGRAM, &[])?,
            tile: DetailTile::new(gpu)?,
            particles: Buffer::upload(gpu, "voxel particles", particles)?,
            bricks: Buffer::new(gpu, "voxel bricks", (BATCH * size_of::<VoxelBrick>()) as u64, BufferKind::Upload)?,
            lists: Buffer::new(gpu, "voxel lists", (BATCH_ENTRIES * size_of::<u32>()) as u64, BufferKind::Upload)?,
            values: Buffer::new(gpu, "voxels", bytes, BufferKind::Device)?,
            readback: Buffer::new(gpu, "voxels readback", bytes, BufferKind::Readback)?,
            push,
            gathered,
        })
    }

    /// Hands every brick of `grid` that a particle touches to `sink`, in `order`; all others are empty. `progress` hears
    /// the fraction done, from 0 to 1, and may break it off. True when it came to the end.
    ///
    /// # Errors
    /// Of the device, and of `sink`.
    pub fn run(
        &mut self,
        frames: &mut Frames,
        grid: &VoxelGrid,
        order: Order,
        sink: &mut dyn FnMut(Brick<'_>) -> Result<()>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<bool> {
        let relative = |axis: usize| (grid.corner[axis] - self.gathered.origin[axis]) as f32;
        self.push.corner = std::array::from_fn(relative);
        self.push.edge = grid.voxel as f32;
        let regions = regions(&self.gathered, grid, order);
        let total: f64 = regions.iter().map(Region::weight).sum::<f64>().max(1.0);
        let mut done = 0.0;
        for region in &regions {
            let weight = region.weight();
            let binned = region.bin(&self.gathered, grid);
            let mut at = 0;
            while at < binned.bricks.len() {
                let next = batch_end(&binned, at, self.push.samples);
                self.batch(frames, grid, &binned, at..next, sink)?;
                at = next;
                if progress((done + weight * at as f64 / binned.bricks.len() as f64) / total).is_break() {
                    return Ok(false);
                }
            }
            done += weight;
        }
        Ok(true)
    }

    fn batch(
        &mut self,
        frames: &mut Frames,
        grid: &VoxelGrid,
        binned: &Binned,
        range: std::ops::Range<usize>,
        sink: &mut dyn FnMut(Brick<'_>) -> Result<()>,
    ) -> Result<()> {
        let bricks = &binned.bricks[range.clone()];
        let start = bricks[0].first;
        let entries: usize = bricks.iter().map(|brick| brick.count as usize).sum();
        let list = &binned.entries[start as usize..start as usize + entries];
        if size_of_val(list) as u64 > self.lists.size() {
            // A single brick with a longer list than all of a batch; no submission is under way.
            let gpu = frames.gpu().clone();
            self.lists = Buffer::new(&gpu, "voxel lists", size_of_val(list) as u64, BufferKind::Upload)?;
            frames.state().forget();
        }
        let local: Vec<_> = bricks.iter().map(|brick| VoxelBrick { first: brick.first - start, ..*brick }).collect();
        self.bricks.write(0, &local);
        self.lists.write(0, list);
        frames.run(|rec| {
            self.tile.record(rec)?;
            rec.pass("voxelize", |rec| {
                let bindings = shader::Bindings {
                    particles: &self.particles,
                    bricks: &self.bricks,
                    lists: &self.lists,
                    detail_tile: self.tile.image.sampled(Sampler::LinearRepeat),
                    values: &self.values,
                };
                rec.dispatch(&self.pipeline, &bindings, &self.push, [64 * local.len() as u32, BRICK, 1])
            })?;
            rec.copy_buffer(&self.values, &self.readback, (local.len() * BRICK_VOXELS * size_of::<f32>()) as u64);
            rec.make_visible_to_host(&self.readback);
            Ok(())
        })?;
        let mut values: Vec<f32> = self.readback.read(0, local.len() * BRICK_VOXELS);
        for (brick, sigma_t) in bricks.iter().zip(values.chunks_exact_mut(BRICK_VOXELS)) {
            crop(brick, sigma_t, grid);
            sink(Brick { at: [brick.x, brick.y, brick.z].map(|c| c / BRICK), sigma_t })?;
        }
        Ok(())
    }

    /// The particles.
    #[must_use]
    pub fn gathered(&self) -> &Gathered {
        &self.gathered
    }
}

/// Empties the voxels of a brick that lie outside of the grid.
fn crop(brick: &VoxelBrick, sigma_t: &mut [f32], grid: &VoxelGrid) {
    let first = [brick.x, brick.y, brick.z];
    if (0..3).all(|axis| first[axis] + BRICK <= grid.size[axis]) {
        return;
    }
    for (index, value) in sigma_t.iter_mut().enumerate() {
        let index = index as u32;
        let inside = [index / 64, index / 8 % 8, index % 8];
        if (0..3).any(|axis| first[axis] + inside[axis] >= grid.size[axis]) {
            *value = 0.0;
        }
    }
}

/// End of the batch that starts at brick `at`: at least one brick, and no more work than 3³ samples in all of them are.
fn batch_end(binned: &Binned, at: usize, samples: u32) -> usize {
    let mut entries = 0;
    let most = BATCH * 27 / samples.pow(3).max(27) as usize;
    let fits = binned.bricks[at..].iter().take(most).take_while(|brick| {
        entries += brick.count as usize;
        entries <= BATCH_ENTRIES
    });
    at + fits.count().max(1)
}
