//! The oracles: one plain, serial file per stage, without Vulkan. Tests compare every stage of the device with these.

pub mod atmosphere;
pub mod compact;
pub mod density;
pub mod grid;
pub mod lighting;
pub mod segments;
pub mod tiling;
