//! What can go wrong that a caller cannot foresee, plus bad data from files and people.
//!
//! Misuse of the API and broken invariants panic with a sentence instead; nothing in this list means "a bug in Welkin".

use std::path::PathBuf;

/// `Result` with [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything a Welkin call can fail with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A Vulkan call returned an error code.
    #[error("{call} failed in {pass}: {result}")]
    Vulkan {
        /// The Vulkan function, for example `vkCreateComputePipelines`.
        call: &'static str,
        /// The pass or object it was for.
        pass: String,
        /// The code the driver returned.
        result: ash::vk::Result,
    },
    /// The device was lost; the last pass whose start the device had recorded is named.
    #[error("the device was lost; the last pass reached was {last_pass}")]
    DeviceLost {
        /// Name of the last pass that the device had begun.
        last_pass: String,
    },
    /// Memory for `what` could not be had.
    #[error("out of memory: {}{what}", bytes.map(|bytes| format!("{bytes} bytes for ")).unwrap_or_default())]
    OutOfMemory {
        /// Name of the resource.
        what: String,
        /// Size asked for [bytes]; none where Vulkan is not told one (pipelines, descriptors, command buffers).
        bytes: Option<u64>,
    },
    /// The device, driver or build lacks something that was asked for.
    #[error("{needed} is not supported by {by}")]
    Unsupported {
        /// What was needed, with the reason if one is known.
        needed: String,
        /// The device or component that lacks it.
        by: String,
    },
    /// The system lacks a part of Vulkan.
    #[error("{missing}: {help}")]
    NoDriver {
        /// What it lacks, in a sentence.
        missing: String,
        /// What to do about it.
        help: String,
    },
    /// A parameter is outside what is accepted.
    #[error("{field} = {value}: expected {expected}")]
    InvalidParam {
        /// Name of the field as a user writes it, for example `clouds.coverage`.
        field: String,
        /// The value that was given.
        value: String,
        /// What would have been accepted.
        expected: String,
    },
    /// A file could not be read, written or understood.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why, in a sentence.
        reason: String,
    },
    /// A text file is wrong at a known place.
    #[error("{}:{line}:{column}: {reason}", path.display())]
    FileAt {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// What is wrong, naming the field, the value and what was expected.
        reason: String,
    },
    /// A list on the device stayed too small although it was grown.
    #[error("list {list} needs {needed} elements but can hold {capacity}")]
    Capacity {
        /// Name of the list.
        list: &'static str,
        /// How many elements the frame wanted to store.
        needed: u64,
        /// How many it can store.
        capacity: u64,
    },
}

impl Error {
    /// A bad value of a named field: says what was given and what would have been accepted.
    pub fn invalid(field: impl Into<String>, value: impl std::fmt::Display, expected: impl Into<String>) -> Self {
        Self::InvalidParam { field: field.into(), value: value.to_string(), expected: expected.into() }
    }

    /// A file that could not be read, written or understood.
    pub fn file(path: impl Into<PathBuf>, reason: impl std::fmt::Display) -> Self {
        Self::File { path: path.into(), reason: reason.to_string() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_invalid_parameter_names_field_value_and_expectation() {
        let text = Error::invalid("clouds.coverage", -1.0, "a number from 0 to 1").to_string();
        assert_eq!(text, "clouds.coverage = -1: expected a number from 0 to 1");
    }

    #[test]
    fn out_of_memory_tells_how_much_was_asked_for_where_that_is_known() {
        let error = |bytes| Error::OutOfMemory { what: "tile nodes (vkCreateBuffer)".into(), bytes }.to_string();
        assert_eq!(error(Some(4096)), "out of memory: 4096 bytes for tile nodes (vkCreateBuffer)");
        assert_eq!(error(None), "out of memory: tile nodes (vkCreateBuffer)");
    }
}
