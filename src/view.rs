//! A view of the sky: what is seen of it from one camera. Visible particles, compositing and the picture, once a picture.

use std::sync::Arc;

use crate::Result;
use crate::atmosphere::Background;
use crate::blend::{BlendInputs, Blender, Choice, CloudTargets, Shading, choose};
use crate::compact::{Compact, frustum_planes};
use crate::film::Film;
use crate::frame::{FrameInputs, FrameOutput, assert_size};
use crate::gpu::{Buffer, BufferKind, Gpu, MethodBindings, Recorder};
use crate::grid::{CounterReadback, Counters};
use crate::lighting::Seen;
use crate::lists::ListUse;
use crate::params::{Camera, Style};
use crate::shared::FrameParams;
use crate::sky::Sky;

/// Records pictures of one size of one [`Sky`].
pub struct View {
    extent: [u32; 2],
    low_extent: [u32; 2],
    choice: Choice,
    compact: Compact,
    blender: Blender,
    targets: CloudTargets,
    background: Background,
    film: Film,
    frame: Vec<Buffer>,
    counters: CounterReadback,
}

impl View {
    /// Pipelines, lists and targets for pictures of `sky` of `extent` pixels. Everything that is compiled is compiled here,
    /// and everything that is allocated is allocated here or in [`Self::grow`].
    ///
    /// # Errors
    /// [`Error::Unsupported`](crate::Error::Unsupported), with the reason, for a blend mode that the device lacks;
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(gpu: &Arc<Gpu>, sky: &Sky, extent: [u32; 2]) -> Result<Self> {
        let params = sky.params();
        let quality = &params.quality;
        let low_extent = extent.map(|pixels| pixels.div_ceil(quality.downscale));
        let choice = choose(quality.blend, gpu.capabilities())?;
        let shading =
            Shading { lighting: params.clouds.lighting, homogeneous: params.clouds.style == Style::Homogeneous };
        let frame = (0..sky.slots())
            .map(|_| Buffer::new(gpu, "frame params", size_of::<FrameParams>() as u64, BufferKind::Upload))
            .collect::<Result<_>>()?;
        Ok(Self {
            compact: Compact::new(gpu, sky.set().capacity())?,
            blender: Blender::new(gpu, choice.used, shading, low_extent, quality.precision)?,
            targets: CloudTargets::new(gpu, low_extent, quality.precision)?,
            background: Background::new(gpu, params.sky.model, extent, quality.downscale, quality.precision)?,
            film: Film::new(gpu, extent, quality.precision)?,
            counters: CounterReadback::new(gpu, sky.slots())?,
            extent,
            low_extent,
            choice,
            frame,
        })
    }

    /// Which blend mode is used, and why.
    #[must_use]
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// What the blend stage wrote.
    #[must_use]
    pub fn targets(&self) -> &CloudTargets {
        &self.targets
    }

    /// The finished picture: scene radiance, and toned.
    #[must_use]
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Records one picture of `sky`, which was recorded before it for the same frame slot, with `output` into an image of
    /// the host's. A view records one picture a frame; more views of one frame are more [`View`]s. Same rules as for
    /// [`Renderer::record_frame`](crate::renderer::Renderer::record_frame).
    ///
    /// # Errors
    /// What Vulkan says.
    ///
    /// # Panics
    /// If the sky was not recorded, the tables are missing although its particles need them, or a lent image has another size
    /// or format than [`FrameInputs`] and [`FrameOutput`] ask for.
    pub fn record(
        &mut self,
        rec: &mut Recorder<'_>,
        sky: &Sky,
        inputs: &FrameInputs<'_>,
        output: Option<&FrameOutput<'_>>,
    ) -> Result<()> {
        if let Some(lent) = &inputs.opaque_distance {
            assert_size(lent.image, self.extent);
            rec.acquire(lent.image, lent.entry.0, lent.entry.1);
        }
        self.record_passes(rec, sky, inputs)?;
        if let Some(lent) = &inputs.opaque_distance {
            rec.release(lent.image, lent.exit.0, lent.exit.1);
        }
        output.map_or(Ok(()), |output| output.output.record(rec, &self.film, &output.target))
    }

    fn record_passes(&mut self, rec: &mut Recorder<'_>, sky: &Sky, inputs: &FrameInputs<'_>) -> Result<()> {
        let needs_tables = Sky::needs_tables(sky.params());
        assert!(inputs.tables.is_some() || !needs_tables, "the scene's particles need their tables");
        self.record_visible(rec, sky, inputs.camera)?;
        if let Some(lent) = &inputs.opaque_distance {
            self.background.record_lent(rec, lent.image)?;
        }
        let (slot, tables) = (rec.slot(), sky.tables_or_none(inputs.tables));
        let blend_inputs = BlendInputs {
            frame: &self.frame[slot],
            particles: sky.set().particles(),
            order: self.compact.order(),
            medium: sky.medium(),
            optical_depth_lut: tables.optical_depth,
            detail_tile: &sky.detail().image,
            opaque_distance: &self.background.low_opaque,
            lighting: MethodBindings {
                method: sky.params().clouds.lighting.name(),
                resources: &sky.light_resources(slot, tables),
            },
            draw_args: self.compact.args(),
            draw_args_offset: Compact::DRAW_ARGS,
            counters: sky.set().counters(),
        };
        self.blender.record(rec, &blend_inputs, &self.targets)?;
        self.record_film(rec, sky)?;
        self.record_counters(rec, sky);
        Ok(())
    }

    /// Everything before the clouds are composited: visible particles and what they show of their light, sky and ground
    /// behind.
    pub(crate) fn record_visible(&self, rec: &mut Recorder<'_>, sky: &Sky, camera: &Camera) -> Result<()> {
        let params = sky.view_params(camera, self.extent, self.low_extent);
        let frame = &self.frame[rec.slot()];
        frame.write(0, &[params]);
        let set = sky.set();
        rec.pass("compact", |rec| self.compact.record(rec, set, &frustum_planes(&params), params.camera))?;
        sky.light().record_seen(rec, &Seen { frame, set, compact: &self.compact })?;
        self.background.record_opaque(rec, sky.atmosphere(), frame)?;
        self.background.record(rec, sky.atmosphere(), frame, sky.shadow(), sky.cloud_base())
    }

    /// Makes the counts of the frame readable by [`Self::counters`].
    pub(crate) fn record_counters(&self, rec: &mut Recorder<'_>, sky: &Sky) {
        self.counters.record(rec, sky.set());
    }

    /// Everything after the clouds are in [`Self::targets`]: the air in front, the background behind, the picture.
    pub(crate) fn record_film(&self, rec: &mut Recorder<'_>, sky: &Sky) -> Result<()> {
        let (background, film, params) = (&self.background, &self.film, sky.params());
        let frame = &self.frame[rec.slot()];
        let cloud = background.record_cloud_air(rec, sky.atmosphere(), frame, &self.targets, sky.cloud_base())?;
        film.record_composite(rec, cloud, &background.low_opaque, &background.opaque_distance, &background.radiance)?;
        film.record_tonemap(rec, &params.film, params.sky.model)
    }

    /// What is behind the clouds.
    pub(crate) fn background(&self) -> &Background {
        &self.background
    }

    /// Whether a list of the view or of `sky` was too small for the frame in `slot`, which must have ended.
    #[must_use]
    pub fn wants_more(&self, sky: &Sky, slot: usize) -> bool {
        self.lists(sky, slot).iter().any(|list| list.needed > list.capacity)
    }

    /// Follows `sky`, which has grown or not, and makes room for what the frame in `slot`, which must have ended, wanted of
    /// the view's own lists. True if anything was too small. As for [`Sky::grow`].
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn grow(&mut self, gpu: &Arc<Gpu>, sky: &Sky, slot: usize) -> Result<bool> {
        let counters = self.counters(slot);
        let grew = self.compact.grow(gpu, sky.set())?;
        Ok(self.blender.grow(gpu, &counters)? || grew)
    }

    /// Counts of the frame in `slot`, which must have ended.
    #[must_use]
    pub fn counters(&self, slot: usize) -> Counters {
        self.counters.read(slot)
    }

    /// Every list of the view and of `sky`, with its size and what the frame in `slot` wanted of it.
    #[must_use]
    pub fn lists(&self, sky: &Sky, slot: usize) -> Vec<ListUse> {
        let counters = self.counters(slot);
        let mut lists = sky.lists(&counters);
        lists.extend(self.blender.lists(&counters));
        lists
    }
}
