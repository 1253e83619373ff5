//! The frame: owns the passes and records them in the order of the paper's pipeline.
//!
//! `density` and `grid` (or an explicit list) make particles → `compact` keeps and sorts the visible ones → `tiling` and
//! `lighting` find the sunlight that reaches each → `blend` draws them into the cloud targets. Nothing is read back,
//! allocated or compiled inside a frame; lists that were too small are grown between frames ([`Renderer::finish`]).

use crate::Result;
use crate::atmosphere::{Air, Atmosphere, Background, CloudShadow};
use crate::blend::medium::MediumParams;
use crate::blend::{BlendInputs, Blender, Choice, CloudTargets, Shading, choose};
use crate::compact::{Compact, frustum_planes};
use crate::detail::DetailTile;
use crate::film::Film;
use crate::frame::{FrameInputs, FrameOutput, assert_size};
use crate::gpu::{Buffer, BufferKind, Gpu, Image, ImageDesc, Recorder};
use crate::grid::{CounterReadback, Counters, Grid, GridDesign, ParticleList, ParticleSet};
use crate::lighting::Lighting;
use crate::lighting::volume::{LightVolume, Place, VolumeDesign, VolumeMedium, mean_profile};
use crate::params::{
    Camera, Clouds, Lighting as LightingKind, Params, Quality, SkyModel, Source, Style, Sun, SunPosition, Transfer,
};
use crate::shared::FrameParams;
use crate::tiling::{Slab, Tiling, TilingParams};
use ash::vk;
use std::sync::Arc;

pub use crate::frame::TableImages;

/// Radius of the planet at sea level [m].
pub const PLANET_RADIUS: f64 = 6.36e6;

/// Light list nodes to begin with, per particle that fits.
const NODES_PER_PARTICLE: u32 = 7;

/// Where the particles come from.
enum Particles {
    Grid(Box<Grid>, Box<GridDesign>),
    List(ParticleList),
}

/// Records cloudy frames of one scene at one size.
pub struct Renderer {
    params: Params,
    extent: [u32; 2],
    low_extent: [u32; 2],
    choice: Choice,
    particles: Particles,
    set: ParticleSet,
    compact: Compact,
    tiling: Tiling,
    lighting: Lighting,
    volume: LightVolume,
    /// Mean density of a particle over its ball.
    mean_profile: f32,
    detail: DetailTile,
    detail_filled: bool,
    blender: Blender,
    targets: CloudTargets,
    frame: Vec<Buffer>,
    medium: Buffer,
    atmosphere: Atmosphere,
    background: Background,
    shadow: CloudShadow,
    film: Film,
    counters: CounterReadback,
    /// Stands in for tables that nothing reads.
    no_table: Image,
}

/// Parts of a frame that others than the renderer read.
pub(crate) struct SceneParts<'a> {
    pub set: &'a ParticleSet,
    pub detail: &'a DetailTile,
    pub atmosphere: &'a Atmosphere,
    pub shadow: &'a CloudShadow,
    pub background: &'a Background,
}

/// Sizes of the lists and what the last frame wanted of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListUse {
    /// Name of the list.
    pub name: &'static str,
    /// Elements wanted.
    pub needed: u32,
    /// Elements that fit.
    pub capacity: u32,
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
        params.validate()?;
        let quality = &params.quality;
        let low_extent = extent.map(|pixels| pixels.div_ceil(quality.downscale));
        let choice = choose(quality.blend, gpu.capabilities())?;
        let shading =
            Shading { lighting: params.clouds.lighting, homogeneous: params.clouds.style == Style::Homogeneous };
        let (particles, capacity) = match &params.clouds.source {
            Source::Particles(list) => {
                let list = ParticleList::new(gpu, list, slots)?;
                let count = list.count();
                (Particles::List(list), count)
            }
            _ => {
                let design = GridDesign::new(&params.clouds, quality, PLANET_RADIUS);
                let grid = Grid::new(gpu, &design, &params.clouds.coverage, slots)?;
                let estimate = design.particle_estimate();
                (Particles::Grid(Box::new(grid), Box::new(design)), estimate)
            }
        };
        let levels = match &particles {
            Particles::Grid(_, design) => design.level_half_widths().len() as u32,
            Particles::List(_) => 1,
        };
        let set = ParticleSet::new(gpu, capacity)?;
        let frame = (0..slots)
            .map(|_| Buffer::new(gpu, "frame params", size_of::<FrameParams>() as u64, BufferKind::Upload))
            .collect::<Result<_>>()?;
        Ok(Self {
            compact: Compact::new(gpu, set.capacity())?,
            tiling: Tiling::new(gpu, levels, set.capacity(), set.capacity().saturating_mul(NODES_PER_PARTICLE), slots)?,
            lighting: Lighting::new(gpu, set.capacity())?,
            mean_profile: mean_profile(params.clouds.style, params.clouds.seed),
            volume: LightVolume::new(gpu, volume_design(&particles, &params.clouds, quality), slots)?,
            detail: DetailTile::new(gpu)?,
            detail_filled: false,
            blender: Blender::new(gpu, choice.used, shading, low_extent, quality.precision)?,
            targets: CloudTargets::new(gpu, low_extent, quality.precision)?,
            frame,
            medium: Buffer::upload(gpu, "medium", &[MediumParams::new(&params.clouds)])?,
            atmosphere: Atmosphere::new(gpu, params.sky.model, &Air::of(&params.sky, &params.sun))?,
            background: Background::new(gpu, params.sky.model, extent, quality.downscale, quality.precision)?,
            shadow: CloudShadow::new(gpu)?,
            film: Film::new(gpu, extent, quality.precision)?,
            counters: CounterReadback::new(gpu, slots)?,
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
            extent,
            low_extent,
            choice,
            particles,
            set,
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

    /// The finished frame: scene radiance and the toned picture.
    #[must_use]
    pub fn film(&self) -> &Film {
        &self.film
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
        if let Some(lent) = &inputs.opaque_distance {
            assert_size(lent.image, self.extent);
            rec.acquire(lent.image, lent.entry.0, lent.entry.1);
        }
        self.record_passes(rec, inputs)?;
        if let Some(lent) = &inputs.opaque_distance {
            rec.release(lent.image, lent.exit.0, lent.exit.1);
        }
        output.map_or(Ok(()), |output| output.output.record(rec, &self.film, &output.target))
    }

    fn record_passes(&mut self, rec: &mut Recorder<'_>, inputs: &FrameInputs<'_>) -> Result<()> {
        let clouds = &self.params.clouds;
        let needs_tables = clouds.style != Style::Homogeneous || clouds.lighting != LightingKind::Flat;
        assert!(inputs.tables.is_some() || !needs_tables, "the scene's particles need their tables");
        self.record_scene(rec, inputs.camera, inputs.tables.map_or(1.0, |tables| tables.fill))?;
        if let Some(lent) = &inputs.opaque_distance {
            self.background.record_lent(rec, lent.image)?;
        }
        let no_table = &self.no_table;
        let tables = inputs.tables.unwrap_or(TableImages { optical_depth: no_table, scattering: no_table, fill: 1.0 });
        let blend_inputs = BlendInputs {
            frame: &self.frame[rec.slot()],
            particles: self.set.particles(),
            order: self.compact.order(),
            lights: self.set.lights(),
            medium: &self.medium,
            sky_light: self.atmosphere.sky_light(),
            optical_depth_lut: tables.optical_depth,
            scattering_lut: tables.scattering,
            detail_tile: &self.detail.image,
            opaque_distance: &self.background.low_opaque,
            volume: self.volume.params(rec.slot()),
            light_volume: self.volume.image(),
            draw_args: self.compact.args(),
            draw_args_offset: Compact::DRAW_ARGS,
            counters: self.set.counters(),
        };
        self.blender.record(rec, &blend_inputs, &self.targets)?;
        self.record_film(rec)?;
        self.record_counters(rec);
        Ok(())
    }

    /// Everything before the clouds are seen: particles and their light, the air, sky and ground behind. `fill` is that of
    /// [`TableImages`].
    pub(crate) fn record_scene(&mut self, rec: &mut Recorder<'_>, camera: &Camera, fill: f32) -> Result<()> {
        let slot = rec.slot();
        let origin = floating_origin(camera.position);
        let frame = self.frame_params(camera, origin, fill);
        self.frame[slot].write(0, &[frame]);

        if !self.detail_filled {
            self.detail.record(rec)?;
            self.detail_filled = true;
        }
        let to_sun = self.params.sun.to_sun();
        let extinction = self.params.clouds.sigma_t * fill;
        let (set, grid) = (&self.set, &mut self.particles);
        let slab = match grid {
            Particles::Grid(grid, design) => {
                let params = design.frame(camera.position, origin);
                rec.pass("grid", |rec| grid.record(rec, &params, set))?;
                let clouds = &self.params.clouds;
                TilingParams::new(
                    to_sun,
                    &Slab {
                        centre: std::array::from_fn(|i| camera.position[i] - origin[i]),
                        base: f64::from(clouds.altitude),
                        thickness: f64::from(clouds.thickness),
                        half_widths: &design.level_half_widths(),
                        greatest_extent: design.greatest_extent(),
                        planet_radius: PLANET_RADIUS,
                    },
                    extinction,
                )
            }
            Particles::List(list) => {
                rec.pass("grid", |rec| list.record(rec, origin, set))?;
                let [least, greatest] = list.bounds();
                let centre: [f64; 3] = std::array::from_fn(|i| 0.5 * (least[i] + greatest[i]) - origin[i]);
                let half = (0.5 * (greatest[0] - least[0])).max(0.5 * (greatest[2] - least[2]));
                TilingParams::new(
                    to_sun,
                    &Slab {
                        centre,
                        base: least[1] - origin[1],
                        thickness: greatest[1] - least[1],
                        half_widths: &[half],
                        greatest_extent: list.greatest_extent(),
                        planet_radius: f64::INFINITY,
                    },
                    extinction,
                )
            }
        };
        rec.pass("compact", |rec| self.compact.record(rec, set, &frustum_planes(&frame), frame.camera))?;
        rec.pass("tiling", |rec| self.tiling.record(rec, &slab, set))?;
        let grid = match &self.particles {
            Particles::Grid(grid, _) => Some(&**grid),
            Particles::List(_) => None,
        };
        let clouds = &self.params.clouds;
        rec.pass("lighting", |rec| {
            self.lighting.record(rec, &self.tiling, set, grid, clouds, self.volume.voxel_edge())
        })?;
        if clouds.lighting == LightingKind::Tables && clouds.transfer == Transfer::Diffusion {
            let place = Place {
                centre: slab.centre.map(f64::from),
                origin,
                base: f64::from(slab.base),
                planet_radius: 0.5 / f64::from(slab.inverse_diameter),
                to_sun,
            };
            let medium = VolumeMedium::with_mean(clouds, fill, self.mean_profile);
            let (volume, frame_buffer) = (&self.volume, &self.frame[slot]);
            rec.pass("light volume", |rec| {
                volume.record(rec, &place, &medium, set, self.lighting.sun_depths())?;
                volume.record_seen(rec, frame_buffer, set, &self.compact)
            })?;
        } else {
            self.volume.record_none(rec);
        }
        let (frame_buffer, cloud_base) = (&self.frame[slot], self.cloud_base());
        if self.params.sky.model == SkyModel::Atmosphere {
            self.shadow.record(rec, &self.tiling, frame.camera)?;
        }
        self.atmosphere.record_luts(rec, frame_buffer, &frame, &self.shadow, cloud_base)?;
        let (atmosphere, background) = (&self.atmosphere, &self.background);
        background.record_opaque(rec, atmosphere, frame_buffer)?;
        background.record(rec, atmosphere, frame_buffer, &self.shadow, cloud_base)?;
        Ok(())
    }

    /// Makes the counts of the frame readable by [`Self::counters`].
    pub(crate) fn record_counters(&self, rec: &mut Recorder<'_>) {
        self.counters.record(rec, &self.set);
    }

    /// Everything after the clouds are in [`Self::targets`]: the air in front, the background behind, the picture.
    pub(crate) fn record_film(&self, rec: &mut Recorder<'_>) -> Result<()> {
        let (atmosphere, background, film) = (&self.atmosphere, &self.background, &self.film);
        let frame = &self.frame[rec.slot()];
        let cloud = background.record_cloud_air(rec, atmosphere, frame, &self.targets, self.cloud_base())?;
        film.record_composite(rec, cloud, &background.low_opaque, &background.opaque_distance, &background.radiance)?;
        film.record_tonemap(rec, &self.params.film, self.params.sky.model)
    }

    /// What path tracing needs of the scene that [`Self::record_scene`] has made.
    pub(crate) fn parts(&self) -> SceneParts<'_> {
        SceneParts {
            set: &self.set,
            detail: &self.detail,
            atmosphere: &self.atmosphere,
            shadow: &self.shadow,
            background: &self.background,
        }
    }

    /// Altitude of the lowest clouds [m].
    pub(crate) fn cloud_base(&self) -> f32 {
        match &self.particles {
            Particles::Grid(..) => self.params.clouds.altitude,
            Particles::List(list) => list.bounds()[0][1] as f32,
        }
    }

    /// Whether a list was too small for the frame in `slot`, which must have ended: it lacks particles or shadows. A host
    /// then waits until the device is done with every frame of this renderer and calls [`Self::finish`].
    #[must_use]
    pub fn wants_more(&self, slot: usize) -> bool {
        self.lists(slot).iter().any(|list| list.needed > list.capacity)
    }

    /// Looks at the counts of the frame in `slot`, which must have ended, and grows the lists that were too small. True
    /// if any was: the frame lacks particles or shadows, and should be recorded again where that matters. The device
    /// must be idle, and the caller then calls [`RecorderState::forget`](crate::gpu::RecorderState::forget).
    pub fn finish(&mut self, gpu: &Arc<Gpu>, slot: usize) -> Result<bool> {
        let counters = self.counters.read(slot);
        let mut grew = self.set.grow(gpu, &counters)?;
        if let Particles::Grid(grid, _) = &mut self.particles {
            grew |= grid.grow(gpu, &counters)?;
        }
        grew |= self.compact.grow(gpu, &self.set)?;
        grew |= self.lighting.grow(gpu, &self.set)?;
        grew |= self.tiling.grow(gpu, &counters, &self.set)?;
        grew |= self.blender.grow(gpu, &counters)?;
        Ok(grew)
    }

    /// Counts of the frame in `slot`, which must have ended.
    #[must_use]
    pub fn counters(&self, slot: usize) -> Counters {
        self.counters.read(slot)
    }

    /// Every list with its size and what the frame in `slot` wanted of it.
    #[must_use]
    pub fn lists(&self, slot: usize) -> Vec<ListUse> {
        let counters = self.counters(slot);
        let mut lists = vec![
            ListUse { name: "particles", needed: counters.generated, capacity: self.set.capacity() },
            ListUse { name: "tile_nodes", needed: counters.tile_nodes, capacity: self.tiling.node_capacity() },
        ];
        if let Particles::Grid(grid, _) = &self.particles {
            let capacity = grid.valid_cell_capacity();
            lists.push(ListUse { name: "valid_cells", needed: counters.valid_cells, capacity });
        }
        lists.extend(self.blender.lists(&counters));
        lists
    }

    pub(crate) fn frame_params(&self, camera: &Camera, origin: [f64; 3], fill: f32) -> FrameParams {
        let basis = camera.basis();
        let f32s = |v: [f64; 3]| v.map(|c| c as f32);
        FrameParams {
            camera: std::array::from_fn(|i| (camera.position[i] - origin[i]) as f32),
            tan_half_fov_y: (camera.fov_y.to_radians() * 0.5).tan() as f32,
            right: f32s(basis.right),
            aspect: self.extent[0] as f32 / self.extent[1] as f32,
            up: f32s(basis.up),
            width: self.extent[0],
            forward: f32s(basis.forward),
            height: self.extent[1],
            to_sun: f32s(self.params.sun.to_sun()),
            sigma_t: self.params.clouds.sigma_t,
            low_width: self.low_extent[0],
            low_height: self.low_extent[1],
            seed: self.params.clouds.seed,
            time: 0.0,
            origin: f32s(origin),
            fill,
        }
    }
}

/// Near a place (the camera), at sea level, on a lattice of 1024 m: positions relative to it are small and change rarely.
pub(crate) fn floating_origin(near: [f64; 3]) -> [f64; 3] {
    let snap = |x: f64| (x / 1024.0).round() * 1024.0;
    [snap(near[0]), 0.0, snap(near[2])]
}

/// Voxels for the light of the scene's particles: few where nothing diffuses.
fn volume_design(particles: &Particles, clouds: &Clouds, quality: &Quality) -> VolumeDesign {
    match particles {
        _ if clouds.lighting != LightingKind::Tables || clouds.transfer != Transfer::Diffusion => VolumeDesign::none(),
        Particles::Grid(_, design) => VolumeDesign::of_layer(
            design.cell_edge(),
            quality.cells,
            f64::from(clouds.particle_cutoff),
            f64::from(clouds.thickness),
        ),
        Particles::List(list) => {
            let [least, greatest] = list.bounds();
            let extent = std::array::from_fn(|axis| greatest[axis] - least[axis]);
            VolumeDesign::of_list(extent, f64::from(list.greatest_extent()))
        }
    }
}
