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
            medium: $inputs.medium,
            optical_depth_lut: $inputs.optical_depth_lut.sampled($crate::blend::OPTICAL_DEPTH_SAMPLER),
            detail_tile: $inputs.detail_tile.sampled($crate::gpu::Sampler::LinearRepeat),
            opaque_distance: $inputs.opaque_distance.sampled($crate::gpu::Sampler::NearestClamp),
            lighting: $inputs.lighting,
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

use crate::gpu::{Buffer, Capabilities, Gpu, Image, MethodBindings, Recorder, Sampler};
use crate::grid::Counters;
use crate::lists::ListUse;
use crate::params::{Blend, Lighting, Precision, WINDOWS};
use crate::{Error, Result};
use std::sync::Arc;

pub use crate::targets::{CloudTargets, NO_CLOUD};

/// What the particles are drawn from.
#[derive(Clone, Copy)]
pub struct BlendInputs<'a> {
    /// [`FrameParams`](crate::shared::FrameParams).
    pub frame: &'a Buffer,
    /// [`Particle`](crate::shared::Particle)s.
    pub particles: &'a Buffer,
    /// Indices of the visible particles, back to front.
    pub order: &'a Buffer,
    /// [`MediumParams`](medium::MediumParams).
    pub medium: &'a Buffer,
    /// Optical depth table.
    pub optical_depth_lut: &'a Image,
    /// Tile of billow noise.
    pub detail_tile: &'a Image,
    /// What the source function of the lighting method reads; the method is that of [`Shading`].
    pub lighting: MethodBindings<'a>,
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

/// What `exact` tries, the cheapest first: a thread a pixel that shades what is seen against lists of all segments.
pub const EXACT: &[Blend] = &[Blend::Tiled, Blend::List];

/// Picks the mode, once. `Auto` takes the first of [`AUTO`] that the device supports, `Exact` the first of [`EXACT`].
///
/// # Errors
/// [`Error::Unsupported`], with the reason, if a mode is asked for by name that the device cannot do.
pub fn choose(requested: Blend, capabilities: &Capabilities) -> Result<Choice> {
    let candidates = match requested {
        Blend::Auto => AUTO,
        Blend::Exact => EXACT,
        _ => {
            supports(requested, capabilities).map_err(|reason| Error::Unsupported {
                needed: format!("blend mode {requested} ({reason})"),
                by: capabilities.device_name.clone(),
            })?;
            return Ok(Choice { requested, used: requested, reason: "as requested".to_owned() });
        }
    };
    let mut lacking = Vec::new();
    for &used in candidates {
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

/// A way of compositing.
trait Compositor {
    /// Draws all visible particles into `targets`, which have `extent` pixels.
    fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        extent: [u32; 2],
    ) -> Result<()>;

    /// Its lists, and what a frame with these counts wanted of them.
    fn lists(&self, _: &Counters) -> Vec<ListUse> {
        Vec::new()
    }

    /// Makes room for what such a frame wanted. True if there was too little.
    fn grow(&mut self, _: &Arc<Gpu>, _: &Counters) -> Result<bool> {
        Ok(false)
    }
}

/// What a compositor is made for.
struct Setting<'a> {
    gpu: &'a Arc<Gpu>,
    shading: Shading,
    extent: [u32; 2],
    precision: Precision,
    budget: NodeBudget,
}

/// How a kind of compositor comes to be.
struct Kind {
    /// Whether a device can run it with a window of so many segments, or a sentence why not.
    supports: fn(u32, &Capabilities) -> Result<(), String>,
    /// Pipelines and state, with a window of so many segments.
    open: fn(&Setting<'_>, u32) -> Result<Box<dyn Compositor>>,
}

/// The compositor of a mode and the length of its window; none for a mode that stands for others.
fn kind(mode: Blend) -> Option<(&'static Kind, u32)> {
    match mode {
        Blend::Interlock(k) => Some((&interlock::KIND, k)),
        Blend::Attachment(k) => Some((&attachment::KIND, k)),
        Blend::List => Some((&list::KIND, 1)),
        Blend::Tiled => Some((&tiled::KIND, 1)),
        Blend::Alpha => Some((&alpha::KIND, 1)),
        Blend::Auto | Blend::Exact | Blend::Impostor => None,
    }
}

/// Whether a device can run `mode`, or a sentence why not.
pub fn supports(mode: Blend, capabilities: &Capabilities) -> Result<(), String> {
    match (mode, kind(mode)) {
        (_, Some((_, k))) if !WINDOWS.contains(&k) => Err(format!("a window has one of {WINDOWS:?} segments, not {k}")),
        (_, Some((kind, k))) => (kind.supports)(k, capabilities),
        (Blend::Auto | Blend::Exact, None) => Ok(()),
        (other, None) => Err(format!("{other} is not in this version yet")),
    }
}

/// Of compositors that run on every device.
fn anywhere(_: u32, _: &Capabilities) -> Result<(), String> {
    Ok(())
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
    compositor: Box<dyn Compositor>,
    extent: [u32; 2],
}

/// What the blend pipelines are made for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shading {
    /// Whose source function colours the segments.
    pub lighting: Lighting,
    /// Constant density inside each ellipsoid: no density table, no detail.
    pub homogeneous: bool,
}

impl Shading {
    fn specialization(self) -> [(&'static str, u32); 1] {
        [("HOMOGENEOUS", u32::from(self.homogeneous))]
    }
}

impl Blender {
    /// Pipelines and per-pixel state of `mode` for targets of `extent` pixels.
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
        let used = choose(mode, gpu.capabilities())?.used;
        let Some((kind, k)) = kind(used) else {
            return Err(Error::Unsupported { needed: format!("blend mode {used}"), by: "this version".into() });
        };
        let compositor = (kind.open)(&Setting { gpu, shading, extent, precision, budget }, k)?;
        Ok(Self { compositor, extent })
    }

    /// Records the drawing of all visible particles.
    pub fn record(&self, rec: &mut Recorder<'_>, inputs: &BlendInputs<'_>, targets: &CloudTargets) -> Result<()> {
        self.compositor.record(rec, inputs, targets, self.extent)
    }

    /// The lists of the mode, if it has any, and what a frame with these `counters` wanted of them.
    #[must_use]
    pub fn lists(&self, counters: &Counters) -> Vec<ListUse> {
        self.compositor.lists(counters)
    }

    /// Makes room for the list nodes that the last frame wanted; the device must be idle. True if there was too little:
    /// that frame lacks segments.
    pub fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        self.compositor.grow(gpu, counters)
    }
}

const OPTICAL_DEPTH_SAMPLER: Sampler = Sampler::LinearRepeatClampRepeat;
