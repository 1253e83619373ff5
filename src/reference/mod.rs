//! The oracles: one plain file per stage, without Vulkan. Tests compare every stage of the device with these.

pub mod atmosphere;
pub mod attenuation;
pub mod compact;
pub mod comparison;
pub mod density;
pub mod detail;
pub mod extinction;
pub mod film;
pub mod forward;
pub mod grid;
pub mod lighting;
pub mod monte_carlo;
pub mod optical_depth;
pub mod path;
pub mod phase;
pub mod quadrature;
pub mod scattering;
pub mod scene;
pub mod segments;
pub mod sphere;
pub mod tiling;
pub mod transport;
pub mod volume;
