//! The clear sky, the ground under it and the air in front of everything.
//!
//! ```text
//! let mut atmosphere = Atmosphere::new(&gpu, model, &Air::of(&params.sky, &params.sun))?;
//! let background = Background::new(&gpu, model, extent, downscale, precision)?;
//! let mut shadow = CloudShadow::new(&gpu)?;
//! // every frame, `frame` being the FrameParams buffer:
//! shadow.record(rec, &tiling, camera)?;                           // after `tiling`; optional
//! atmosphere.record_luts(rec, &frame, &frame_params, &shadow, cloud_base)?; // fills atmosphere.sky_light()
//! background.record_opaque(rec, &atmosphere, &frame)?;            // before `blend`: fills background.low_opaque
//! background.record(rec, &atmosphere, &frame, &shadow, cloud_base)?; // fills background.radiance
//! let cloud = background.record_cloud_air(rec, &atmosphere, &frame, &targets, cloud_base)?; // after `blend`
//! ```
//!
//! Rayleigh and aerosol single scattering are integrated along rays, all higher orders come from Hillaire's closed form
//! ("A Scalable and Production Ready Sky and Atmosphere Rendering Technique", 2020). `glsl/atmosphere/sky.glsl` is what
//! other shaders ask; an atmosphere that is to replace this one keeps its functions and the methods here.
//! The oracle is [`crate::reference::atmosphere`].

mod air;
mod background;
mod shadow;
mod tables;

pub use air::{Air, AirParams, SkyLight};
pub use background::Background;
pub use shadow::{CloudShadow, SHADOW_EXTENT};
pub use tables::Atmosphere;
