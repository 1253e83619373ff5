//! What changes with time: the camera, the sun, and clouds that drift and grow.
//!
//! Everything is a function of absolute time, so that any frame can be made alone and frames made apart fit together.

use super::{Aim, Camera, SunPosition, check};
use crate::{Error, Result};

/// Vectors that [`Animation::wind`] may hold.
pub const WIND_LAYERS: usize = 8;
/// How long a parcel rises from the base of a cloud to its top [s]: the time that shear has to lean a column. 700 m at
/// 2.3 m/s, an updraught of fair-weather cumulus.
const RISE_TIME: f64 = 300.0;
/// How far the detail of a cloud's surface rises in the life of a cloud [m]: 1 m/s for lives of ten minutes.
const DETAIL_RISE: f64 = 600.0;
/// Weather and streaks change this much more slowly than heaps.
const WEATHER_SHARE: f64 = 0.125;

/// What changes in a sequence. By default nothing does: every frame is the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// Frames a second [Hz]. Default 30.
    pub frame_rate: f64,
    /// Time of the picture [s]. 0 in a scene; [`Params::at_frame`](super::Params::at_frame) moves it on.
    pub time: f64,
    /// Motion of the camera [m per frame]. With [`Aim::LookAt`] the target stays where it is.
    pub velocity: [f64; 3],
    /// Turn of the camera towards the east [degrees per frame]. Only for an aim by angles.
    pub yaw_rate: f64,
    /// Turn of the camera upwards [degrees per frame], stopping at the zenith. Only for an aim by angles.
    pub pitch_rate: f64,
    /// The camera's path, in order of time. In place of the three above; empty by default.
    pub keys: Vec<CameraKey>,
    /// Wind, x (east) and z (south) [m/s]: one vector, or up to [`WIND_LAYERS`] at even heights of the layer from base to
    /// top, linear between. Clouds drift with the mean, and shear leans their columns. Empty: none.
    pub wind: Vec<[f64; 2]>,
    /// How fast clouds of the grid grow and dissolve, as 1 / life time [1/s]. Default 0: they keep their shapes.
    pub evolution: f64,
    /// Seconds of the day that pass in a second, for a sun by time. Default 0.
    pub sun_rate: f64,
    /// Change of the sun's elevation [degrees/s], for a sun by angles. Default 0.
    pub sun_elevation_rate: f64,
    /// Change of the sun's azimuth [degrees/s], for a sun by angles. Default 0.
    pub sun_azimuth_rate: f64,
}

/// Where the camera is at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraKey {
    /// Time [s].
    pub time: f64,
    /// Position [m].
    pub position: [f64; 3],
    /// Direction of view.
    pub aim: Aim,
}

/// How far the clouds have come at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudMotion {
    /// How far the wind has carried them, x and z [m].
    pub drift: [f64; 2],
    /// Lives that have passed.
    pub lives: f64,
    /// Whether they change their shapes at all.
    pub evolving: bool,
}

impl Default for Animation {
    fn default() -> Self {
        Self {
            frame_rate: 30.0,
            time: 0.0,
            velocity: [0.0; 3],
            yaw_rate: 0.0,
            pitch_rate: 0.0,
            keys: Vec::new(),
            wind: Vec::new(),
            evolution: 0.0,
            sun_rate: 0.0,
            sun_elevation_rate: 0.0,
            sun_azimuth_rate: 0.0,
        }
    }
}

impl CloudMotion {
    /// Phase of the noises of heaps, outlines and turrets: 2²⁴ a life, which repeats after 256 lives.
    #[must_use]
    pub fn phase(&self) -> u32 {
        fixed(self.lives)
    }

    /// Phase of the slower noises of streaks and weather.
    #[must_use]
    pub fn weather_phase(&self) -> u32 {
        fixed(self.lives * WEATHER_SHARE)
    }

    /// Where the detail noise is anchored, given the floating origin [m]: it goes with the wind and rises with evolution.
    #[must_use]
    pub fn detail_origin(&self, origin: [f64; 3]) -> [f64; 3] {
        [origin[0] - self.drift[0], origin[1] - self.lives * DETAIL_RISE, origin[2] - self.drift[1]]
    }
}

/// `lives` in 2⁻²⁴, modulo 2³².
fn fixed(lives: f64) -> u32 {
    // Exact: a product with a power of two, and a remainder below 2³².
    (lives.rem_euclid(256.0) * 16_777_216.0) as u64 as u32
}

impl Animation {
    /// `camera` after `frame` frames.
    #[must_use]
    pub fn camera_at(&self, camera: &Camera, frame: u32) -> Camera {
        let frames = f64::from(frame);
        if !self.keys.is_empty() {
            let (position, aim) = self.on_path(self.time + frames / self.frame_rate);
            return Camera { position, aim, ..*camera };
        }
        let aim = match camera.aim {
            Aim::Angles { yaw, pitch } => Aim::Angles {
                yaw: yaw + self.yaw_rate * frames,
                pitch: (pitch + self.pitch_rate * frames).clamp(-90.0, 90.0),
            },
            target => target,
        };
        let position = std::array::from_fn(|i| camera.position[i] + self.velocity[i] * frames);
        Camera { position, aim, ..*camera }
    }

    /// The sun, at `position` now, after `seconds`.
    #[must_use]
    pub fn sun_after(&self, position: SunPosition, seconds: f64) -> SunPosition {
        match position {
            SunPosition::Angles { elevation, azimuth } => {
                let turned = azimuth + self.sun_azimuth_rate * seconds;
                SunPosition::Angles {
                    elevation: (elevation + self.sun_elevation_rate * seconds).clamp(-90.0, 90.0),
                    azimuth: if turned.abs() <= 360.0 { turned } else { turned % 360.0 },
                }
            }
            SunPosition::Time { unix_seconds, latitude, longitude } => {
                SunPosition::Time { unix_seconds: unix_seconds + self.sun_rate * seconds, latitude, longitude }
            }
        }
    }

    /// The wind that carries the clouds, x and z [m/s]: its mean over the height of the layer.
    #[must_use]
    pub fn mean_wind(&self) -> [f64; 2] {
        match self.wind.as_slice() {
            [] => [0.0; 2],
            [one] => *one,
            // Of a function that is linear between even knots.
            several => {
                let mean = |axis: usize| {
                    let spans = several.windows(2).map(|pair| 0.5 * (pair[0][axis] + pair[1][axis]));
                    spans.sum::<f64>() / (several.len() - 1) as f64
                };
                [mean(0), mean(1)]
            }
        }
    }

    /// How far columns lean at even heights from base to top, x and z [m]: by what the wind there moved against the mean
    /// while a parcel rose through the layer. The lean is steady, so that columns stay whole for ever.
    #[must_use]
    pub fn lean(&self) -> Vec<[f64; 2]> {
        let mean = self.mean_wind();
        let leaning = self.wind.len() > 1;
        let knots = self.wind.iter().filter(|_| leaning);
        knots.map(|wind| [0, 1].map(|axis| (wind[axis] - mean[axis]) * RISE_TIME)).collect()
    }

    /// How far the clouds have come at [`Self::time`].
    #[must_use]
    pub fn clouds(&self) -> CloudMotion {
        CloudMotion {
            drift: self.mean_wind().map(|wind| wind * self.time),
            lives: self.evolution * self.time,
            evolving: self.evolution > 0.0,
        }
    }

    /// Position and aim on the path at `time` [s]; before the first key and after the last one they stay.
    fn on_path(&self, time: f64) -> ([f64; 3], Aim) {
        let keys = &self.keys;
        let (first, last) = (&keys[0], &keys[keys.len() - 1]);
        if time <= first.time || keys.len() == 1 {
            return (first.position, first.aim);
        }
        if time >= last.time {
            return (last.position, last.aim);
        }
        let next = keys.partition_point(|key| key.time <= time);
        if keys[next - 1].time == time {
            return (keys[next - 1].position, keys[next - 1].aim);
        }
        let times: Vec<f64> = keys.iter().map(|key| key.time).collect();
        let along = |value: &dyn Fn(&CameraKey) -> f64, slopes: fn(&[f64], &[f64]) -> Vec<f64>| {
            let values: Vec<f64> = keys.iter().map(value).collect();
            hermite(&times, &values, &slopes(&times, &values), time)
        };
        let position = [0, 1, 2].map(|axis| along(&|key| key.position[axis], smooth_slopes));
        if keys.iter().all(|key| matches!(key.aim, Aim::LookAt(_))) {
            let target = |key: &CameraKey| if let Aim::LookAt(target) = key.aim { target } else { key.position };
            return (position, Aim::LookAt([0, 1, 2].map(|axis| along(&|key| target(key)[axis], monotone_slopes))));
        }
        // The shorter way round from each key to the next.
        let angles: Vec<[f64; 2]> = keys
            .iter()
            .scan(None, |before: &mut Option<f64>, key| {
                let (yaw, pitch) = Camera { position: key.position, aim: key.aim, fov_y: 60.0 }.yaw_pitch();
                let turn = |from: f64| from + (yaw - from + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
                let yaw = before.map_or(yaw, |from| turn(from) - std::f64::consts::PI);
                *before = Some(yaw);
                Some([yaw, pitch])
            })
            .collect();
        let turned = |axis: usize| {
            let values: Vec<f64> = angles.iter().map(|angles| angles[axis]).collect();
            hermite(&times, &values, &monotone_slopes(&times, &values), time).to_degrees()
        };
        (position, Aim::Angles { yaw: turned(0), pitch: turned(1).clamp(-90.0, 90.0) })
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        check::within("animation.frame_rate", self.frame_rate, 1.0e-3..=1.0e4, "Hz")?;
        check::within("animation.time", self.time, -1.0e9..=1.0e9, "s")?;
        check::each_within("animation.velocity", self.velocity, -1.0e5..=1.0e5, "m per frame")?;
        check::within("animation.yaw_rate", self.yaw_rate, -360.0..=360.0, "degrees per frame")?;
        check::within("animation.pitch_rate", self.pitch_rate, -360.0..=360.0, "degrees per frame")?;
        if self.wind.len() > WIND_LAYERS {
            let expected = format!("one vector, or 2 to {WIND_LAYERS} from base to top");
            return Err(Error::invalid("animation.wind", format!("{} vectors", self.wind.len()), expected));
        }
        for (index, &wind) in self.wind.iter().enumerate() {
            let name = if self.wind.len() > 1 { format!("animation.wind[{index}]") } else { "animation.wind".into() };
            check::each_within(&name, wind, -200.0..=200.0, "m/s")?;
        }
        check::within("animation.evolution", self.evolution, 0.0..=10.0, "1/s")?;
        check::within("animation.sun_rate", self.sun_rate, -1.0e6..=1.0e6, "s/s")?;
        check::within("animation.sun_elevation_rate", self.sun_elevation_rate, -360.0..=360.0, "degrees/s")?;
        check::within("animation.sun_azimuth_rate", self.sun_azimuth_rate, -360.0..=360.0, "degrees/s")?;
        let by_frame = [
            ("velocity", self.velocity != [0.0; 3]),
            ("yaw_rate", self.yaw_rate != 0.0),
            ("pitch_rate", self.pitch_rate != 0.0),
        ];
        if let Some((name, _)) = by_frame.iter().find(|(_, given)| *given && !self.keys.is_empty()) {
            let expected = "either it or [[animation.key]] tables";
            return Err(Error::invalid(format!("animation.{name}"), "…", expected));
        }
        for (index, key) in self.keys.iter().enumerate() {
            let name = format!("animation.key[{index}]");
            check::within(&format!("{name}.time"), key.time, -1.0e9..=1.0e9, "s")?;
            if index > 0 && key.time <= self.keys[index - 1].time {
                let expected = format!("a time above that of the key before it, {}", self.keys[index - 1].time);
                return Err(Error::invalid(format!("{name}.time"), key.time, expected));
            }
            Camera { position: key.position, aim: key.aim, fov_y: 60.0 }.validate_as(&name)?;
        }
        Ok(())
    }
}

/// Value at `time` of the cubics that have `values` and `slopes` at `times`, which surround it.
fn hermite(times: &[f64], values: &[f64], slopes: &[f64], time: f64) -> f64 {
    let i = times.partition_point(|&t| t <= time).clamp(1, times.len() - 1) - 1;
    let span = times[i + 1] - times[i];
    let s = (time - times[i]) / span;
    let (a, b) = (values[i], values[i + 1]);
    let rest = (1.0 - s) * slopes[i] * span - s * slopes[i + 1] * span;
    a + s * s * (3.0 - 2.0 * s) * (b - a) + s * (1.0 - s) * rest
}

/// Slopes of the natural cubic spline, whose second derivative is continuous, and 0 at both ends: the tridiagonal system
/// m₍ᵢ₋₁₎ / h₍ᵢ₋₁₎ + 2 mᵢ (1 / h₍ᵢ₋₁₎ + 1 / hᵢ) + m₍ᵢ₊₁₎ / hᵢ = 3 (d₍ᵢ₋₁₎ / h₍ᵢ₋₁₎ + dᵢ / hᵢ), by elimination.
fn smooth_slopes(times: &[f64], values: &[f64]) -> Vec<f64> {
    let n = times.len();
    let inverse = |i: usize| 1.0 / (times[i + 1] - times[i]);
    let pull = |i: usize| 3.0 * (values[i + 1] - values[i]) * inverse(i) * inverse(i);
    let (mut above, mut right) = (vec![0.0; n], vec![0.0; n]);
    for i in 0..n {
        let (before, after) = (if i > 0 { inverse(i - 1) } else { 0.0 }, if i + 1 < n { inverse(i) } else { 0.0 });
        let pulls = if i > 0 { pull(i - 1) } else { 0.0 } + if i + 1 < n { pull(i) } else { 0.0 };
        let (carried, known) = if i > 0 { (above[i - 1], right[i - 1]) } else { (0.0, 0.0) };
        let pivot = 2.0 * (before + after) - before * carried;
        above[i] = after / pivot;
        right[i] = (pulls - before * known) / pivot;
    }
    for i in (0..n - 1).rev() {
        right[i] -= above[i] * right[i + 1];
    }
    right
}

/// Slopes for which no cubic leaves the range of its two ends (Fritsch and Butland 1984).
fn monotone_slopes(times: &[f64], values: &[f64]) -> Vec<f64> {
    let n = times.len();
    let span = |i: usize| times[i + 1] - times[i];
    let rise = |i: usize| (values[i + 1] - values[i]) / span(i);
    let slope = |i: usize| {
        if i == 0 || i + 1 == n {
            return 0.0; // the camera stands still at both ends of its path
        }
        let (a, b) = (rise(i - 1), rise(i));
        if a * b <= 0.0 {
            return 0.0;
        }
        let (wa, wb) = (2.0 * span(i) + span(i - 1), span(i) + 2.0 * span(i - 1));
        (wa + wb) / (wa / a + wb / b)
    };
    (0..n).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(time: f64, position: [f64; 3], yaw: f64, pitch: f64) -> CameraKey {
        CameraKey { time, position, aim: Aim::Angles { yaw, pitch } }
    }

    fn path() -> Animation {
        let keys = vec![
            key(0.0, [0.0, 500.0, 0.0], 350.0, 0.0),
            key(1.0, [100.0, 500.0, 0.0], 20.0, 30.0),
            key(4.0, [400.0, 900.0, -50.0], 20.0, 10.0),
            key(5.0, [380.0, 800.0, -90.0], 15.0, 10.0),
        ];
        Animation { keys, frame_rate: 1.0, ..Animation::default() }
    }

    #[test]
    fn the_camera_passes_through_its_keys_exactly_and_stays_at_the_ends() {
        let animation = path();
        for key in &animation.keys {
            assert_eq!(animation.on_path(key.time), (key.position, key.aim));
        }
        assert_eq!(animation.on_path(-3.0).0, animation.keys[0].position);
        assert_eq!(animation.on_path(99.0).0, animation.keys[3].position);
    }

    #[test]
    fn velocity_and_acceleration_are_continuous_at_keys() {
        let animation = path();
        let at = |time: f64, axis: usize| animation.on_path(time).0[axis];
        for (time, axis) in [(1.0, 0), (1.0, 1), (4.0, 0), (4.0, 2)] {
            let step = 1e-3;
            let left = (at(time, axis) - 2.0 * at(time - step, axis) + at(time - 2.0 * step, axis)) / (step * step);
            let right = (at(time + 2.0 * step, axis) - 2.0 * at(time + step, axis) + at(time, axis)) / (step * step);
            // Third derivatives are below 1000 m/s³ and one-sided differences are off by a step of them; f64 rounding
            // of 1e3 m over 1e-6 s² adds 1e-6.
            assert!((left - right).abs() < 2.0 * 1000.0 * step, "{time}: {left} {right}");
        }
    }

    #[test]
    fn orientation_never_leaves_the_range_of_the_two_keys_around_it() {
        let animation = path();
        for i in 0..500 {
            let time = f64::from(i) * 0.01;
            let Aim::Angles { yaw, pitch } = animation.on_path(time).1 else { panic!("an aim by angles") };
            let yaw = (yaw + 180.0).rem_euclid(360.0) - 180.0;
            let range = |a: f64, b: f64| (a.min(b) - 1e-9)..=(a.max(b) + 1e-9);
            let (yaws, pitches) = match time {
                t if t < 1.0 => (range(-10.0, 20.0), range(0.0, 30.0)),
                t if t < 4.0 => (range(20.0, 20.0), range(10.0, 30.0)),
                _ => (range(15.0, 20.0), range(10.0, 10.0)),
            };
            assert!(yaws.contains(&yaw) && pitches.contains(&pitch), "{time}: {yaw} {pitch}");
        }
    }

    #[test]
    fn keys_that_look_at_one_point_look_at_it_all_the_way() {
        let target = [10.0, 2000.0, -3000.0];
        let mut animation = path();
        animation.keys.iter_mut().for_each(|key| key.aim = Aim::LookAt(target));
        assert!((0..50).all(|i| animation.on_path(f64::from(i) * 0.1).1 == Aim::LookAt(target)));
    }

    #[test]
    fn shear_leans_columns_about_the_mean_that_carries_them() {
        let animation =
            Animation { wind: vec![[4.0, 0.0], [10.0, 2.0], [12.0, 4.0]], time: 10.0, ..Animation::default() };
        assert_eq!(animation.mean_wind(), [9.0, 2.0]);
        assert_eq!(animation.clouds().drift, [90.0, 20.0]);
        assert_eq!(animation.lean(), [[-1500.0, -600.0], [300.0, 0.0], [900.0, 600.0]]);
        assert!(Animation { wind: vec![[4.0, 0.0]], ..Animation::default() }.lean().is_empty());
    }

    #[test]
    fn phases_are_exact_and_repeat_after_256_lives() {
        let at = |lives: f64| CloudMotion { lives, ..CloudMotion::default() };
        assert_eq!([0.0, 0.5, 256.5].map(|lives| at(lives).phase()), [0, 1 << 23, 1 << 23]);
        assert_eq!(at(4.0).weather_phase(), 1 << 23);
    }
}
