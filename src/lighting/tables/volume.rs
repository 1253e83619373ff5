//! Sunlight in the depth of the clouds: what particles scatter diffuses through them all.
//!
//! Particles are added to nested boxes of voxels around the camera, and the diffusion equation is solved in these, the
//! coarsest first (`glsl/lighting/tables/diffusion/start.comp` has the equation). The solution is an image of mean radiance, which shading
//! filters at the point that is seen: light passes from particle to particle, and a crowd of them is one cloud.

use std::sync::Arc;

use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::Result;
use crate::compact::Compact;
use crate::definitions::REFERENCE_SEED;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Gpu, Image, ImageDesc, Recorder};
use crate::grid::ParticleSet;
use crate::lighting::Scene;
use crate::params::{Clouds, Style};
use crate::reference::optical_depth::profile_density;
use crate::reference::phase::PhaseFunction;
use crate::shaders::{
    lighting_tables_diffusion_reduce_comp as reduce, lighting_tables_diffusion_relax_comp as relax,
    lighting_tables_diffusion_seen_comp as seen, lighting_tables_diffusion_splat_comp as splat,
    lighting_tables_diffusion_start_comp as start, lighting_tables_diffusion_store_comp as store,
};
use crate::shared::assert_layout;

/// Levels that the device's struct holds.
pub const LEVEL_CAPACITY: usize =
    crate::shared::constants::lighting_tables_diffusion_params_glsl::VOLUME_LEVELS as usize;
/// What fills empty space, as an extinction of isotropic scattering [1/m]: clouds closer than its inverse light each other.
pub const VACUUM: f32 = 1.0 / 240.0;

/// Geometry of the voxels and the medium in them, for one frame (`glsl/lighting/tables/diffusion/params.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct VolumeParams {
    /// Unit direction towards the light.
    pub to_sun: [f32; 3],
    /// Height of the lower faces at `bend` [m, floating origin].
    pub base: f32,
    /// Around this point (x, z) the boxes follow the planet's curvature [m, floating origin].
    pub bend: [f32; 2],
    /// 1 / (2 · planet radius) [1/m]; 0 is a flat world.
    pub inverse_diameter: f32,
    /// Height of a voxel of the two finest levels [m]; it doubles from each other level to the next.
    pub height: f32,
    /// Levels in use; 0: there is no volume.
    pub levels: u32,
    /// Voxels along either horizontal edge of a level.
    pub dim: u32,
    /// Layers of voxels of all levels together.
    pub layers: u32,
    /// [`VolumeMedium`].
    pub medium: VolumeMedium,
    /// [`VACUUM`].
    pub vacuum: f32,
    /// 1: particles are smaller than voxels, and each has a linear fit of what it sees ([`VolumeDesign::fitted`]).
    pub fitted: u32,
    /// Zero.
    pub reserved: [f32; 2],
    /// Least x, least z of each level [m, floating origin]; edge of a voxel [m]; 1 / edge.
    pub corner: [[f32; 4]; LEVEL_CAPACITY],
    /// Of each level: voxel (x, z) in which the next finer one begins; first layer in the stack of all levels; layers.
    pub stack: [[i32; 4]; LEVEL_CAPACITY],
}
assert_layout!(VolumeParams, volume_params, {
    to_sun: TO_SUN, base: BASE, bend: BEND, inverse_diameter: INVERSE_DIAMETER, height: HEIGHT, levels: LEVELS, dim: DIM,
    layers: LAYERS, medium: EXTINCTION, vacuum: VACUUM,
    fitted: FITTED, reserved: RESERVED_A,
    corner: CORNER, stack: STACK,
});

/// How many voxels there are, and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeDesign {
    /// Voxels along either horizontal edge of a level; a multiple of 4.
    pub dim: u32,
    /// Layers of the finest level from base to top.
    pub layers: u32,
    /// Nested levels, each twice as wide as the one inside.
    pub levels: u32,
    /// Edge of a voxel of the finest level [m].
    pub edge: f64,
    /// Height of a voxel of the two finest levels [m]; it doubles from each other level to the next.
    pub height: f64,
    /// Whether particles are smaller than voxels: then light is looked up once for each particle, not in every pixel.
    pub fitted: bool,
}

/// Edge of a voxel in cells of the innermost ring, and layers of voxels a cell. A deck is lit through its layers: with as
/// few of them as there are cells, twice too much light comes through.
const CELLS_PER_VOXEL: f64 = 2.0;
const LAYERS_PER_CELL: f64 = 3.0;

impl VolumeDesign {
    /// Around the camera, as far as `cutoff` [m], for a layer `thickness` high [m] of particles that stand `cell` apart [m],
    /// `cells` in a row.
    #[must_use]
    pub fn of_layer(cell: f64, cells: u32, cutoff: f64, thickness: f64) -> Self {
        let dim = (cells / 4).clamp(16, 96) / 4 * 4;
        let doublings = (2.0 * cutoff / (f64::from(dim) * CELLS_PER_VOXEL * cell)).log2().ceil().max(0.0);
        let inside = (thickness / (cell / LAYERS_PER_CELL)).ceil().clamp(1.0, 32.0);
        Self {
            dim,
            layers: inside as u32 + 2,
            levels: (doublings as u32 + 1).min(LEVEL_CAPACITY as u32),
            edge: CELLS_PER_VOXEL * cell,
            height: thickness / inside,
            fitted: true,
        }
    }

    /// Around a list of particles `extent` wide, high and deep [m], none of which reaches farther than `greatest` from its
    /// centre [m].
    #[must_use]
    pub fn of_list(extent: [f64; 3], greatest: f64) -> Self {
        const DIM: u32 = 64;
        let widest = extent[0].max(extent[2]).max(1.0);
        let edge = (widest / f64::from(DIM - 4)).max(greatest / 5.0);
        let inside = (extent[1] / edge).ceil().clamp(1.0, 62.0);
        let height = edge.max(extent[1] / inside);
        Self { dim: DIM, layers: inside as u32 + 2, levels: 1, edge, height, fitted: false }
    }

    /// No voxels at all.
    #[must_use]
    pub fn none() -> Self {
        Self { dim: 0, layers: 0, levels: 0, edge: 1.0, height: 1.0, fitted: false }
    }

    /// Layers of a level; at least the two that an interpolation takes.
    fn layers_of(&self, level: u32) -> u32 {
        self.layers.div_ceil(1 << level.saturating_sub(1)).max(2)
    }

    /// Layers of all levels.
    fn stacked(&self) -> u32 {
        (0..self.levels).map(|level| self.layers_of(level)).sum()
    }

    /// Voxels for one frame. They keep their places in the world while `centre` moves, so that light does not flicker.
    #[must_use]
    pub fn frame(&self, place: &VolumePlace, medium: &VolumeMedium) -> VolumeParams {
        let mut params = VolumeParams::zeroed();
        let mut first = [[0i64; 2]; LEVEL_CAPACITY];
        let mut layer = 0;
        for level in 0..self.levels as usize {
            let edge = self.edge * f64::from(1u32 << level);
            for (axis, first) in [0, 2].into_iter().zip(&mut first[level]) {
                // Even, so that voxels of a level are four of the next finer one.
                let centre = ((place.centre[axis] + place.origin[axis]) / (2.0 * edge)).round() as i64;
                *first = 2 * centre - i64::from(self.dim / 2);
            }
            let corner = |i: usize, axis: usize| (first[level][i] as f64 * edge - place.origin[axis]) as f32;
            params.corner[level] = [corner(0, 0), corner(1, 2), edge as f32, (1.0 / edge) as f32];
            if level > 0 {
                let begin = |i: usize| (first[level - 1][i] / 2 - first[level][i]) as i32;
                [params.stack[level][0], params.stack[level][1]] = [begin(0), begin(1)];
            }
            [params.stack[level][2], params.stack[level][3]] = [layer as i32, self.layers_of(level as u32) as i32];
            layer += self.layers_of(level as u32);
        }
        VolumeParams {
            to_sun: place.to_sun.map(|c| c as f32),
            base: (place.base - self.height) as f32,
            bend: [place.centre[0] as f32, place.centre[2] as f32],
            inverse_diameter: (0.5 / place.planet_radius) as f32,
            height: self.height as f32,
            levels: self.levels,
            dim: self.dim,
            layers: self.stacked(),
            medium: *medium,
            vacuum: VACUUM,
            fitted: self.fitted.into(),
            ..params
        }
    }
}

/// Where the voxels of a frame lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumePlace {
    /// Middle of the levels [m, floating origin].
    pub centre: [f64; 3],
    /// Floating origin [m].
    pub origin: [f64; 3],
    /// Least height of any matter at the centre [m, floating origin].
    pub base: f64,
    /// Of the planet that the layer follows [m]; infinite for a flat world.
    pub planet_radius: f64,
    /// Unit direction towards the sun.
    pub to_sun: [f64; 3],
}

impl VolumePlace {
    /// That of a frame.
    pub(crate) fn of(scene: &Scene<'_>) -> Self {
        let (origin, [east, south]) = (scene.place.origin, scene.drift);
        Self {
            centre: scene.layer.centre,
            // Voxels drift with the clouds, so that their light does not flicker.
            origin: [origin[0] - east, origin[1], origin[2] - south],
            base: scene.layer.base,
            planet_radius: scene.layer.planet_radius,
            to_sun: scene.to_sun,
        }
    }
}

/// What the particles are made of.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct VolumeMedium {
    /// Mean extinction of a whole ellipsoid of relative density 1, what detail takes off counting as empty [1/m].
    pub extinction: f32,
    /// Single-scattering albedo.
    pub albedo: f32,
    /// Mean cosine of scattering.
    pub asymmetry: f32,
    /// Optical depth of an ellipsoid over what light lists count for it, which do not know detail, on the mean over all rays
    /// through it.
    pub shade: f32,
    /// Radius, in a particle's, of the ball that holds its matter once detail is taken off.
    pub body: f32,
}

/// Radius, in a particle's, that detail leaves of a displaced particle. With it the matter that `welkin voxelize` finds in
/// scenes of the default style is met within 5 %.
const DISPLACED: f32 = 0.7;

impl VolumeMedium {
    /// The medium of a scene whose particles have the mean density `fill` on chords through their centres.
    #[must_use]
    pub fn new(clouds: &Clouds, fill: f32) -> Self {
        Self::with_mean(clouds, fill, mean_profile(clouds.style))
    }

    /// The same with the mean of the profile known, which takes thousands of noise values.
    pub(crate) fn with_mean(clouds: &Clouds, fill: f32, mean: f32) -> Self {
        let body = if clouds.style.displaced() { DISPLACED } else { 1.0 };
        Self {
            extinction: clouds.sigma_t * mean * body.powi(3),
            albedo: clouds.albedo,
            asymmetry: PhaseFunction::from(clouds.phase).mean_cosine(f64::from(clouds.g_multiple)) as f32,
            shade: mean * body.powi(3) / fill.max(1e-3),
            body,
        }
    }
}

/// Mean density over its ball of the particle that every sky is made of.
pub(crate) fn mean_profile(style: Style) -> f32 {
    const POINTS: u32 = 4096;
    let sum: f64 = (0..POINTS)
        .map(|i| {
            // Shells of equal volume, each met in one direction; directions follow the R2 sequence (Roberts 2018).
            let radius = ((f64::from(i) + 0.5) / f64::from(POINTS)).cbrt();
            let z = 1.0 - 2.0 * (f64::from(i) * 0.754_877_666_246_693).fract();
            let (sin, cos) = (std::f64::consts::TAU * (f64::from(i) * 0.569_840_290_998_053).fract()).sin_cos();
            let across = (1.0 - z * z).sqrt();
            profile_density(radius * DVec3::new(across * cos, across * sin, z), style, REFERENCE_SEED)
        })
        .sum();
    (sum / f64::from(POINTS)) as f32
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LevelPush {
    level: u32,
    colour: u32,
    over_relaxation: f32,
}

/// How a level is relaxed.
#[derive(Clone, Copy)]
struct Relaxation {
    sweeps: u32,
    /// Spectral radius of the iteration without over-relaxation that is reckoned with.
    radius: f32,
}

/// The only level, of a list of particles: it starts from darkness, and light has to cross all of it.
const ONLY: Relaxation = Relaxation { sweeps: 40, radius: 0.99 };
/// The coarsest level of a sky: it starts from darkness too, but its voxels are kilometres wide.
const COARSEST: Relaxation = Relaxation { sweeps: 16, radius: 0.95 };
/// Each other level, which starts from the coarser one's solution.
const FINER: Relaxation = Relaxation { sweeps: 6, radius: 0.95 };

/// The voxels, and the light in them.
pub struct LightVolume {
    design: VolumeDesign,
    splat: ComputePipeline,
    reduce: ComputePipeline,
    start: ComputePipeline,
    relax: ComputePipeline,
    store: ComputePipeline,
    seen: ComputePipeline,
    params: Vec<Buffer>,
    matter: Buffer,
    light: Buffer,
    drive: Buffer,
    radiance: Buffer,
    image: Image,
}

impl LightVolume {
    /// Voxels of `design`, with `slots` frames in flight.
    pub fn new(gpu: &Arc<Gpu>, design: VolumeDesign, slots: usize) -> Result<Self> {
        let (dim, layers) = (design.dim.max(1), design.stacked().max(1));
        let voxels = dim as usize * dim as usize * layers as usize;
        let params = (0..slots)
            .map(|_| {
                let buffer = Buffer::new(gpu, "volume params", size_of::<VolumeParams>() as u64, BufferKind::Upload)?;
                buffer.write(0, &[VolumeParams::zeroed()]);
                Ok(buffer)
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            design,
            splat: ComputePipeline::new(gpu, &splat::PROGRAM, &[])?,
            reduce: ComputePipeline::new(gpu, &reduce::PROGRAM, &[])?,
            start: ComputePipeline::new(gpu, &start::PROGRAM, &[])?,
            relax: ComputePipeline::new(gpu, &relax::PROGRAM, &[])?,
            store: ComputePipeline::new(gpu, &store::PROGRAM, &[])?,
            seen: ComputePipeline::new(gpu, &seen::PROGRAM, &[])?,
            params,
            matter: Buffer::array::<[u32; 2]>(gpu, "volume matter", voxels)?,
            light: Buffer::array::<[f32; 2]>(gpu, "volume light", voxels)?,
            drive: Buffer::array::<[f32; 2]>(gpu, "volume drive", voxels)?,
            radiance: Buffer::array::<f32>(gpu, "volume radiance", voxels)?,
            image: Image::new(
                gpu,
                &ImageDesc {
                    name: "light volume",
                    extent: if design.fitted { [1; 3] } else { [dim, dim, layers] },
                    format: vk::Format::R16_SFLOAT,
                    usage: vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE,
                },
            )?,
        })
    }

    /// Whether [`Self::record_seen`] has anything to do.
    #[must_use]
    pub fn fitted(&self) -> bool {
        self.design.fitted
    }

    /// Edge of a voxel of the finest level [m].
    #[must_use]
    pub fn voxel_edge(&self) -> f32 {
        self.design.edge as f32
    }

    /// This frame's parameters, for shaders that look the light up (`glsl/lighting/tables/diffusion/lookup.glsl`).
    #[must_use]
    pub fn params(&self, slot: usize) -> &Buffer {
        &self.params[slot]
    }

    /// Mean radiance per irradiance of the sun [1/sr], where it is looked up in every pixel ([`VolumeDesign::fitted`]).
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Fluence per irradiance of the sun in the second number of each voxel.
    #[must_use]
    pub fn light(&self) -> &Buffer {
        &self.light
    }

    /// Mean radiance per irradiance of the sun [1/sr], voxel by voxel.
    #[must_use]
    pub fn radiance(&self) -> &Buffer {
        &self.radiance
    }

    /// Extinction in the first number of each voxel, extinction × sunlight in the second, in units of 2⁻²⁰ 1/m.
    #[must_use]
    pub fn matter(&self) -> &Buffer {
        &self.matter
    }

    /// Records that there is no volume: nothing diffuses.
    pub fn record_none(&self, rec: &mut Recorder<'_>) {
        self.params[rec.slot()].write(0, &[VolumeParams::zeroed()]);
        rec.clear_image(&self.image, [0.0; 4]);
    }

    /// Records the light of one frame. `sun_depths`: of every particle the optical depths of others towards the sun at its
    /// near pole, its centre and its far pole, and its own diameter's.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        place: &VolumePlace,
        medium: &VolumeMedium,
        set: &ParticleSet,
        sun_depths: &Buffer,
    ) -> Result<()> {
        let params = &self.params[rec.slot()];
        params.write(0, &[self.design.frame(place, medium)]);
        let (matter, light, drive, radiance) = (&self.matter, &self.light, &self.drive, &self.radiance);
        let VolumeDesign { dim, levels, .. } = self.design;
        rec.fill_buffer(matter, 0, matter.size(), 0);
        rec.dispatch_indirect(
            &self.splat,
            &splat::Bindings {
                volume: params,
                counters: set.counters(),
                particles: set.particles(),
                sun_depths,
                matter,
            },
            &(),
            set.args(),
            ParticleSet::PARTICLE_ARGS,
        )?;
        for level in 1..levels {
            rec.dispatch(
                &self.reduce,
                &reduce::Bindings { volume: params, matter },
                &level,
                [dim / 2, dim / 2, self.design.layers_of(level)],
            )?;
        }
        for level in (0..levels).rev() {
            let layers = self.design.layers_of(level);
            let push = LevelPush { level, colour: 0, over_relaxation: 1.0 };
            rec.dispatch(
                &self.start,
                &start::Bindings { volume: params, matter, light, drive },
                &push,
                [dim, dim, layers],
            )?;
            let Relaxation { sweeps, radius } = match level {
                0 if levels == 1 => ONLY,
                _ if level + 1 == levels => COARSEST,
                _ => FINER,
            };
            // Chebyshev's choice of the over-relaxation, which begins with none (Golub and Varga 1961).
            let mut over_relaxation = 1.0;
            for half in 0..2 * sweeps {
                let push = LevelPush { colour: half & 1, over_relaxation, ..push };
                rec.dispatch(
                    &self.relax,
                    &relax::Bindings { volume: params, light, drive },
                    &push,
                    [dim / 2, dim, layers],
                )?;
                let share = if half == 0 { 0.5 } else { 0.25 * over_relaxation };
                over_relaxation = 1.0 / (1.0 - radius * radius * share);
            }
        }
        let bindings = store::Bindings { volume: params, light, matter, radiance, light_volume: &self.image };
        rec.dispatch(&self.store, &bindings, &(), [dim, dim, self.design.stacked()])
    }

    /// Records what each visible particle shows of the light, once [`Self::record`] has found it: in its
    /// [`ParticleLight`](crate::shared::ParticleLight) in `lights`.
    pub fn record_seen(
        &self,
        rec: &mut Recorder<'_>,
        frame: &Buffer,
        set: &ParticleSet,
        compact: &Compact,
        lights: &Buffer,
    ) -> Result<()> {
        if !self.design.fitted {
            return Ok(());
        }
        rec.dispatch_indirect(
            &self.seen,
            &seen::Bindings {
                volume: &self.params[rec.slot()],
                frame,
                counters: set.counters(),
                particles: set.particles(),
                order: compact.order(),
                lights,
                radiance: &self.radiance,
            },
            &(),
            compact.args(),
            Compact::VISIBLE_ARGS,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_that_of_the_particle_in_the_tables_whatever_the_seed_of_the_scene() {
        for style in [Style::Homogeneous, Style::Radial, Style::Threshold, Style::Pyroclastic] {
            let medium = |seed| VolumeMedium::new(&Clouds { style, seed, ..Clouds::default() }, 0.8);
            assert_eq!(medium(1), medium(7), "{style:?}");
            let body = f64::from(medium(7).body);
            let mean = f64::from(medium(7).extinction / Clouds::default().sigma_t) / body.powi(3);
            // Truth on a lattice of 32³ points.
            let lattice =
                (0..32 * 32 * 32).map(|i| DVec3::new((i % 32).into(), (i / 32 % 32).into(), (i / 1024).into()));
            let inside: Vec<DVec3> =
                lattice.map(|at| (at + 0.5) / 16.0 - 1.0).filter(|p| p.length_squared() < 1.0).collect();
            let mean_of = |seed| {
                let sum: f64 = inside.iter().map(|&p| profile_density(p, style, seed)).sum();
                sum / inside.len() as f64
            };
            // A density has a standard deviation of 1/2 at most: the error of 4096 random points, and even ones do better.
            let bound = 0.5 / 64.0;
            assert!((mean - mean_of(REFERENCE_SEED)).abs() < bound, "{style:?}: {mean}");
            // The bound tells the noise of another seed, where there is noise.
            assert!(style == Style::Homogeneous || (mean - mean_of(7)).abs() > bound, "{style:?}: {mean}");
        }
    }
}
