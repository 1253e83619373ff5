//! Volumetric cumulus skies in raw Vulkan.

pub mod error;

pub use error::{Error, Result};
