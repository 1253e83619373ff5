//! How particles come to shine: one module, one folder of `glsl/lighting` and one oracle for each method.
//!
//! A method owns its passes and resources. Once a frame it finds the light of all particles, once a picture what visible ones
//! show of it, and compositing asks its `source.glsl` for the colour of each segment (`glsl/lighting/hit.glsl`). A new one
//! touches its own folders, [`Lighting`] with its row in [`LIGHTINGS`](crate::params::LIGHTINGS), the scene's keys if it has any,
//! and `open`.
//!
//! Shaders of any method get shadows at any point from `glsl/lighting/sun_optical_depth.glsl`.

pub mod attenuation;
mod flat;
pub mod forward;
pub mod tables;

use std::sync::Arc;

use crate::Result;
use crate::compact::Compact;
use crate::gpu::{Buffer, Gpu, Image, Recorder, Resource};
use crate::grid::{Counters, Grid, ParticleSet};
use crate::lists::ListUse;
use crate::params::{Lighting, Params};
use crate::source::{Layer, Place, Spread};
use crate::tiling::Tiling;

/// What a method is made for.
pub(crate) struct Setting<'a> {
    pub gpu: &'a Arc<Gpu>,
    pub params: &'a Params,
    /// How the source's particles are spread.
    pub spread: Spread,
    /// Particles that the set holds.
    pub capacity: u32,
    /// Levels of light tiles.
    pub levels: u32,
    /// Frames in flight.
    pub slots: usize,
}

/// The particles of a frame and what light needs to know of them.
pub(crate) struct Scene<'a> {
    pub params: &'a Params,
    pub set: &'a ParticleSet,
    pub tiling: &'a Tiling,
    /// The grid's cells, if particles come from a grid.
    pub cells: Option<&'a Grid>,
    pub place: &'a Place,
    pub layer: &'a Layer,
    /// How far the wind has carried the particles, x and z [m].
    pub drift: [f64; 2],
    /// Unit direction towards the sun.
    pub to_sun: [f64; 3],
    /// Mean density of a particle along a chord through its centre.
    pub fill: f32,
}

/// A view of the frame.
pub(crate) struct Seen<'a> {
    /// [`FrameParams`](crate::shared::FrameParams) of the view.
    pub frame: &'a Buffer,
    pub set: &'a ParticleSet,
    pub compact: &'a Compact,
}

/// What others lend a method's source function.
pub(crate) struct Lent<'a> {
    /// Frame slot.
    pub slot: usize,
    /// Scattering table.
    pub scattering: &'a Image,
    /// [`SkyLight`](crate::atmosphere::SkyLight).
    pub sky_light: &'a Buffer,
}

/// A way of lighting particles.
pub(crate) trait Method {
    /// Finds the light of all particles, once a frame.
    fn record(&mut self, rec: &mut Recorder<'_>, scene: &Scene<'_>) -> Result<()>;

    /// Finds what visible particles show of it, once a picture.
    fn record_seen(&self, _: &mut Recorder<'_>, _: &Seen<'_>) -> Result<()> {
        Ok(())
    }

    /// What the method's `source.glsl` reads, by the names that it has there.
    fn resources<'a>(&'a self, lent: &Lent<'a>) -> Vec<(&'static str, Resource<'a>)>;

    /// Follows a set that has grown, and makes room in lists of its own for what a frame with these counts wanted. True if
    /// anything was too small.
    fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters, set: &ParticleSet) -> Result<bool>;

    /// Its lists, and what a frame with these counts wanted of them.
    fn lists(&self, _: &Counters) -> Vec<ListUse> {
        Vec::new()
    }
}

/// The method that the parameters ask for.
///
/// # Errors
/// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and what else Vulkan says.
///
/// # Panics
/// If [`Params::validate`] does not let the method pass.
pub(crate) fn open(setting: &Setting<'_>) -> Result<Box<dyn Method>> {
    match setting.params.clouds.lighting {
        Lighting::Tables => Ok(Box::new(tables::TableLight::new(setting)?)),
        Lighting::Flat => Ok(Box::new(flat::Flat)),
        Lighting::Forward => Ok(Box::new(forward::ForwardLight::new(setting)?)),
        Lighting::Attenuation => Ok(Box::new(attenuation::AttenuationLight::new(setting)?)),
        later @ (Lighting::March | Lighting::MarchCached | Lighting::MarchMulti | Lighting::Path) => {
            panic!("validation has let the lighting method {} pass", later.name())
        }
    }
}
