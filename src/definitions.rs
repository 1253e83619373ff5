//! Constants and plain data that the renderer and its oracles share by definition. No mathematics: each side has its own.

/// Radius of the planet at sea level [m].
pub const PLANET_RADIUS: f64 = 6.36e6;

/// Seed of the noise inside the reference particle: there is one for all skies, and particles differ by rotation and detail.
pub const REFERENCE_SEED: u32 = 1;
