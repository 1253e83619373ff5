//! Lighting `forward`: its lights, and how much light goes on straight (Harris 2.2, Stoian 3).

use super::check;
use crate::{Error, Result};

/// Lights that a scene can have at most: a particle holds the light of four in one vector.
pub const LIGHT_CAPACITY: usize = 4;

/// How [`Lighting::Forward`](super::Lighting::Forward) lights particles.
#[derive(Clone, Debug, PartialEq)]
pub struct Forward {
    /// Up to [`LIGHT_CAPACITY`]. Default: the sun, and the sky's light from the zenith.
    pub lights: Vec<Light>,
    /// Cone γ around the way of light that counts as forward [sr], above 0 to 4π. Default 0.09, that of Harris's released
    /// code.
    pub solid_angle: f32,
    /// Texels along each edge of a level of the light buffer, up to 4096; 0 has light looked up where it is asked for.
    /// Default 0; the paper has 32 for each cloud.
    pub resolution: u32,
    /// How opacity falls off from the middle of a particle. Default [`Splat::Gaussian`].
    pub splat: Splat,
    /// Default [`ForwardPhase::Rayleigh`].
    pub phase: ForwardPhase,
}

/// One distant light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// What `colour` scales.
    pub from: LightFrom,
    /// Unit direction towards it; none: towards the sun.
    pub direction: Option<[f64; 3]>,
    /// At least 0: a share of `from`, or irradiance [W m⁻² nm⁻¹].
    pub colour: [f32; 3],
}

/// Whose irradiance a light has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightFrom {
    /// The sun's at the clouds.
    Sun,
    /// The sky's on a level plane at the clouds.
    Sky,
    /// Its own.
    Own,
}

/// How the opacity of a splat falls off with the distance from its middle, f = 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Splat {
    /// A Gaussian with its standard deviation at f = ½, lowered to 0 at f = 1 (Harris 2; the width is not in the paper).
    Gaussian,
    /// 2 f³ − 3 f² + 1 (Stoian 6, with v₁ = 1).
    Polynomial,
}

/// The phase function of lighting `forward`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForwardPhase {
    /// Rayleigh's, as both papers take it.
    Rayleigh,
    /// The scene's: [`Clouds::phase`](super::Clouds::phase) with `g_single`.
    Scene,
}

impl Default for Forward {
    fn default() -> Self {
        Self {
            lights: vec![Light::SUN, Light::SKY],
            solid_angle: 0.09,
            resolution: 0,
            splat: Splat::Gaussian,
            phase: ForwardPhase::Rayleigh,
        }
    }
}

impl Light {
    /// The sun.
    pub const SUN: Self = Self { from: LightFrom::Sun, direction: None, colour: [1.0; 3] };
    /// All of the sky's light, from the zenith.
    pub const SKY: Self = Self { from: LightFrom::Sky, direction: Some([0.0, 1.0, 0.0]), colour: [1.0; 3] };

    fn validate(&self, index: usize) -> Result<()> {
        let field = |key: &str| format!("clouds.light[{index}].{key}");
        if let Some(direction) = self.direction {
            let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
            // 1e-3: a vector written with four digits passes.
            if !(0.999..=1.001).contains(&length) {
                return Err(Error::invalid(
                    field("direction"),
                    format!("{direction:?}"),
                    "a unit vector towards the light",
                ));
            }
        }
        check::each_within(&field("colour"), self.colour, 0.0..=1.0e6, "")
    }
}

impl Forward {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        let count = self.lights.len();
        if count == 0 || count > LIGHT_CAPACITY {
            let expected = format!("1 to {LIGHT_CAPACITY} lights");
            return Err(Error::invalid("clouds.light", format!("{count} lights"), expected));
        }
        for (index, light) in self.lights.iter().enumerate() {
            light.validate(index)?;
        }
        check::positive("clouds.forward_solid_angle", self.solid_angle, 12.566_371, "sr")?;
        check::within("clouds.forward_resolution", self.resolution, 0..=4096, "texels")
    }
}
