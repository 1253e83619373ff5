//! The text of a scene and of the overrides as one table of values that remember where they were written.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::Override;
use crate::{Error, Result};

/// The TOML of an override. Leading blanks shift the spans of its values behind those of the scene file, so that a span
/// tells which text it belongs to.
pub struct OverrideText {
    shown: String,
    value: String,
    padded: String,
    span: Range<usize>,
}

/// A merged scene.
pub struct Source<'a> {
    path: PathBuf,
    text: &'a str,
    overrides: &'a [OverrideText],
    table: Spanned<DeTable<'a>>,
}

/// The texts of `overrides` to a scene file of `text_length` bytes.
pub fn override_texts(text_length: usize, overrides: &[Override]) -> Result<Vec<OverrideText>> {
    let mut start = text_length + 1;
    let mut texts = Vec::with_capacity(overrides.len());
    for entry in overrides {
        let bad = || Error::invalid(&entry.flag, &entry.assignment, "key=value with a dotted key of the scene file");
        let (key, value) = entry.assignment.split_once('=').ok_or_else(bad)?;
        let (key, value) = (key.trim(), value.trim());
        if key.is_empty() || value.is_empty() || entry.assignment.contains(['\n', '\r']) {
            return Err(bad());
        }
        let pad = " ".repeat(start);
        let as_toml = format!("{pad}{key}={value}");
        let padded = if DeTable::parse(&as_toml).is_ok() {
            as_toml
        } else {
            format!("{pad}{key}={}", toml::Value::String(value.to_owned()))
        };
        DeTable::parse(&padded).map_err(|_| bad())?;
        let span = start..padded.len() + 1;
        start = span.end;
        texts.push(OverrideText { shown: format!("{} {key}", entry.flag), value: value.to_owned(), padded, span });
    }
    Ok(texts)
}

impl<'a> Source<'a> {
    /// Parses `text`, the contents of `path`, and lays the overrides over it in order.
    pub fn new(text: &'a str, path: &Path, overrides: &'a [OverrideText]) -> Result<Self> {
        let mut table = DeTable::parse(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            error_at(path, text, at, format!("not TOML: {}", error.message().trim()))
        })?;
        for entry in overrides {
            // It has been parsed once; it parses again.
            if let Ok(parsed) = DeTable::parse(&entry.padded) {
                merge(table.get_mut(), parsed.into_inner());
            }
        }
        Ok(Self { path: path.to_owned(), text, overrides, table })
    }

    /// Deserialises the merged table.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T> {
        T::deserialize(toml::Deserializer::from(self.table.clone())).map_err(|error| {
            let span = error.span().unwrap_or_default();
            let field = path_at(self.table.get_ref(), span.start).unwrap_or_else(|| "the scene".into());
            let message = error.message().trim();
            let (what, expected) = message.split_once(", expected ").unwrap_or(("", message));
            if what.starts_with("unknown field") {
                return self.fault(&span, &field, None, &format!("a known key ({})", expected.replace('`', "")));
            }
            if let Some(missing) = message.strip_prefix("missing field ") {
                return self.fault(&span, &field, None, &format!("the key {}", missing.replace('`', "")));
            }
            self.fault(&span, &field, self.text.get(span.clone()), in_words(expected))
        })
    }

    /// Adds the place to an error that names a field of the scene.
    pub fn locate(&self, error: Error) -> Error {
        let Error::InvalidParam { field, value, expected } = &error else { return error };
        match span_of(self.table.get_ref(), field) {
            Some(span) => self.fault(&span, field, Some(value), expected),
            None => Error::file(&self.path, &error),
        }
    }

    /// The error for a fault at `span`.
    fn fault(&self, span: &Range<usize>, field: &str, value: Option<&str>, expected: &str) -> Error {
        if let Some(entry) = self.overrides.iter().find(|entry| entry.span.contains(&span.start)) {
            return Error::invalid(&entry.shown, &entry.value, expected);
        }
        let value = value.map(|value| format!(" = {value}")).unwrap_or_default();
        error_at(&self.path, self.text, span.start, format!("{field}{value}: expected {expected}"))
    }
}

/// The error for byte `at` of `text`, the contents of `path`.
fn error_at(path: &Path, text: &str, at: usize, reason: String) -> Error {
    let before = text.get(..at).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Error::FileAt {
        path: path.to_owned(),
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
        reason,
    }
}

/// Lays `over` over `table`: tables are merged, anything else is replaced.
fn merge<'a>(table: &mut DeTable<'a>, over: DeTable<'a>) {
    for (key, value) in over {
        match (table.get_mut(&key).map(Spanned::get_mut), value.get_ref()) {
            (Some(DeValue::Table(inner)), DeValue::Table(_)) => {
                if let DeValue::Table(over) = value.into_inner() {
                    merge(inner, over);
                }
            }
            _ => {
                // The key's span must follow its value's.
                table.remove(&key);
                table.insert(key, value);
            }
        }
    }
}

/// Dotted path of the innermost key or value whose span holds byte `at`.
fn path_at(table: &DeTable<'_>, at: usize) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let inner = match value.get_ref() {
            DeValue::Table(inner) => path_at(inner, at).map(|path| format!("{}.{path}", key.get_ref())),
            DeValue::Array(items) => items.iter().enumerate().find_map(|(index, item)| {
                let name = format!("{}[{index}]", key.get_ref());
                match item.get_ref() {
                    DeValue::Table(inner) => path_at(inner, at).map(|path| format!("{name}.{path}")),
                    _ => None,
                }
                .or_else(|| item.span().contains(&at).then_some(name))
            }),
            _ => None,
        };
        inner.or_else(|| {
            let here = key.span().contains(&at) || value.span().contains(&at);
            here.then(|| key.get_ref().to_string())
        })
    })
}

/// Span of the value that the path `field` (`clouds.particle[1].radii[2]`) names, or of the innermost part of it that has
/// been written.
fn span_of(table: &DeTable<'_>, field: &str) -> Option<Range<usize>> {
    let mut parts = field.split(['.', '[']).map(|part| part.trim_end_matches(']'));
    let first = table.get(parts.next()?)?;
    let (mut value, mut span) = (first.get_ref(), None);
    for part in parts {
        let next = match value {
            DeValue::Table(inner) => inner.get(part),
            DeValue::Array(items) => part.parse().ok().and_then(|index: usize| items.get(index)),
            _ => None,
        };
        let Some(next) = next else { break };
        (value, span) = (next.get_ref(), Some(next.span()));
    }
    span
}

/// Rust's names of types as a writer of scene files knows them.
fn in_words(expected: &str) -> &str {
    match expected {
        "f32" | "f64" => "a number",
        "u32" => "a whole number from 0 to 4294967295",
        "a sequence" => "a list [ … ]",
        "an array of length 2" => "a list of 2 numbers",
        "an array of length 3" => "a list of 3 numbers",
        "an array of length 4" => "a list of 4 numbers",
        "a TOML datetime" => "a date and time with zone, such as 2026-06-21T16:00:00Z",
        other => other,
    }
}
