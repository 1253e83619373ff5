//! The choices that have names, and which of them this version has: one table per axis.
//!
//! Scene files, `welkin devices`, `docs/scene.md` and the errors for what is not here or does not go together are made from
//! these tables.

use super::{Blend, ForwardPhase, LightFrom, Lighting, OcclusionMode, Params, Phase, Source, Splat, Style, Transfer};
use crate::{Error, Result};

/// One name of an axis.
#[derive(Clone, Copy, Debug)]
pub struct AxisValue<T: 'static> {
    /// As a scene file or the command line writes it.
    pub name: &'static str,
    /// What it stands for.
    pub value: T,
    /// Whether this version has it.
    pub here: bool,
    /// What it means, in a few words.
    pub about: &'static str,
}

/// A lighting method.
#[derive(Clone, Copy, Debug)]
pub struct LightingMethod {
    /// Its name and meaning. The name is also that of its folder in `glsl/lighting`.
    pub axis: AxisValue<Lighting>,
    /// Whose clouds it can light.
    pub sources: &'static [SourceKind],
    /// Whether it reads the scattering table.
    pub reads_tables: bool,
}

/// A row of a table of names.
pub trait Row {
    /// What its names stand for.
    type Value: Copy + 'static;
    /// The name and what it stands for.
    fn axis(&self) -> &AxisValue<Self::Value>;
}

impl<T: Copy + 'static> Row for AxisValue<T> {
    type Value = T;

    fn axis(&self) -> &Self {
        self
    }
}

impl Row for LightingMethod {
    type Value = Lighting;

    fn axis(&self) -> &AxisValue<Lighting> {
        &self.axis
    }
}

const fn here<T>(name: &'static str, value: T, about: &'static str) -> AxisValue<T> {
    AxisValue { name, value, here: true, about }
}

const fn later<T>(name: &'static str, value: T, about: &'static str) -> AxisValue<T> {
    AxisValue { name, value, here: false, about }
}

/// The kinds of cloud source, without their data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceKind {
    /// [`Source::Grid`].
    Grid,
    /// [`Source::Particles`].
    Particles,
    /// [`Source::Voxels`].
    Voxels,
}

impl Source {
    /// Which kind of source this is.
    #[must_use]
    pub fn kind(&self) -> SourceKind {
        match self {
            Self::Grid => SourceKind::Grid,
            Self::Particles(_) => SourceKind::Particles,
            Self::Voxels { .. } => SourceKind::Voxels,
        }
    }
}

/// `clouds.source`.
pub const SOURCES: &[AxisValue<SourceKind>] = &[
    here("grid", SourceKind::Grid, "procedural, around the camera"),
    here("particles", SourceKind::Particles, "an explicit list"),
    later("voxels", SourceKind::Voxels, "a volume from a file"),
];

const PARTICLES: &[SourceKind] = &[SourceKind::Grid, SourceKind::Particles];

/// `clouds.lighting`.
pub const LIGHTINGS: &[LightingMethod] = &[
    LightingMethod {
        axis: here("tables", Lighting::Tables, "pre-computed scattering, and light that diffuses among particles"),
        sources: PARTICLES,
        reads_tables: true,
    },
    LightingMethod {
        axis: here("flat", Lighting::Flat, "each particle its own colour"),
        sources: &[SourceKind::Particles],
        reads_tables: false,
    },
    LightingMethod {
        axis: here(
            "forward",
            Lighting::Forward,
            "multiple forward scattering along each light, and single scattering to the eye",
        ),
        sources: PARTICLES,
        reads_tables: false,
    },
    LightingMethod {
        axis: here("attenuation", Lighting::Attenuation, "shadows in a volume, summed in any order"),
        sources: PARTICLES,
        reads_tables: false,
    },
    LightingMethod {
        axis: later("march", Lighting::March, "ray marching with shadow rays"),
        sources: &[],
        reads_tables: false,
    },
    LightingMethod {
        axis: later("march-cached", Lighting::MarchCached, "ray marching with cached transmittance"),
        sources: &[],
        reads_tables: false,
    },
    LightingMethod {
        axis: later("march-multi", Lighting::MarchMulti, "ray marching with several orders of scattering"),
        sources: &[],
        reads_tables: false,
    },
    LightingMethod { axis: later("path", Lighting::Path, "path tracing"), sources: &[], reads_tables: false },
];

/// `quality.blend` and `--blend`.
pub const BLENDS: &[AxisValue<Blend>] = &[
    here("auto", Blend::Auto, "the best of interlock, attachment and alpha that the device has"),
    here("exact", Blend::Exact, "the cheapest of tiled and list that the device has"),
    here("interlock", Blend::Interlock(1), "volume-aware, ordered by fragment shader interlock"),
    here("attachment", Blend::Attachment(1), "volume-aware, ordered by rasterization-order attachment access"),
    here("alpha", Blend::Alpha, "sorted, overlap ignored"),
    here("list", Blend::List, "exact, from lists of all segments"),
    here("tiled", Blend::Tiled, "exact, from particles binned to screen tiles"),
    later("impostor", Blend::Impostor, "dynamic impostors"),
];

/// `clouds.style`.
pub const STYLES: &[AxisValue<Style>] = &[
    here("pyroclastic", Style::Pyroclastic, "a ball whose surface noise displaces"),
    here("radial", Style::Radial, "radial fall-off and noise"),
    here("threshold", Style::Threshold, "noise above a threshold"),
    here("homogeneous", Style::Homogeneous, "constant 1"),
    here("gaussian", Style::Gaussian, "a smooth puff, a Gaussian (Harris)"),
    here("polynomial", Style::Polynomial, "a smooth puff, 2 r³ − 3 r² + 1 (Stoian)"),
];

/// `clouds.transfer`.
pub const TRANSFERS: &[AxisValue<Transfer>] = &[
    here("diffusion", Transfer::Diffusion, "light diffuses through all particles"),
    here("exponential", Transfer::Exponential, "light fades as exp(-ξ τ)"),
];

/// `clouds.occlusion`.
pub const OCCLUSIONS: &[AxisValue<OcclusionMode>] = &[
    here("points", OcclusionMode::Points, "at three points of each particle"),
    here("volume", OcclusionMode::Volume, "in every pixel, from a volume"),
];

/// `clouds.phase`.
pub const PHASES: &[AxisValue<Phase>] = &[
    here("cornette-shanks", Phase::CornetteShanks, "Cornette and Shanks"),
    here("henyey-greenstein", Phase::HenyeyGreenstein, "Henyey and Greenstein"),
];

/// `clouds.splat`.
pub const SPLATS: &[AxisValue<Splat>] = &[
    here("gaussian", Splat::Gaussian, "a Gaussian (Harris)"),
    here("polynomial", Splat::Polynomial, "2 f³ − 3 f² + 1 (Stoian)"),
];

/// `clouds.forward_phase`.
pub const FORWARD_PHASES: &[AxisValue<ForwardPhase>] = &[
    here("rayleigh", ForwardPhase::Rayleigh, "Rayleigh's"),
    here("scene", ForwardPhase::Scene, "the scene's, with g_single"),
];

/// `from` of `[[clouds.light]]`.
pub const LIGHT_FROMS: &[AxisValue<LightFrom>] = &[
    here("own", LightFrom::Own, "colour is its irradiance"),
    here("sun", LightFrom::Sun, "the sun's irradiance"),
    here("sky", LightFrom::Sky, "the sky's irradiance"),
];

impl Lighting {
    /// The row of this method in [`LIGHTINGS`].
    #[must_use]
    pub fn row(self) -> &'static LightingMethod {
        match LIGHTINGS.iter().find(|row| row.axis.value == self) {
            Some(row) => row,
            None => panic!("{self:?} has no row in the table of lighting methods"),
        }
    }

    /// As a scene file writes it; also the method's folder in `glsl/lighting`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().axis.name
    }
}

/// The value that `name` stands for; `field` is what an error calls it.
///
/// # Errors
/// [`Error::InvalidParam`] with the list of names.
pub fn lookup<R: Row>(table: &[R], field: &str, name: &str) -> Result<R::Value> {
    table.iter().map(Row::axis).find(|row| row.name == name).map(|row| row.value).ok_or_else(|| {
        let names: Vec<_> = table.iter().map(|row| row.axis().name).collect();
        Error::invalid(field, name, format!("one of {}", names.join(", ")))
    })
}

/// The name of the value that `is` picks; every value of an axis has a row.
pub(super) fn name_of<R: Row>(table: &[R], is: impl Fn(&R::Value) -> bool) -> &'static str {
    table.iter().map(Row::axis).find(|row| is(&row.value)).map_or("unnamed", |row| row.name)
}

/// An error when the row that `is` picks is not in this version.
fn require_here<R: Row>(table: &[R], field: &str, is: impl Fn(&R::Value) -> bool) -> Result<()> {
    match table.iter().map(Row::axis).find(|row| is(&row.value)) {
        Some(row) if !row.here => {
            let names: Vec<_> = table.iter().map(Row::axis).filter(|row| row.here).map(|row| row.name).collect();
            Err(not_yet(format!("{field} = {:?}", row.name), &names.join(", ")))
        }
        _ => Ok(()),
    }
}

fn not_yet(needed: String, has: &str) -> Error {
    Error::Unsupported { needed, by: format!("this version yet (it has {has})") }
}

/// The lighting methods of this version that clouds from `source` can have.
#[must_use]
pub fn lightings_of(source: SourceKind) -> Vec<&'static LightingMethod> {
    LIGHTINGS.iter().filter(|row| row.axis.here && row.sources.contains(&source)).collect()
}

/// Checks that this version has what `params` choose.
pub(super) fn validate(params: &Params) -> Result<()> {
    let (source, lighting, blend) = (params.clouds.source.kind(), params.clouds.lighting, params.quality.blend);
    require_here(SOURCES, "clouds.source", |value| *value == source)?;
    require_here(LIGHTINGS, "clouds.lighting", |value| *value == lighting)?;
    require_here(BLENDS, "quality.blend", |value| value.same_kind(&blend))?;
    if !lighting.row().sources.contains(&source) {
        let (name, source_name) = (lighting.name(), name_of(SOURCES, |value| *value == source));
        let has: Vec<_> = lightings_of(source).iter().map(|row| row.axis.name).collect();
        let needed = format!("clouds.lighting = {name:?} with clouds.source = {source_name:?}");
        return Err(Error::Unsupported { needed, by: format!("any device (this source can have {})", has.join(", ")) });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lighting_method_that_is_here_has_shaders_and_a_source() {
        for row in LIGHTINGS.iter().filter(|row| row.axis.here) {
            assert!(!row.sources.is_empty(), "{}", row.axis.name);
            assert_eq!(crate::shaders::blend_alpha_frag::program(row.axis.name).lighting, row.axis.name);
        }
    }
}
