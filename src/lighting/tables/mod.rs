//! Lighting `tables`: pre-computed single and multiple scattering (Yusov 4), sunlight dimmed by the particles in front (Yusov
//! 5.3), and what particles have scattered diffusing through all of them (`docs/lighting.md`).

mod occlusion;
pub mod volume;

use std::sync::Arc;

use super::attenuation::volume::{AttenuationDesign, AttenuationVolume};
use super::{Lent, Method, Scene, Seen, Setting, attenuation};
use crate::Result;
use crate::gpu::{Gpu, Recorder, Resource, Sampler};
use crate::grid::{Counters, ParticleSet};
use crate::params::{Clouds, OcclusionMode, Transfer};
use crate::source::Spread;

pub use occlusion::Occlusion;

use volume::{LightVolume, VolumeDesign, VolumeMedium, VolumePlace, mean_profile};

pub(super) struct TableLight {
    occlusion: Occlusion,
    volume: LightVolume,
    /// Shadows in every pixel, where the scene asks for them.
    shadows: AttenuationVolume,
    /// Mean density of a particle over its ball.
    mean_profile: f32,
}

impl TableLight {
    pub(super) fn new(setting: &Setting<'_>) -> Result<Self> {
        let clouds = &setting.params.clouds;
        let shadows = (clouds.occlusion == OcclusionMode::Volume)
            .then(|| AttenuationDesign::new(&setting.spread, clouds.attenuation_resolution));
        Ok(Self {
            occlusion: Occlusion::new(setting.gpu, setting.capacity)?,
            volume: LightVolume::new(setting.gpu, volume_design(clouds, &setting.spread), setting.slots)?,
            shadows: AttenuationVolume::new(setting.gpu, shadows, setting.params.quality.precision, setting.slots)?,
            mean_profile: mean_profile(clouds.style),
        })
    }
}

/// Voxels for the light of particles that are so spread; none where nothing diffuses.
fn volume_design(clouds: &Clouds, spread: &Spread) -> VolumeDesign {
    match (clouds.transfer, spread) {
        (Transfer::Exponential, _) => VolumeDesign::none(),
        (Transfer::Diffusion, Spread::Layer { cell, cells, cutoff, thickness }) => {
            VolumeDesign::of_layer(*cell, *cells, *cutoff, *thickness)
        }
        (Transfer::Diffusion, Spread::Heap { extent, greatest }) => VolumeDesign::of_list(*extent, *greatest),
    }
}

impl Method for TableLight {
    fn record(&mut self, rec: &mut Recorder<'_>, scene: &Scene<'_>) -> Result<()> {
        let (clouds, set) = (&scene.params.clouds, scene.set);
        rec.pass("lighting", |rec| {
            self.occlusion.record(rec, scene.tiling, set, scene.cells, clouds, self.volume.voxel_edge())
        })?;
        if clouds.occlusion == OcclusionMode::Volume {
            let medium = attenuation::volume::medium(clouds, self.mean_profile);
            let place = VolumePlace::of(scene);
            rec.pass("attenuation", |rec| self.shadows.record(rec, &place, &medium, set))?;
        }
        match clouds.transfer {
            Transfer::Exponential => {
                self.volume.record_none(rec);
                Ok(())
            }
            Transfer::Diffusion => {
                let place = VolumePlace::of(scene);
                let medium = VolumeMedium::with_mean(clouds, scene.fill, self.mean_profile);
                rec.pass("light volume", |rec| {
                    self.volume.record(rec, &place, &medium, set, self.occlusion.sun_depths())
                })
            }
        }
    }

    fn record_seen(&self, rec: &mut Recorder<'_>, seen: &Seen<'_>) -> Result<()> {
        if !self.volume.fitted() {
            return Ok(());
        }
        rec.pass("light seen", |rec| {
            self.volume.record_seen(rec, seen.frame, seen.set, seen.compact, self.occlusion.lights())
        })
    }

    fn resources<'a>(&'a self, lent: &Lent<'a>) -> Vec<(&'static str, Resource<'a>)> {
        vec![
            ("lights", Resource::Buffer(self.occlusion.lights())),
            ("sky_light", Resource::Buffer(lent.sky_light)),
            ("scattering_lut", Resource::Sampled(lent.scattering.sampled(Sampler::LinearClamp))),
            ("volume", Resource::Buffer(self.volume.params(lent.slot))),
            ("light_volume", Resource::Sampled(self.volume.image().sampled(Sampler::LinearClamp))),
            ("attenuation", Resource::Buffer(self.shadows.params(lent.slot))),
            ("attenuation_volume", Resource::Sampled(self.shadows.image().sampled(Sampler::LinearClamp))),
        ]
    }

    fn grow(&mut self, gpu: &Arc<Gpu>, _: &Counters, set: &ParticleSet) -> Result<bool> {
        self.occlusion.grow(gpu, set)
    }
}
