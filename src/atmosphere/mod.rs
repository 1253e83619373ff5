//! The clear sky, the ground under it and the air in front of everything.

mod air;

pub use air::{Air, AirParams, SkyLight};
