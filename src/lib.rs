//! Volumetric cumulus skies in raw Vulkan.

pub mod error;
#[cfg(feature = "files")]
pub mod output;
pub mod params;
#[cfg(feature = "files")]
pub mod scene;

pub use error::{Error, Result};
pub use params::Params;
