//! Compositing: particles become segments of view rays, and segments become three images (Yusov 5.4, 5.5).
//!
//! Every mode takes the same segments (`glsl/blend/segment.glsl`) and writes the same [`CloudTargets`]; they differ in
//! how the segments of one pixel are combined:
//!
//! | mode | how | state per pixel |
//! |---|---|---|
//! | [`Interlock`](crate::params::Blend::Interlock) | volume-aware merge with K pending segments, ordered by `VK_EXT_fragment_shader_interlock` | 40 bytes; 16 + 24 K for K > 1 |
//! | [`Attachment`](crate::params::Blend::Attachment) | the same, K up to 4, ordered by `VK_EXT_rasterization_order_attachment_access` | the same |
//! | [`List`](crate::params::Blend::List) | all segments kept, sorted and integrated exactly at resolve | 4 bytes, and 32 for each segment |
//! | [`Tiled`](crate::params::Blend::Tiled) | compute: particles binned to screen tiles, exact integral front to back | none; 32 bytes for each particle, 16 for each tile it touches |
//! | [`Alpha`](crate::params::Blend::Alpha) | fixed-function blending of sorted particles; overlap is ignored | none |

/// The bindings of a mode's program `$shader`: what every mode reads (`glsl/blend/bindings.glsl`), and its own.
macro_rules! scene_bindings {
    ($shader:ident, $inputs:expr, { $($name:ident: $resource:expr,)* }) => {
        $shader::Bindings {
            frame: $inputs.frame,
            particles: $inputs.particles,
            order: $inputs.order,
            lights: $inputs.lights,
            medium: $inputs.medium,
            sky_light: $inputs.sky_light,
            optical_depth_lut: $inputs.optical_depth_lut.sampled($crate::blend::OPTICAL_DEPTH_SAMPLER),
            scattering_lut: $inputs.scattering_lut.sampled($crate::gpu::Sampler::LinearClamp),
            detail_tile: $inputs.detail_tile.sampled($crate::gpu::Sampler::LinearRepeat),
            opaque_distance: $inputs.opaque_distance.sampled($crate::gpu::Sampler::NearestClamp),
            volume: $inputs.volume,
            light_volume: $inputs.light_volume.sampled($crate::gpu::Sampler::LinearClamp),
            $($name: $resource,)*
        }
    };
}

mod alpha;
mod attachment;
mod interlock;
mod list;
pub mod medium;
mod tiled;

use crate::gpu::{Buffer, Capabilities, Feature, Gpu, Image, ImageDesc, Recorder, Sampler};
use crate::grid::Counters;
use crate::params::{Blend, Lighting, Precision, WINDOWS};
use crate::renderer::ListUse;
use crate::{Error, Result};
use ash::vk;
use std::sync::Arc;

/// The images that every mode writes.
pub struct CloudTargets {
    /// In-scattered radiance in rgb [W m⁻² sr⁻¹], transmittance in a.
    pub cloud: Image,
    /// Distance to the first cloud along the ray [m]; 1e30 where there is none.
    pub nearest: Image,
}

impl CloudTargets {
    /// Targets of `extent` pixels.
    pub fn new(gpu: &Arc<Gpu>, extent: [u32; 2], precision: Precision) -> Result<Self> {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::COLOR_ATTACHMENT;
        let image =
            |name, format| Image::new(gpu, &ImageDesc { name, extent: [extent[0], extent[1], 0], format, usage });
        Ok(Self { cloud: image("cloud", cloud_format(precision))?, nearest: image("nearest", NEAREST_FORMAT)? })
    }
}

const NEAREST_FORMAT: vk::Format = vk::Format::R32_SFLOAT;

pub(crate) fn cloud_format(precision: Precision) -> vk::Format {
    match precision {
        Precision::F16 => vk::Format::R16G16B16A16_SFLOAT,
        Precision::F32 => vk::Format::R32G32B32A32_SFLOAT,
    }
}

/// Value of `nearest` where there is no cloud [m].
pub const NO_CLOUD: f32 = 1e30;

/// What the particles are drawn from.
#[derive(Clone, Copy)]
pub struct BlendInputs<'a> {
    /// [`FrameParams`](crate::shared::FrameParams).
    pub frame: &'a Buffer,
    /// [`Particle`](crate::shared::Particle)s.
    pub particles: &'a Buffer,
    /// Indices of the visible particles, back to front.
    pub order: &'a Buffer,
    /// [`ParticleLight`](crate::shared::ParticleLight)s.
    pub lights: &'a Buffer,
    /// [`MediumParams`](medium::MediumParams).
    pub medium: &'a Buffer,
    /// [`SkyLight`](crate::atmosphere::SkyLight).
    pub sky_light: &'a Buffer,
    /// Optical depth table.
    pub optical_depth_lut: &'a Image,
    /// Scattering table.
    pub scattering_lut: &'a Image,
    /// Tile of billow noise.
    pub detail_tile: &'a Image,
    /// [`VolumeParams`](crate::lighting::volume::VolumeParams).
    pub volume: &'a Buffer,
    /// What the clouds scatter ([`LightVolume::image`](crate::lighting::volume::LightVolume::image)).
    pub light_volume: &'a Image,
    /// Distance to the opaque scene at the resolution of the targets [m].
    pub opaque_distance: &'a Image,
    /// `VkDrawIndirectCommand`: 4 vertices, one instance for each visible particle.
    pub draw_args: &'a Buffer,
    /// Where in it the command lies [bytes].
    pub draw_args_offset: u64,
    /// The frame's [`Counters`]; modes with lists raise [`Counters::blend_nodes`].
    pub counters: &'a Buffer,
}

/// Which mode was asked for, which is used, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// As asked.
    pub requested: Blend,
    /// As used.
    pub used: Blend,
    /// Why `used` was taken.
    pub reason: String,
}

/// What `auto` tries, the best first: quality, then cost (`docs/blending.md` has both).
pub const AUTO: &[Blend] = &[Blend::Interlock(1), Blend::Attachment(1), Blend::Alpha];

/// Picks the mode, once. `Auto` takes the first of [`AUTO`] that the device supports.
///
/// # Errors
/// [`Error::Unsupported`], with the reason, if a mode is asked for by name that the device cannot do.
pub fn choose(requested: Blend, capabilities: &Capabilities) -> Result<Choice> {
    if requested != Blend::Auto {
        supports(requested, capabilities).map_err(|reason| Error::Unsupported {
            needed: format!("blend mode {requested} ({reason})"),
            by: capabilities.device_name.clone(),
        })?;
        return Ok(Choice { requested, used: requested, reason: "as requested".to_owned() });
    }
    let mut lacking = Vec::new();
    for &used in AUTO {
        match supports(used, capabilities) {
            Ok(()) if lacking.is_empty() => {
                return Ok(Choice { requested, used, reason: format!("the device has all that {used} needs") });
            }
            Ok(()) => return Ok(Choice { requested, used, reason: lacking.join("; ") }),
            Err(reason) => lacking.push(format!("no {used}: {reason}")),
        }
    }
    Err(Error::Unsupported { needed: lacking.join("; "), by: capabilities.device_name.clone() })
}

/// Whether a device can run `mode`, or a sentence why not.
pub fn supports(mode: Blend, capabilities: &Capabilities) -> Result<(), String> {
    match mode {
        Blend::Auto | Blend::Alpha | Blend::List | Blend::Tiled => Ok(()),
        Blend::Interlock(k) | Blend::Attachment(k) if !WINDOWS.contains(&k) => {
            Err(format!("a window has one of {WINDOWS:?} segments, not {k}"))
        }
        Blend::Interlock(_) => capabilities.supports(Feature::FragmentShaderInterlock).map_err(str::to_owned),
        Blend::Attachment(k) => attachment::supports(k, capabilities),
        other => Err(format!("{other} is not in this version yet")),
    }
}

#[allow(clippy::large_enum_variant)] // A renderer has one.
enum Mode {
    Interlock(interlock::Interlock),
    Attachment(attachment::AttachmentMode),
    List(list::List),
    Tiled(tiled::Tiled),
    Alpha(alpha::Alpha),
}

/// Length of the list of a mode that has one, in nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeBudget {
    /// To begin with; by default some for each pixel.
    pub first: Option<u32>,
    /// At most: a frame that wants more is drawn in parts. By default what a shader can address, and no more than 512 MiB.
    pub most: Option<u32>,
}

/// Draws particles into [`CloudTargets`] by one mode.
pub struct Blender {
    mode: Mode,
    extent: [u32; 2],
}

/// What the blend pipelines are specialised for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shading {
    /// Tables or constant colours.
    pub lighting: Lighting,
    /// Constant density inside each ellipsoid: no density table, no detail.
    pub homogeneous: bool,
}

impl Shading {
    fn specialization(self) -> [(&'static str, u32); 2] {
        [("LIGHTING", u32::from(self.lighting == Lighting::Flat)), ("HOMOGENEOUS", u32::from(self.homogeneous))]
    }
}

impl Blender {
    /// Pipelines and per-pixel state of `mode` (not `Auto`: see [`choose`]) for targets of `extent` pixels.
    pub fn new(gpu: &Arc<Gpu>, mode: Blend, shading: Shading, extent: [u32; 2], precision: Precision) -> Result<Self> {
        Self::with_nodes(gpu, mode, shading, extent, precision, NodeBudget::default())
    }

    /// The same, with a `budget` for the list of a mode that has one.
    pub fn with_nodes(
        gpu: &Arc<Gpu>,
        mode: Blend,
        shading: Shading,
        extent: [u32; 2],
        precision: Precision,
        budget: NodeBudget,
    ) -> Result<Self> {
        let mode = match choose(mode, gpu.capabilities())?.used {
            Blend::Interlock(k) => Mode::Interlock(interlock::Interlock::new(gpu, k, shading, extent)?),
            Blend::Attachment(k) => Mode::Attachment(attachment::AttachmentMode::new(gpu, k, shading, extent)?),
            Blend::List => Mode::List(list::List::new(gpu, shading, extent, budget)?),
            Blend::Tiled => Mode::Tiled(tiled::Tiled::new(gpu, shading, extent, budget)?),
            _ => Mode::Alpha(alpha::Alpha::new(gpu, shading, precision)?),
        };
        Ok(Self { mode, extent })
    }

    /// Records the drawing of all visible particles.
    pub fn record(&self, rec: &mut Recorder<'_>, inputs: &BlendInputs<'_>, targets: &CloudTargets) -> Result<()> {
        match &self.mode {
            Mode::Interlock(mode) => mode.record(rec, inputs, targets, self.extent),
            Mode::Attachment(mode) => mode.record(rec, inputs, targets, self.extent),
            Mode::List(mode) => mode.record(rec, inputs, targets, self.extent),
            Mode::Tiled(mode) => mode.record(rec, inputs, targets),
            Mode::Alpha(mode) => mode.record(rec, inputs, targets, self.extent),
        }
    }

    /// The lists of the mode, if it has any, and what a frame with these `counters` wanted of them.
    #[must_use]
    pub fn lists(&self, counters: &Counters) -> Vec<ListUse> {
        match &self.mode {
            Mode::List(mode) => mode.lists(counters),
            Mode::Tiled(mode) => mode.lists(counters),
            Mode::Interlock(_) | Mode::Attachment(_) | Mode::Alpha(_) => Vec::new(),
        }
    }

    /// Makes room for the list nodes that the last frame wanted; the device must be idle. True if there was too little:
    /// that frame lacks segments.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        match &mut self.mode {
            Mode::List(mode) => mode.grow(gpu, counters.blend_nodes),
            Mode::Tiled(mode) => mode.grow(gpu, counters),
            Mode::Interlock(_) | Mode::Attachment(_) | Mode::Alpha(_) => Ok(false),
        }
    }
}

const OPTICAL_DEPTH_SAMPLER: Sampler = Sampler::LinearRepeatClampRepeat;
