//! The clear air in f64: the oracle for `glsl/atmosphere`, with the same tables, mappings and step counts.
//!
//! The geometry is written the obvious way, with radii and square roots: at f64 it needs none of the care the shaders
//! take. [`AirTables`] holds the tables and answers what a pixel asks; [`Air`]'s methods are the physics below them.

mod mapping;
mod tables;
#[cfg(test)]
mod tests;

pub use mapping::*;
pub use tables::*;

use crate::atmosphere::Air;
use glam::DVec3;
use std::f64::consts::PI;

/// Densities at one altitude, as coefficients \[1/m\].
#[derive(Clone, Copy, Debug)]
pub struct AirSample {
    /// Rayleigh scattering.
    pub rayleigh: DVec3,
    /// Aerosol scattering.
    pub mie: DVec3,
    /// Extinction by everything.
    pub extinction: DVec3,
}

/// Rayleigh phase function \[1/sr\] of the cosine between view ray and sun direction.
pub fn rayleigh_phase(nu: f64) -> f64 {
    3.0 / (16.0 * PI) * (1.0 + nu * nu)
}

/// Cornette–Shanks phase function \[1/sr\].
pub fn mie_phase(nu: f64, g: f64) -> f64 {
    let k = 3.0 / (8.0 * PI) * (1.0 - g * g) / (2.0 + g * g);
    k * (1.0 + nu * nu) / (1.0 + g * g - 2.0 * g * nu).powf(1.5)
}

/// ∫₀^d j e^(−σx) dx.
pub fn step_radiance(j: DVec3, sigma_t: DVec3, d: f64) -> DVec3 {
    let one = |j: f64, sigma: f64| if sigma * d < 1e-9 { j * d } else { j * -(-sigma * d).exp_m1() / sigma };
    DVec3::new(one(j.x, sigma_t.x), one(j.y, sigma_t.y), one(j.z, sigma_t.z))
}

/// e to the power of minus each component.
pub fn exp_minus(tau: DVec3) -> DVec3 {
    DVec3::new((-tau.x).exp(), (-tau.y).exp(), (-tau.z).exp())
}

fn smoothstep(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl Air {
    fn r(&self, h: f64) -> f64 {
        self.bottom_radius + h
    }

    /// Distance to the horizon of the sea-level sphere \[m\].
    pub fn horizon_distance(&self, h: f64) -> f64 {
        (self.r(h).powi(2) - self.bottom_radius.powi(2)).max(0.0).sqrt()
    }

    /// Cosine of the direction that grazes the sea-level sphere.
    pub fn horizon_mu(&self, h: f64) -> f64 {
        -self.horizon_distance(h) / self.r(h)
    }

    /// Does the ray meet the ground?
    pub fn hits_ground(&self, h: f64, mu: f64) -> bool {
        mu < self.horizon_mu(h)
    }

    /// Distance along a ray to the top of the atmosphere \[m\].
    pub fn distance_to_top(&self, h: f64, mu: f64) -> f64 {
        let (b, top) = (self.r(h) * mu, self.r(self.top_height));
        (-b + (b * b + top * top - self.r(h).powi(2)).max(0.0).sqrt()).max(0.0)
    }

    /// Distance along a ray that meets the ground \[m\].
    pub fn distance_to_ground(&self, h: f64, mu: f64) -> f64 {
        let b = -self.r(h) * mu;
        (b - (b * b - self.horizon_distance(h).powi(2)).max(0.0).sqrt()).max(0.0)
    }

    /// Altitude a distance along a ray \[m\].
    pub fn altitude_along(&self, h: f64, mu: f64, d: f64) -> f64 {
        let r = self.r(h);
        (r * r + d * (2.0 * r * mu + d)).max(0.0).sqrt() - self.bottom_radius
    }

    /// Cosine of a direction to the local vertical, a distance along a ray; `nu` is the cosine between the two.
    pub fn mu_along(&self, h: f64, mu_other: f64, nu: f64, h_d: f64, d: f64) -> f64 {
        ((self.r(h) * mu_other + d * nu) / self.r(h_d)).clamp(-1.0, 1.0)
    }

    /// Coefficients at an altitude; below sea level as at sea level.
    pub fn at(&self, h: f64) -> AirSample {
        let h = h.max(0.0);
        let rayleigh_density = (-h / self.rayleigh_scale_height).exp();
        let mie_density = (-h / self.mie_scale_height).exp();
        let ozone_density = (1.0 - (h - self.ozone_centre).abs() / self.ozone_half_width).max(0.0);
        let rayleigh = DVec3::from_array(self.rayleigh_scattering) * rayleigh_density;
        AirSample {
            rayleigh,
            mie: DVec3::from_array(self.mie_scattering) * mie_density,
            extinction: rayleigh
                + DVec3::from_array(self.mie_extinction) * mie_density
                + DVec3::from_array(self.ozone_absorption) * ozone_density,
        }
    }

    /// Part of the sun's disc above the geometric horizon \[1\].
    pub fn sun_visible_fraction(&self, h: f64, mu_s: f64) -> f64 {
        let edge = self.sun_angular_radius * self.bottom_radius / self.r(h);
        smoothstep(-edge, edge, mu_s - self.horizon_mu(h))
    }

    /// Optical depth of a ray that nowhere descends \[1\], in `steps` steps of quadratically growing length.
    pub fn optical_depth_upwards(&self, h: f64, mu: f64, length: f64, steps: usize) -> DVec3 {
        quadratic_steps(length, steps)
            .map(|(begin, end)| self.at(self.altitude_along(h, mu, 0.5 * (begin + end))).extinction * (end - begin))
            .sum()
    }

    /// Transmittance to the top of the atmosphere along a ray that misses the ground.
    pub fn transmittance(&self, h: f64, mu: f64, steps: usize) -> DVec3 {
        let d_top = self.distance_to_top(h, mu);
        if mu >= 0.0 {
            return exp_minus(self.optical_depth_upwards(h, mu, d_top, steps));
        }
        let d_low = -self.r(h) * mu;
        let h_low = self.altitude_along(h, mu, d_low).max(0.0);
        exp_minus(
            self.optical_depth_upwards(h_low, 0.0, d_low, steps)
                + self.optical_depth_upwards(h_low, 0.0, d_top - d_low, steps),
        )
    }

    /// Airlight's radiance from its two parts (see [`Airlight`]).
    pub fn airlight_radiance(&self, smooth_part: DVec3, aerosol: DVec3, nu: f64) -> DVec3 {
        DVec3::from_array(self.solar_irradiance) * (smooth_part + aerosol * mie_phase(nu, self.mie_g))
    }

    /// Radiance of the sun's disc outside the atmosphere at `angle` \[rad\] from its centre: limb-darkened after Neckel
    /// 1996 (L ∝ μ^α), scaled so that the disc's irradiance is [`Air::solar_irradiance`].
    pub fn sun_disc_radiance(&self, angle: f64) -> DVec3 {
        let x = angle / self.sun_angular_radius;
        if x >= 1.0 {
            return DVec3::ZERO;
        }
        let solid_angle = PI * self.sun_angular_radius.powi(2);
        let mu = (1.0 - x * x).sqrt();
        let limb = LIMB_DARKENING.map(|a| 0.5 * (a + 2.0) * mu.powf(a));
        DVec3::from_array(self.solar_irradiance) * DVec3::from_array(limb) / solid_angle
    }
}

/// Exponent α of the limb darkening μ^α for red, green, blue (Neckel 1996, as tabulated by Hillaire 2020).
pub const LIMB_DARKENING: [f64; 3] = [0.397, 0.503, 0.652];

/// The step ends (begin, end) of an integral whose steps grow quadratically.
pub fn quadratic_steps(length: f64, steps: usize) -> impl Iterator<Item = (f64, f64)> {
    let end_of = move |i: usize| length * (i as f64 / steps as f64).powi(2);
    (1..=steps).map(move |i| (end_of(i - 1), end_of(i)))
}
