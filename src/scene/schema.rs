//! The keys of a scene file and how they become [`Params`].

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::value::{Datetime, Offset};

use super::particles::ParticleKeys;
use super::{coverage, particles};
use crate::params::check;
use crate::params::{
    Aim, Animation, Camera, CameraKey, Clouds, Coverage, FORWARD_PHASES, Film, Forward, Ground, LIGHT_FROMS, LIGHTINGS,
    Light, LightFrom, OCCLUSIONS, PHASES, Params, Precision, Preset, Quality, SOURCES, SPLATS, STYLES, Sky, SkyModel,
    Source, SourceKind, Sun, SunPosition, TRANSFERS, ToneCurve, lookup, solar,
};
use crate::{Error, Result};

/// A whole scene file.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub struct Scene {
    camera: CameraKeys,
    sun: SunKeys,
    clouds: CloudKeys,
    quality: QualityKeys,
    sky: SkyKeys,
    film: FilmKeys,
    animation: AnimationKeys,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct CameraKeys {
    position: Option<[f64; 3]>,
    yaw: Option<f64>,
    pitch: Option<f64>,
    look_at: Option<[f64; 3]>,
    fov_y: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct SunKeys {
    elevation: Option<f64>,
    azimuth: Option<f64>,
    time: Option<Datetime>,
    latitude: Option<f64>,
    longitude: Option<f64>,
    irradiance: Option<[f32; 3]>,
    angular_radius: Option<f32>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct CloudKeys {
    source: Option<String>,
    lighting: Option<String>,
    style: Option<String>,
    seed: Option<u32>,
    altitude: Option<f32>,
    thickness: Option<f32>,
    coverage: Option<f32>,
    coverage_map: Option<PathBuf>,
    coverage_map_extent: Option<f32>,
    coverage_map_offset: Option<[f64; 2]>,
    coverage_map_rotation: Option<f64>,
    sigma_t: Option<f32>,
    albedo: Option<f32>,
    phase: Option<String>,
    g_single: Option<f32>,
    g_multiple: Option<f32>,
    orders: Option<u32>,
    transfer: Option<String>,
    xi: Option<f32>,
    smoothing: Option<f32>,
    occlusion: Option<String>,
    attenuation_resolution: Option<u32>,
    particle_cutoff: Option<f32>,
    light: Option<Vec<LightKeys>>,
    splat: Option<String>,
    forward_solid_angle: Option<f32>,
    forward_resolution: Option<u32>,
    forward_phase: Option<String>,
    file: Option<PathBuf>,
    particle: Option<Vec<ParticleKeys>>,
    grid: Option<String>,
    density_scale: Option<f32>,
}

/// One `[[clouds.light]]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct LightKeys {
    from: Option<String>,
    direction: Option<[f64; 3]>,
    elevation: Option<f64>,
    azimuth: Option<f64>,
    colour: Option<[f32; 3]>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct QualityKeys {
    preset: Option<String>,
    cells: Option<u32>,
    rings: Option<u32>,
    layers: Option<u32>,
    downscale: Option<u32>,
    precision: Option<String>,
    blend: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct SkyKeys {
    model: Option<String>,
    ground: Option<String>,
    ground_albedo: Option<[f32; 3]>,
    haze: Option<f32>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct FilmKeys {
    exposure_ev: Option<f32>,
    curve: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct AnimationKeys {
    frame_rate: Option<f64>,
    velocity: Option<[f64; 3]>,
    yaw_rate: Option<f64>,
    pitch_rate: Option<f64>,
    wind: Option<WindKeys>,
    evolution: Option<f64>,
    sun_rate: Option<f64>,
    sun_elevation_rate: Option<f64>,
    sun_azimuth_rate: Option<f64>,
    key: Option<Vec<PathKeys>>,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "a vector [x, z], or a list of such vectors from base to top")]
enum WindKeys {
    One([f64; 2]),
    Layers(Vec<[f64; 2]>),
}

/// One `[[animation.key]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PathKeys {
    time: f64,
    position: [f64; 3],
    yaw: Option<f64>,
    pitch: Option<f64>,
    look_at: Option<[f64; 3]>,
}

/// Puts a given value in place of a default.
fn set<T>(target: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *target = value;
    }
}

/// As [`set`], for a value by name.
fn set_named<T>(target: &mut T, name: Option<&String>, read: impl FnOnce(&str) -> Result<T>) -> Result<()> {
    if let Some(name) = name {
        *target = read(name)?;
    }
    Ok(())
}

/// The value of `name` in a short list of names.
fn one_of<T: Copy>(field: &str, name: &str, names: &[(&str, T)]) -> Result<T> {
    names.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<_> = names.iter().map(|(known, _)| *known).collect();
        Error::invalid(field, name, format!("one of {}", known.join(", ")))
    })
}

impl Scene {
    /// The parameters that this scene stands for; files are relative to `base`. `note` is told what files hold in vain.
    pub fn into_params(self, base: &Path, note: &mut dyn FnMut(&str)) -> Result<Params> {
        let camera = self.camera.into_params()?;
        Ok(Params {
            animation: self.animation.into_params(camera.aim)?,
            camera,
            sun: self.sun.into_params()?,
            clouds: self.clouds.into_params(base, note)?,
            quality: self.quality.into_params()?,
            sky: self.sky.into_params(base)?,
            film: self.film.into_params()?,
        })
    }
}

impl CameraKeys {
    fn into_params(self) -> Result<Camera> {
        let mut camera = Camera::default();
        set(&mut camera.position, self.position);
        set(&mut camera.fov_y, self.fov_y);
        match (self.look_at, self.yaw.is_some() || self.pitch.is_some()) {
            (Some(target), false) => camera.aim = Aim::LookAt(target),
            (Some(target), true) => {
                return Err(Error::invalid("camera.look_at", format!("{target:?}"), "either look_at or yaw and pitch"));
            }
            (None, _) => {
                if let Aim::Angles { yaw, pitch } = &mut camera.aim {
                    set(yaw, self.yaw);
                    set(pitch, self.pitch);
                }
            }
        }
        Ok(camera)
    }
}

impl SunKeys {
    fn into_params(self) -> Result<Sun> {
        let mut sun = Sun::default();
        set(&mut sun.irradiance, self.irradiance);
        set(&mut sun.angular_radius, self.angular_radius);
        if let Some(time) = self.time {
            if self.elevation.is_some() || self.azimuth.is_some() {
                return Err(Error::invalid(
                    "sun.time",
                    time,
                    "either time, latitude and longitude or elevation and azimuth",
                ));
            }
            let (Some(latitude), Some(longitude)) = (self.latitude, self.longitude) else {
                return Err(Error::invalid("sun.time", time, "sun.latitude and sun.longitude beside it"));
            };
            sun.position = SunPosition::Time { unix_seconds: unix_seconds(time)?, latitude, longitude };
            return Ok(sun);
        }
        for (field, value) in [("sun.latitude", self.latitude), ("sun.longitude", self.longitude)] {
            if let Some(value) = value {
                return Err(Error::invalid(field, value, "sun.time beside it"));
            }
        }
        if let SunPosition::Angles { elevation, azimuth } = &mut sun.position {
            set(elevation, self.elevation);
            set(azimuth, self.azimuth);
        }
        Ok(sun)
    }
}

/// Seconds since 1970-01-01T00:00:00Z.
fn unix_seconds(time: Datetime) -> Result<f64> {
    let (Some(date), Some(clock), Some(offset)) = (time.date, time.time, time.offset) else {
        return Err(Error::invalid("sun.time", time, "a date and time with zone, such as 2026-06-21T16:00:00Z"));
    };
    let offset_minutes = match offset {
        Offset::Z => 0,
        Offset::Custom { minutes } => minutes,
    };
    let second = f64::from(clock.second.unwrap_or(0)) + f64::from(clock.nanosecond.unwrap_or(0)) * 1.0e-9;
    let seconds =
        f64::from(clock.hour) * 3600.0 + (f64::from(clock.minute) - f64::from(offset_minutes)) * 60.0 + second;
    Ok(solar::unix_seconds(i32::from(date.year), u32::from(date.month), u32::from(date.day), seconds))
}

impl CloudKeys {
    fn into_params(self, base: &Path, note: &mut dyn FnMut(&str)) -> Result<Clouds> {
        let mut clouds = Clouds::default();
        set_named(&mut clouds.lighting, self.lighting.as_ref(), |name| lookup(LIGHTINGS, "clouds.lighting", name))?;
        set_named(&mut clouds.style, self.style.as_ref(), |name| lookup(STYLES, "clouds.style", name))?;
        set_named(&mut clouds.phase, self.phase.as_ref(), |name| lookup(PHASES, "clouds.phase", name))?;
        set(&mut clouds.seed, self.seed);
        set(&mut clouds.altitude, self.altitude);
        set(&mut clouds.thickness, self.thickness);
        set(&mut clouds.sigma_t, self.sigma_t);
        set(&mut clouds.albedo, self.albedo);
        set(&mut clouds.g_single, self.g_single);
        set(&mut clouds.g_multiple, self.g_multiple);
        set(&mut clouds.orders, self.orders);
        set_named(&mut clouds.transfer, self.transfer.as_ref(), |name| lookup(TRANSFERS, "clouds.transfer", name))?;
        clouds.xi = self.xi.unwrap_or(clouds.transfer.xi());
        set(&mut clouds.smoothing, self.smoothing);
        set_named(&mut clouds.occlusion, self.occlusion.as_ref(), |name| lookup(OCCLUSIONS, "clouds.occlusion", name))?;
        set(&mut clouds.attenuation_resolution, self.attenuation_resolution);
        set(&mut clouds.particle_cutoff, self.particle_cutoff);
        clouds.forward = self.forward()?;
        clouds.coverage = self.coverage(base, note)?;
        clouds.source = self.source(base)?;
        Ok(clouds)
    }

    fn forward(&self) -> Result<Forward> {
        let mut forward = Forward::default();
        set_named(&mut forward.splat, self.splat.as_ref(), |name| lookup(SPLATS, "clouds.splat", name))?;
        set_named(&mut forward.phase, self.forward_phase.as_ref(), |name| {
            lookup(FORWARD_PHASES, "clouds.forward_phase", name)
        })?;
        set(&mut forward.solid_angle, self.forward_solid_angle);
        set(&mut forward.resolution, self.forward_resolution);
        if let Some(lights) = &self.light {
            let lights = lights.iter().enumerate().map(|(index, light)| light.read(index));
            forward.lights = lights.collect::<Result<_>>()?;
        }
        Ok(forward)
    }

    fn coverage(&self, base: &Path, note: &mut dyn FnMut(&str)) -> Result<Coverage> {
        let Some(file) = &self.coverage_map else {
            let given = [
                ("extent", self.coverage_map_extent.map(|v| v.to_string())),
                ("offset", self.coverage_map_offset.map(|v| format!("{v:?}"))),
                ("rotation", self.coverage_map_rotation.map(|v| v.to_string())),
            ];
            for (key, value) in given {
                if let Some(value) = value {
                    let key = format!("clouds.coverage_map_{key}");
                    return Err(Error::invalid(key, value, "clouds.coverage_map beside it"));
                }
            }
            return Ok(self.coverage.map_or(Clouds::default().coverage, Coverage::Uniform));
        };
        if let Some(coverage) = self.coverage {
            return Err(Error::invalid("clouds.coverage", coverage, "either coverage or coverage_map"));
        }
        // 200 km: the longer of the two wavelengths of the procedural coverage.
        let extent = self.coverage_map_extent.unwrap_or(2.0e5);
        let place =
            (extent, self.coverage_map_offset.unwrap_or_default(), self.coverage_map_rotation.unwrap_or_default());
        Ok(Coverage::Map(coverage::load(&base.join(file), place, note)?))
    }

    fn source(self, base: &Path) -> Result<Source> {
        let mut kind = SourceKind::Grid;
        set_named(&mut kind, self.source.as_ref(), |name| lookup(SOURCES, "clouds.source", name))?;
        let only = |key: &str, of: &str| Error::invalid(format!("clouds.{key}"), "…", format!("this key only {of}"));
        if kind != SourceKind::Particles && self.particle.is_some() {
            return Err(only("particle", "with clouds.source = \"particles\""));
        }
        if kind == SourceKind::Grid && self.file.is_some() {
            return Err(only("file", "with clouds.source = \"particles\" or \"voxels\""));
        }
        if kind != SourceKind::Voxels {
            let given = self.grid.as_ref().map(|_| "grid").or(self.density_scale.map(|_| "density_scale"));
            if let Some(key) = given {
                return Err(only(key, "with clouds.source = \"voxels\""));
            }
        }
        match (kind, self.file, self.particle) {
            (SourceKind::Grid, ..) => Ok(Source::Grid),
            (SourceKind::Particles, Some(file), None) => particles::load(&base.join(file)).map(Source::Particles),
            (SourceKind::Particles, None, Some(list)) if !list.is_empty() => {
                particles::inline(list).map(Source::Particles)
            }
            (SourceKind::Particles, Some(_), Some(_)) => {
                Err(Error::invalid("clouds.file", "…", "either file or [[clouds.particle]] tables"))
            }
            (SourceKind::Particles, None, _) => {
                Err(Error::invalid("clouds.source", "particles", "clouds.file or [[clouds.particle]] tables beside it"))
            }
            (SourceKind::Voxels, Some(file), _) => Ok(Source::Voxels {
                file: base.join(file),
                grid: self.grid.unwrap_or_else(|| "density".into()),
                density_scale: self.density_scale.unwrap_or(1.0),
            }),
            (SourceKind::Voxels, None, _) => Err(Error::invalid("clouds.source", "voxels", "clouds.file beside it")),
        }
    }
}

impl LightKeys {
    fn read(&self, index: usize) -> Result<Light> {
        let field = |key: &str| format!("clouds.light[{index}].{key}");
        let mut from = LightFrom::Own;
        set_named(&mut from, self.from.as_ref(), |name| lookup(LIGHT_FROMS, &field("from"), name))?;
        let mut light = match from {
            LightFrom::Sun => Light::SUN,
            LightFrom::Sky => Light::SKY,
            LightFrom::Own => Light { from, ..Light::SUN },
        };
        set(&mut light.colour, self.colour);
        match (self.direction, self.elevation.or(self.azimuth)) {
            (Some(direction), None) => light.direction = Some(direction),
            (Some(direction), Some(_)) => {
                let expected = "either direction or elevation and azimuth";
                return Err(Error::invalid(field("direction"), format!("{direction:?}"), expected));
            }
            (None, Some(_)) => {
                let (elevation, azimuth) = (self.elevation.unwrap_or(0.0), self.azimuth.unwrap_or(0.0));
                for (key, value, most) in [("elevation", elevation, 90.0), ("azimuth", azimuth, 360.0)] {
                    check::within(&field(key), value, -most..=most, "degrees")?;
                }
                let position = SunPosition::Angles { elevation, azimuth };
                light.direction = Some(Sun { position, ..Sun::default() }.to_sun());
            }
            (None, None) if from == LightFrom::Own => {
                return Err(Error::invalid(field("from"), "own", "direction or elevation and azimuth beside it"));
            }
            (None, None) => {}
        }
        Ok(light)
    }
}

impl QualityKeys {
    fn into_params(self) -> Result<Quality> {
        const PRESETS: [(&str, Preset); 3] = [("low", Preset::Low), ("medium", Preset::Medium), ("high", Preset::High)];
        const PRECISIONS: [(&str, Precision); 2] = [("f16", Precision::F16), ("f32", Precision::F32)];
        let mut preset = Preset::default();
        set_named(&mut preset, self.preset.as_ref(), |name| one_of("quality.preset", name, &PRESETS))?;
        let mut quality = preset.quality();
        set(&mut quality.cells, self.cells);
        set(&mut quality.rings, self.rings);
        set(&mut quality.layers, self.layers);
        set(&mut quality.downscale, self.downscale);
        set_named(&mut quality.precision, self.precision.as_ref(), |name| {
            one_of("quality.precision", name, &PRECISIONS)
        })?;
        set_named(&mut quality.blend, self.blend.as_ref(), str::parse)?;
        Ok(quality)
    }
}

impl SkyKeys {
    fn into_params(self, base: &Path) -> Result<Sky> {
        const MODELS: [(&str, SkyModel); 2] = [("none", SkyModel::None), ("atmosphere", SkyModel::Atmosphere)];
        let mut sky = Sky::default();
        set_named(&mut sky.model, self.model.as_ref(), |name| one_of("sky.model", name, &MODELS))?;
        match self.ground.as_deref() {
            None | Some("none") => {}
            Some(file) => sky.ground = Ground::Terrain(base.join(file)),
        }
        set(&mut sky.ground_albedo, self.ground_albedo);
        set(&mut sky.haze, self.haze);
        Ok(sky)
    }
}

impl FilmKeys {
    fn into_params(self) -> Result<Film> {
        const CURVES: [(&str, ToneCurve); 2] = [("filmic", ToneCurve::Filmic), ("linear", ToneCurve::Linear)];
        let mut film = Film::default();
        set(&mut film.exposure_ev, self.exposure_ev);
        set_named(&mut film.curve, self.curve.as_ref(), |name| one_of("film.curve", name, &CURVES))?;
        Ok(film)
    }
}

impl AnimationKeys {
    /// `aim` is that of the camera, for keys that have none.
    fn into_params(self, aim: Aim) -> Result<Animation> {
        let mut animation = Animation::default();
        set(&mut animation.frame_rate, self.frame_rate);
        set(&mut animation.velocity, self.velocity);
        set(&mut animation.yaw_rate, self.yaw_rate);
        set(&mut animation.pitch_rate, self.pitch_rate);
        set(&mut animation.evolution, self.evolution);
        set(&mut animation.sun_rate, self.sun_rate);
        set(&mut animation.sun_elevation_rate, self.sun_elevation_rate);
        set(&mut animation.sun_azimuth_rate, self.sun_azimuth_rate);
        animation.wind = match self.wind {
            None => Vec::new(),
            Some(WindKeys::One(wind)) => vec![wind],
            Some(WindKeys::Layers(layers)) => layers,
        };
        let keys = self.key.unwrap_or_default().into_iter().enumerate();
        animation.keys = keys.map(|(index, key)| key.into_params(index, aim)).collect::<Result<_>>()?;
        Ok(animation)
    }
}

impl PathKeys {
    fn into_params(self, index: usize, aim: Aim) -> Result<CameraKey> {
        let aim = match (self.look_at, self.yaw, self.pitch) {
            (Some(target), None, None) => Aim::LookAt(target),
            (Some(target), ..) => {
                let field = format!("animation.key[{index}].look_at");
                return Err(Error::invalid(field, format!("{target:?}"), "either look_at or yaw and pitch"));
            }
            (None, None, None) => aim,
            (None, yaw, pitch) => Aim::Angles { yaw: yaw.unwrap_or(0.0), pitch: pitch.unwrap_or(0.0) },
        };
        Ok(CameraKey { time: self.time, position: self.position, aim })
    }
}
