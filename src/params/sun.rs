//! The sun: its direction and its light.

use super::{check, solar};
use crate::Result;

/// The sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Where it stands.
    pub position: SunPosition,
    /// Irradiance above the atmosphere on a surface facing the sun, at 680, 550 and 440 nm for r, g and b
    /// [W m⁻² nm⁻¹]. Default 1.474, 1.8504, 1.91198 (ASTM G173 extraterrestrial spectrum, as Bruneton uses it).
    pub irradiance: [f32; 3],
    /// Half the angle that the disc subtends [degrees]. Default 0.2666 (mean distance).
    pub angular_radius: f32,
}

/// Where the sun stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SunPosition {
    /// By angles [degrees].
    Angles {
        /// Above the horizontal, −90 to 90.
        elevation: f64,
        /// Compass direction: 0 north (−z), 90 east (+x), as the camera's yaw.
        azimuth: f64,
    },
    /// By time and place; see [`solar::position`].
    Time {
        /// Seconds since 1970-01-01T00:00:00Z.
        unix_seconds: f64,
        /// North positive [degrees].
        latitude: f64,
        /// East positive [degrees].
        longitude: f64,
    },
}

impl Default for Sun {
    fn default() -> Self {
        Self {
            position: SunPosition::Angles { elevation: 35.0, azimuth: 150.0 },
            irradiance: [1.474, 1.850_4, 1.911_98],
            angular_radius: 0.2666,
        }
    }
}

impl Sun {
    /// Elevation and azimuth [degrees].
    #[must_use]
    pub fn elevation_azimuth(&self) -> (f64, f64) {
        match self.position {
            SunPosition::Angles { elevation, azimuth } => (elevation, azimuth),
            SunPosition::Time { unix_seconds, latitude, longitude } => {
                let at = solar::position(unix_seconds, latitude, longitude);
                (at.elevation, at.azimuth)
            }
        }
    }

    /// Unit direction from the ground towards the sun, world axes.
    #[must_use]
    pub fn to_sun(&self) -> [f64; 3] {
        let (elevation, azimuth) = self.elevation_azimuth();
        let ((sin_el, cos_el), (sin_az, cos_az)) = (elevation.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
        [cos_el * sin_az, sin_el, -cos_el * cos_az]
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        match self.position {
            SunPosition::Angles { elevation, azimuth } => {
                check::within("sun.elevation", elevation, -90.0..=90.0, "degrees")?;
                check::within("sun.azimuth", azimuth, -360.0..=360.0, "degrees")?;
            }
            SunPosition::Time { unix_seconds, latitude, longitude } => {
                let (from, to) = (solar::unix_seconds(1900, 1, 1, 0.0), solar::unix_seconds(2100, 1, 1, 0.0));
                check::within("sun.time", unix_seconds, from..=to, "s since 1970 (the years 1900 to 2099)")?;
                check::within("sun.latitude", latitude, -90.0..=90.0, "degrees")?;
                check::within("sun.longitude", longitude, -360.0..=360.0, "degrees")?;
            }
        }
        check::each_within("sun.irradiance", self.irradiance, 0.0..=1.0e6, "W/m²/nm")?;
        check::within("sun.angular_radius", self.angular_radius, 0.01..=10.0, "degrees")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuth_is_the_compass_angle_of_the_sun() {
        let to_sun = |elevation, azimuth| {
            Sun { position: SunPosition::Angles { elevation, azimuth }, ..Sun::default() }.to_sun()
        };
        let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-12); // f64 rounding
        assert!(close(to_sun(0.0, 0.0), [0.0, 0.0, -1.0]));
        assert!(close(to_sun(0.0, 90.0), [1.0, 0.0, 0.0]));
        assert!(close(to_sun(90.0, 12.0), [0.0, 1.0, 0.0]));
    }
}
