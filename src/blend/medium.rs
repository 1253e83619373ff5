//! What the clouds are made of, as the shading reads it (`glsl/medium/params.glsl`).

use crate::params::{Clouds, Phase};
use crate::shared::assert_layout;
use crate::shared::constants::medium_phase_glsl as constants;
use bytemuck::{Pod, Zeroable};

/// Parameters of the shading model (Yusov 4.4).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MediumParams {
    /// Asymmetry of the scattering event that meets the sun.
    pub g_single: f32,
    /// `PHASE_*` of `glsl/medium/phase.glsl`.
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
            phase_function: phase_function(clouds.phase),
            albedo: clouds.albedo,
            crease: 0.5,
            detail: if clouds.style.displaced() { 1.0 } else { 0.0 },
            relief: 0.7,
            reserved_a: 0.0,
            reserved_b: 0.0,
        }
    }
}

/// Number of a phase function in `glsl/medium/phase.glsl`.
pub(crate) fn phase_function(phase: Phase) -> u32 {
    match phase {
        Phase::CornetteShanks => constants::PHASE_CORNETTE_SHANKS,
        Phase::HenyeyGreenstein => constants::PHASE_HENYEY_GREENSTEIN,
    }
}
