//! The clouds: where they come from, what they are made of, how they are lit.

use std::path::PathBuf;

use super::{Forward, check};
use crate::{Error, Result};

/// The cloud layer or list of cloud particles.
#[derive(Clone, Debug, PartialEq)]
pub struct Clouds {
    /// Where particles come from. Default [`Source::Grid`].
    pub source: Source,
    /// How particles are lit. Default [`Lighting::Tables`].
    pub lighting: Lighting,
    /// The density inside a particle. Default [`Style::Pyroclastic`], whose billows look most like cumulus (Yusov, Fig. 4).
    pub style: Style,
    /// Chooses the sky: the same seed gives the same clouds. Default 1.
    pub seed: u32,
    /// Altitude of the layer's base above sea level [m]. Default 3000 (the authors' scene).
    pub altitude: f32,
    /// Height of the layer, base to top [m]. Default 700 (the authors' scene).
    pub thickness: f32,
    /// How much of the sky is cloud. Default 0.6 everywhere.
    pub coverage: Coverage,
    /// Extinction of the medium at relative density 1 [1/m]. Default 0.07 (Yusov 5.1).
    pub sigma_t: f32,
    /// Single-scattering albedo. Default 1: water droplets absorb next to nothing of visible light.
    pub albedo: f32,
    /// The phase function. Default Cornette–Shanks (Yusov, Eq. 7).
    pub phase: Phase,
    /// Asymmetry of the phase function for light scattered once. Default 0.9 (Yusov 4).
    pub g_single: f32,
    /// Asymmetry of the phase function for light scattered more than once. Default 0.7 (Yusov 4).
    pub g_multiple: f32,
    /// Orders of scattering in the tables; 0 sums until converged. Default 0; Yusov stops at 18.
    pub orders: u32,
    /// How sunlight fares among particles. Default [`Transfer::Diffusion`].
    pub transfer: Transfer,
    /// How much sunlight a particle takes from those behind it, per unit of its optical depth, ξ. Default
    /// [`Transfer::xi`].
    pub xi: f32,
    /// How much light a particle of the grid shares with each of its neighbours, against 1 of its own, 0 to 10 (Yusov 5.3,
    /// step 3). Default 0: no gain against path tracing (`docs/accuracy.md`).
    pub smoothing: f32,
    /// Where sunlight that other particles let through is found for [`Lighting::Tables`]. Default [`OcclusionMode::Points`].
    pub occlusion: OcclusionMode,
    /// Voxels along an edge of the volume of [`Lighting::Attenuation`] and [`OcclusionMode::Volume`], 32 to 384 (Shimada 4).
    /// Default 128.
    pub attenuation_resolution: u32,
    /// No particle is made farther from the camera than this [m]. Default 1e5 (the authors' scene).
    pub particle_cutoff: f32,
    /// How [`Lighting::Forward`] lights them.
    pub forward: Forward,
}

/// What [`Clouds::attenuation_resolution`] may be (Shimada 4).
pub const ATTENUATION_RESOLUTIONS: std::ops::RangeInclusive<u32> = 32..=384;

/// Where particles come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Procedural, in nested rings of cells around the camera (Yusov 5.2).
    Grid,
    /// An explicit list.
    Particles(Vec<ParticleDesc>),
    /// A dense or sparse volume from a file.
    Voxels {
        /// The file.
        file: PathBuf,
        /// Name of the grid inside the file.
        grid: String,
        /// Relative density per unit of the grid's value.
        density_scale: f32,
    },
}

/// One ellipsoid of cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParticleDesc {
    /// Centre [m].
    pub centre: [f64; 3],
    /// Semi-axes [m].
    pub radii: [f32; 3],
    /// Unit quaternion x, y, z, w that turns the ellipsoid's axes into the world.
    pub rotation: [f32; 4],
    /// Density relative to [`Clouds::sigma_t`].
    pub density: f32,
    /// Radiance of the particle's own light as [`Lighting::Flat`] takes it: a thick particle shows exactly this.
    pub colour: [f32; 3],
    /// Motion of its own, besides the wind [m/s].
    pub velocity: [f64; 3],
    /// Which cloud the particle is part of; a list that says nothing is one cloud, 0.
    pub cloud: u32,
}

impl Default for ParticleDesc {
    fn default() -> Self {
        Self {
            centre: [0.0; 3],
            radii: [100.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
            density: 1.0,
            colour: [1.0; 3],
            velocity: [0.0; 3],
            cloud: 0,
        }
    }
}

/// How particles are lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lighting {
    /// Pre-computed optical depth, single and multiple scattering (Yusov 4).
    Tables,
    /// Each particle its own constant colour.
    Flat,
    /// Multiple forward scattering and eye scattering (Harris 2, Stoian 3–4).
    Forward,
    /// Order-free attenuation volume (Shimada 3).
    Attenuation,
    /// Ray marching with shadow rays (Bajkowski 3.2).
    March,
    /// Ray marching with cached sun transmittance (Bajkowski 3.3).
    MarchCached,
    /// Ray marching with several octaves of scattering (Bajkowski 3.4).
    MarchMulti,
    /// Path tracing.
    Path,
}

/// How the sunlight that reaches a particle depends on the optical depth τ of the particles in front of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// What comes straight from the sun fades as exp(-τ), what feeds a particle's own multiple scattering as exp(-ξ τ),
    /// and what all particles scatter diffuses through all of them (`docs/lighting.md`).
    Diffusion,
    /// All of it fades as exp(-ξ τ) (Yusov 5.3).
    Exponential,
}

impl Transfer {
    /// The ξ that goes with it: fitted to path-traced clouds (`docs/accuracy.md`), or that of the authors' scene.
    #[must_use]
    pub fn xi(self) -> f32 {
        match self {
            Self::Diffusion => 0.02,
            Self::Exponential => 0.05,
        }
    }
}

/// Where the sunlight that other particles let through to one is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OcclusionMode {
    /// At three points of each particle: both poles towards the sun, and the centre.
    Points,
    /// In every pixel, from the volume of [`Lighting::Attenuation`].
    Volume,
}

/// The density inside a particle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Radial fall-off plus noise.
    Radial,
    /// Noise above a threshold.
    Threshold,
    /// A ball whose surface is displaced by noise.
    Pyroclastic,
    /// Constant 1.
    Homogeneous,
    /// A Gaussian with its standard deviation at half the radius, lowered to 0 at the rim (Harris 2).
    Gaussian,
    /// 2 r³ − 3 r² + 1 (Stoian 6).
    Polynomial,
}

impl Style {
    /// Whether detail noise displaces the surface: not where there is none, nor where density is the same all around.
    #[must_use]
    pub fn displaced(self) -> bool {
        matches!(self, Self::Radial | Self::Threshold | Self::Pyroclastic)
    }
}

/// The phase function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Cornette–Shanks (Yusov, Eq. 7).
    CornetteShanks,
    /// Henyey–Greenstein.
    HenyeyGreenstein,
}

/// How much of the sky is cloud.
#[derive(Clone, Debug, PartialEq)]
pub enum Coverage {
    /// The same everywhere: 0 is a clear sky, 1 an overcast one.
    Uniform(f32),
    /// From a picture.
    Map(CoverageMap),
}

/// Coverage as a picture seen from above and repeated: unturned, columns grow to the east (+x) and rows to the south (+z), so
/// that it reads as a map.
#[derive(Clone, Debug, PartialEq)]
pub struct CoverageMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Coverage 0 to 1 of each texel, row by row, northernmost first.
    pub values: Vec<f32>,
    /// What the picture's width measures in the world [m]; the height follows from square texels.
    pub extent: f32,
    /// Where the picture's centre lies, east (+x) and south (+z) of the world's origin [m].
    pub offset: [f64; 2],
    /// Compass direction that the picture's top points to [degrees]: 90 turns it clockwise, its top to the east.
    pub rotation: f64,
}

impl Default for Clouds {
    fn default() -> Self {
        Self {
            source: Source::Grid,
            lighting: Lighting::Tables,
            style: Style::Pyroclastic,
            seed: 1,
            altitude: 3000.0,
            thickness: 700.0,
            coverage: Coverage::Uniform(0.6),
            sigma_t: 0.07,
            albedo: 1.0,
            phase: Phase::CornetteShanks,
            g_single: 0.9,
            g_multiple: 0.7,
            orders: 0,
            transfer: Transfer::Diffusion,
            xi: Transfer::Diffusion.xi(),
            smoothing: 0.0,
            occlusion: OcclusionMode::Points,
            attenuation_resolution: 128,
            particle_cutoff: 1.0e5,
            forward: Forward::default(),
        }
    }
}

impl Clouds {
    /// Checks every field; whether the choices go together is checked by [`super::Params::validate`].
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        match &self.source {
            Source::Grid => {}
            Source::Particles(particles) => {
                for (index, particle) in particles.iter().enumerate() {
                    particle.validate(|| format!("clouds.particle[{index}]"))?;
                }
            }
            Source::Voxels { density_scale, .. } => {
                check::positive("clouds.density_scale", *density_scale, 1.0e6, "")?;
            }
        }
        match &self.coverage {
            Coverage::Uniform(coverage) => check::within("clouds.coverage", *coverage, 0.0..=1.0, "")?,
            Coverage::Map(map) => map.validate()?,
        }
        check::within("clouds.altitude", self.altitude, 0.0..=5.0e4, "m")?;
        check::positive("clouds.thickness", self.thickness, 2.0e4, "m")?;
        check::positive("clouds.sigma_t", self.sigma_t, 10.0, "1/m")?;
        check::within("clouds.albedo", self.albedo, 0.0..=1.0, "")?;
        check::within("clouds.g_single", self.g_single, -0.99..=0.99, "")?;
        check::within("clouds.g_multiple", self.g_multiple, -0.99..=0.99, "")?;
        check::within("clouds.orders", self.orders, 0..=1000, "(0: until converged)")?;
        check::within("clouds.xi", self.xi, 0.0..=1.0, "")?;
        check::within("clouds.smoothing", self.smoothing, 0.0..=10.0, "")?;
        self.forward.validate()?;
        check::within("clouds.attenuation_resolution", self.attenuation_resolution, ATTENUATION_RESOLUTIONS, "")?;
        check::within("clouds.particle_cutoff", self.particle_cutoff, 1.0e3..=1.0e6, "m")
    }
}

impl ParticleDesc {
    /// Where the particle is after `seconds` in a wind of x, z [m/s].
    #[must_use]
    pub fn after(&self, seconds: f64, wind: [f64; 2]) -> [f64; 3] {
        let carried = [wind[0], 0.0, wind[1]];
        std::array::from_fn(|axis| self.centre[axis] + (self.velocity[axis] + carried[axis]) * seconds)
    }

    /// Checks every field. `name` is what an error calls the particle; it is only asked for when something is wrong, since
    /// lists are long.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self, name: impl Fn() -> String) -> Result<()> {
        let field = |field: &str| format!("{}.{field}", name());
        let near = |v: f64| v.abs() <= check::MAX_COORDINATE;
        if !self.centre.iter().all(|&v| near(v)) {
            let range = -check::MAX_COORDINATE..=check::MAX_COORDINATE;
            check::each_within(&field("centre"), self.centre, range, "m")?;
        }
        for (axis, &radius) in self.radii.iter().enumerate() {
            if !(radius > 0.0 && radius <= 1.0e6) {
                check::positive(&field(&format!("radii[{axis}]")), radius, 1.0e6, "m")?;
            }
        }
        let length = self.rotation.iter().map(|c| c * c).sum::<f32>().sqrt();
        // 1e-3: a quaternion written with four digits passes; the shaders normalise nothing.
        if !(0.999..=1.001).contains(&length) {
            return Err(Error::invalid(
                field("rotation"),
                format!("{:?}", self.rotation),
                "a unit quaternion x, y, z, w",
            ));
        }
        if !(0.0..=1.0e3).contains(&self.density) {
            check::within(&field("density"), self.density, 0.0..=1.0e3, "")?;
        }
        if !self.colour.iter().all(|c| (0.0..=1.0e6).contains(c)) {
            check::each_within(&field("colour"), self.colour, 0.0..=1.0e6, "")?;
        }
        if !self.velocity.iter().all(|v| v.abs() <= 1.0e4) {
            check::each_within(&field("velocity"), self.velocity, -1.0e4..=1.0e4, "m/s")?;
        }
        Ok(())
    }
}

impl CoverageMap {
    fn validate(&self) -> Result<()> {
        let size = format!("{}x{}", self.width, self.height);
        if self.width == 0 || self.height == 0 || self.width > 16_384 || self.height > 16_384 {
            return Err(Error::invalid("clouds.coverage_map", size, "a picture of 1x1 to 16384x16384 pixels"));
        }
        if self.values.len() as u64 != u64::from(self.width) * u64::from(self.height) {
            let expected = format!("{size} values");
            return Err(Error::invalid("clouds.coverage_map", format!("{} values", self.values.len()), expected));
        }
        if let Some(bad) = self.values.iter().find(|v| !(0.0..=1.0).contains(*v)) {
            return Err(Error::invalid("clouds.coverage_map", bad, "values from 0 to 1"));
        }
        check::within("clouds.coverage_map_extent", self.extent, 1.0e2..=1.0e7, "m")?;
        let coordinates = -check::MAX_COORDINATE..=check::MAX_COORDINATE;
        check::each_within("clouds.coverage_map_offset", self.offset, coordinates, "m")?;
        check::within("clouds.coverage_map_rotation", self.rotation, -360.0..=360.0, "degrees")
    }
}
