//! Particle tables, built once per medium and style: optical depth (Yusov 4.1) and scattering (4.2, 4.3).

pub mod axes;
mod background;
mod cache;
mod export;
mod optical_depth;
mod scattering;
pub(crate) mod tables;
pub mod transport;

pub use background::{Background, ProgressFn};
pub use export::{EnergyBalance, ExportAxis, ExportTable};
pub use optical_depth::{OpticalDepthTable, style_index};
pub use scattering::{LevelReport, ScatteringTable};
pub use tables::{Detail, Progress, TableData, TableParams, Tables, read_image};
