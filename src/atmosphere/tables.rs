//! Fills the tables of the clear air and computes its light on clouds and ground.

use super::{Air, CloudShadow, SkyLight};
use crate::Result;
use crate::gpu::{Buffer, BufferKind, ComputePipeline, Gpu, Image, ImageDesc, Once, Recorder, Sampler};
use crate::params::SkyModel;
use crate::shaders::{
    atmosphere_aerial_comp as aerial, atmosphere_multiple_comp as multiple, atmosphere_sky_light_comp as sky_light,
    atmosphere_sky_view_comp as sky_view, atmosphere_transmittance_comp as transmittance,
};
use crate::shared::constants::atmosphere_sky_light_comp as constants;
use crate::shared::{FrameParams, assert_layout};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Texels of the transmittance table, by direction and altitude.
pub const TRANSMITTANCE_SIZE: [u32; 2] = [256, 64];
/// Texels of the multiple-scattering table, by sun and altitude.
pub const MULTIPLE_SIZE: [u32; 2] = [32, 32];
/// Texels of the sky view, by azimuth and elevation (half of the rows below the horizon).
pub const SKY_VIEW_SIZE: [u32; 2] = [64, 192];
/// Texels of the aerial perspective, by azimuth, elevation (odd: one row is horizontal) and distance.
pub const AERIAL_SIZE: [u32; 3] = [32, 65, 32];

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SkyLightPush {
    cloud_altitude: f32,
    shadowed: u32,
}
assert_layout!(SkyLightPush, sky_light_push, { cloud_altitude: CLOUD_ALTITUDE, shadowed: SHADOWED });

/// The tables of one sky, and what fills them.
pub struct Atmosphere {
    model: SkyModel,
    /// The tables of the air alone.
    filled: Once,
    /// Sky view and aerial perspective, by camera altitude, sine of the sun's elevation and cloud base.
    view: Once,
    fill_transmittance: ComputePipeline,
    fill_multiple: ComputePipeline,
    fill_sky_view: ComputePipeline,
    fill_aerial: ComputePipeline,
    fill_sky_light: ComputePipeline,
    pub(crate) air: Buffer,
    sky_light: Buffer,
    /// Transmittance to the top of the atmosphere.
    pub transmittance: Image,
    /// Multiply scattered radiance.
    pub multiple: Image,
    /// Airlight along whole rays: Rayleigh and multiple scattering.
    pub sky_view_smooth: Image,
    /// Airlight along whole rays: aerosol, without its phase function.
    pub sky_view_aerosol: Image,
    /// What of [`Self::sky_view_smooth`] comes from below the clouds.
    pub below_smooth: Image,
    /// What of [`Self::sky_view_aerosol`] comes from below the clouds.
    pub below_aerosol: Image,
    /// Mean in-scattering up to a distance: Rayleigh and multiple scattering.
    pub aerial_smooth: Image,
    /// Mean in-scattering up to a distance: aerosol, without its phase function.
    pub aerial_aerosol: Image,
    /// Mean extinction up to a distance.
    pub aerial_extinction: Image,
}

fn table(gpu: &Arc<Gpu>, name: &'static str, extent: [u32; 3]) -> Result<Image> {
    let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
    Image::new(gpu, &ImageDesc { name, extent, format: vk::Format::R16G16B16A16_SFLOAT, usage })
}

impl Atmosphere {
    /// Pipelines and empty tables.
    ///
    /// # Errors
    /// A field of `air` that cannot be used, or what Vulkan says.
    pub fn new(gpu: &Arc<Gpu>, model: SkyModel, air: &Air) -> Result<Self> {
        air.validate()?;
        let flat = |size: [u32; 2]| [size[0], size[1], 0];
        let number = match model {
            SkyModel::None => constants::SKY_NONE,
            SkyModel::Atmosphere => constants::SKY_ATMOSPHERE,
        };
        let model_constant = [("SKY_MODEL", number)];
        Ok(Self {
            model,
            filled: Once::new(),
            view: Once::new(),
            fill_transmittance: ComputePipeline::new(gpu, &transmittance::PROGRAM, &[])?,
            fill_multiple: ComputePipeline::new(gpu, &multiple::PROGRAM, &[])?,
            fill_sky_view: ComputePipeline::new(gpu, &sky_view::PROGRAM, &[])?,
            fill_aerial: ComputePipeline::new(gpu, &aerial::PROGRAM, &[])?,
            fill_sky_light: ComputePipeline::new(gpu, &sky_light::PROGRAM, &model_constant)?,
            air: Buffer::upload(gpu, "air", &[air.to_device()])?,
            sky_light: Buffer::new(gpu, "sky light", size_of::<SkyLight>() as u64, BufferKind::Device)?,
            transmittance: table(gpu, "air transmittance", flat(TRANSMITTANCE_SIZE))?,
            multiple: table(gpu, "air multiple scattering", flat(MULTIPLE_SIZE))?,
            sky_view_smooth: table(gpu, "sky view, smooth", flat(SKY_VIEW_SIZE))?,
            sky_view_aerosol: table(gpu, "sky view, aerosol", flat(SKY_VIEW_SIZE))?,
            below_smooth: table(gpu, "sky view below clouds, smooth", flat(SKY_VIEW_SIZE))?,
            below_aerosol: table(gpu, "sky view below clouds, aerosol", flat(SKY_VIEW_SIZE))?,
            aerial_smooth: table(gpu, "aerial perspective, smooth", AERIAL_SIZE)?,
            aerial_aerosol: table(gpu, "aerial perspective, aerosol", AERIAL_SIZE)?,
            aerial_extinction: table(gpu, "aerial extinction", flat([AERIAL_SIZE[1], AERIAL_SIZE[2]]))?,
        })
    }

    /// Which sky this is.
    #[must_use]
    pub fn model(&self) -> SkyModel {
        self.model
    }

    /// [`SkyLight`], filled by [`Self::record_luts`].
    #[must_use]
    pub fn sky_light(&self) -> &Buffer {
        &self.sky_light
    }

    /// Fills the tables: once those of the air alone, sky view and aerial perspective when the camera's altitude, the
    /// sun's elevation or `cloud_base` change, and every frame the light on clouds and ground. `frame` holds `params`;
    /// `shadow` is what the clouds let through to the ground; `cloud_base` is the lowest altitude of the clouds, where
    /// their light is taken \[m\]. With no sky only the light is written.
    pub fn record_luts(
        &self,
        rec: &mut Recorder<'_>,
        frame: &Buffer,
        params: &FrameParams,
        shadow: &CloudShadow,
        cloud_base: f32,
    ) -> Result<()> {
        let linear = |image| Image::sampled(image, Sampler::LinearClamp);
        rec.pass("atmosphere", |rec| {
            if self.model == SkyModel::Atmosphere {
                rec.once(&self.filled, |rec| {
                    let [w, h] = TRANSMITTANCE_SIZE;
                    let bindings = transmittance::Bindings { air: &self.air, table: &self.transmittance };
                    rec.dispatch(&self.fill_transmittance, &bindings, &(), [w, h, 1])?;
                    let [w, h] = MULTIPLE_SIZE;
                    let bindings = multiple::Bindings {
                        air: &self.air,
                        transmittance_lut: linear(&self.transmittance),
                        table: &self.multiple,
                    };
                    rec.dispatch(&self.fill_multiple, &bindings, &(), [w, h, 1])?;
                    Ok(())
                })?;
            }
            let view = [params.camera[1] + params.origin[1], params.to_sun[1], cloud_base];
            if self.model == SkyModel::Atmosphere {
                rec.refresh(&self.view, &view, |rec| {
                    let bindings = sky_view::Bindings {
                        air: &self.air,
                        frame,
                        transmittance_lut: linear(&self.transmittance),
                        multiple_lut: linear(&self.multiple),
                        smooth_table: &self.sky_view_smooth,
                        aerosol_table: &self.sky_view_aerosol,
                        below_smooth_table: &self.below_smooth,
                        below_aerosol_table: &self.below_aerosol,
                    };
                    rec.dispatch(&self.fill_sky_view, &bindings, &cloud_base, [SKY_VIEW_SIZE[0], SKY_VIEW_SIZE[1], 1])?;
                    let bindings = aerial::Bindings {
                        air: &self.air,
                        frame,
                        transmittance_lut: linear(&self.transmittance),
                        multiple_lut: linear(&self.multiple),
                        smooth_table: &self.aerial_smooth,
                        aerosol_table: &self.aerial_aerosol,
                        extinction_table: &self.aerial_extinction,
                    };
                    rec.dispatch(&self.fill_aerial, &bindings, &(), [AERIAL_SIZE[0], AERIAL_SIZE[1], 1])?;
                    Ok(())
                })?;
            }
            let bindings = sky_light::Bindings {
                air: &self.air,
                frame,
                transmittance_lut: linear(&self.transmittance),
                multiple_lut: linear(&self.multiple),
                sky_light: &self.sky_light,
                cloud_shadow: linear(&shadow.image),
            };
            let push = SkyLightPush { cloud_altitude: cloud_base, shadowed: u32::from(shadow.place().1 > 0.0) };
            rec.dispatch(&self.fill_sky_light, &bindings, &push, [1, 1, 1])
        })
    }
}
