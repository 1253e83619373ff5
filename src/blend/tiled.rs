//! Mode `tiled`: particles are binned to screen tiles and sorted by the distance before which no ray enters them; one
//! thread a pixel integrates exactly, front to back, and shades only what is seen (`glsl/blend/tiled*.comp`).
//!
//! Keys → sort → silhouettes and tile counts → prefix sum → pairs of particle and tile → stable sort by tile → ranges →
//! integral → the pixels that did not fit. The two lists, of particles and of pairs, grow between frames.

use super::{BlendInputs, CloudTargets, Compositor, Kind, NO_CLOUD, OPTICAL_DEPTH_SAMPLER, Setting, anywhere};
use crate::Result;
use crate::compact::{Scan, Sort};
use crate::gpu::{Buffer, ComputePipeline, Gpu, Recorder, Sampler};
use crate::grid::Counters;
use crate::lists::{ListUse, grown};
use crate::shaders::{
    blend_tiled_args_comp as args, blend_tiled_comp as integrate, blend_tiled_count_comp as count,
    blend_tiled_emit_comp as emit, blend_tiled_keys_comp as keys, blend_tiled_ranges_comp as ranges,
    blend_tiled_rest_comp as rest,
};
use crate::shared::{assert_layout, layout};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Pixels along a side of a tile.
const TILE: u32 = crate::shared::constants::blend_tile_particle_glsl::TILE;

/// Significant bits of the key that particles are sorted by.
const DISTANCE_BITS: u32 = 16;

/// Particles and pairs to begin with.
const FIRST_NODES: u32 = 1 << 16;

/// A visible particle on the screen (`glsl/blend/tile_particle.glsl`).
#[repr(C)]
struct TileParticle {
    middle: [f32; 2],
    particle: u32,
    bound: f32,
    conic: [f32; 3],
    reserved: f32,
}
assert_layout!(TileParticle, tile_particle, {
    middle: MIDDLE, particle: PARTICLE, bound: BOUND, conic: CONIC, reserved: RESERVED,
});

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ArgsPush {
    stage: u32,
    instances: u32,
    capacity: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct EmitPush {
    tiles: [u32; 2],
    capacity: u32,
}

struct Pipelines {
    args: ComputePipeline,
    keys: ComputePipeline,
    count: ComputePipeline,
    emit: ComputePipeline,
    ranges: ComputePipeline,
    integrate: ComputePipeline,
    rest: ComputePipeline,
}

/// What grows with the particles.
struct Particles {
    capacity: u32,
    elements: Buffer,
    keys: Buffer,
    indices: Buffer,
    counts: Buffer,
    firsts: Buffer,
    sort: Sort,
    scan: Scan,
}

/// What grows with the pairs.
struct Pairs {
    capacity: u32,
    tiles: Buffer,
    particles: Buffer,
    sort: Sort,
}

pub(super) const KIND: Kind = Kind { supports: anywhere, open: |setting, _| Ok(Box::new(Tiled::new(setting)?)) };

struct Tiled {
    pipelines: Pipelines,
    particles: Particles,
    pairs: Pairs,
    in_use: Buffer,
    total: Buffer,
    ranges: Buffer,
    tile_list: Buffer,
    rest: Buffer,
    tiles: [u32; 2],
}

impl Particles {
    fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        let count = capacity as usize;
        Ok(Self {
            capacity,
            elements: Buffer::array::<TileParticle>(gpu, "tile particles", count)?,
            keys: Buffer::array::<u32>(gpu, "entry keys", count)?,
            indices: Buffer::array::<u32>(gpu, "entry order", count)?,
            counts: Buffer::array::<u32>(gpu, "tile counts", count)?,
            firsts: Buffer::array::<u32>(gpu, "first pairs", count)?,
            sort: Sort::new(gpu, capacity)?,
            scan: Scan::new(gpu, capacity)?,
        })
    }
}

impl Pairs {
    fn new(gpu: &Arc<Gpu>, capacity: u32) -> Result<Self> {
        Ok(Self {
            capacity,
            tiles: Buffer::array::<u32>(gpu, "pair tiles", capacity as usize)?,
            particles: Buffer::array::<u32>(gpu, "pair particles", capacity as usize)?,
            sort: Sort::new(gpu, capacity)?,
        })
    }
}

impl Tiled {
    fn new(setting: &Setting<'_>) -> Result<Self> {
        let Setting { gpu, shading, extent, budget, .. } = *setting;
        let lighting = shading.lighting.name();
        let tiles = extent.map(|pixels| pixels.div_ceil(TILE));
        let tile_count = (tiles[0] * tiles[1]) as usize;
        let first = budget.first.unwrap_or(FIRST_NODES).max(1);
        let constants = shading.specialization();
        Ok(Self {
            pipelines: Pipelines {
                args: ComputePipeline::new(gpu, &args::PROGRAM, &[])?,
                keys: ComputePipeline::new(gpu, &keys::PROGRAM, &[])?,
                count: ComputePipeline::new(gpu, &count::PROGRAM, &[])?,
                emit: ComputePipeline::new(gpu, &emit::PROGRAM, &[])?,
                ranges: ComputePipeline::new(gpu, &ranges::PROGRAM, &[])?,
                integrate: ComputePipeline::new(gpu, integrate::program(lighting), &constants)?,
                rest: ComputePipeline::new(gpu, rest::program(lighting), &constants)?,
            },
            particles: Particles::new(gpu, first)?,
            pairs: Pairs::new(gpu, first)?,
            in_use: Buffer::array::<[u8; layout::tiled_use::SIZE]>(gpu, "tiled use", 1)?,
            total: Buffer::array::<u32>(gpu, "pair total", 1)?,
            ranges: Buffer::array::<[u32; 2]>(gpu, "tile ranges", tile_count)?,
            tile_list: Buffer::array::<u32>(gpu, "tile list", tile_count)?,
            rest: Buffer::array::<[u32; 4]>(gpu, "unfinished half tiles", tile_count)?,
            tiles,
        })
    }

    fn record_args(&self, rec: &mut Recorder<'_>, inputs: &BlendInputs<'_>, stage: u32, capacity: u32) -> Result<()> {
        let bindings = args::Bindings {
            draw_args: inputs.draw_args,
            pair_total: &self.total,
            tiled_use: &self.in_use,
            counters: inputs.counters,
        };
        let instances = (inputs.draw_args_offset / 4) as u32 + 1;
        rec.dispatch(&self.pipelines.args, &bindings, &ArgsPush { stage, instances, capacity }, [1, 1, 1])
    }

    fn record_bins(&self, rec: &mut Recorder<'_>, inputs: &BlendInputs<'_>) -> Result<()> {
        use layout::tiled_use as offset;
        let (particles, pairs, in_use) = (&self.particles, &self.pairs, &self.in_use);
        let particle_groups = offset::PARTICLE_GROUPS as u64;
        self.record_args(rec, inputs, 0, particles.capacity)?;
        let bindings = keys::Bindings {
            frame: inputs.frame,
            particles: inputs.particles,
            order: inputs.order,
            tiled_use: in_use,
            keys: &particles.keys,
            indices: &particles.indices,
        };
        rec.dispatch_indirect(&self.pipelines.keys, &bindings, &(), in_use, particle_groups)?;
        let (count, sort) = ((in_use, offset::PARTICLES as u32 / 4), (in_use, offset::PARTICLE_SORT as u64));
        particles.sort.record_bits(rec, DISTANCE_BITS, count, sort, &particles.keys, &particles.indices)?;

        rec.fill_buffer(&particles.counts, 0, particles.counts.size(), 0);
        let bindings = count::Bindings {
            frame: inputs.frame,
            particles: inputs.particles,
            tiled_use: in_use,
            keys: &particles.keys,
            indices: &particles.indices,
            tile_particles: &particles.elements,
            counts: &particles.counts,
        };
        rec.dispatch_indirect(&self.pipelines.count, &bindings, &self.tiles, in_use, particle_groups)?;
        particles.scan.record(rec, &particles.counts, particles.capacity, &particles.firsts, &self.total)?;
        self.record_args(rec, inputs, 1, pairs.capacity)?;

        let bindings = emit::Bindings {
            tiled_use: in_use,
            tile_particles: &particles.elements,
            firsts: &particles.firsts,
            pair_tiles: &pairs.tiles,
            pair_particles: &pairs.particles,
        };
        let push = EmitPush { tiles: self.tiles, capacity: pairs.capacity };
        rec.dispatch_indirect(&self.pipelines.emit, &bindings, &push, in_use, particle_groups)?;
        let tile_bits = u32::BITS - (self.tiles[0] * self.tiles[1] - 1).leading_zeros();
        let (count, sort) = ((in_use, offset::PAIRS as u32 / 4), (in_use, offset::PAIR_SORT as u64));
        pairs.sort.record_bits(rec, tile_bits, count, sort, &pairs.tiles, &pairs.particles)?;

        rec.fill_buffer(&self.ranges, 0, self.ranges.size(), 0);
        let bindings = ranges::Bindings {
            tiled_use: in_use,
            pair_tiles: &pairs.tiles,
            tile_ranges: &self.ranges,
            tile_list: &self.tile_list,
        };
        rec.dispatch_indirect(&self.pipelines.ranges, &bindings, &(), in_use, offset::PAIR_GROUPS as u64)
    }

    fn record_integral(&self, rec: &mut Recorder<'_>, inputs: &BlendInputs<'_>, targets: &CloudTargets) -> Result<()> {
        rec.clear_image(&targets.cloud, [0.0, 0.0, 0.0, 1.0]);
        rec.clear_image(&targets.nearest, [NO_CLOUD; 4]);
        rec.fill_buffer(&self.rest, 0, self.rest.size(), 0);
        macro_rules! bindings {
            ($program:ident) => {
                $program::Bindings {
                    frame: inputs.frame,
                    particles: inputs.particles,
                    medium: inputs.medium,
                    optical_depth_lut: inputs.optical_depth_lut.sampled(OPTICAL_DEPTH_SAMPLER),
                    detail_tile: inputs.detail_tile.sampled(Sampler::LinearRepeat),
                    opaque_distance: inputs.opaque_distance.sampled(Sampler::NearestClamp),
                    lighting: inputs.lighting,
                    tile_ranges: &self.ranges,
                    pair_particles: &self.pairs.particles,
                    tile_particles: &self.particles.elements,
                    tiled_use: &self.in_use,
                    tile_list: &self.tile_list,
                    rest: &self.rest,
                    cloud: &targets.cloud,
                    nearest: &targets.nearest,
                }
            };
        }
        self.record_args(rec, inputs, 2, 0)?;
        let offset = layout::tiled_use::TILE_GROUPS as u64;
        rec.dispatch_indirect(&self.pipelines.integrate, &bindings!(integrate), &self.tiles, &self.in_use, offset)?;
        self.record_args(rec, inputs, 3, 0)?;
        let offset = layout::tiled_use::REST_GROUPS as u64;
        rec.dispatch_indirect(&self.pipelines.rest, &bindings!(rest), &self.tiles, &self.in_use, offset)
    }
}

impl Compositor for Tiled {
    fn lists(&self, counters: &Counters) -> Vec<ListUse> {
        vec![
            ListUse { name: "blend_nodes", needed: counters.blend_nodes, capacity: self.pairs.capacity },
            ListUse { name: "blend_particles", needed: counters.visible, capacity: self.particles.capacity },
        ]
    }

    fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        let (few_particles, few_pairs) =
            (counters.visible > self.particles.capacity, counters.blend_nodes > self.pairs.capacity);
        if few_particles {
            self.particles = Particles::new(gpu, grown(counters.visible))?;
        }
        if few_pairs {
            self.pairs = Pairs::new(gpu, grown(counters.blend_nodes))?;
        }
        Ok(few_particles || few_pairs)
    }

    fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        _: [u32; 2],
    ) -> Result<()> {
        rec.pass("bin", |rec| self.record_bins(rec, inputs))?;
        rec.pass("blend", |rec| self.record_integral(rec, inputs, targets))
    }
}
