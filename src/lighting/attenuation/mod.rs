//! Lighting `attenuation`: sunlight from a volume of optical depths that particles are added to in any order (Shimada 3),
//! looked up in every pixel, so that light has gradations inside a particle (`docs/lighting.md`).

pub mod volume;

use std::sync::Arc;

use super::tables::volume::{VolumeMedium, VolumePlace, mean_profile};
use super::{Lent, Method, Scene, Setting};
use crate::Result;
use crate::gpu::{Gpu, Recorder, Resource, Sampler};
use crate::grid::{Counters, ParticleSet};

use volume::{AttenuationDesign, AttenuationVolume};

pub(super) struct AttenuationLight {
    volume: AttenuationVolume,
    medium: VolumeMedium,
}

impl AttenuationLight {
    pub(super) fn new(setting: &Setting<'_>) -> Result<Self> {
        let clouds = &setting.params.clouds;
        let design = AttenuationDesign::new(&setting.spread, clouds.attenuation_resolution);
        Ok(Self {
            volume: AttenuationVolume::new(setting.gpu, Some(design), setting.params.quality.precision, setting.slots)?,
            medium: volume::medium(clouds, mean_profile(clouds.style)),
        })
    }
}

impl Method for AttenuationLight {
    fn record(&mut self, rec: &mut Recorder<'_>, scene: &Scene<'_>) -> Result<()> {
        let place = VolumePlace::of(scene);
        rec.pass("attenuation", |rec| self.volume.record(rec, &place, &self.medium, scene.set))
    }

    fn resources<'a>(&'a self, lent: &Lent<'a>) -> Vec<(&'static str, Resource<'a>)> {
        vec![
            ("sky_light", Resource::Buffer(lent.sky_light)),
            ("attenuation", Resource::Buffer(self.volume.params(lent.slot))),
            ("attenuation_volume", Resource::Sampled(self.volume.image().sampled(Sampler::LinearClamp))),
        ]
    }

    fn grow(&mut self, _: &Arc<Gpu>, _: &Counters, _: &ParticleSet) -> Result<bool> {
        Ok(false)
    }
}
