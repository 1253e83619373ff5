//! What the clouds are made of, as the shading reads it (`glsl/medium/params.glsl`).

use crate::params::{Clouds, Phase};
use crate::shared::assert_layout;
use bytemuck::{Pod, Zeroable};

/// Parameters of the shading model (Yusov 4.4).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MediumParams {
    /// Asymmetry of the scattering event that meets the sun.
    pub g_single: f32,
    /// 0: Cornette-Shanks, 1: Henyey-Greenstein.
    pub phase_function: u32,
    /// Single-scattering albedo.
    pub albedo: f32,
    /// Strength of the crease term (Yusov 4.4).
    pub crease: f32,
    /// Strength of the detail noise; 0 turns it off.
    pub detail: f32,
    /// How much the slope of the noise turns the surface that light meets.
    pub relief: f32,
    /// Zero.
    pub reserved_a: f32,
    /// Zero.
    pub reserved_b: f32,
}
assert_layout!(MediumParams, medium_params, {
    g_single: G_SINGLE, phase_function: PHASE_FUNCTION, albedo: ALBEDO, crease: CREASE,
    detail: DETAIL, relief: RELIEF,
    reserved_a: RESERVED_A, reserved_b: RESERVED_B,
});

impl MediumParams {
    /// The medium of a scene.
    #[must_use]
    pub fn new(clouds: &Clouds) -> Self {
        Self {
            g_single: clouds.g_single,
            phase_function: u32::from(clouds.phase == Phase::HenyeyGreenstein),
            albedo: clouds.albedo,
            crease: 0.5,
            detail: 1.0,
            relief: 0.7,
            reserved_a: 0.0,
            reserved_b: 0.0,
        }
    }
}
