//! What the clouds are made of and the light around them, as the shading reads it (`glsl/blend/shade.glsl`).

use crate::params::{Clouds, Phase};
use crate::shared::assert_layout;
use bytemuck::{Pod, Zeroable};

/// Parameters of the shading model (Yusov 4.4).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MediumParams {
    /// Mean radiance of the sky's upper half [W m⁻² sr⁻¹].
    pub sky: [f32; 3],
    /// Asymmetry of the scattering event that meets the sun.
    pub g_single: f32,
    /// Mean radiance of the lower half: light that comes up from the ground [W m⁻² sr⁻¹].
    pub ground: [f32; 3],
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
}
assert_layout!(MediumParams, medium_params, {
    sky: SKY, g_single: G_SINGLE, ground: GROUND, phase_function: PHASE_FUNCTION, albedo: ALBEDO, crease: CREASE,
    detail: DETAIL, relief: RELIEF,
});

impl MediumParams {
    /// The medium of a scene under no sky light; [`sky`](Self::sky) and [`ground`](Self::ground) are zero.
    #[must_use]
    pub fn new(clouds: &Clouds) -> Self {
        Self {
            sky: [0.0; 3],
            g_single: clouds.g_single,
            ground: [0.0; 3],
            phase_function: u32::from(clouds.phase == Phase::HenyeyGreenstein),
            albedo: clouds.albedo,
            crease: 0.5,
            detail: 1.0,
            relief: 1.0,
        }
    }
}
