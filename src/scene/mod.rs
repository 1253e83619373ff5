//! Scene files: TOML in, [`Params`] out.
//!
//! Every key has a default, so an empty file renders a good sky. An unknown key, a wrong type or a value out of range is an
//! error that names the key, the value and what is accepted, and points at file, line and column; where the value came
//! from the command line, the error names the flag instead. Paths inside a scene are relative to the scene file.

mod coverage;
pub(crate) mod particles;
mod schema;
mod source;

use std::path::Path;

use crate::params::Params;
use crate::{Error, Result};

/// A value that replaces one of the scene file, written `key=value` with a dotted key: `clouds.coverage=0.3`.
///
/// The value is TOML; what is not TOML is taken as a string, so that `clouds.style=radial` needs no quotes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Override {
    /// What the user wrote it with, for messages: `--set`.
    pub flag: String,
    /// `key=value`.
    pub assignment: String,
}

/// Reads the scene file at `path` with `overrides` applied in order, and validates it.
///
/// # Errors
/// [`Error::File`] when a file cannot be read, [`Error::FileAt`] for a fault at a known place of a file,
/// [`Error::InvalidParam`] for one in an override, [`Error::Unsupported`] for a choice that this version lacks.
pub fn load(path: &Path, overrides: &[Override]) -> Result<Params> {
    load_noting(path, overrides, &mut |_| ())
}

/// As [`load`]; `note` is told, a sentence at a time, what the scene's files hold in vain.
///
/// # Errors
/// As [`load`].
pub fn load_noting(path: &Path, overrides: &[Override], note: &mut dyn FnMut(&str)) -> Result<Params> {
    let bytes = std::fs::read(path).map_err(|error| Error::file(path, format!("cannot be read: {error}")))?;
    let text = String::from_utf8(bytes).map_err(|_| Error::file(path, "is not UTF-8 text"))?;
    parse_noting(&text, path, overrides, note)
}

/// As [`load`], with the text of the scene file at `path` given.
///
/// # Errors
/// As [`load`].
pub fn parse(text: &str, path: &Path, overrides: &[Override]) -> Result<Params> {
    parse_noting(text, path, overrides, &mut |_| ())
}

fn parse_noting(text: &str, path: &Path, overrides: &[Override], note: &mut dyn FnMut(&str)) -> Result<Params> {
    let overrides = source::override_texts(text.len(), overrides)?;
    let source = source::Source::new(text, path, &overrides)?;
    let scene: schema::Scene = source.read()?;
    let base = path.parent().unwrap_or(Path::new(""));
    let params = scene.into_params(base, note).map_err(|error| source.locate(error))?;
    params.validate().map_err(|error| source.locate(error))?;
    Ok(params)
}

#[cfg(test)]
mod tests;
