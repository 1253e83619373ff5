//! Structs that host and shaders both see. Offsets are reflected from the shaders and compared at compile time.

use bytemuck::{Pod, Zeroable};

/// Byte offsets as the shaders have them.
pub(crate) mod layout {
    include!(concat!(env!("OUT_DIR"), "/layout.rs"));
}

/// The numbers that shaders have names for, a module for each file: `glsl/medium/phase.glsl` is `medium_phase_glsl`.
pub(crate) mod constants {
    include!(concat!(env!("OUT_DIR"), "/constants.rs"));
}

/// Checks a `#[repr(C)]` struct against its shader twin: `assert_layout!(Particle, particle, { centre: CENTRE, … })`.
macro_rules! assert_layout {
    ($rust:ty, $glsl:ident, { $($field:ident: $offset:ident),* $(,)? }) => {
        const _: () = {
            assert!(size_of::<$rust>() == $crate::shared::layout::$glsl::SIZE);
            $(assert!(std::mem::offset_of!($rust, $field) == $crate::shared::layout::$glsl::$offset);)*
        };
    };
}
pub(crate) use assert_layout;

/// What every source produces and every later stage reads (`glsl/common/particle.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Particle {
    /// Centre, relative to the floating origin [m].
    pub centre: [f32; 3],
    /// Relative density ρ; extinction is `sigma_t · density · fade · profile`.
    pub density: f32,
    /// Unit quaternion (x, y, z, w), local to world.
    pub rotation: [f32; 4],
    /// Semi-axes [m].
    pub semi_axes: [f32; 3],
    /// Cross-fade between levels of detail, 0 to 1.
    pub fade: f32,
    /// Constant radiance C of `flat` lighting.
    pub colour: [f32; 3],
    /// Stable identity, also the seed of everything random about it.
    pub id: u32,
}
assert_layout!(Particle, particle, {
    centre: CENTRE, density: DENSITY, rotation: ROTATION, semi_axes: SEMI_AXES, fade: FADE, colour: COLOUR, id: ID,
});

/// Light that reaches a particle (`glsl/common/particle.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ParticleLight {
    /// Share of the sunlight that feeds what the particle itself scatters many times, at the pole facing the sun, the
    /// centre and the far pole, 0 to 1.
    pub diffuse: [f32; 3],
    /// How much of its half-sphere above is sky and not neighbouring cloud, 0 to 1.
    pub ambient: f32,
    /// Share of the sunlight that comes straight from the sun, at the same points, 0 to 1.
    pub direct: [f32; 3],
    /// How much the particle sees of what its neighbours scatter: 0 alone, 1 in the depth of a crowd.
    pub crowd: f32,
    /// What it sees of it as the eye looks through it, per irradiance of the sun: gradient [1/(m sr)], value at the floating
    /// origin [1/sr]. Of visible particles alone.
    pub others: [f32; 4],
}
assert_layout!(ParticleLight, particle_light, {
    diffuse: DIFFUSE, ambient: AMBIENT, direct: DIRECT, crowd: CROWD, others: OTHERS,
});

impl ParticleLight {
    /// Nothing between the particle and the sun, nor the sky.
    pub const OPEN: Self = Self { diffuse: [1.0; 3], ambient: 1.0, direct: [1.0; 3], crowd: 0.0, others: [0.0; 4] };
}

/// The view, the sun and the medium of one frame (`glsl/common/frame.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FrameParams {
    /// Camera position, relative to the floating origin [m].
    pub camera: [f32; 3],
    /// Tangent of half the vertical field of view.
    pub tan_half_fov_y: f32,
    /// Unit vector to the right of the view.
    pub right: [f32; 3],
    /// Width / height.
    pub aspect: f32,
    /// Unit vector up in the view.
    pub up: [f32; 3],
    /// Full width [pixels].
    pub width: u32,
    /// Unit vector into the view.
    pub forward: [f32; 3],
    /// Full height [pixels].
    pub height: u32,
    /// Unit direction towards the sun.
    pub to_sun: [f32; 3],
    /// Extinction at relative density 1 [1/m].
    pub sigma_t: f32,
    /// Width of the cloud targets [pixels].
    pub low_width: u32,
    /// Height of the cloud targets [pixels].
    pub low_height: u32,
    /// Seed of the scene.
    pub seed: u32,
    /// Time of the frame [s].
    pub time: f32,
    /// The floating origin in the scene's coordinates [m]: anchors the ground to the world.
    pub origin: [f32; 3],
    /// Mean of the density profile over a chord through the middle of a particle.
    pub fill: f32,
    /// What anchors the detail noise [m]: the origin, less the way that the clouds have come.
    pub detail_origin: [f32; 3],
    /// Unused.
    pub reserved: u32,
}
assert_layout!(FrameParams, frame_params, {
    camera: CAMERA, tan_half_fov_y: TAN_HALF_FOV_Y, right: RIGHT, aspect: ASPECT, up: UP, width: WIDTH,
    forward: FORWARD, height: HEIGHT, to_sun: TO_SUN, sigma_t: SIGMA_T, low_width: LOW_WIDTH,
    low_height: LOW_HEIGHT, seed: SEED, time: TIME, origin: ORIGIN, fill: FILL,
    detail_origin: DETAIL_ORIGIN, reserved: RESERVED_C,
});
