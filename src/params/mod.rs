//! Everything a picture depends on, as plain data: SI units, angles in degrees, defaults with their source.
//!
//! [`Params::default`] is a good sky. [`Params::validate`] names every bad field as a scene file writes it; the renderer
//! refuses parameters that do not pass. Reading them from a scene file is the business of [`crate::scene`] (feature
//! `files`); an engine fills the structs itself.
//!
//! World axes: right-handed, +y up, +x east, −z north, metres; `y = 0` is sea level. Yaw and azimuth are compass angles:
//! 0 is north (−z), 90 is east (+x). Pitch and elevation grow upwards.

mod animation;
mod axes;
mod camera;
pub(crate) mod check;
mod clouds;
mod forward;
mod quality;
mod sky;
pub mod solar;
mod sun;

pub use animation::{Animation, CameraKey, CloudMotion, WIND_LAYERS};
pub use axes::{
    AxisValue, BLENDS, FORWARD_PHASES, LIGHT_FROMS, LIGHTINGS, LightingMethod, OCCLUSIONS, PHASES, Row, SOURCES,
    SPLATS, STYLES, SourceKind, TRANSFERS, lightings_of, lookup,
};
pub use camera::{Aim, Basis, Camera};
pub use clouds::{
    ATTENUATION_RESOLUTIONS, Clouds, Coverage, CoverageMap, Lighting, OcclusionMode, ParticleDesc, Phase, Source,
    Style, Transfer,
};
pub use forward::{Forward, ForwardPhase, LIGHT_CAPACITY, Light, LightFrom, Splat};
pub use quality::{Blend, Precision, Preset, Quality, WINDOWS};
pub use sky::{Film, Ground, Sky, SkyModel, ToneCurve};
pub use sun::{Sun, SunPosition};

use crate::{Error, Result};

/// All parameters of a picture or a sequence of pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Params {
    /// Where the picture is taken from.
    pub camera: Camera,
    /// The light.
    pub sun: Sun,
    /// What is drawn.
    pub clouds: Clouds,
    /// How finely it is drawn, and by which compositing mode.
    pub quality: Quality,
    /// The clear sky and the ground.
    pub sky: Sky,
    /// From radiance to display values.
    pub film: Film,
    /// What changes from one frame of a sequence to the next.
    pub animation: Animation,
}

impl Params {
    /// Checks every field, and that this version has the chosen combination of source, lighting and compositing.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] naming the field as a scene file writes it, the value and what
    /// would have been accepted, or [`Error::Unsupported`] for a choice that is known but not
    /// in this version.
    pub fn validate(&self) -> Result<()> {
        self.camera.validate()?;
        self.sun.validate()?;
        self.clouds.validate()?;
        self.quality.validate()?;
        self.sky.validate()?;
        self.film.validate()?;
        self.animation.validate()?;
        self.validate_motion()?;
        axes::validate(self)?;
        if self.sky.model == SkyModel::Atmosphere {
            // Below sea level the clear sky's rays would start inside the planet.
            check::within(
                "camera.position[1]",
                self.camera.position[1],
                0.0..=1.0e6,
                "m, with sky.model = \"atmosphere\"",
            )?;
        }
        Ok(())
    }

    /// Checks that what the animation moves is there to be moved.
    fn validate_motion(&self) -> Result<()> {
        let animation = &self.animation;
        let by_time = matches!(self.sun.position, SunPosition::Time { .. });
        for (field, rate, fits, beside) in [
            ("sun_rate", animation.sun_rate, by_time, "0, or sun.time beside it"),
            ("sun_elevation_rate", animation.sun_elevation_rate, !by_time, "0, or a sun by elevation and azimuth"),
            ("sun_azimuth_rate", animation.sun_azimuth_rate, !by_time, "0, or a sun by elevation and azimuth"),
        ] {
            if rate != 0.0 && !fits {
                return Err(Error::invalid(format!("animation.{field}"), rate, beside));
            }
        }
        if animation.wind.len() > 1 && !matches!(self.clouds.source, Source::Grid) {
            let value = format!("{} vectors", animation.wind.len());
            let expected =
                "one vector: layers are those of clouds.source = \"grid\"; particles have velocities of their own";
            return Err(Error::invalid("animation.wind", value, expected));
        }
        if animation.evolution != 0.0 && !matches!(self.clouds.source, Source::Grid) {
            let expected = "0: only clouds of clouds.source = \"grid\" change their shapes";
            return Err(Error::invalid("animation.evolution", animation.evolution, expected));
        }
        Ok(())
    }

    /// The parameters of frame `frame`, at `frame / frame_rate` seconds after `self`: what [`Animation`] moves is moved,
    /// explicit particles have gone with the wind and their velocities. Frame 0 of a scene without camera path is `self`.
    #[must_use]
    pub fn at_frame(&self, frame: u32) -> Self {
        let mut params = self.clone();
        let seconds = f64::from(frame) / self.animation.frame_rate;
        params.camera = self.animation.camera_at(&self.camera, frame);
        params.animation.time += seconds;
        params.sun.position = self.animation.sun_after(self.sun.position, seconds);
        if let Source::Particles(particles) = &mut params.clouds.source {
            let wind = self.animation.mean_wind();
            particles.iter_mut().for_each(|particle| particle.centre = particle.after(seconds, wind));
        }
        params
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The field that validation blames after `change` has been made to the defaults.
    pub(super) fn blamed(change: impl FnOnce(&mut Params)) -> String {
        let mut params = Params::default();
        change(&mut params);
        match params.validate() {
            Err(Error::InvalidParam { field, .. }) => field,
            Err(Error::Unsupported { needed, .. }) => format!("unsupported {needed}"),
            Err(other) => panic!("unexpected error: {other}"),
            Ok(()) => "nothing".into(),
        }
    }

    #[test]
    fn the_defaults_are_valid() {
        assert_eq!(blamed(|_| ()), "nothing");
    }

    #[test]
    fn every_bad_field_is_named_as_a_scene_file_writes_it() {
        assert_eq!(blamed(|p| p.camera.position[0] = f64::NAN), "camera.position[0]");
        assert_eq!(blamed(|p| p.camera.position[1] = -1.0), "camera.position[1]");
        assert_eq!(blamed(|p| p.camera.fov_y = 180.0), "camera.fov_y");
        assert_eq!(blamed(|p| p.camera.aim = Aim::LookAt(p.camera.position)), "camera.look_at");
        assert_eq!(blamed(|p| p.camera.aim = Aim::Angles { yaw: 0.0, pitch: 91.0 }), "camera.pitch");
        assert_eq!(blamed(|p| p.sun.position = SunPosition::Angles { elevation: 95.0, azimuth: 0.0 }), "sun.elevation");
        assert_eq!(blamed(|p| p.sun.irradiance[2] = -1.0), "sun.irradiance[2]");
        assert_eq!(blamed(|p| p.clouds.coverage = Coverage::Uniform(-0.1)), "clouds.coverage");
        assert_eq!(blamed(|p| p.clouds.coverage = Coverage::Uniform(f32::NAN)), "clouds.coverage");
        assert_eq!(blamed(|p| p.clouds.thickness = 0.0), "clouds.thickness");
        assert_eq!(blamed(|p| p.clouds.sigma_t = -0.07), "clouds.sigma_t");
        assert_eq!(blamed(|p| p.clouds.g_single = 1.0), "clouds.g_single");
        assert_eq!(blamed(|p| p.clouds.albedo = 1.5), "clouds.albedo");
        assert_eq!(blamed(|p| p.clouds.particle_cutoff = f32::INFINITY), "clouds.particle_cutoff");
        assert_eq!(blamed(|p| p.clouds.attenuation_resolution = 16), "clouds.attenuation_resolution");
        assert_eq!(blamed(|p| p.quality.downscale = 3), "quality.downscale");
        assert_eq!(blamed(|p| p.quality.cells = 100), "quality.cells");
        assert_eq!(blamed(|p| p.film.exposure_ev = f32::INFINITY), "film.exposure_ev");
        assert_eq!(blamed(|p| p.animation.velocity[1] = f64::NAN), "animation.velocity[1]");
    }

    #[test]
    fn a_bad_particle_is_named_by_its_number() {
        let with = |particle: ParticleDesc| {
            blamed(|p| p.clouds.source = Source::Particles(vec![ParticleDesc::default(), particle]))
        };
        let good = ParticleDesc::default();
        assert_eq!(with(good), "nothing");
        assert_eq!(with(ParticleDesc { radii: [1.0, 0.0, 1.0], ..good }), "clouds.particle[1].radii[1]");
        assert_eq!(with(ParticleDesc { rotation: [0.0; 4], ..good }), "clouds.particle[1].rotation");
        assert_eq!(with(ParticleDesc { density: -1.0, ..good }), "clouds.particle[1].density");
    }

    #[test]
    fn a_bad_light_is_named_by_its_number() {
        let with = |light: Light| blamed(|p| p.clouds.forward.lights = vec![Light::SUN, light]);
        assert_eq!(with(Light::SKY), "nothing");
        for direction in [[0.0; 3], [0.0, 1.1, 0.0], [f64::NAN, 1.0, 0.0]] {
            assert_eq!(with(Light { direction: Some(direction), ..Light::SKY }), "clouds.light[1].direction");
        }
        assert_eq!(with(Light { colour: [1.0, -0.1, 1.0], ..Light::SUN }), "clouds.light[1].colour[1]");
        assert_eq!(blamed(|p| p.clouds.forward.lights = vec![Light::SUN; LIGHT_CAPACITY + 1]), "clouds.light");
        assert_eq!(blamed(|p| p.clouds.forward.lights.clear()), "clouds.light");
        assert_eq!(blamed(|p| p.clouds.forward.solid_angle = 0.0), "clouds.forward_solid_angle");
        assert_eq!(blamed(|p| p.clouds.forward.resolution = 5000), "clouds.forward_resolution");
    }

    #[test]
    fn names_that_are_known_but_not_here_yet_say_so() {
        let march = blamed(|p| p.clouds.lighting = Lighting::March);
        assert_eq!(march, "unsupported clouds.lighting = \"march\"");
        assert!(
            blamed(|p| p.clouds.lighting = Lighting::Flat).starts_with("unsupported clouds.lighting = \"flat\" with")
        );
        let flat_particles = blamed(|p| {
            p.clouds.lighting = Lighting::Flat;
            p.clouds.source = Source::Particles(vec![ParticleDesc::default()]);
        });
        assert_eq!(flat_particles, "nothing");
        assert!(blamed(|p| p.quality.blend = Blend::Impostor).starts_with("unsupported quality.blend = \"impostor\""));
        assert_eq!(blamed(|p| p.quality.blend = Blend::Interlock(4)), "nothing");
    }

    #[test]
    fn frames_move_and_turn_the_camera() {
        let animation = Animation { velocity: [10.0, 0.0, -2.0], yaw_rate: 1.5, ..Animation::default() };
        let params = Params { animation, ..Params::default() };
        let later = params.at_frame(4);
        let [x, y, z] = params.camera.position;
        assert_eq!(later.camera.position, [x + 40.0, y, z - 8.0]);
        assert_eq!(later.camera.aim, Aim::Angles { yaw: 6.0, pitch: 8.0 });
        assert_eq!(params.at_frame(0), params);
    }

    #[test]
    fn time_moves_the_sun_the_clouds_and_the_particles_and_composes() {
        let mut params = Params::default();
        params.animation = Animation {
            frame_rate: 4.0,
            wind: vec![[8.0, -2.0]],
            sun_elevation_rate: 2.0,
            sun_azimuth_rate: -4.0,
            ..Animation::default()
        };
        let particle = ParticleDesc { centre: [1.0, 2.0, 3.0], velocity: [0.0, 16.0, 4.0], ..ParticleDesc::default() };
        params.clouds.source = Source::Particles(vec![particle]);
        let later = params.at_frame(6); // 1.5 s
        assert_eq!(later.animation.time, 1.5);
        assert_eq!(later.animation.clouds().drift, [12.0, -3.0]);
        assert_eq!(later.sun.position, SunPosition::Angles { elevation: 38.0, azimuth: 144.0 });
        let Source::Particles(list) = &later.clouds.source else { panic!("still a list") };
        assert_eq!(list[0].centre, [13.0, 26.0, 6.0]);
        assert_eq!(params.at_frame(2).at_frame(4), later);
        params.sun.position = SunPosition::Time { unix_seconds: 1.0e9, latitude: 0.0, longitude: 0.0 };
        params.animation.sun_rate = 3600.0;
        let SunPosition::Time { unix_seconds, .. } = params.at_frame(8).sun.position else { panic!("still by time") };
        assert_eq!(unix_seconds, 1.0e9 + 7200.0);
    }

    #[test]
    fn bad_motion_is_named_as_a_scene_file_writes_it() {
        let animated = |change: fn(&mut Animation)| blamed(|p| change(&mut p.animation));
        assert_eq!(animated(|a| a.frame_rate = 0.0), "animation.frame_rate");
        assert_eq!(animated(|a| a.wind = vec![[1.0, f64::NAN]]), "animation.wind[1]");
        assert_eq!(animated(|a| a.wind = vec![[0.0; 2], [f64::INFINITY, 0.0]]), "animation.wind[1][0]");
        assert_eq!(animated(|a| a.wind = vec![[0.0; 2]; 9]), "animation.wind");
        assert_eq!(animated(|a| a.evolution = -1.0), "animation.evolution");
        assert_eq!(animated(|a| a.evolution = f64::NAN), "animation.evolution");
        assert_eq!(animated(|a| a.sun_rate = 60.0), "animation.sun_rate");
        assert_eq!(animated(|a| a.sun_azimuth_rate = f64::INFINITY), "animation.sun_azimuth_rate");
        let keys = |times: [f64; 2]| {
            blamed(|p| {
                let key = |time| CameraKey { time, position: [0.0, 10.0, 0.0], aim: p.camera.aim };
                p.animation.keys = times.map(key).to_vec();
            })
        };
        assert_eq!(keys([0.0, 1.0]), "nothing");
        assert_eq!(keys([1.0, 1.0]), "animation.key[1].time");
        assert_eq!(keys([1.0, 0.0]), "animation.key[1].time");
        assert_eq!(keys([f64::NAN, 0.0]), "animation.key[0].time");
        let both = blamed(|p| {
            p.animation.keys = vec![CameraKey { time: 0.0, position: [0.0, 10.0, 0.0], aim: p.camera.aim }];
            p.animation.velocity = [1.0, 0.0, 0.0];
        });
        assert_eq!(both, "animation.velocity");
        let shear = blamed(|p| {
            p.clouds.source = Source::Particles(vec![ParticleDesc::default()]);
            p.animation.wind = vec![[0.0; 2], [1.0, 0.0]];
        });
        assert_eq!(shear, "animation.wind");
    }
}
