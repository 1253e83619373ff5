//! What the clear air is made of: the host's parameters and their device twin.

use crate::definitions::PLANET_RADIUS;
use crate::params;
use crate::shared::assert_layout;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};

/// Clear air over a spherical planet, at three wavelengths that stand for linear sRGB (680, 550 and 440 nm).
///
/// Irradiance and radiance are in the unit of [`Air::solar_irradiance`]: W m⁻² nm⁻¹ and W m⁻² sr⁻¹ nm⁻¹.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Radius of the planet at sea level \[m\].
    pub bottom_radius: f64,
    /// Altitude above which there is no air \[m\].
    pub top_height: f64,
    /// Rayleigh scattering at sea level \[1/m\].
    pub rayleigh_scattering: [f64; 3],
    /// Altitude over which the Rayleigh density falls by e \[m\].
    pub rayleigh_scale_height: f64,
    /// Aerosol scattering at sea level \[1/m\].
    pub mie_scattering: [f64; 3],
    /// Aerosol extinction at sea level \[1/m\].
    pub mie_extinction: [f64; 3],
    /// Altitude over which the aerosol density falls by e \[m\].
    pub mie_scale_height: f64,
    /// Asymmetry of the aerosol's Cornette–Shanks phase function \[1\].
    pub mie_g: f64,
    /// Ozone absorption at the centre of its layer \[1/m\].
    pub ozone_absorption: [f64; 3],
    /// Altitude of the centre of the ozone layer \[m\].
    pub ozone_centre: f64,
    /// Distance from that centre to where the tent-shaped ozone density is zero \[m\].
    pub ozone_half_width: f64,
    /// Irradiance on a plane facing the sun outside the atmosphere \[W m⁻² nm⁻¹\].
    pub solar_irradiance: [f64; 3],
    /// Angular radius of the sun \[rad\].
    pub sun_angular_radius: f64,
    /// Diffuse albedo of the ground as the air sees it from afar \[1\].
    pub ground_albedo: [f64; 3],
}

impl Default for Air {
    /// Mid-latitude air on a fair summer day.
    ///
    /// Rayleigh and ozone are the values of Hillaire 2020 (after Bruneton 2017); the aerosol has the profile, albedo and
    /// asymmetry of Bruneton 2008 but is denser: a visual range of 100 km (Koschmieder: 3.91/σ at 550 nm), good on a day
    /// with cumulus, where theirs would be 220 km. The sun is that of the ASTM G173 extraterrestrial spectrum.
    fn default() -> Self {
        Self {
            bottom_radius: PLANET_RADIUS,
            top_height: 100e3,
            rayleigh_scattering: [5.802e-6, 13.558e-6, 33.1e-6],
            rayleigh_scale_height: 8000.0,
            mie_scattering: [2.25e-5; 3],
            mie_extinction: [2.5e-5; 3],
            mie_scale_height: 1200.0,
            mie_g: 0.8,
            ozone_absorption: [0.650e-6, 1.881e-6, 0.085e-6],
            ozone_centre: 25e3,
            ozone_half_width: 15e3,
            solar_irradiance: [1.474, 1.8504, 1.91198],
            sun_angular_radius: 0.004675,
            ground_albedo: [0.10, 0.11, 0.07],
        }
    }
}

impl Air {
    /// Air as a scene describes it: the default with the scene's haze, ground and sun.
    #[must_use]
    pub fn of(sky: &params::Sky, sun: &params::Sun) -> Self {
        let air = Self::default();
        let haze = f64::from(sky.haze);
        Self {
            mie_scattering: air.mie_scattering.map(|c| c * haze),
            mie_extinction: air.mie_extinction.map(|c| c * haze),
            ground_albedo: sky.ground_albedo.map(f64::from),
            solar_irradiance: sun.irradiance.map(f64::from),
            sun_angular_radius: f64::from(sun.angular_radius).to_radians(),
            ..air
        }
    }

    /// Checks every field; the error names the first that cannot be used.
    pub fn validate(&self) -> Result<()> {
        let positive = |name: &str, value: f64| {
            if value.is_finite() && value > 0.0 { Ok(()) } else { Err(Error::invalid(name, value, "a number above 0")) }
        };
        let triple = |name: &str, values: [f64; 3], most: f64| match values
            .iter()
            .find(|v| !(v.is_finite() && **v >= 0.0 && **v <= most))
        {
            Some(bad) => Err(Error::invalid(name, bad, format!("three numbers from 0 to {most}"))),
            None => Ok(()),
        };
        positive("sky.bottom_radius", self.bottom_radius)?;
        positive("sky.top_height", self.top_height)?;
        positive("sky.rayleigh_scale_height", self.rayleigh_scale_height)?;
        positive("sky.mie_scale_height", self.mie_scale_height)?;
        positive("sky.ozone_half_width", self.ozone_half_width)?;
        positive("sky.sun_angular_radius", self.sun_angular_radius)?;
        triple("sky.rayleigh_scattering", self.rayleigh_scattering, 1.0)?;
        triple("sky.mie_scattering", self.mie_scattering, 1.0)?;
        triple("sky.mie_extinction", self.mie_extinction, 1.0)?;
        triple("sky.ozone_absorption", self.ozone_absorption, 1.0)?;
        triple("sky.solar_irradiance", self.solar_irradiance, 1e6)?;
        triple("sky.ground_albedo", self.ground_albedo, 1.0)?;
        if !(self.mie_g.is_finite() && self.mie_g.abs() < 1.0) {
            return Err(Error::invalid("sky.mie_g", self.mie_g, "a number above -1 and below 1"));
        }
        if !self.ozone_centre.is_finite() {
            return Err(Error::invalid("sky.ozone_centre", self.ozone_centre, "a number"));
        }
        for c in 0..3 {
            if self.mie_scattering[c] > self.mie_extinction[c] {
                return Err(Error::invalid(
                    "sky.mie_scattering",
                    self.mie_scattering[c],
                    "no more than sky.mie_extinction in each channel",
                ));
            }
        }
        Ok(())
    }

    /// The same numbers as the shaders read them.
    pub fn to_device(&self) -> AirParams {
        let v = |a: [f64; 3]| a.map(|x| x as f32);
        AirParams {
            rayleigh_scattering: v(self.rayleigh_scattering),
            rayleigh_scale_height: self.rayleigh_scale_height as f32,
            mie_scattering: v(self.mie_scattering),
            mie_scale_height: self.mie_scale_height as f32,
            mie_extinction: v(self.mie_extinction),
            mie_g: self.mie_g as f32,
            ozone_absorption: v(self.ozone_absorption),
            ozone_centre: self.ozone_centre as f32,
            solar_irradiance: v(self.solar_irradiance),
            ozone_half_width: self.ozone_half_width as f32,
            ground_albedo: v(self.ground_albedo),
            bottom_radius: self.bottom_radius as f32,
            top_height: self.top_height as f32,
            sun_angular_radius: self.sun_angular_radius as f32,
            reserved_a: 0.0,
            reserved_b: 0.0,
        }
    }
}

/// [`Air`] as the shaders read it (`glsl/atmosphere/params.glsl`); see there for each field.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct AirParams {
    pub rayleigh_scattering: [f32; 3],
    pub rayleigh_scale_height: f32,
    pub mie_scattering: [f32; 3],
    pub mie_scale_height: f32,
    pub mie_extinction: [f32; 3],
    pub mie_g: f32,
    pub ozone_absorption: [f32; 3],
    pub ozone_centre: f32,
    pub solar_irradiance: [f32; 3],
    pub ozone_half_width: f32,
    pub ground_albedo: [f32; 3],
    pub bottom_radius: f32,
    pub top_height: f32,
    pub sun_angular_radius: f32,
    pub reserved_a: f32,
    pub reserved_b: f32,
}
assert_layout!(AirParams, air_params, {
    rayleigh_scattering: RAYLEIGH_SCATTERING, rayleigh_scale_height: RAYLEIGH_SCALE_HEIGHT,
    mie_scattering: MIE_SCATTERING, mie_scale_height: MIE_SCALE_HEIGHT, mie_extinction: MIE_EXTINCTION, mie_g: MIE_G,
    ozone_absorption: OZONE_ABSORPTION, ozone_centre: OZONE_CENTRE, solar_irradiance: SOLAR_IRRADIANCE,
    ozone_half_width: OZONE_HALF_WIDTH, ground_albedo: GROUND_ALBEDO, bottom_radius: BOTTOM_RADIUS,
    top_height: TOP_HEIGHT, sun_angular_radius: SUN_ANGULAR_RADIUS, reserved_a: RESERVED_A, reserved_b: RESERVED_B,
});

/// The light that the sky and the sun give to clouds and ground this frame, computed on the device.
///
/// All are irradiances \[W m⁻² nm⁻¹\]; with `[sky] model = "none"` the sun's is exactly [`Air::solar_irradiance`] and
/// everything else exactly 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct SkyLight {
    /// Of the sun, on a plane facing it, at the clouds' altitude.
    pub sun_irradiance_clouds: [f32; 3],
    pub reserved_a: f32,
    /// Of the sky above, on a horizontal plane facing up, at the clouds' altitude.
    pub sky_irradiance_clouds: [f32; 3],
    pub reserved_b: f32,
    /// Of the ground and the air below, on a horizontal plane facing down, at the clouds' altitude.
    pub ground_irradiance_clouds: [f32; 3],
    pub reserved_c: f32,
    /// Of the sun, on a plane facing it, at sea level.
    pub sun_irradiance_ground: [f32; 3],
    pub reserved_d: f32,
    /// Of the sky, on a horizontal plane facing up, at sea level.
    pub sky_irradiance_ground: [f32; 3],
    pub reserved_e: f32,
}
assert_layout!(SkyLight, sky_light, {
    sun_irradiance_clouds: SUN_IRRADIANCE_CLOUDS, reserved_a: RESERVED_A,
    sky_irradiance_clouds: SKY_IRRADIANCE_CLOUDS, reserved_b: RESERVED_B,
    ground_irradiance_clouds: GROUND_IRRADIANCE_CLOUDS, reserved_c: RESERVED_C,
    sun_irradiance_ground: SUN_IRRADIANCE_GROUND, reserved_d: RESERVED_D,
    sky_irradiance_ground: SKY_IRRADIANCE_GROUND, reserved_e: RESERVED_E,
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_air_is_valid_and_a_bad_field_is_named() {
        assert!(Air::default().validate().is_ok());
        let bad = Air { mie_g: 1.0, ..Air::default() };
        assert!(bad.validate().is_err_and(|e| e.to_string().contains("sky.mie_g = 1")));
        let bad = Air { ground_albedo: [0.1, f64::NAN, 0.1], ..Air::default() };
        assert!(bad.validate().is_err_and(|e| e.to_string().contains("sky.ground_albedo = NaN")));
        let bad = Air { mie_scattering: [1.0; 3], ..Air::default() };
        assert!(bad.validate().is_err_and(|e| e.to_string().contains("mie_extinction")));
    }
}
