//! Volumetric cumulus skies in raw Vulkan.

#![deny(clippy::unwrap_used, clippy::expect_used)] // Tests and examples may.

pub mod atmosphere;
pub mod blend;
pub mod compact;
pub mod density;
pub mod detail;
pub mod error;
pub mod film;
pub mod frame;
pub mod gpu;
pub mod grid;
pub mod lighting;
pub mod lut;
#[cfg(feature = "files")]
pub mod output;
pub mod params;
pub mod reference;
pub mod renderer;
#[cfg(feature = "files")]
pub mod scene;
pub mod shared;
pub mod tiling;

/// Every shader program, as compiled and reflected by the build.
pub mod shaders {
    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}

pub use error::{Error, Result};
pub use params::Params;
