//! Fields of cumulus made of explicit particles, from a seed.
//!
//! ```
//! let field = welkin::scatter::Field { clouds: 4, particles: 1000, ..Default::default() };
//! let particles = field.particles().unwrap();
//! assert_eq!(particles.len(), 1000);
//! ```

use std::f64::consts::{PI, TAU};

use crate::Result;
use crate::params::{ParticleDesc, check};

/// What a field is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Clouds. Default 100.
    pub clouds: u32,
    /// Particles of all clouds together; each cloud has at least one, and else as many as its share of the volume. Default
    /// 50 000.
    pub particles: u32,
    /// Another seed is another field. Default 1.
    pub seed: u32,
    /// Edge of the square that the middles of cloud bases lie in, around the origin [m]. Default 10 000.
    pub extent: f64,
    /// Altitude of the bases [m]. Default 1500.
    pub base: f64,
    /// Median radius of a cloud at its base [m]. Default 400.
    pub radius: f64,
    /// Density of the particles, relative to the scene's extinction. Default 0.3.
    pub density: f64,
}

impl Default for Field {
    fn default() -> Self {
        Self { clouds: 100, particles: 50_000, seed: 1, extent: 10_000.0, base: 1500.0, radius: 400.0, density: 0.3 }
    }
}

/// Particles of a cloud over what would fill its body without overlap, by volume: a point in it lies in so many of them.
const OVERLAP: f64 = 3.0;

impl Field {
    /// Checks every field.
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) naming the field as the command line writes it.
    pub fn validate(&self) -> Result<()> {
        check::within("--clouds", self.clouds, 1..=1_000_000, "")?;
        check::within("--particles", self.particles, self.clouds..=100_000_000, "(at least one a cloud)")?;
        check::positive("--extent", self.extent, 1.0e6, "m")?;
        check::within("--base", self.base, 0.0..=2.0e4, "m")?;
        check::positive("--radius", self.radius, 1.0e4, "m")?;
        check::within("--density", self.density, 0.0..=1.0e3, "")
    }

    /// The particles, cloud by cloud, whose [`ParticleDesc::cloud`] counts from 0.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn particles(&self) -> Result<Vec<ParticleDesc>> {
        self.validate()?;
        let mut random = Random(u64::from(self.seed));
        let clouds: Vec<Cloud> = (0..self.clouds).map(|_| Cloud::new(self, &mut random)).collect();
        let volume: f64 = clouds.iter().map(Cloud::volume).sum();
        let spare = f64::from(self.particles - self.clouds);
        let mut particles = Vec::with_capacity(self.particles as usize);
        let mut share = 0.0;
        for (index, cloud) in clouds.iter().enumerate() {
            share += cloud.volume() / volume;
            let end = index + 1 + (spare * share).round() as usize;
            let count = end.min(self.particles as usize) - particles.len();
            particles.extend((0..count).map(|_| cloud.particle(self, index as u32, count, &mut random)));
        }
        Ok(particles)
    }
}

/// A ball of a cloud's body; what is below the base is no part of it.
struct Lobe {
    centre: [f64; 3],
    radius: f64,
}

/// Cauliflowers on a flat base.
struct Cloud {
    lobes: Vec<Lobe>,
}

impl Cloud {
    fn new(field: &Field, random: &mut Random) -> Self {
        // Sizes of cumulus are spread over a decade: log-normal.
        let radius = field.radius * (0.45 * random.normal()).clamp(-1.2, 1.2).exp();
        let [x, z] = [0, 1].map(|_| (random.unit() - 0.5) * field.extent);
        let count = 4 + (random.unit() * 5.0) as usize;
        let lobes = (0..count).map(|i| {
            // The first ones spread over the base, later ones stand on them.
            let storey = i as f64 / count as f64;
            let (sin, cos) = (TAU * random.unit()).sin_cos();
            let away = radius * 0.7 * random.unit().sqrt() * (1.0 - 0.7 * storey);
            let size = radius * (0.62 - 0.28 * storey) * (0.8 + 0.4 * random.unit());
            let height = radius * (0.1 + 1.0 * storey) * (0.7 + 0.6 * random.unit());
            Lobe { centre: [x + away * cos, field.base + height, z + away * sin], radius: size }
        });
        Self { lobes: lobes.collect() }
    }

    /// Of all lobes, overlaps and what is below the base counted too [m³].
    fn volume(&self) -> f64 {
        self.lobes.iter().map(|lobe| 4.0 / 3.0 * PI * lobe.radius.powi(3)).sum()
    }

    /// One of `count` particles of the cloud numbered `cloud`.
    fn particle(&self, field: &Field, cloud: u32, count: usize, random: &mut Random) -> ParticleDesc {
        let mut pick = random.unit() * self.volume();
        let mut chosen = &self.lobes[0];
        for lobe in &self.lobes {
            chosen = lobe;
            pick -= 4.0 / 3.0 * PI * lobe.radius.powi(3);
            if pick < 0.0 {
                break;
            }
        }
        let mean = (OVERLAP * self.volume() / (4.0 / 3.0 * PI * count as f64)).cbrt().min(0.6 * chosen.radius);
        // Even in the ball, and mirrored where it is below the base, so that bases are flat and dense.
        let (up, (sin, cos)) = (2.0 * random.unit() - 1.0, (TAU * random.unit()).sin_cos());
        let away = chosen.radius * random.unit().cbrt();
        let across = away * (1.0 - up * up).sqrt();
        let size = mean * (0.7 + 0.6 * random.unit());
        let above = (chosen.centre[1] + away * up - field.base).abs().max(0.5 * size);
        let radii = [1.0, 0.75, 0.9].map(|ratio| (size * ratio * (0.9 + 0.2 * random.unit())) as f32);
        let (turn_sin, turn_cos) = (PI * random.unit()).sin_cos();
        ParticleDesc {
            // Millimetres: files stay short.
            centre: [chosen.centre[0] + across * cos, field.base + above, chosen.centre[2] + across * sin]
                .map(|c| (c * 1e3).round() / 1e3),
            radii: radii.map(|r| ((r * 1e3).round() / 1e3).max(1e-3)),
            rotation: [0.0, turn_sin as f32, 0.0, turn_cos as f32],
            density: ((field.density * (0.7 + 0.6 * random.unit())) as f32 * 1e4).round() / 1e4,
            cloud,
            ..ParticleDesc::default()
        }
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014): the same field on every machine.
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Of mean 0 and variance 1 (Box and Muller).
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (TAU * self.unit()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_has_as_many_particles_and_clouds_as_asked_for_all_of_them_valid_and_above_the_base() {
        for (clouds, particles) in [(1, 1), (7, 7), (20, 1000), (300, 9382)] {
            let field = Field { clouds, particles, ..Field::default() };
            let list = field.particles().unwrap();
            assert_eq!(list.len(), particles as usize);
            let mut next = 0;
            for p in &list {
                p.validate(|| "a particle".into()).unwrap();
                assert!(p.cloud == next || p.cloud + 1 == next, "clouds come one after the other");
                next = p.cloud + 1;
                assert!(p.centre[1] > field.base);
                assert!(p.centre[0].abs().max(p.centre[2].abs()) < 0.5 * field.extent + 4.0 * field.radius);
            }
            assert_eq!(next, clouds);
        }
    }

    #[test]
    fn a_seed_is_a_field() {
        let of = |seed| Field { seed, clouds: 5, particles: 100, ..Field::default() }.particles().unwrap();
        assert_eq!(of(3), of(3));
        assert!(of(3) != of(4));
    }

    #[test]
    fn what_cannot_be_is_named_as_the_command_line_writes_it() {
        let blamed = |field: Field| field.particles().unwrap_err().to_string();
        assert!(blamed(Field { clouds: 0, ..Field::default() }).starts_with("--clouds = 0: expected a number from 1"));
        let few = Field { clouds: 10, particles: 9, ..Field::default() };
        assert!(blamed(few).starts_with("--particles = 9: expected a number from 10 to"));
        assert!(blamed(Field { extent: f64::NAN, ..Field::default() }).starts_with("--extent = NaN"));
    }
}
