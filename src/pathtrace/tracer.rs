//! Runs paths: the scene from the renderer, the grid over its particles, passes of samples over tiles of pixels.

use std::ops::ControlFlow;
use std::time::Instant;

use bytemuck::{Pod, Zeroable};

use super::cells::{CellCounts, CellGrid};
use super::state::{PixelSums, State};
use crate::atmosphere::{Air, Atmosphere};
use crate::blend::medium::{MediumParams, phase_function};
use crate::definitions::REFERENCE_SEED;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Frames, Image, ImageDesc, Sampler};
use crate::lut::style_index;
use crate::lut::tables::central_fill;
use crate::params::{Blend, Film, Lighting, Params, Precision, SkyModel, Style};
use crate::renderer::Renderer;
use crate::shaders::{lut_profile_comp as profile, pathtrace_trace_comp as trace};
use crate::shared::constants::pathtrace_trace_comp as constants;
use crate::shared::{FrameParams, assert_layout};
use crate::{Error, Result};

/// Pixels that are traced together: 128 bytes of state and 64 of sums each.
const TILE: usize = 1 << 18;
/// Counters that a dispatch leaves (`Activity` of `glsl/pathtrace/trace.comp`).
const ACTIVITY: usize = 5;
/// Size of `PathState` of `glsl/pathtrace/path.glsl`.
const STATE_WORDS: usize = crate::shared::layout::path_state::SIZE / 4;
/// Time that a dispatch is to take [s]: drivers reset a device that has not answered for about two seconds.
const DISPATCH_SECONDS: f64 = 0.2;
/// Steps of a dispatch at most: Mesa 22.3's lavapipe ends all loops of a thread after 65 535 rounds, and one of these has
/// about five, and a few for each binary choice from a list.
const MOST_STEPS: u32 = 2048;
/// Steps of the first dispatch.
const FIRST_STEPS: u32 = 32;
/// Time that a pass is to take [s]; between passes a run can be stopped and kept.
const PASS_SECONDS: f64 = 2.0;
/// Points of the density profile along an axis: the lattice that the full optical depth table is made from.
const PROFILE_LATTICE: u32 = 96;
/// How often lists of particles may prove too small.
const TIMES_GROWN: usize = 8;

/// How the sun shines on the clouds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SunShape {
    /// From one direction, as the renderer's tables have it.
    #[default]
    Direction,
    /// From an evenly bright disc of the scene's angular radius.
    Disc,
}

/// What shines on the clouds from where there is no cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Environment {
    /// The scene's: its sky by direction as seen from the clouds, and below the horizon the radiance of ground and air.
    #[default]
    Scene,
    /// The same radiance from everywhere, and no sun [W m⁻² sr⁻¹ nm⁻¹].
    Uniform([f32; 3]),
}

/// How a picture is estimated. All are unbiased.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Estimator {
    /// A ray to the sun from every event, absorption as a weight.
    #[default]
    NextEvent,
    /// Nothing but random walks: absorbed ones end, and sunlight is found by chance. For tests; needs [`SunShape::Disc`].
    Analogue,
}

/// What is not in [`Params`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathOptions {
    /// Another seed is another picture of the same mean.
    pub seed: u32,
    /// The sun on the clouds.
    pub sun: SunShape,
    /// The light around.
    pub environment: Environment,
    /// The estimator.
    pub estimator: Estimator,
    /// Spreads rays over each pixel. Off: through pixel centres, as the renderer's.
    pub antialias: bool,
}

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Samples of each pixel that are kept.
    pub samples: u32,
    /// Done of the pass that is running, 0 to 1.
    pub pass: f32,
    /// Samples that it adds.
    pub pass_samples: u32,
}

/// What a tracer has done since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Stretches of rays, each in one cell up to a wall or a tentative event.
    pub steps: u64,
    /// Scattering events.
    pub events: u64,
    /// Tentative events: the real ones, and null collisions.
    pub tentative: u64,
    /// How much of those was real, in quarters of an event.
    pub real: u64,
}

impl Work {
    /// Which part of all tentative events was none, 0 to 1.
    #[must_use]
    pub fn null_collisions(&self) -> f64 {
        1.0 - self.real as f64 / (4 * self.tentative).max(1) as f64
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PathParams {
    uniform_sky: [f32; 3],
    sky_altitude: f32,
    sun_versine: f32,
    g_single: f32,
    g_multiple: f32,
    albedo: f32,
    detail: f32,
    seed: u32,
    reserved: [u32; 2],
}
assert_layout!(PathParams, path_params, {
    uniform_sky: UNIFORM_SKY, sky_altitude: SKY_ALTITUDE, sun_versine: SUN_VERSINE, g_single: G_SINGLE,
    g_multiple: G_MULTIPLE, albedo: ALBEDO, detail: DETAIL, seed: SEED, reserved: RESERVED_A,
});

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TracePush {
    first_pixel: u32,
    pixel_count: u32,
    first_sample: u32,
    samples: u32,
    steps: u32,
    reserved: u32,
}
assert_layout!(TracePush, trace_push, {
    first_pixel: FIRST_PIXEL, pixel_count: PIXEL_COUNT, first_sample: FIRST_SAMPLE, samples: SAMPLES, steps: STEPS,
    reserved: RESERVED,
});

/// Traces one picture of one scene.
pub struct PathTracer {
    pub(super) params: Params,
    pub(super) extent: [u32; 2],
    pub(super) renderer: Renderer,
    pub(super) fill: f32,
    pub(super) samples: u32,
    pub(super) pixels: Vec<PixelSums>,
    options: PathOptions,
    fingerprint: [u8; 32],
    grid: CellGrid,
    pipeline: ComputePipeline,
    frame: Buffer,
    path: Buffer,
    profile: Image,
    sky: Atmosphere,
    states: Buffer,
    sums: Buffer,
    upload: Buffer,
    readback: Buffer,
    activity: Buffer,
    read_activity: Buffer,
    steps: u32,
    pass_samples: u32,
    work: Work,
}

impl PathTracer {
    /// Makes the scene of `params` on the device, as the renderer would draw it at `extent` pixels without downscaling,
    /// and the grid over its particles.
    ///
    /// # Errors
    /// As [`Renderer::new`]; [`Error::InvalidParam`] for an analogue estimator without a disc of the sun.
    pub fn new(frames: &mut Frames, params: &Params, extent: [u32; 2], options: &PathOptions) -> Result<Self> {
        params.validate()?;
        if options.estimator == Estimator::Analogue && options.sun == SunShape::Direction {
            return Err(Error::invalid("estimator", "analogue", "a sun with a disc: walks never meet a direction"));
        }
        let gpu = &frames.gpu().clone();
        let mut params = params.clone();
        params.quality.downscale = 1;
        params.quality.precision = Precision::F32;
        params.quality.blend = Blend::Alpha;
        let emission = params.clouds.lighting == Lighting::Flat;
        if !emission {
            params.clouds.lighting = Lighting::Tables;
        }
        if let Environment::Uniform(_) = options.environment {
            params.sun.irradiance = [0.0; 3];
            params.sky.model = SkyModel::None;
        }
        let fill = central_fill(params.clouds.style);
        let mut renderer = Renderer::new(gpu, &params, extent, frames.slots())?;
        let particles = record_until_it_fits(frames, &mut renderer, &params, fill)?;
        let (sigma_t, to_sun) = (params.clouds.sigma_t, params.sun.to_sun().map(|c| c as f32));
        let grid = CellGrid::build(frames, renderer.sky().set().particles(), particles, sigma_t, to_sun)?;

        let frame = renderer.sky().view_params(&params.camera, extent, extent);
        let profile = make_profile(frames, params.clouds.style)?;
        let sky = make_sky(frames, &params, &renderer, &frame)?;
        let clouds = &params.clouds;
        let (sky_kind, uniform_sky) = match options.environment {
            Environment::Uniform(radiance) => (constants::SKY_UNIFORM, radiance),
            Environment::Scene => match params.sky.model {
                SkyModel::None => (constants::SKY_NONE, [0.0; 3]),
                SkyModel::Atmosphere => (constants::SKY_ATMOSPHERE, [0.0; 3]),
            },
        };
        let sine = (0.5 * f64::from(params.sun.angular_radius)).to_radians().sin();
        let path = PathParams {
            uniform_sky,
            sky_altitude: renderer.sky().cloud_base().max(1.0),
            sun_versine: if options.sun == SunShape::Disc { (2.0 * sine * sine) as f32 } else { 0.0 },
            g_single: clouds.g_single,
            g_multiple: clouds.g_multiple,
            albedo: clouds.albedo,
            detail: MediumParams::new(clouds).detail,
            seed: options.seed,
            reserved: [0; 2],
        };
        let pipeline = ComputePipeline::new(
            gpu,
            &trace::PROGRAM,
            &[
                ("HOMOGENEOUS", u32::from(clouds.style == Style::Homogeneous)),
                ("EMISSION", u32::from(emission)),
                ("SKY", sky_kind),
                ("ANALOGUE", u32::from(options.estimator == Estimator::Analogue)),
                ("PHASE_FUNCTION", phase_function(clouds.phase)),
                ("ANTIALIAS", u32::from(options.antialias)),
            ],
        )?;
        let count = extent[0] as usize * extent[1] as usize;
        let tile = count.min(TILE);
        let sums_bytes = (tile * size_of::<PixelSums>()) as u64;
        frames.state().forget(); // what the grid's construction used is gone
        Ok(Self {
            fingerprint: fingerprint(&params, extent, options),
            options: *options,
            path: Buffer::upload(gpu, "path params", &[path])?,
            frame: Buffer::upload(gpu, "path frame params", &[frame])?,
            states: Buffer::array::<[u32; STATE_WORDS]>(gpu, "path states", tile)?,
            sums: Buffer::array::<PixelSums>(gpu, "pixel sums", tile)?,
            upload: Buffer::new(gpu, "pixel sums upload", sums_bytes, BufferKind::Upload)?,
            readback: Buffer::new(gpu, "pixel sums readback", sums_bytes, BufferKind::Readback)?,
            activity: Buffer::array::<[u32; ACTIVITY]>(gpu, "path activity", 1)?,
            read_activity: Buffer::new(gpu, "path activity readback", 4 * ACTIVITY as u64, BufferKind::Readback)?,
            pixels: vec![PixelSums::default(); count],
            samples: 0,
            steps: FIRST_STEPS,
            pass_samples: 1,
            work: Work::default(),
            params,
            extent,
            renderer,
            fill,
            grid,
            pipeline,
            profile,
            sky,
        })
    }

    /// Samples of each pixel so far.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Size of the grid over the particles.
    #[must_use]
    pub fn cells(&self) -> CellCounts {
        self.grid.counts()
    }

    /// What it took so far.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Starts again with another seed.
    pub fn reseed(&mut self, seed: u32) {
        self.options.seed = seed;
        self.fingerprint = fingerprint(&self.params, self.extent, &self.options);
        self.path.write(std::mem::offset_of!(PathParams, seed) as u64, &[seed]);
        self.samples = 0;
        self.pixels.fill(PixelSums::default());
    }

    /// What has been gathered, to be kept.
    #[must_use]
    pub fn state(&self) -> State {
        State { fingerprint: self.fingerprint, samples: self.samples, pixels: self.pixels.clone() }
    }

    /// Goes on from `state`.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] if it belongs to another scene, size, seed or version.
    pub fn restore(&mut self, state: State) -> Result<()> {
        if state.fingerprint != self.fingerprint || state.pixels.len() != self.pixels.len() {
            let expected = "the state of this scene at this size, with this seed, from this version";
            return Err(Error::invalid("state", "of another picture", expected));
        }
        (self.samples, self.pixels) = (state.samples, state.pixels);
        Ok(())
    }

    /// Gathers until every pixel has `samples` samples, or `progress` breaks it off: then what the last whole pass has
    /// gathered is kept. `progress` is called after every dispatch, several times a second.
    pub fn run(
        &mut self,
        frames: &mut Frames,
        samples: u32,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>> {
        while self.samples < samples {
            if self.run_pass(frames, samples, progress)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// One pass: some samples of every pixel, at most up to `samples`; as many as take about two seconds.
    pub fn run_pass(
        &mut self,
        frames: &mut Frames,
        samples: u32,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>> {
        let pass_samples = self.pass_samples.min(samples.saturating_sub(self.samples));
        if pass_samples == 0 {
            return Ok(ControlFlow::Continue(()));
        }
        let started = Instant::now();
        let (kept, total) = (self.samples, self.pixels.len());
        let mut pixels = Vec::with_capacity(total);
        for first in (0..total).step_by(TILE) {
            let count = TILE.min(total - first);
            let mut tell = |unfinished: u32| {
                let done = (first + count) as f32 - unfinished as f32;
                progress(Progress { samples: kept, pass: done / total as f32, pass_samples })
            };
            if self.run_tile(frames, first, count, pass_samples, &mut tell)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
            pixels.extend(self.readback.read::<PixelSums>(0, count));
        }
        self.pixels = pixels;
        self.samples += pass_samples;
        if pass_samples == self.pass_samples && started.elapsed().as_secs_f64() < 0.5 * PASS_SECONDS {
            self.pass_samples *= 2;
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Runs dispatches until every pixel of a tile has its samples; then its sums are in `readback`.
    fn run_tile(
        &mut self,
        frames: &mut Frames,
        first: usize,
        count: usize,
        samples: u32,
        tell: &mut dyn FnMut(u32) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>> {
        self.upload.write(0, &self.pixels[first..first + count]);
        let bytes = (count * size_of::<PixelSums>()) as u64;
        frames.run(|rec| {
            rec.copy_buffer(&self.upload, &self.sums, bytes);
            rec.fill_buffer(&self.states, 0, self.states.size(), 0);
            Ok(())
        })?;
        let mut steps = self.steps;
        let mut all_busy = true;
        loop {
            let started = Instant::now();
            let push = TracePush {
                first_pixel: first as u32,
                pixel_count: count as u32,
                first_sample: self.samples,
                samples,
                steps,
                reserved: 0,
            };
            self.dispatch(frames, &push)?;
            let seconds = started.elapsed().as_secs_f64();
            let activity = self.read_activity.read::<u32>(0, ACTIVITY);
            let unfinished = activity[0];
            self.work.steps += u64::from(activity[1]);
            self.work.events += u64::from(activity[2]);
            self.work.tentative += u64::from(activity[3]);
            self.work.real += u64::from(activity[4]);
            // Towards the time that a dispatch may take, by at most a factor of 2 since its load can rise as fast.
            let factor = (DISPATCH_SECONDS / seconds.max(1e-6)).clamp(0.25, 2.0);
            steps = ((f64::from(steps) * factor) as u32).clamp(1, MOST_STEPS);
            all_busy &= unfinished as usize * 2 > count;
            if all_busy {
                self.steps = steps; // as a full tile needs them
            }
            if tell(unfinished).is_break() {
                return Ok(ControlFlow::Break(()));
            }
            if unfinished == 0 {
                break;
            }
        }
        frames.run(|rec| {
            rec.copy_buffer(&self.sums, &self.readback, bytes);
            rec.make_visible_to_host(&self.readback);
            Ok(())
        })?;
        Ok(ControlFlow::Continue(()))
    }

    fn dispatch(&self, frames: &mut Frames, push: &TracePush) -> Result<()> {
        let (sky, background) = (self.renderer.sky(), self.renderer.view().background());
        let bindings = trace::Bindings {
            frame: &self.frame,
            grid: &self.grid.params,
            cell_counts: &self.grid.cell_counts,
            cell_first: &self.grid.cell_first,
            cells: &self.grid.cells,
            entries: &self.grid.entries,
            particles: sky.set().particles(),
            params: &self.path,
            air: &sky.atmosphere().air,
            sky_light: sky.atmosphere().sky_light(),
            states: &self.states,
            pixels: &self.sums,
            activity: &self.activity,
            detail_tile: sky.detail().image.sampled(Sampler::LinearRepeat),
            profile_volume: self.profile.sampled(Sampler::LinearClamp),
            sky_smooth: self.sky.sky_view_smooth.sampled(Sampler::LinearClamp),
            sky_aerosol: self.sky.sky_view_aerosol.sampled(Sampler::LinearClamp),
            opaque_distance: background.opaque_distance.sampled(Sampler::NearestClamp),
        };
        frames.run(|rec| {
            rec.pass("paths", |rec| {
                rec.fill_buffer(&self.activity, 0, self.activity.size(), 0);
                rec.dispatch(&self.pipeline, &bindings, push, [push.pixel_count, 1, 1])?;
                rec.copy_buffer(&self.activity, &self.read_activity, self.activity.size());
                rec.make_visible_to_host(&self.read_activity);
                Ok(())
            })
        })
    }
}

/// Records the scene until every list of particles is large enough; their number.
fn record_until_it_fits(frames: &mut Frames, renderer: &mut Renderer, params: &Params, fill: f32) -> Result<u32> {
    let gpu = &frames.gpu().clone();
    for _ in 0..TIMES_GROWN {
        let (slot, ()) = frames.submit(|rec| {
            renderer.record_scene(rec, &params.camera, fill)?;
            renderer.view().record_counters(rec, renderer.sky());
            Ok(())
        })?;
        frames.wait()?;
        if !renderer.finish(gpu, slot)? {
            return Ok(renderer.counters(slot).stored);
        }
        frames.state().forget();
    }
    Err(Error::Capacity { list: "particles", needed: u64::from(u32::MAX), capacity: 0 })
}

/// The density inside the reference particle, sampled as the optical depth table's is.
fn make_profile(frames: &mut Frames, style: Style) -> Result<Image> {
    let gpu = &frames.gpu().clone();
    let usage = ash::vk::ImageUsageFlags::STORAGE | ash::vk::ImageUsageFlags::SAMPLED;
    let format = ash::vk::Format::R16_SFLOAT;
    let extent = [PROFILE_LATTICE; 3];
    let volume = Image::new(gpu, &ImageDesc { name: "path density", extent, format, usage })?;
    let pipeline = ComputePipeline::new(gpu, &profile::PROGRAM, &[])?;
    frames.run(|rec| {
        let push = [style_index(style), REFERENCE_SEED];
        rec.pass("path density", |rec| rec.dispatch(&pipeline, &profile::Bindings { volume: &volume }, &push, extent))
    })?;
    Ok(volume)
}

/// The sky by direction as the clouds see it: the renderer's tables, filled for an eye at their base.
fn make_sky(frames: &mut Frames, params: &Params, renderer: &Renderer, frame: &FrameParams) -> Result<Atmosphere> {
    let gpu = &frames.gpu().clone();
    let cloud_base = renderer.sky().cloud_base();
    let mut frame = *frame;
    frame.camera[1] = cloud_base.max(1.0) - frame.origin[1];
    let buffer = Buffer::upload(gpu, "sky frame params", &[frame])?;
    let sky = Atmosphere::new(gpu, params.sky.model, &Air::of(&params.sky, &params.sun))?;
    frames.run(|rec| sky.record_luts(rec, &buffer, &frame, renderer.sky().shadow(), cloud_base))?;
    // Without a sky nothing has written the tables, which are bound all the same.
    frames.run(|rec| {
        if params.sky.model == SkyModel::None {
            rec.clear_image(&sky.sky_view_smooth, [0.0; 4]);
            rec.clear_image(&sky.sky_view_aerosol, [0.0; 4]);
        }
        Ok(())
    })?;
    Ok(sky)
}

/// Of everything that the sums depend on. (Film and background do not change them.)
fn fingerprint(params: &Params, extent: [u32; 2], options: &PathOptions) -> [u8; 32] {
    let (motion, lean) = (params.animation.clouds(), params.animation.lean());
    let params = Params { film: Film::default(), animation: Default::default(), ..params.clone() };
    let mut hasher = blake3::Hasher::new();
    hasher.update(format!("{params:?} {motion:?} {lean:?} {extent:?} {options:?}").as_bytes());
    hasher.update(trace::PROGRAM.stages[0].spirv);
    *hasher.finalize().as_bytes()
}
