//! Optical depth between every point of the clouds and the sun, in a volume that particles are added to in any order.
//!
//! Shimada, Shinya, Shiraishi and Harada, *Real-time Rendering of Dynamic Clouds*: attenuations of particles multiply, so
//! their logarithms add, and no particle has to be sorted or read back. One axis of the volume runs along the light. Each
//! particle is added to the columns of voxels that it covers, as the two ends of its optical depth's ramp, and one sum along
//! the light makes all shadows of it (`glsl/lighting/attenuation/splat.comp`, `store.comp`).

use std::sync::Arc;

use ash::vk;
use bytemuck::{Pod, Zeroable};

use crate::gpu::{Buffer, BufferKind, ComputePipeline, Gpu, Image, ImageDesc, Recorder};
use crate::grid::ParticleSet;
use crate::lighting::tables::volume::{VolumeMedium, VolumePlace};
use crate::params::{Clouds, Precision};
use crate::shaders::{lighting_attenuation_splat_comp as splat, lighting_attenuation_store_comp as store};
use crate::shared::assert_layout;
use crate::source::Spread;
use crate::{Error, Result};

/// Levels that the device's struct holds.
pub const LEVEL_CAPACITY: usize = 8;

/// Where the voxels of a frame lie, and what dims light in them (`glsl/lighting/attenuation/params.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AttenuationParams {
    /// Unit direction towards the light.
    pub to_sun: [f32; 3],
    /// Extinction of a particle of relative density 1 [1/m].
    pub extinction: f32,
    /// Boxes in use, the finest first; 0: there is no volume.
    pub levels: u32,
    /// Voxels across the light.
    pub dim: u32,
    /// Voxels along it, of each level.
    pub depth: u32,
    /// Radius, in a particle's, of the ellipsoid that dims.
    pub body: f32,
    /// In the middle of all boxes [m, floating origin].
    pub anchor: [f32; 3],
    /// Mean cosine of scattering, of light that is scattered more than once.
    pub asymmetry: f32,
    /// From a point, from the anchor [m], to its place in each level across the light [voxels].
    pub row_u: [[f32; 4]; LEVEL_CAPACITY],
    /// The same, the other way across.
    pub row_v: [[f32; 4]; LEVEL_CAPACITY],
    /// The same, away from the light.
    pub row_w: [[f32; 4]; LEVEL_CAPACITY],
}
assert_layout!(AttenuationParams, attenuation_params, {
    to_sun: TO_SUN, extinction: EXTINCTION, levels: LEVELS, dim: DIM, depth: DEPTH, body: BODY, anchor: ANCHOR, asymmetry: ASYMMETRY,
    row_u: ROW_U, row_v: ROW_V, row_w: ROW_W,
});

/// How many voxels there are, and what they have to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttenuationDesign {
    /// Voxels across the light.
    pub dim: u32,
    /// Voxels along it, of each level.
    pub depth: u32,
    /// What the boxes are fitted to.
    pub shape: AttenuationShape,
}

/// What the boxes are fitted to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AttenuationShape {
    /// One box around particles that extend so far in the world [m].
    Box([f64; 3]),
    /// Boxes around the camera, each twice as wide as the one inside.
    Layer {
        /// Half the edge of the finest one [m].
        half_width: f64,
        /// How many.
        levels: u32,
        /// Height of the layer [m].
        thickness: f64,
    },
}

/// Half the edge of the finest box, in cells of the innermost ring.
const CELLS_ACROSS: f64 = 32.0;
/// Particles of a layer reach so far below its base and above it, in thicknesses; what reaches farther dims at the box's
/// faces.
const BELOW: f64 = 0.25;
const ABOVE: f64 = 1.5;
/// Sine of the lowest height at which the sun shades a layer: a lower one shades as if it stood 3° high.
const LOWEST_SUN: f64 = 0.052_336;
/// Voxels at each face of a box that hold no particle.
const MARGIN: f64 = 2.0;

impl AttenuationDesign {
    /// `resolution`³ voxels around particles that extend so far [m].
    #[must_use]
    pub fn of_list(extent: [f64; 3], resolution: u32) -> Self {
        let extent = extent.map(|e| e.max(1.0));
        Self { dim: resolution, depth: resolution, shape: AttenuationShape::Box(extent) }
    }

    /// Levels of `resolution`² × `resolution` / 4 voxels around the camera, as far as `cutoff` [m], for a layer `thickness`
    /// high [m] of particles that stand `cell` apart [m] next to the camera.
    #[must_use]
    pub fn of_layer(cell: f64, cutoff: f64, thickness: f64, resolution: u32) -> Self {
        let doublings = (cutoff / (CELLS_ACROSS * cell)).log2().round().clamp(0.0, LEVEL_CAPACITY as f64 - 1.0);
        let shape =
            AttenuationShape::Layer { half_width: cutoff / doublings.exp2(), levels: doublings as u32 + 1, thickness };
        Self { dim: resolution, depth: (resolution / 4).max(16), shape }
    }

    /// For particles that are so spread.
    pub(crate) fn new(spread: &Spread, resolution: u32) -> Self {
        match *spread {
            Spread::Layer { cell, cutoff, thickness, .. } => Self::of_layer(cell, cutoff, thickness, resolution),
            Spread::Heap { extent, .. } => Self::of_list(extent, resolution),
        }
    }

    /// Boxes.
    #[must_use]
    pub fn levels(&self) -> u32 {
        match self.shape {
            AttenuationShape::Box(_) => 1,
            AttenuationShape::Layer { levels, .. } => levels,
        }
    }

    /// Width, height and depth of the volume, all levels one behind the other [voxels].
    #[must_use]
    pub fn extent(&self) -> [u32; 3] {
        [self.dim, self.dim, self.depth * self.levels()]
    }

    /// Device memory for all voxels [bytes].
    #[must_use]
    pub fn bytes(&self, precision: Precision) -> u64 {
        let texel = if precision == Precision::F32 { 8 } else { 6 };
        self.extent().map(u64::from).iter().product::<u64>() * texel
    }

    /// Voxels for one frame, with [`VolumePlace::centre`] the middle of a list, or the camera. Boxes of a layer follow the
    /// camera by whole voxels, so that shadows do not flicker.
    #[must_use]
    pub fn frame(&self, place: &VolumePlace, medium: &VolumeMedium) -> AttenuationParams {
        let mut params = AttenuationParams {
            extinction: medium.extinction / medium.body.powi(3),
            levels: self.levels(),
            dim: self.dim,
            depth: self.depth,
            body: medium.body,
            asymmetry: medium.asymmetry,
            ..Zeroable::zeroed()
        };
        let (dim, depth) = (f64::from(self.dim), f64::from(self.depth));
        match self.shape {
            AttenuationShape::Box(extent) => {
                let (sun, half) = (place.to_sun, extent.map(|e| 0.5 * e));
                params.to_sun = sun.map(|c| c as f32);
                let frame = Slices::least(sun, half);
                let (half_u, half_v) =
                    (frame.half_width(frame.across[0], half), frame.half_width(frame.across[1], half));
                let scale = [(0.5 * dim - MARGIN) / half_u, (0.5 * dim - MARGIN) / half_v];
                let along = (0.5 * depth - MARGIN) / half[frame.axis];
                params.anchor = place.centre.map(|c| c as f32);
                let [u, v, w] = frame.rows(scale, along);
                params.row_u[0] = row(u, 0.5 * dim);
                params.row_v[0] = row(v, 0.5 * dim);
                params.row_w[0] = row(w, 0.5 * depth);
            }
            AttenuationShape::Layer { half_width, levels, thickness } => {
                let sun = no_lower(place.to_sun);
                params.to_sun = sun.map(|c| c as f32);
                let frame = Slices::across(sun, 1);
                // Columns are those of the world at half the layer's height.
                params.anchor = [place.centre[0], place.base + 0.5 * thickness, place.centre[2]].map(|c| c as f32);
                let anchor = params.anchor.map(f64::from);
                for level in 0..levels as usize {
                    let half = half_width * f64::from(1u32 << level);
                    let edge = 2.0 * half / dim;
                    let low = place.base - half * half / place.planet_radius - BELOW * thickness;
                    let high = place.base + ABOVE * thickness;
                    // Whole voxels from the world's origin.
                    let first = |axis: usize| {
                        let begin = ((place.centre[axis] + place.origin[axis]) / edge).round() - 0.5 * dim;
                        (anchor[axis] + place.origin[axis]) / edge - begin
                    };
                    let [u, v] = frame.across;
                    let along = (depth - 2.0 * MARGIN) / (high - low);
                    let rows = frame.rows([1.0 / edge; 2], along);
                    params.row_u[level] = row(rows[0], first(u));
                    params.row_v[level] = row(rows[1], first(v));
                    params.row_w[level] = row(rows[2], MARGIN + (high - anchor[1]) * along);
                }
            }
        }
        params
    }
}

fn row(direction: [f64; 3], offset: f64) -> [f32; 4] {
    [direction[0] as f32, direction[1] as f32, direction[2] as f32, offset as f32]
}

/// `to_sun`, or where that is lower than [`LOWEST_SUN`], the direction at that height above it.
fn no_lower(to_sun: [f64; 3]) -> [f64; 3] {
    if to_sun[1] >= LOWEST_SUN {
        return to_sun;
    }
    let horizontal = to_sun[0].hypot(to_sun[2]);
    let [x, z] = if horizontal > 1e-6 { [to_sun[0] / horizontal, to_sun[2] / horizontal] } else { [1.0, 0.0] };
    let cos = (1.0 - LOWEST_SUN * LOWEST_SUN).sqrt();
    [x * cos, LOWEST_SUN, z * cos]
}

/// Slices of voxels perpendicular to an axis of the world, sheared so that columns through all of them run along the light.
struct Slices {
    axis: usize,
    across: [usize; 2],
    to_sun: [f64; 3],
}

impl Slices {
    fn across(to_sun: [f64; 3], axis: usize) -> Self {
        Self { axis, across: [(axis + 2) % 3, (axis + 1) % 3], to_sun }
    }

    /// The slices that hold a box of these half edges in the least room.
    fn least(to_sun: [f64; 3], half: [f64; 3]) -> Self {
        let room = |frame: &Self| {
            half[frame.axis] * frame.across.iter().map(|&axis| frame.half_width(axis, half)).product::<f64>()
        };
        let [x, y, z] = [0, 1, 2].map(|axis| Self::across(to_sun, axis));
        [x, z].into_iter().fold(y, |least, other| if room(&other) < room(&least) { other } else { least })
    }

    /// Way along `axis` for a unit of way along the slices' own.
    fn slant(&self, axis: usize) -> f64 {
        let along = self.to_sun[self.axis];
        // Below this the room is so large that another axis has less.
        self.to_sun[axis] / along.abs().max(1e-9).copysign(along)
    }

    /// Half of what a box of these half edges covers along `axis`, seen along the light.
    fn half_width(&self, axis: usize, half: [f64; 3]) -> f64 {
        half[axis] + half[self.axis] * self.slant(axis).abs()
    }

    /// From a direction [m] to voxels across the light and away from it.
    fn rows(&self, scale: [f64; 2], along: f64) -> [[f64; 3]; 3] {
        let mut rows = [[0.0; 3]; 3];
        for (i, (axis, scale)) in self.across.into_iter().zip(scale).enumerate() {
            rows[i][axis] = scale;
            rows[i][self.axis] = -scale * self.slant(axis);
        }
        rows[2][self.axis] = -along.copysign(self.to_sun[self.axis]);
        rows
    }
}

/// The volume, and the passes that fill it.
pub struct AttenuationVolume {
    design: AttenuationDesign,
    splat: ComputePipeline,
    store: ComputePipeline,
    params: Vec<Buffer>,
    bends: Image,
    image: Image,
}

impl AttenuationVolume {
    /// Voxels of `design` with `slots` frames in flight; none without a design.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] naming `clouds.attenuation_resolution` if the device has no volume so large;
    /// [`Error::OutOfMemory`].
    pub fn new(gpu: &Arc<Gpu>, design: Option<AttenuationDesign>, precision: Precision, slots: usize) -> Result<Self> {
        let none = AttenuationDesign { dim: 1, depth: 1, shape: AttenuationShape::Box([1.0; 3]) };
        let design = design.unwrap_or(none);
        let extent = design.extent();
        let limit = gpu.capabilities().max_image_dimension_3d;
        if let Some(most) = extent.into_iter().max().filter(|most| *most > limit) {
            let fits = u64::from(design.dim) * u64::from(limit) / u64::from(most);
            let expected = format!("at most {fits}: the device's volumes end at {limit} voxels, and this takes {most}");
            return Err(Error::invalid("clouds.attenuation_resolution", design.dim, expected));
        }
        let format = if precision == Precision::F32 { vk::Format::R32_SFLOAT } else { vk::Format::R16_SFLOAT };
        let image = |name, format| {
            let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
            Image::new(gpu, &ImageDesc { name, extent, format, usage })
        };
        let params = (0..slots)
            .map(|_| {
                let bytes = size_of::<AttenuationParams>() as u64;
                let buffer = Buffer::new(gpu, "attenuation params", bytes, BufferKind::Upload)?;
                buffer.write(0, &[AttenuationParams::zeroed()]);
                Ok(buffer)
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            design,
            splat: ComputePipeline::new(gpu, &splat::PROGRAM, &[])?,
            store: ComputePipeline::new(gpu, &store::PROGRAM, &[])?,
            params,
            bends: image("attenuation bends", vk::Format::R32_UINT)?,
            image: image("attenuation volume", format)?,
        })
    }

    /// This frame's parameters, for shaders that look depths up (`glsl/lighting/attenuation/lookup.glsl`).
    #[must_use]
    pub fn params(&self, slot: usize) -> &Buffer {
        &self.params[slot]
    }

    /// Optical depth between the middle of each voxel and the sun.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Records all shadows of one frame.
    ///
    /// # Errors
    /// What Vulkan says.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        place: &VolumePlace,
        medium: &VolumeMedium,
        set: &ParticleSet,
    ) -> Result<()> {
        let attenuation = &self.params[rec.slot()];
        attenuation.write(0, &[self.design.frame(place, medium)]);
        rec.clear_image(&self.bends, [0.0; 4]);
        rec.dispatch_indirect(
            &self.splat,
            &splat::Bindings { attenuation, counters: set.counters(), particles: set.particles(), bends: &self.bends },
            &(),
            set.args(),
            ParticleSet::PARTICLE_ARGS,
        )?;
        let bindings = store::Bindings { attenuation, bends: &self.bends, attenuation_volume: &self.image };
        rec.dispatch(&self.store, &bindings, &(), [self.design.dim, self.design.dim, self.design.levels()])
    }
}

/// What dims light in the volume: the body of particles that detail leaves, at its mean density.
pub(crate) fn medium(clouds: &Clouds, mean_profile: f32) -> VolumeMedium {
    VolumeMedium::with_mean(clouds, 1.0, mean_profile)
}
