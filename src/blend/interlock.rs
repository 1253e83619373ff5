//! Mode `interlock`: the volume-aware merge, ordered per pixel by `VK_EXT_fragment_shader_interlock`: with one pending
//! segment `glsl/blend/interlock.frag` (Yusov 5.5), with more `glsl/blend/window.frag`.

use super::{BlendInputs, CloudTargets, Compositor, Kind, Setting};
use crate::Result;
use crate::gpu::{
    Capabilities, ComputePipeline, Draw, Feature, GraphicsPipeline, GraphicsState, Image, ImageDesc, Recorder,
};
use crate::shaders::{blend_interlock_frag as single, blend_resolve_comp as single_resolve};
use crate::shaders::{blend_window_frag as window, blend_window_resolve_comp as window_resolve};
use ash::vk;

pub(super) const KIND: Kind = Kind { supports, open: |setting, k| Ok(Box::new(Interlock::new(setting, k)?)) };

fn supports(_: u32, capabilities: &Capabilities) -> Result<(), String> {
    capabilities.supports(Feature::FragmentShaderInterlock).map_err(str::to_owned)
}

struct Interlock {
    pipeline: GraphicsPipeline,
    resolve: ComputePipeline,
    state: State,
}

/// What a pixel keeps between fragments; zeros are nothing pending, nothing committed.
#[allow(clippy::large_enum_variant)] // A renderer has one.
enum State {
    Single { committed: Image, pending: Image, ends: Image },
    Window(Image),
}

impl Interlock {
    fn new(setting: &Setting<'_>, k: u32) -> Result<Self> {
        let Setting { gpu, shading, extent, .. } = *setting;
        let lighting = shading.lighting.name();
        let usage = vk::ImageUsageFlags::STORAGE;
        let desc = |name, format| ImageDesc { name, extent: [extent[0], extent[1], 0], format, usage };
        let (wide, narrow) = (vk::Format::R32G32B32A32_SFLOAT, vk::Format::R32G32_SFLOAT);
        let (program, resolve, constants, state) = if k == 1 {
            let state = State::Single {
                committed: Image::new(gpu, &desc("interlocked committed", wide))?,
                pending: Image::new(gpu, &desc("interlocked pending", wide))?,
                ends: Image::new(gpu, &desc("interlocked extent", narrow))?,
            };
            (single::program(lighting), &single_resolve::PROGRAM, vec![], state)
        } else {
            let layers = 1 + k + k / 2;
            let state = State::Window(Image::layered(gpu, &desc("interlocked window", wide), layers)?);
            (window::program(lighting), &window_resolve::PROGRAM, vec![("WINDOW", k)], state)
        };
        let specialization = [&shading.specialization()[..], &constants].concat();
        Ok(Self {
            pipeline: GraphicsPipeline::new(gpu, program, &specialization, GraphicsState::default())?,
            resolve: ComputePipeline::new(gpu, resolve, &constants)?,
            state,
        })
    }
}

impl Compositor for Interlock {
    fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        extent: [u32; 2],
    ) -> Result<()> {
        let draw = Draw::Indirect { args: inputs.draw_args, offset: inputs.draw_args_offset };
        let (cloud, nearest, threads) = (&targets.cloud, &targets.nearest, [extent[0], extent[1], 1]);
        match &self.state {
            State::Single { committed, pending, ends } => {
                rec.pass("blend", |rec| {
                    for image in [committed, pending, ends] {
                        rec.clear_image(image, [0.0; 4]);
                    }
                    let bindings = scene_bindings!(single, inputs, {
                        interlocked_committed: committed, interlocked_pending: pending, interlocked_extent: ends,
                    });
                    rec.draw(&self.pipeline, &bindings, &(), extent, &[], draw)
                })?;
                rec.pass("resolve", |rec| {
                    let bindings = single_resolve::Bindings {
                        committed_state: committed,
                        pending_state: pending,
                        extent_state: ends,
                        cloud,
                        nearest,
                    };
                    rec.dispatch(&self.resolve, &bindings, &(), threads)
                })
            }
            State::Window(window_state) => {
                rec.pass("blend", |rec| {
                    rec.clear_image(window_state, [0.0; 4]);
                    let bindings = scene_bindings!(window, inputs, { window_state: window_state, });
                    rec.draw(&self.pipeline, &bindings, &(), extent, &[], draw)
                })?;
                rec.pass("resolve", |rec| {
                    let bindings = window_resolve::Bindings { window_state, cloud, nearest };
                    rec.dispatch(&self.resolve, &bindings, &(), threads)
                })
            }
        }
    }
}
