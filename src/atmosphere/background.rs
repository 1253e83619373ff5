//! What is behind and in front of the clouds: sky and ground with their distance, and the air before the clouds.

use super::{Atmosphere, CloudShadow};
use crate::Result;
use crate::gpu::{Buffer, ComputePipeline, Gpu, Image, ImageDesc, Recorder, Sampler};
use crate::params::{Precision, SkyModel};
use crate::shaders::{
    atmosphere_background_comp as background, atmosphere_cloud_air_comp as cloud_air,
    atmosphere_opaque_distance_comp as opaque_distance, atmosphere_opaque_lent_comp as opaque_lent,
    atmosphere_opaque_reduce_comp as opaque_reduce, atmosphere_shafts_comp as shafts,
    atmosphere_shafts_smooth_comp as shafts_smooth,
};
use crate::shared::assert_layout;
use crate::targets::{CloudTargets, NO_CLOUD, cloud_format};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    shadow_centre: [f32; 2],
    shadow_extent: f32,
    /// Of the shafts; the background does not read it.
    cloud_base: f32,
}
assert_layout!(Push, background_push, {
    shadow_centre: SHADOW_CENTRE, shadow_extent: SHADOW_EXTENT, cloud_base: RESERVED,
});

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ShaftsPush {
    shadow: Push,
    downscale: u32,
    reserved: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CloudAirPush {
    cloud_base: f32,
    downscale: u32,
}
assert_layout!(CloudAirPush, cloud_air_push, { cloud_base: CLOUD_BASE, downscale: DOWNSCALE });

/// The scene without clouds, and the clouds with air in front. Without a sky everything here is black, infinitely far,
/// and clear.
pub struct Background {
    model: SkyModel,
    downscale: u32,
    distance: ComputePipeline,
    reduce: ComputePipeline,
    lent: ComputePipeline,
    background: ComputePipeline,
    air: ComputePipeline,
    shafts: ComputePipeline,
    shafts_smooth: ComputePipeline,
    /// Distance along the ray to the opaque scene \[m\], 1e30 for none; full resolution.
    pub opaque_distance: Image,
    /// The same at the resolution of the cloud targets: nearest and farthest of each block in turn.
    pub low_opaque: Image,
    /// Linear radiance of sky, sun and ground, the air in front of them included; full resolution.
    pub radiance: Image,
    cloud_in_air: Image,
    visibility: Image,
    smooth_visibility: Image,
}

impl Background {
    /// Pipelines and images for frames of `extent` pixels, whose cloud targets are `downscale` times smaller.
    pub fn new(
        gpu: &Arc<Gpu>,
        model: SkyModel,
        extent: [u32; 2],
        downscale: u32,
        precision: Precision,
    ) -> Result<Self> {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
        let image =
            |name, [w, h]: [u32; 2], format| Image::new(gpu, &ImageDesc { name, extent: [w, h, 0], format, usage });
        let low_extent = extent.map(|pixels| pixels.div_ceil(downscale));
        Ok(Self {
            model,
            downscale,
            distance: ComputePipeline::new(gpu, &opaque_distance::PROGRAM, &[])?,
            reduce: ComputePipeline::new(gpu, &opaque_reduce::PROGRAM, &[])?,
            lent: ComputePipeline::new(gpu, &opaque_lent::PROGRAM, &[])?,
            background: ComputePipeline::new(gpu, &background::PROGRAM, &[])?,
            air: ComputePipeline::new(gpu, &cloud_air::PROGRAM, &[])?,
            shafts: ComputePipeline::new(gpu, &shafts::PROGRAM, &[])?,
            shafts_smooth: ComputePipeline::new(gpu, &shafts_smooth::PROGRAM, &[])?,
            opaque_distance: image("opaque distance", extent, vk::Format::R32_SFLOAT)?,
            low_opaque: image("low opaque distance", low_extent, vk::Format::R32_SFLOAT)?,
            radiance: image("background", extent, cloud_format(precision))?,
            cloud_in_air: image("cloud in air", low_extent, cloud_format(precision))?,
            visibility: image("sun visibility below clouds", low_extent, vk::Format::R16_SFLOAT)?,
            smooth_visibility: image("smooth sun visibility below clouds", low_extent, vk::Format::R16_SFLOAT)?,
        })
    }

    /// Finds the opaque scene, which is the bare planet; before `blend`.
    pub fn record_opaque(&self, rec: &mut Recorder<'_>, atmosphere: &Atmosphere, frame: &Buffer) -> Result<()> {
        if self.model == SkyModel::None {
            rec.clear_image(&self.opaque_distance, [NO_CLOUD; 4]);
            rec.clear_image(&self.low_opaque, [NO_CLOUD; 4]);
            return Ok(());
        }
        rec.pass("opaque", |rec| {
            let bindings =
                opaque_distance::Bindings { air: &atmosphere.air, frame, opaque_distance: &self.opaque_distance };
            let [w, h, _] = self.opaque_distance.extent();
            rec.dispatch(&self.distance, &bindings, &(), [w, h, 1])?;
            self.record_reduce(rec)
        })
    }

    /// Puts a lent opaque scene in front, with or without a sky; after [`Self::record`], before `blend`. `lent` holds the
    /// distance along the ray \[m\] at full resolution, 1e30 where there is nothing. Where it is the nearest,
    /// [`Self::radiance`] becomes black: what the host's surface looks like is for the host to add.
    pub fn record_lent(&self, rec: &mut Recorder<'_>, lent: &Image) -> Result<()> {
        rec.pass("opaque", |rec| {
            let bindings = opaque_lent::Bindings {
                lent: lent.sampled(Sampler::NearestClamp),
                opaque_distance: &self.opaque_distance,
                radiance: &self.radiance,
            };
            let [w, h, _] = self.opaque_distance.extent();
            rec.dispatch(&self.lent, &bindings, &(), [w, h, 1])?;
            self.record_reduce(rec)
        })
    }

    fn record_reduce(&self, rec: &mut Recorder<'_>) -> Result<()> {
        let bindings = opaque_reduce::Bindings {
            opaque_distance: self.opaque_distance.sampled(Sampler::NearestClamp),
            opaque_low: &self.low_opaque,
        };
        let [w, h, _] = self.low_opaque.extent();
        rec.dispatch(&self.reduce, &bindings, &self.downscale, [w, h, 1])
    }

    /// Fills [`Self::radiance`]. Air below `cloud_base` \[m\] lies in the clouds' shadow where `shadow` says so.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        atmosphere: &Atmosphere,
        frame: &Buffer,
        shadow: &CloudShadow,
        cloud_base: f32,
    ) -> Result<()> {
        if self.model == SkyModel::None {
            rec.clear_image(&self.radiance, [0.0; 4]);
            return Ok(());
        }
        let linear = |image| Image::sampled(image, Sampler::LinearClamp);
        let (shadow_centre, shadow_extent) = shadow.place();
        let push = Push { shadow_centre, shadow_extent, cloud_base };
        let bindings = shafts::Bindings {
            air: &atmosphere.air,
            frame,
            cloud_shadow: linear(&shadow.image),
            visibility: &self.visibility,
        };
        let [w, h, _] = self.visibility.extent();
        let shafts_push = ShaftsPush { shadow: push, downscale: self.downscale, reserved: 0 };
        rec.pass("shafts", |rec| {
            rec.dispatch(&self.shafts, &bindings, &shafts_push, [w, h, 1])?;
            let bindings = shafts_smooth::Bindings {
                visibility: self.visibility.sampled(Sampler::NearestClamp),
                smooth_visibility: &self.smooth_visibility,
            };
            rec.dispatch(&self.shafts_smooth, &bindings, &(), [w, h, 1])
        })?;
        let bindings = background::Bindings {
            air: &atmosphere.air,
            frame,
            sky_light: atmosphere.sky_light(),
            transmittance_lut: linear(&atmosphere.transmittance),
            sky_view_smooth: linear(&atmosphere.sky_view_smooth),
            sky_view_aerosol: linear(&atmosphere.sky_view_aerosol),
            cloud_shadow: linear(&shadow.image),
            below_smooth_table: linear(&atmosphere.below_smooth),
            below_aerosol_table: linear(&atmosphere.below_aerosol),
            visibility: linear(&self.smooth_visibility),
            radiance: &self.radiance,
        };
        let [w, h, _] = self.radiance.extent();
        rec.pass("background", |rec| rec.dispatch(&self.background, &bindings, &push, [w, h, 1]))
    }

    /// Puts the air in front of the clouds, after `blend` and [`Self::record`]; the result takes the place of
    /// `targets.cloud`.
    pub fn record_cloud_air<'a>(
        &'a self,
        rec: &mut Recorder<'_>,
        atmosphere: &Atmosphere,
        frame: &Buffer,
        targets: &'a CloudTargets,
        cloud_base: f32,
    ) -> Result<&'a Image> {
        if self.model == SkyModel::None {
            return Ok(&targets.cloud);
        }
        let linear = |image| Image::sampled(image, Sampler::LinearClamp);
        let bindings = cloud_air::Bindings {
            air: &atmosphere.air,
            frame,
            smooth_table: linear(&atmosphere.aerial_smooth),
            aerosol_table: linear(&atmosphere.aerial_aerosol),
            extinction_table: linear(&atmosphere.aerial_extinction),
            cloud: targets.cloud.sampled(Sampler::NearestClamp),
            nearest: targets.nearest.sampled(Sampler::NearestClamp),
            visibility: linear(&self.smooth_visibility),
            below_smooth_table: linear(&atmosphere.below_smooth),
            below_aerosol_table: linear(&atmosphere.below_aerosol),
            cloud_in_air: &self.cloud_in_air,
        };
        let push = CloudAirPush { cloud_base, downscale: self.downscale };
        let [w, h, _] = self.cloud_in_air.extent();
        rec.pass("cloud air", |rec| rec.dispatch(&self.air, &bindings, &push, [w, h, 1]))?;
        Ok(&self.cloud_in_air)
    }
}
