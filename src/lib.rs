//! Volumetric cumulus skies in raw Vulkan.

pub mod error;
pub mod params;

pub use error::{Error, Result};
pub use params::Params;
