//! The sky: what the views of a frame share. Particles, their light, the air and the shadows of the clouds, once a frame.

use std::sync::Arc;

use ash::vk;

use crate::Result;
use crate::atmosphere::{Air, Atmosphere, CloudShadow};
use crate::blend::medium::MediumParams;
use crate::detail::DetailTile;
use crate::frame::TableImages;
use crate::gpu::{Buffer, BufferKind, Gpu, Image, ImageDesc, Recorder, Resource};
use crate::grid::{Counters, ParticleSet};
use crate::lighting::{self, Lent, Method, Scene};
use crate::lists::ListUse;
use crate::params::{Animation, Camera, Params, SkyModel, Style, Sun, SunPosition};
use crate::shared::FrameParams;
use crate::source::{self, ParticleSource, Place};
use crate::tiling::{NODES_PER_PARTICLE, TileNode, Tiling, TilingParams};

/// The clouds and the air of a frame. [`View`](crate::view::View)s look at it.
pub struct Sky {
    params: Params,
    slots: usize,
    source: Box<dyn ParticleSource>,
    set: ParticleSet,
    tiling: Tiling,
    light: Box<dyn Method>,
    detail: DetailTile,
    medium: Buffer,
    frame: Vec<Buffer>,
    atmosphere: Atmosphere,
    shadow: CloudShadow,
    /// Stands in for tables that nothing reads.
    no_table: Image,
    now: Option<Now>,
}

/// The frame that was recorded last.
#[derive(Clone, Copy)]
struct Now {
    place: Place,
    fill: f32,
}

impl Sky {
    /// Pipelines, lists and tables of air for `params`, with `slots` frames in flight. Everything that is compiled is
    /// compiled here, and everything that is allocated is allocated here or in [`Self::grow`].
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) for parameters out of range;
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(gpu: &Arc<Gpu>, params: &Params, slots: usize) -> Result<Self> {
        params.validate()?;
        let source = source::open(gpu, params, slots)?;
        let set = ParticleSet::new(gpu, source.capacity())?;
        // A million particles make do with fewer each: they are small.
        let most = gpu.capabilities().max_storage_buffer_range / size_of::<TileNode>() as u32;
        let nodes = set.capacity().saturating_mul(NODES_PER_PARTICLE).min(most);
        let (spread, levels) = (source.spread(), source.levels());
        let setting = lighting::Setting { gpu, params, spread, capacity: set.capacity(), levels, slots };
        let frame = (0..slots)
            .map(|_| Buffer::new(gpu, "sky frame params", size_of::<FrameParams>() as u64, BufferKind::Upload))
            .collect::<Result<_>>()?;
        Ok(Self {
            tiling: Tiling::new(gpu, levels, set.capacity(), nodes, slots)?,
            light: lighting::open(&setting)?,
            detail: DetailTile::new(gpu)?,
            medium: Buffer::upload(gpu, "medium", &[MediumParams::new(&params.clouds)])?,
            frame,
            atmosphere: Atmosphere::new(gpu, params.sky.model, &Air::of(&params.sky, &params.sun))?,
            shadow: CloudShadow::new(gpu)?,
            no_table: Image::new(
                gpu,
                &ImageDesc {
                    name: "no table",
                    extent: [1, 1, 2],
                    format: vk::Format::R16G16_SFLOAT,
                    usage: vk::ImageUsageFlags::SAMPLED,
                },
            )?,
            params: params.clone(),
            slots,
            source,
            set,
            now: None,
        })
    }

    /// What the sky is made from.
    #[must_use]
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Frames in flight.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Moves the sun, from the next frame on. Its irradiance and size stay as they were.
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) if an angle is out of range.
    pub fn set_sun(&mut self, position: SunPosition) -> Result<()> {
        let sun = Sun { position, ..self.params.sun };
        sun.validate()?;
        self.params.sun = sun;
        Ok(())
    }

    /// Moves the clouds on to `time` [s], from the next frame on: by the wind, the evolution and the velocities that the
    /// parameters have. What it shows depends on the time alone, which may also go back. The sun and the cameras are the
    /// host's to move; [`Params::at_frame`] has all three for a scene's animation.
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) if the time is out of range.
    pub fn set_time(&mut self, time: f64) -> Result<()> {
        let animation = Animation { time, ..self.params.animation.clone() };
        animation.validate()?;
        self.source.set_time(&animation);
        self.params.animation = animation;
        Ok(())
    }

    /// Whether the particles of `params` need their tables ([`TableImages`]).
    #[must_use]
    pub fn needs_tables(params: &Params) -> bool {
        params.clouds.style != Style::Homogeneous || params.clouds.lighting.row().reads_tables
    }

    /// Records the clouds and the air around `centre` \[m\], for every view of this frame: views may stand some metres apart,
    /// as two eyes do. `fill` is that of [`TableImages`], 1 without tables. Same rules as for
    /// [`Renderer::record_frame`](crate::renderer::Renderer::record_frame).
    ///
    /// # Errors
    /// What Vulkan says.
    pub fn record(&mut self, rec: &mut Recorder<'_>, centre: [f64; 3], fill: f32) -> Result<()> {
        let slot = rec.slot();
        let now = Now { place: Place::around(centre), fill };
        self.now = Some(now);
        let place = &now.place;
        let frame = self.frame_params(&Camera { position: centre, ..self.params.camera }, [1, 1], [1, 1], now);
        self.frame[slot].write(0, &[frame]);
        self.detail.record(rec)?;
        let to_sun = self.params.sun.to_sun();
        let (set, source) = (&self.set, &mut self.source);
        rec.pass("grid", |rec| source.record(rec, place, set))?;
        let layer = self.source.layer(place);
        let tiles = TilingParams::new(to_sun, &layer.slab(), self.params.clouds.sigma_t * fill);
        rec.pass("tiling", |rec| self.tiling.record(rec, &tiles, set))?;
        let scene = Scene {
            params: &self.params,
            set,
            tiling: &self.tiling,
            cells: self.source.cells(),
            place,
            layer: &layer,
            drift: self.params.animation.clouds().drift,
            to_sun,
            fill,
        };
        self.light.record(rec, &scene)?;
        if self.params.sky.model == SkyModel::Atmosphere {
            self.shadow.record(rec, &self.tiling, frame.camera)?;
        }
        let cloud_base = self.cloud_base();
        self.atmosphere.record_luts(rec, &self.frame[slot], &frame, &self.shadow, cloud_base)
    }

    /// Makes lists longer that were too small for a frame with these counts. True if any was. The device must be idle, and
    /// the caller then calls [`RecorderState::forget`](crate::gpu::RecorderState::forget).
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        let mut grew = self.set.grow(gpu, counters)?;
        grew |= self.source.grow(gpu, counters)?;
        grew |= self.light.grow(gpu, counters, &self.set)?;
        grew |= self.tiling.grow(gpu, counters, &self.set)?;
        Ok(grew)
    }

    /// Every list with its size and what a frame with these counts wanted of it.
    #[must_use]
    pub fn lists(&self, counters: &Counters) -> Vec<ListUse> {
        let mut lists = vec![
            ListUse { name: "particles", needed: counters.generated, capacity: self.set.capacity() },
            ListUse { name: "tile_nodes", needed: counters.tile_nodes, capacity: self.tiling.node_capacity() },
        ];
        lists.extend(self.source.lists(counters));
        lists.extend(self.light.lists(counters));
        lists
    }

    /// Altitude of the lowest clouds [m].
    pub(crate) fn cloud_base(&self) -> f32 {
        self.source.base()
    }

    /// The particles.
    pub(crate) fn set(&self) -> &ParticleSet {
        &self.set
    }

    /// Tile of billow noise.
    pub(crate) fn detail(&self) -> &DetailTile {
        &self.detail
    }

    /// [`MediumParams`].
    pub(crate) fn medium(&self) -> &Buffer {
        &self.medium
    }

    pub(crate) fn atmosphere(&self) -> &Atmosphere {
        &self.atmosphere
    }

    pub(crate) fn shadow(&self) -> &CloudShadow {
        &self.shadow
    }

    pub(crate) fn light(&self) -> &dyn Method {
        &*self.light
    }

    /// `tables`, or stand-ins that nothing reads.
    pub(crate) fn tables_or_none<'a>(&'a self, tables: Option<TableImages<'a>>) -> TableImages<'a> {
        let none = &self.no_table;
        tables.unwrap_or(TableImages { optical_depth: none, scattering: none, fill: 1.0 })
    }

    /// What the source function of the lighting method reads.
    pub(crate) fn light_resources<'a>(
        &'a self,
        slot: usize,
        tables: TableImages<'a>,
    ) -> Vec<(&'static str, Resource<'a>)> {
        let sky_light = self.atmosphere.sky_light();
        self.light.resources(&Lent { slot, scattering: tables.scattering, sky_light })
    }

    /// Parameters of a view of `extent` pixels, whose cloud targets have `low_extent`, of the frame recorded last.
    ///
    /// # Panics
    /// If none was recorded.
    pub(crate) fn view_params(&self, camera: &Camera, extent: [u32; 2], low_extent: [u32; 2]) -> FrameParams {
        let Some(now) = self.now else { panic!("a view was recorded before its sky") };
        self.frame_params(camera, extent, low_extent, now)
    }

    fn frame_params(&self, camera: &Camera, extent: [u32; 2], low_extent: [u32; 2], now: Now) -> FrameParams {
        let basis = camera.basis();
        let f32s = |v: [f64; 3]| v.map(|c| c as f32);
        FrameParams {
            camera: f32s(now.place.relative(camera.position)),
            tan_half_fov_y: (camera.fov_y.to_radians() * 0.5).tan() as f32,
            right: f32s(basis.right),
            aspect: extent[0] as f32 / extent[1] as f32,
            up: f32s(basis.up),
            width: extent[0],
            forward: f32s(basis.forward),
            height: extent[1],
            to_sun: f32s(self.params.sun.to_sun()),
            sigma_t: self.params.clouds.sigma_t,
            low_width: low_extent[0],
            low_height: low_extent[1],
            seed: self.params.clouds.seed,
            time: self.params.animation.time as f32,
            origin: f32s(now.place.origin),
            fill: now.fill,
            detail_origin: f32s(self.params.animation.clouds().detail_origin(now.place.origin)),
            reserved: 0,
        }
    }
}
