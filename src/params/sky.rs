//! The clear sky, the ground, and the way from radiance to display values.

use std::path::PathBuf;

use super::check;
use crate::{Error, Result};

/// The clear sky and the ground under it.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    /// Which sky. Default [`SkyModel::Atmosphere`].
    pub model: SkyModel,
    /// What stands on the planet. Default [`Ground::None`]: the bare sphere.
    pub ground: Ground,
    /// Share of the light that the bare ground reflects. Default 0.09, 0.11, 0.06: summer meadow and woods, tuned.
    pub ground_albedo: [f32; 3],
    /// Amount of haze (Mie scattering) relative to clear air. Default 1.
    pub haze: f32,
}

/// Which sky.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkyModel {
    /// Black; the sun shines on the clouds undimmed, and nothing else adds light. There is no ground.
    None,
    /// Rayleigh and Mie scattering.
    Atmosphere,
}

/// What stands on the planet.
#[derive(Clone, Debug, PartialEq)]
pub enum Ground {
    /// Nothing: the sphere at sea level.
    None,
    /// A height map.
    Terrain(PathBuf),
}

impl Default for Sky {
    fn default() -> Self {
        Self { model: SkyModel::Atmosphere, ground: Ground::None, ground_albedo: [0.09, 0.11, 0.06], haze: 1.0 }
    }
}

impl Sky {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        if let Ground::Terrain(file) = &self.ground {
            let needed = format!("sky.ground = {:?}", file.display().to_string());
            return Err(Error::Unsupported { needed, by: "this version yet (it has \"none\")".into() });
        }
        check::each_within("sky.ground_albedo", self.ground_albedo, 0.0..=1.0, "")?;
        check::within("sky.haze", self.haze, 0.0..=100.0, "")
    }
}

/// From scene radiance to display values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Exposure in stops relative to the renderer's own for a sunlit cloud: +1 doubles the brightness. Default 0.
    pub exposure_ev: f32,
    /// The tone curve. Default [`ToneCurve::Filmic`].
    pub curve: ToneCurve,
}

/// The tone curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToneCurve {
    /// A toe and a shoulder: highlights roll off.
    Filmic,
    /// None: values above 1 clip.
    Linear,
}

impl Default for Film {
    fn default() -> Self {
        Self { exposure_ev: 0.0, curve: ToneCurve::Filmic }
    }
}

impl Film {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        check::within("film.exposure_ev", self.exposure_ev, -30.0..=30.0, "stops")
    }
}
