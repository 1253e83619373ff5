//! The choices that have names, and which of them this version has: one table per axis.
//!
//! A later version turns a row's `here` to true, and adds its combination to [`COMBINATIONS`]; nothing else changes.

use super::{Blend, Lighting, Params, Phase, Source, Style, Transfer};
use crate::{Error, Result};

/// One name of an axis.
#[derive(Clone, Copy, Debug)]
pub struct AxisValue<T: 'static> {
    /// As a scene file or the command line writes it.
    pub name: &'static str,
    /// What it means.
    pub value: T,
    /// Whether this version has it.
    pub here: bool,
}

const fn here<T>(name: &'static str, value: T) -> AxisValue<T> {
    AxisValue { name, value, here: true }
}

const fn later<T>(name: &'static str, value: T) -> AxisValue<T> {
    AxisValue { name, value, here: false }
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
pub const SOURCES: &[AxisValue<SourceKind>] =
    &[here("grid", SourceKind::Grid), here("particles", SourceKind::Particles), later("voxels", SourceKind::Voxels)];

/// `clouds.lighting`.
pub const LIGHTINGS: &[AxisValue<Lighting>] = &[
    here("tables", Lighting::Tables),
    here("flat", Lighting::Flat),
    later("forward", Lighting::Forward),
    later("attenuation", Lighting::Attenuation),
    later("march", Lighting::March),
    later("march-cached", Lighting::MarchCached),
    later("march-multi", Lighting::MarchMulti),
    later("path", Lighting::Path),
];

/// `quality.blend` and `--blend`.
pub const BLENDS: &[AxisValue<Blend>] = &[
    here("auto", Blend::Auto),
    here("interlock", Blend::Interlock(1)),
    here("attachment", Blend::Attachment(1)),
    here("alpha", Blend::Alpha),
    here("list", Blend::List),
    here("tiled", Blend::Tiled),
    later("impostor", Blend::Impostor),
];

/// `clouds.style`.
pub const STYLES: &[AxisValue<Style>] = &[
    here("pyroclastic", Style::Pyroclastic),
    here("radial", Style::Radial),
    here("threshold", Style::Threshold),
    here("homogeneous", Style::Homogeneous),
];

/// `clouds.transfer`.
pub const TRANSFERS: &[AxisValue<Transfer>] =
    &[here("diffusion", Transfer::Diffusion), here("exponential", Transfer::Exponential)];

/// `clouds.phase`.
pub const PHASES: &[AxisValue<Phase>] =
    &[here("cornette-shanks", Phase::CornetteShanks), here("henyey-greenstein", Phase::HenyeyGreenstein)];

/// Which lightings each source can have, among those that are here.
const COMBINATIONS: &[(SourceKind, Lighting)] = &[
    (SourceKind::Grid, Lighting::Tables),
    (SourceKind::Particles, Lighting::Tables),
    (SourceKind::Particles, Lighting::Flat),
];

/// The value that `name` stands for; `field` is what an error calls it.
///
/// # Errors
/// [`Error::InvalidParam`] with the list of names.
pub fn lookup<T: Copy>(table: &[AxisValue<T>], field: &str, name: &str) -> Result<T> {
    table.iter().find(|row| row.name == name).map(|row| row.value).ok_or_else(|| {
        let names: Vec<_> = table.iter().map(|row| row.name).collect();
        Error::invalid(field, name, format!("one of {}", names.join(", ")))
    })
}

/// The name of the value that `is` picks; every value of an axis has a row.
pub(super) fn name_of<T>(table: &[AxisValue<T>], is: impl Fn(&T) -> bool) -> &'static str {
    table.iter().find(|row| is(&row.value)).map_or("unnamed", |row| row.name)
}

/// An error when the row that `is` picks is not in this version.
fn require_here<T>(table: &[AxisValue<T>], field: &str, is: impl Fn(&T) -> bool) -> Result<()> {
    match table.iter().find(|row| is(&row.value)) {
        Some(row) if !row.here => {
            let names: Vec<_> = table.iter().filter(|row| row.here).map(|row| row.name).collect();
            Err(not_yet(format!("{field} = {:?}", row.name), &names.join(", ")))
        }
        _ => Ok(()),
    }
}

fn not_yet(needed: String, has: &str) -> Error {
    Error::Unsupported { needed, by: format!("this version yet (it has {has})") }
}

/// Checks that this version has what `params` choose.
pub(super) fn validate(params: &Params) -> Result<()> {
    let (source, lighting, blend) = (params.clouds.source.kind(), params.clouds.lighting, params.quality.blend);
    require_here(SOURCES, "clouds.source", |value| *value == source)?;
    require_here(LIGHTINGS, "clouds.lighting", |value| *value == lighting)?;
    require_here(BLENDS, "quality.blend", |value| value.same_kind(&blend))?;
    if !COMBINATIONS.contains(&(source, lighting)) {
        let source_name = name_of(SOURCES, |value| *value == source);
        let lighting_name = name_of(LIGHTINGS, |value| *value == lighting);
        let has: Vec<_> = COMBINATIONS
            .iter()
            .filter(|(s, _)| *s == source)
            .map(|(_, l)| name_of(LIGHTINGS, |value| value == l))
            .collect();
        let needed = format!("clouds.lighting = {lighting_name:?} with clouds.source = {source_name:?}");
        return Err(not_yet(needed, &has.join(", ")));
    }
    Ok(())
}
