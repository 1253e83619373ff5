//! Mode `list`: a linked list of segments per pixel in an append buffer, sorted and exactly integrated at resolve
//! (`glsl/blend/list.frag`, `list_resolve.comp`).
//!
//! The append buffer counts past its capacity and grows between frames ([`List::grow`]). Where it may not grow any more,
//! the picture is drawn in bands of rows that take turns with it: however many segments a frame has, none is lost.

use super::{BlendInputs, CloudTargets, Compositor, Kind, Setting, anywhere};
use crate::gpu::{Buffer, ComputePipeline, Draw, DrawCall, Gpu, GraphicsPipeline, GraphicsState, PassState, Recorder};
use crate::grid::Counters;
use crate::lists::{ListUse, grown};
use crate::shaders::{blend_list_frag as shader, blend_list_resolve_comp as resolve};
use crate::shared::assert_layout;
use crate::{Error, Result};
use std::ops::Range;
use std::sync::Arc;

/// A segment in the list of its pixel (`glsl/blend/list.glsl`).
#[repr(C)]
struct SegmentNode {
    colour: [f32; 3],
    optical_depth: f32,
    t_enter: f32,
    t_exit: f32,
    particle: u32,
    next: u32,
}
assert_layout!(SegmentNode, segment_node, {
    colour: COLOUR, optical_depth: OPTICAL_DEPTH, t_enter: T_ENTER, t_exit: T_EXIT, particle: PARTICLE, next: NEXT,
});

/// `next` of the last node.
const NO_NODE: u32 = crate::shared::constants::blend_list_glsl::NO_NODE;

/// Nodes to begin with, per pixel.
const NODES_PER_PIXEL: u32 = 8;

/// The append buffer takes no more than this [bytes], and no more than a shader can address.
const MOST_BYTES: u64 = 512 << 20;

pub(super) const KIND: Kind = Kind { supports: anywhere, open: |setting, _| Ok(Box::new(List::new(setting)?)) };

struct List {
    pipeline: GraphicsPipeline,
    resolve: ComputePipeline,
    heads: Buffer,
    nodes: Buffer,
    wanted: Buffer,
    extent: [u32; 2],
    capacity: u32,
    most: u32,
    bands: u32,
}

impl List {
    fn new(setting: &Setting<'_>) -> Result<Self> {
        let Setting { gpu, shading, extent, budget, .. } = *setting;
        let bytes = MOST_BYTES.min(u64::from(gpu.capabilities().max_storage_buffer_range));
        let most = (bytes / size_of::<SegmentNode>() as u64) as u32;
        let most = budget.most.map_or(most, |wish| wish.clamp(1, most));
        let pixels = extent[0] * extent[1];
        let capacity = budget.first.unwrap_or(pixels.saturating_mul(NODES_PER_PIXEL)).clamp(1, most);
        let (state, lighting) = (GraphicsState::default(), shading.lighting.name());
        Ok(Self {
            pipeline: GraphicsPipeline::new(gpu, shader::program(lighting), &shading.specialization(), state)?,
            resolve: ComputePipeline::new(gpu, &resolve::PROGRAM, &[])?,
            heads: Buffer::array::<u32>(gpu, "segment heads", pixels as usize)?,
            nodes: Buffer::array::<SegmentNode>(gpu, "segment nodes", capacity as usize)?,
            wanted: Buffer::array::<u32>(gpu, "segments wanted", 1)?,
            extent,
            capacity,
            most,
            bands: 1,
        })
    }

    fn record_segments(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        extent: [u32; 2],
        rows: Range<u32>,
    ) -> Result<()> {
        rec.fill_buffer(&self.wanted, 0, self.wanted.size(), 0);
        let bindings = scene_bindings!(shader, inputs, {
            list_heads: &self.heads,
            list_nodes: &self.nodes,
            list_use: &self.wanted,
        });
        let draw = Draw::Indirect { args: inputs.draw_args, offset: inputs.draw_args_offset };
        let push = bytemuck::bytes_of(&self.capacity);
        let pass = PassState { rows: Some((rows.start, rows.end)), ..PassState::default() };
        let call = DrawCall { pipeline: &self.pipeline, bindings: &bindings, push, draw };
        rec.draw_pass(extent, &[], pass, &[call])
    }
}

impl Compositor for List {
    fn lists(&self, counters: &Counters) -> Vec<ListUse> {
        vec![ListUse { name: "blend_nodes", needed: counters.blend_nodes, capacity: self.capacity }]
    }

    /// A longer buffer, or more bands that share it.
    fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        let needed = counters.blend_nodes;
        if needed <= self.capacity {
            return Ok(false);
        }
        if needed > self.most {
            // Bands are as tall as each other, not as full: the next frame tells whether that was enough.
            if self.bands == self.extent[1] {
                return Err(Error::Unsupported {
                    needed: format!(
                        "blend mode list with {needed} segments in one row of pixels (it holds {})",
                        self.most
                    ),
                    by: gpu.capabilities().device_name.clone(),
                });
            }
            self.bands = self.bands.saturating_mul(2 * needed.div_ceil(self.most)).min(self.extent[1]);
        }
        let capacity = grown(needed).min(self.most);
        if capacity > self.capacity {
            self.nodes = Buffer::array::<SegmentNode>(gpu, "segment nodes", capacity as usize)?;
            self.capacity = capacity;
        }
        Ok(true)
    }

    fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        extent: [u32; 2],
    ) -> Result<()> {
        rec.fill_buffer(&self.heads, 0, self.heads.size(), NO_NODE);
        for band in 0..self.bands {
            let row = |band| (u64::from(extent[1]) * u64::from(band) / u64::from(self.bands)) as u32;
            let rows = row(band)..row(band + 1);
            rec.pass("blend", |rec| self.record_segments(rec, inputs, extent, rows.clone()))?;
            rec.pass("resolve", |rec| {
                let bindings = resolve::Bindings {
                    list_heads: &self.heads,
                    list_nodes: &self.nodes,
                    list_use: &self.wanted,
                    counters: inputs.counters,
                    cloud: &targets.cloud,
                    nearest: &targets.nearest,
                };
                let threads = [extent[0], rows.end - rows.start, 1];
                rec.dispatch(&self.resolve, &bindings, &[rows.start, rows.end], threads)
            })?;
        }
        Ok(())
    }
}
