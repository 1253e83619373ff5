//! Particle tables, built once per medium and style: optical depth (Yusov 4.1) and scattering (4.2, 4.3).

pub mod axes;
mod optical_depth;
mod scattering;
pub mod transport;

pub use optical_depth::{OpticalDepthTable, style_index};
pub use scattering::{LevelReport, ScatteringTable};
