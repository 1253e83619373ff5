//! Where the sun stands at a time and a place.
//!
//! The low-precision solar coordinates of Meeus, *Astronomical Algorithms*, chapter 25, in the form of NOAA's solar
//! calculator: within about 0.01° between the years 1900 and 2100. No refraction: the sky's rays are straight.

/// Sun position seen from the ground [degrees]: elevation above the horizon, azimuth from north towards east, 0 to 360.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolarPosition {
    /// Angle above the horizontal [degrees].
    pub elevation: f64,
    /// Compass direction [degrees]: 0 north (−z), 90 east (+x).
    pub azimuth: f64,
}

/// The sun's position at `unix_seconds` (seconds since 1970-01-01T00:00:00Z) from `latitude` (north positive) and
/// `longitude` (east positive) [degrees].
#[must_use]
pub fn position(unix_seconds: f64, latitude: f64, longitude: f64) -> SolarPosition {
    let (declination, equation_of_time) = declination_and_equation_of_time(unix_seconds);
    let minutes_utc = unix_seconds.rem_euclid(86_400.0) / 60.0;
    let true_solar_minutes = minutes_utc + equation_of_time + 4.0 * longitude; // The earth turns 1° in 4 minutes.
    let hour_angle = (true_solar_minutes / 4.0 - 180.0).to_radians(); // 0 at true noon, positive in the afternoon.
    let ((sin_lat, cos_lat), (sin_dec, cos_dec)) = (latitude.to_radians().sin_cos(), declination.sin_cos());
    // Components of the direction to the sun in the local frame.
    let up = sin_lat * sin_dec + cos_lat * cos_dec * hour_angle.cos();
    let north = cos_lat * sin_dec - sin_lat * cos_dec * hour_angle.cos();
    let east = -cos_dec * hour_angle.sin();
    SolarPosition {
        elevation: up.clamp(-1.0, 1.0).asin().to_degrees(),
        azimuth: east.atan2(north).to_degrees().rem_euclid(360.0),
    }
}

/// Declination [radians] and equation of time (true minus mean solar time) [minutes].
fn declination_and_equation_of_time(unix_seconds: f64) -> (f64, f64) {
    let julian_day = unix_seconds / 86_400.0 + 2_440_587.5;
    let t = (julian_day - 2_451_545.0) / 36_525.0; // Julian centuries since J2000
    let mean_longitude = (280.466_46 + t * (36_000.769_83 + t * 0.000_303_2)).to_radians();
    let mean_anomaly = (357.529_11 + t * (35_999.050_29 - t * 0.000_153_7)).to_radians();
    let eccentricity = 0.016_708_634 - t * (0.000_042_037 + t * 0.000_000_126_7);
    let centre = mean_anomaly.sin() * (1.914_602 - t * (0.004_817 + t * 0.000_014))
        + (2.0 * mean_anomaly).sin() * (0.019_993 - t * 0.000_101)
        + (3.0 * mean_anomaly).sin() * 0.000_289;
    let node = (125.04 - 1_934.136 * t).to_radians(); // of the moon's orbit, for nutation
    let apparent_longitude = mean_longitude + (centre - 0.005_69 - 0.004_78 * node.sin()).to_radians();
    let mean_obliquity = 23.0 + (26.0 + (21.448 - t * (46.815 + t * (0.000_59 - t * 0.001_813))) / 60.0) / 60.0;
    let obliquity = (mean_obliquity + 0.002_56 * node.cos()).to_radians();
    let declination = (obliquity.sin() * apparent_longitude.sin()).asin();
    let y = (obliquity * 0.5).tan().powi(2);
    let equation = y * (2.0 * mean_longitude).sin() - 2.0 * eccentricity * mean_anomaly.sin()
        + 4.0 * eccentricity * y * mean_anomaly.sin() * (2.0 * mean_longitude).cos()
        - 0.5 * y * y * (4.0 * mean_longitude).sin()
        - 1.25 * eccentricity * eccentricity * (2.0 * mean_anomaly).sin();
    (declination, 4.0 * equation.to_degrees())
}

/// Seconds since 1970-01-01T00:00:00Z of a date of the Gregorian calendar (`month` and `day` from 1) plus `seconds`.
#[must_use]
pub fn unix_seconds(year: i32, month: u32, day: u32, seconds: f64) -> f64 {
    // Days from civil: years begin in March, so that the leap day is the last one.
    let year = i64::from(year) - i64::from(month <= 2);
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let month_from_march = i64::from((month + 9) % 12);
    let day_of_year = (153 * month_from_march + 2) / 5 + i64::from(day) - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    let days = era * 146_097 + day_of_era - 719_468;
    days as f64 * 86_400.0 + seconds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_count_from_1970() {
        assert_eq!(unix_seconds(1970, 1, 1, 0.0), 0.0);
        assert_eq!(unix_seconds(2000, 2, 29, 0.0), 951_782_400.0);
        assert_eq!(unix_seconds(2026, 6, 21, 57_600.0), 1_782_057_600.0);
    }

    /// Reda and Andreas, "Solar Position Algorithm for Solar Radiation Applications" (NREL/TP-560-34302), worked example:
    /// Golden, Colorado, 2003-10-17 12:30:30 UTC−7; topocentric elevation without refraction 39.872046°, azimuth 194.340241°.
    #[test]
    fn the_nrel_example_is_met() {
        let seconds = unix_seconds(2003, 10, 17, 19.0 * 3600.0 + 30.0 * 60.0 + 30.0);
        let SolarPosition { elevation, azimuth } = position(seconds, 39.742_476, -105.178_6);
        // 0.01° is the algorithm's own accuracy; it also leaves out parallax (0.002°).
        assert!((elevation - 39.872_046).abs() < 0.01, "elevation {elevation}");
        assert!((azimuth - 194.340_241).abs() < 0.01, "azimuth {azimuth}");
    }

    /// Published extremes: obliquity 23.44° at the June solstice of 2026 (21 June 08:24 UTC), declination 0 at the March
    /// equinox (20 March 14:46 UTC), equation of time +16.4 minutes on 3 November.
    #[test]
    fn solstice_equinox_and_equation_of_time_are_met() {
        let at =
            |month, day, hours: f64| declination_and_equation_of_time(unix_seconds(2026, month, day, hours * 3600.0));
        assert!((at(6, 21, 8.4).0.to_degrees() - 23.436).abs() < 0.005);
        assert!(at(3, 20, 14.77).0.to_degrees().abs() < 0.01);
        assert!((at(11, 3, 12.0).1 - 16.4).abs() < 0.1);
    }

    #[test]
    fn the_sun_is_in_the_south_at_noon_in_the_north_and_rises_in_the_east() {
        let noon = position(unix_seconds(2026, 6, 21, 12.0 * 3600.0), 50.0, 0.0);
        assert!((noon.azimuth - 180.0).abs() < 2.0 && (noon.elevation - 63.4).abs() < 0.2, "{noon:?}");
        let morning = position(unix_seconds(2026, 3, 20, 6.0 * 3600.0), 0.0, 0.0);
        assert!((morning.azimuth - 90.0).abs() < 0.5 && morning.elevation.abs() < 3.0, "{morning:?}");
    }
}
