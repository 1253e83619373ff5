//! From the cloud targets and the background to the picture: upsampling, compositing, exposure, tone curve.

use crate::Result;
use crate::gpu::{ComputePipeline, Gpu, Image, ImageDesc, Recorder, Sampler};
use crate::params::{self, Precision, SkyModel, ToneCurve};
use crate::shaders::{film_composite_comp as composite, film_tonemap_comp as tonemap};
use crate::shared::assert_layout;
use crate::shared::constants::film_tonemap_glsl as constants;
use crate::targets::cloud_format;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Radiance that exposure 0 EV maps to 1 before the tone curve. Relative to the sun's irradiance outside the atmosphere:
/// a white Lambertian surface facing it would have 0.32.
pub const REFERENCE_RADIANCE: f32 = 0.29;

/// Irradiance on a surface that faces the sun 45° high, 1000 m above the sea in the default air [W m⁻² nm⁻¹]: the light
/// that shows white, as on a daylight film. Clouds are then neither yellow nor blue, and the evening stays warm.
/// (A test of [`crate::reference::atmosphere`] compares it with the air.)
pub const DAYLIGHT: [f32; 3] = [1.35, 1.53, 1.35];

/// Factors from radiance to the tone curve's input. Without a sky all three channels are treated alike.
#[must_use]
pub fn gain(film: &params::Film, model: SkyModel) -> [f32; 3] {
    let exposure = film.exposure_ev.exp2() / REFERENCE_RADIANCE;
    match model {
        SkyModel::None => [exposure; 3],
        // A white surface in daylight is as bright as one in unit irradiance without a sky.
        SkyModel::Atmosphere => DAYLIGHT.map(|irradiance| exposure / irradiance),
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TonemapPush {
    gain: [f32; 3],
    curve: u32,
}
assert_layout!(TonemapPush, tonemap_push, { gain: GAIN, curve: CURVE });

/// Composites and tones.
pub struct Film {
    composite: ComputePipeline,
    tonemap: ComputePipeline,
    /// Radiance in rgb, transmittance of the clouds in a; full resolution.
    pub scene: Image,
    /// Toned, sRGB-encoded picture; full resolution, 16 bits a channel.
    pub picture: Image,
}

impl Film {
    /// Images of `extent` pixels.
    pub fn new(gpu: &Arc<Gpu>, extent: [u32; 2], precision: Precision) -> Result<Self> {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
        let image =
            |name, format| Image::new(gpu, &ImageDesc { name, extent: [extent[0], extent[1], 0], format, usage });
        Ok(Self {
            composite: ComputePipeline::new(gpu, &composite::PROGRAM, &[])?,
            tonemap: ComputePipeline::new(gpu, &tonemap::PROGRAM, &[])?,
            scene: image("scene", cloud_format(precision))?,
            picture: image("picture", vk::Format::R16G16B16A16_UNORM)?,
        })
    }

    /// Puts the clouds over `background`; distances tell where opaque edges are, at low and at full resolution.
    pub fn record_composite(
        &self,
        rec: &mut Recorder<'_>,
        cloud: &Image,
        low_opaque: &Image,
        opaque_distance: &Image,
        background: &Image,
    ) -> Result<()> {
        let nearest = Sampler::NearestClamp;
        let bindings = composite::Bindings {
            cloud: cloud.sampled(nearest),
            low_opaque: low_opaque.sampled(nearest),
            opaque_distance: opaque_distance.sampled(nearest),
            background: background.sampled(nearest),
            scene: &self.scene,
        };
        let [width, height, _] = self.scene.extent();
        rec.pass("composite", |rec| rec.dispatch(&self.composite, &bindings, &(), [width, height, 1]))
    }

    /// Tones the composited scene.
    pub fn record_tonemap(&self, rec: &mut Recorder<'_>, film: &params::Film, model: SkyModel) -> Result<()> {
        let bindings = tonemap::Bindings { scene: self.scene.sampled(Sampler::NearestClamp), picture: &self.picture };
        let push = TonemapPush { gain: gain(film, model), curve: curve(film.curve) };
        let [width, height, _] = self.picture.extent();
        rec.pass("tonemap", |rec| rec.dispatch(&self.tonemap, &bindings, &push, [width, height, 1]))
    }
}

/// Number of a tone curve in `glsl/film/tonemap.glsl`.
fn curve(curve: ToneCurve) -> u32 {
    match curve {
        ToneCurve::Filmic => constants::CURVE_FILMIC,
        ToneCurve::Linear => constants::CURVE_LINEAR,
    }
}
