//! One view of one sky, for hosts that need no more: records both in the order of the paper's pipeline.
//!
//! Of the [`Sky`]: `grid` makes particles → `tiling` and `lighting` find the sunlight that reaches each. Of the [`View`]:
//! `compact` keeps and sorts the visible ones → `blend` draws them into the cloud targets. Nothing is read back, allocated or
//! compiled inside a frame; lists that were too small are grown between frames ([`Renderer::finish`]).

use std::sync::Arc;

use crate::Result;
use crate::blend::{Choice, CloudTargets};
use crate::film::Film;
use crate::frame::{FrameInputs, FrameOutput};
use crate::gpu::{Gpu, Recorder};
use crate::grid::Counters;
use crate::params::{Camera, Params, SunPosition};
use crate::sky::Sky;
use crate::view::View;

pub use crate::frame::TableImages;
pub use crate::lists::ListUse;

/// Records cloudy frames of one scene at one size.
pub struct Renderer {
    sky: Sky,
    view: View,
}

impl Renderer {
    /// Pipelines, lists and targets for `params` at `extent` pixels, with `slots` frames in flight. Everything that is
    /// compiled is compiled here, and everything that is allocated is allocated here or in [`Self::finish`].
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) for parameters out of range;
    /// [`Error::Unsupported`](crate::Error::Unsupported), with the reason, for a blend mode that the device lacks;
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(gpu: &Arc<Gpu>, params: &Params, extent: [u32; 2], slots: usize) -> Result<Self> {
        let sky = Sky::new(gpu, params, slots)?;
        let view = View::new(gpu, &sky, extent)?;
        Ok(Self { sky, view })
    }

    /// What is seen.
    #[must_use]
    pub fn sky(&self) -> &Sky {
        &self.sky
    }

    /// Its picture.
    #[must_use]
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Which blend mode is used, and why.
    #[must_use]
    pub fn choice(&self) -> &Choice {
        self.view.choice()
    }

    /// What the blend stage wrote.
    #[must_use]
    pub fn targets(&self) -> &CloudTargets {
        self.view.targets()
    }

    /// The finished frame: scene radiance and the toned picture.
    #[must_use]
    pub fn film(&self) -> &Film {
        self.view.film()
    }

    /// Moves the sun, from the next frame on. Its irradiance and size stay as they were.
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) if an angle is out of range.
    pub fn set_sun(&mut self, position: SunPosition) -> Result<()> {
        self.sky.set_sun(position)
    }

    /// Moves the clouds on to `time` [s], from the next frame on: see [`Sky::set_time`].
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) if the time is out of range.
    pub fn set_time(&mut self, time: f64) -> Result<()> {
        self.sky.set_time(time)
    }

    /// Records one frame seen by `camera` into the renderer's own images: [`Self::film`], [`Self::targets`].
    pub fn record(&mut self, rec: &mut Recorder<'_>, camera: &Camera, tables: TableImages<'_>) -> Result<()> {
        self.record_frame(rec, &FrameInputs::new(camera, tables), None)
    }

    /// Records one frame of `inputs`, with `output` into an image of the host's.
    ///
    /// Only commands are recorded: nothing is submitted, waited for, allocated or compiled. (The first frame also fills the
    /// noise tile and the air's tables.) The caller owes:
    ///
    /// - what [`RecorderState::begin`](crate::gpu::RecorderState::begin) asks: above all, that the last frame of this slot
    ///   has ended on the device, since its parameters are overwritten now;
    /// - lent images in the layout that their entry names, the access named there being the last one; on return of the
    ///   call the commands leave them in their exit layout, and a command of the host's with the exit access needs no
    ///   barrier of its own;
    /// - a barrier of its own before it uses an image of the renderer's ([`Self::film`], [`Self::targets`]) itself:
    ///   [`Recorder::share`] records it;
    /// - frames of one renderer submitted in the order of their recording, to one queue or ordered by semaphores: they
    ///   share lists and images;
    /// - when a frame has ended, a look at [`Self::wants_more`].
    ///
    /// # Panics
    /// If the tables are missing although the particles need them, or if a lent image has another size or format than
    /// [`FrameInputs`] and [`FrameOutput`] ask for.
    pub fn record_frame(
        &mut self,
        rec: &mut Recorder<'_>,
        inputs: &FrameInputs<'_>,
        output: Option<&FrameOutput<'_>>,
    ) -> Result<()> {
        self.sky.record(rec, inputs.camera.position, inputs.tables.map_or(1.0, |tables| tables.fill))?;
        self.view.record(rec, &self.sky, inputs, output)
    }

    /// Everything before the clouds are composited: particles and their light, the air, sky and ground behind. `fill` is
    /// that of [`TableImages`].
    pub(crate) fn record_scene(&mut self, rec: &mut Recorder<'_>, camera: &Camera, fill: f32) -> Result<()> {
        self.sky.record(rec, camera.position, fill)?;
        self.view.record_visible(rec, &self.sky, camera)
    }

    /// Whether a list was too small for the frame in `slot`, which must have ended: it lacks particles or shadows. A host
    /// then waits until the device is done with every frame of this renderer and calls [`Self::finish`].
    #[must_use]
    pub fn wants_more(&self, slot: usize) -> bool {
        self.view.wants_more(&self.sky, slot)
    }

    /// Looks at the counts of the frame in `slot`, which must have ended, and grows the lists that were too small. True
    /// if any was: the frame lacks particles or shadows, and should be recorded again where that matters. The device
    /// must be idle, and the caller then calls [`RecorderState::forget`](crate::gpu::RecorderState::forget).
    pub fn finish(&mut self, gpu: &Arc<Gpu>, slot: usize) -> Result<bool> {
        let grew = self.sky.grow(gpu, &self.view.counters(slot))?;
        Ok(self.view.grow(gpu, &self.sky, slot)? || grew)
    }

    /// Counts of the frame in `slot`, which must have ended.
    #[must_use]
    pub fn counters(&self, slot: usize) -> Counters {
        self.view.counters(slot)
    }

    /// Every list with its size and what the frame in `slot` wanted of it.
    #[must_use]
    pub fn lists(&self, slot: usize) -> Vec<ListUse> {
        self.view.lists(&self.sky, slot)
    }
}
