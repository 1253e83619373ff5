//! From scene files and flags to parameters.

use std::path::Path;

use welkin::params::{Blend, Params};
use welkin::scene::{self, Override};
use welkin::{Error, Result};

use super::args::{PictureArgs, QualityArg, SceneArgs};
use super::progress::note;

/// The parameters of the scene file at `path` under the flags.
pub fn load(path: &Path, args: &PictureArgs) -> Result<Params> {
    load_with_quality(path, args.quality, &args.scene)
}

/// The same with more values replaced, which `flag` gave.
pub fn load_replaced(path: &Path, args: &PictureArgs, flag: &str, values: &[String]) -> Result<Params> {
    let replaced = values.iter().map(|value| Override { flag: flag.into(), assignment: value.clone() });
    load_noting(path, &overrides(None, args.quality, &args.scene).chain(replaced).collect::<Vec<_>>())
}

/// The same for commands that make no picture.
pub fn load_with_quality(path: &Path, quality: Option<QualityArg>, args: &SceneArgs) -> Result<Params> {
    load_noting(path, &overrides(None, quality, args).collect::<Vec<_>>())
}

/// The same with targets of 32-bit floats unless `--set quality.precision` says otherwise: for comparisons.
pub fn load_precise(path: &Path, args: &PictureArgs) -> Result<Params> {
    let precision = Override { flag: "--set".into(), assignment: "quality.precision=f32".into() };
    load_noting(path, &overrides(Some(precision), args.quality, &args.scene).collect::<Vec<_>>())
}

fn load_noting(path: &Path, overrides: &[Override]) -> Result<Params> {
    scene::load_noting(path, overrides, &mut note)
}

fn overrides(
    first: Option<Override>,
    quality: Option<QualityArg>,
    args: &SceneArgs,
) -> impl Iterator<Item = Override> + '_ {
    // The preset comes before --set, which can still change a part of it.
    let preset =
        quality.map(|q| Override { flag: "--quality".into(), assignment: format!("quality.preset={}", q.name()) });
    first.into_iter().chain(preset).chain(sets(args))
}

/// `params` with the compositing mode that `flag` chose, if it chose one.
pub fn blended(mut params: Params, blend: Option<Blend>, flag: &str) -> Result<Params> {
    if let Some(blend) = blend {
        params.quality.blend = blend;
        params.validate().map_err(|error| flagged(error, flag))?;
    }
    Ok(params)
}

/// The parameters of an optional scene file where no picture is meant.
pub fn load_medium(path: Option<&Path>, args: &SceneArgs) -> Result<Params> {
    let overrides: Vec<_> = sets(args).collect();
    match path {
        Some(path) => load_noting(path, &overrides),
        None => scene::parse("", Path::new("the default scene"), &overrides),
    }
}

fn sets(args: &SceneArgs) -> impl Iterator<Item = Override> + '_ {
    args.set.iter().map(|assignment| Override { flag: "--set".into(), assignment: assignment.clone() })
}

/// `error` about the compositing mode, named as the flag that chose it.
fn flagged(error: Error, flag: &str) -> Error {
    match error {
        Error::InvalidParam { field, value, expected } if field == "quality.blend" => {
            Error::invalid(flag, value, expected)
        }
        Error::Unsupported { needed, by } => Error::Unsupported { needed: needed.replace("quality.blend =", flag), by },
        other => other,
    }
}
