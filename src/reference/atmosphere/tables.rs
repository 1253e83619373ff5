//! The tables of the clear air and what is read from them; the twin of `glsl/atmosphere/luts.glsl` and `sky.glsl`.

use super::*;
use crate::atmosphere::Air;
use glam::DVec3;
use std::f64::consts::PI;

/// Steps of a transmittance integral (`TRANSMITTANCE_STEPS`).
pub const TRANSMITTANCE_STEPS: usize = 48;
/// Directions over which multiple scattering is averaged.
pub const MULTIPLE_DIRECTIONS: usize = 64;
/// Steps along each of them.
pub const MULTIPLE_STEPS: usize = 24;
/// Steps of a sky-view ray.
pub const SKY_VIEW_STEPS: usize = 40;
/// Steps between two distances of the aerial perspective.
pub const AERIAL_STEPS: usize = 2;
/// Directions over which the sky's irradiance is summed.
pub const IRRADIANCE_DIRECTIONS: usize = 256;
/// Steps along each of them.
pub const IRRADIANCE_STEPS: usize = 24;

/// A table of RGB values, x fastest, read as a linear sampler with clamped edges reads it.
#[derive(Clone, Debug)]
pub struct Table {
    /// Extent along x, y, z; 1 for a dimension that is not there.
    pub size: [usize; 3],
    /// The values.
    pub texels: Vec<DVec3>,
}

impl Table {
    /// Fills a table texel by texel.
    pub fn fill(size: [usize; 3], f: impl Fn(usize, usize, usize) -> DVec3) -> Self {
        let mut texels = Vec::with_capacity(size[0] * size[1] * size[2]);
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    texels.push(f(x, y, z));
                }
            }
        }
        Self { size, texels }
    }

    /// The value of one texel.
    pub fn at(&self, x: usize, y: usize, z: usize) -> DVec3 {
        self.texels[(z * self.size[1] + y) * self.size[0] + x]
    }

    /// Linear interpolation at texel coordinates (0 = the centre of texel 0).
    pub fn sample(&self, texel: [f64; 3]) -> DVec3 {
        let mut low = [0; 3];
        let mut f = [0.0; 3];
        for i in 0..3 {
            let t = texel[i].clamp(0.0, (self.size[i] - 1) as f64);
            low[i] = (t as usize).min(self.size[i].saturating_sub(2));
            f[i] = t - low[i] as f64;
        }
        let mut sum = DVec3::ZERO;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = low;
            for i in 0..3 {
                let up = corner >> i & 1 == 1;
                weight *= if up { f[i] } else { 1.0 - f[i] };
                index[i] = if up { (low[i] + 1).min(self.size[i] - 1) } else { low[i] };
            }
            if weight > 0.0 {
                sum += self.at(index[0], index[1], index[2]) * weight;
            }
        }
        sum
    }

    /// Linear interpolation at [0, 1]³, domain ends on texel centres.
    pub fn sample_unit(&self, u: [f64; 3]) -> DVec3 {
        self.sample([0, 1, 2].map(|i| u[i] * (self.size[i] - 1) as f64))
    }
}

/// What a ray gathers per unit of solar irradiance.
#[derive(Clone, Copy, Debug, Default)]
pub struct Airlight {
    /// Rayleigh and multiple scattering with their phase functions \[1/sr\].
    pub smooth_part: DVec3,
    /// Aerosol single scattering without its phase function \[1\].
    pub aerosol: DVec3,
    /// Optical depth passed \[1\].
    pub optical_depth: DVec3,
}

/// Transmittance and multiple scattering: what depends on the air alone.
#[derive(Clone, Debug)]
pub struct AirTables {
    /// The air.
    pub air: Air,
    /// Transmittance to the top, by (mu, h).
    pub transmittance: Table,
    /// Multiple scattering, by (mu_s, h).
    pub multiple: Table,
}

/// Direction i of n, evenly over the sphere.
pub fn sphere_direction(i: usize, n: usize) -> DVec3 {
    let y = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
    let phi = 2.399_963_229_728_65 * i as f64;
    let s = (1.0 - y * y).sqrt();
    DVec3::new(s * phi.cos(), y, s * phi.sin())
}

impl AirTables {
    /// Computes both tables at the given sizes.
    pub fn new(air: Air, transmittance_size: [usize; 2], multiple_size: [usize; 2]) -> Self {
        let [w, h] = transmittance_size;
        let transmittance = Table::fill([w, h, 1], |x, y, _| {
            let (h, mu) = ray_from_transmittance(&air, [from_texel(x, w), from_texel(y, h)]);
            air.transmittance(h, mu, TRANSMITTANCE_STEPS)
        });
        let mut tables = Self { air, transmittance, multiple: Table::fill([1, 1, 1], |_, _, _| DVec3::ZERO) };
        let [w, h] = multiple_size;
        tables.multiple = Table::fill([w, h, 1], |x, y, _| {
            let (h, mu_s) = point_from_multiple(&air, [from_texel(x, w), from_texel(y, h)]);
            tables.compute_multiple(h, mu_s)
        });
        tables
    }

    /// Transmittance to the top of the atmosphere, from the table.
    pub fn to_top(&self, h: f64, mu: f64) -> DVec3 {
        let u = transmittance_from_ray(&self.air, h.clamp(0.0, self.air.top_height), mu);
        self.transmittance.sample_unit([u[0], u[1], 0.0])
    }

    /// Transmittance to the sun's disc, the part of it below the horizon cut off.
    pub fn to_sun(&self, h: f64, mu_s: f64) -> DVec3 {
        self.to_top(h, mu_s) * self.air.sun_visible_fraction(h, mu_s)
    }

    /// Multiply scattered radiance per unit of solar irradiance \[1/sr\], from the table.
    pub fn multiple_radiance(&self, h: f64, mu_s: f64) -> DVec3 {
        let u = multiple_from_point(&self.air, h, mu_s);
        self.multiple.sample_unit([u[0], u[1], 0.0])
    }

    /// Multiply scattered radiance per unit of solar irradiance, computed (Hillaire 2020, Eq. 5–10).
    pub fn compute_multiple(&self, h: f64, mu_s: f64) -> DVec3 {
        let air = &self.air;
        let to_sun = DVec3::new((1.0 - mu_s * mu_s).max(0.0).sqrt(), mu_s, 0.0);
        let (mut second, mut transfer) = (DVec3::ZERO, DVec3::ZERO);
        for i in 0..MULTIPLE_DIRECTIONS {
            let direction = sphere_direction(i, MULTIPLE_DIRECTIONS);
            let (mu, nu) = (direction.y, direction.dot(to_sun));
            let ground = air.hits_ground(h, mu);
            let length = if ground { air.distance_to_ground(h, mu) } else { air.distance_to_top(h, mu) };
            let mut through = DVec3::ONE;
            for (begin, end) in quadratic_steps(length, MULTIPLE_STEPS) {
                let d = 0.5 * (begin + end);
                let h_d = air.altitude_along(h, mu, d);
                let a = air.at(h_d);
                let sun = self.to_sun(h_d, air.mu_along(h, mu_s, nu, h_d, d));
                let sigma_s = a.rayleigh + a.mie;
                second += through * step_radiance(sigma_s * sun, a.extinction, end - begin) / (4.0 * PI);
                transfer += through * step_radiance(sigma_s, a.extinction, end - begin);
                through *= exp_minus(a.extinction * (end - begin));
            }
            if ground {
                let mu_s_ground = air.mu_along(h, mu_s, nu, 0.0, length);
                let sun = self.to_sun(0.0, mu_s_ground) * mu_s_ground.max(0.0);
                second += through * sun * DVec3::from_array(air.ground_albedo) / PI;
            }
        }
        let n = MULTIPLE_DIRECTIONS as f64;
        second / n / (DVec3::ONE - transfer / n)
    }

    /// Adds one step of a ray to `light`.
    pub fn step(&self, h: f64, mu: f64, mu_s: f64, nu: f64, begin: f64, end: f64, light: &mut Airlight) {
        let air = &self.air;
        let (d, length) = (0.5 * (begin + end), end - begin);
        let h_d = air.altitude_along(h, mu, d).max(0.0);
        let mu_s_d = air.mu_along(h, mu_s, nu, h_d, d);
        let a = air.at(h_d);
        let sun = self.to_sun(h_d, mu_s_d);
        let smooth = a.rayleigh * sun * rayleigh_phase(nu) + (a.rayleigh + a.mie) * self.multiple_radiance(h_d, mu_s_d);
        let through = exp_minus(light.optical_depth);
        light.smooth_part += through * step_radiance(smooth, a.extinction, length);
        light.aerosol += through * step_radiance(a.mie * sun, a.extinction, length);
        light.optical_depth += a.extinction * length;
    }

    /// Airlight along a whole ray, to the ground or to the top.
    pub fn airlight(&self, h: f64, mu: f64, mu_s: f64, nu: f64, ground: bool, steps: usize) -> Airlight {
        let air = &self.air;
        let length = if ground { air.distance_to_ground(h, mu) } else { air.distance_to_top(h, mu) };
        let mut light = Airlight::default();
        for (begin, end) in quadratic_steps(length, steps) {
            self.step(h, mu, mu_s, nu, begin, end, &mut light);
        }
        light
    }

    /// One texel of the sky view of a camera at altitude h.
    pub fn sky_view_texel(&self, h: f64, mu_s: f64, x: usize, y: usize, size: [usize; 2]) -> Airlight {
        let (u, ground) = sky_view_texel(x, y, size);
        let (mu, azimuth) = direction_from_sky_view(&self.air, h, u, ground);
        self.airlight(h, mu, mu_s, nu_from_azimuth(mu, mu_s, azimuth), ground, SKY_VIEW_STEPS)
    }

    /// One column (all distances) of the aerial perspective: mean in-scattering and mean extinction up to each
    /// distance, per kilometre.
    pub fn aerial_column(&self, h: f64, mu_s: f64, x: usize, y: usize, size: [usize; 3]) -> Vec<Airlight> {
        let at = |z: usize| ray_from_aerial([from_texel(x, size[0]), from_texel(y, size[1]), from_texel(z, size[2])]);
        let (mu, azimuth, _) = at(0);
        let nu = nu_from_azimuth(mu, mu_s, azimuth);
        let mut light = Airlight::default();
        let mut column = Vec::with_capacity(size[2]);
        // The limit at distance 0: one metre's worth.
        self.step(h, mu, mu_s, nu, 0.0, 1.0, &mut light);
        column.push(scaled(light, 1000.0));
        light = Airlight::default();
        for z in 1..size[2] {
            let (begin, end) = (at(z - 1).2, at(z).2);
            for k in 0..AERIAL_STEPS {
                let part = |k: usize| begin + (end - begin) * k as f64 / AERIAL_STEPS as f64;
                self.step(h, mu, mu_s, nu, part(k), part(k + 1), &mut light);
            }
            column.push(scaled(light, 1000.0 / end));
        }
        column
    }

    /// Irradiance per unit of solar irradiance on a horizontal plane at altitude h: facing up from the air above,
    /// facing down from the air and the sunlit ground below.
    pub fn horizontal_irradiance(&self, h: f64, mu_s: f64, up: bool, ground_radiance: DVec3) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for i in 0..IRRADIANCE_DIRECTIONS {
            // Cosine-weighted: points of a sunflower disc, lifted to the hemisphere.
            let r2 = (i as f64 + 0.5) / IRRADIANCE_DIRECTIONS as f64;
            let phi = 2.399_963_229_728_65 * i as f64;
            let mu = if up { (1.0 - r2).sqrt() } else { -(1.0 - r2).sqrt() };
            let nu = nu_from_azimuth(mu, mu_s, phi);
            let ground = self.air.hits_ground(h, mu);
            let light = self.airlight(h, mu, mu_s, nu, ground, IRRADIANCE_STEPS);
            sum += light.smooth_part + light.aerosol * mie_phase(nu, self.air.mie_g);
            if ground {
                sum += ground_radiance * exp_minus(light.optical_depth);
            }
        }
        sum * PI / IRRADIANCE_DIRECTIONS as f64
    }
}

fn scaled(light: Airlight, k: f64) -> Airlight {
    Airlight { smooth_part: light.smooth_part * k, aerosol: light.aerosol * k, optical_depth: light.optical_depth * k }
}
