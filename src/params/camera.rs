//! The pinhole camera.

use super::check;
use crate::{Error, Result};

/// A pinhole camera: rays through pixel centres, row 0 at the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position [m]; `[1]` is the altitude above sea level. Default 0, 500, 0: over open ground, below the clouds.
    pub position: [f64; 3],
    /// Where it looks. Default yaw 0, pitch 8.
    pub aim: Aim,
    /// Vertical field of view [degrees], above 0 and below 180. Default 60.
    pub fov_y: f64,
}

/// The direction of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// By angles [degrees]: yaw 0 looks along −z (north) and grows towards +x (east), pitch grows upwards.
    Angles {
        /// Compass direction [degrees].
        yaw: f64,
        /// Angle above the horizontal [degrees], −90 to 90.
        pitch: f64,
    },
    /// At a point [m] other than the camera's position. Straight up or down, the picture's top is turned as yaw 0 turns it.
    LookAt([f64; 3]),
}

/// A right-handed orthonormal camera frame in world axes: `right × up = −forward`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis {
    /// Towards the right edge of the picture.
    pub right: [f64; 3],
    /// Towards the top edge of the picture.
    pub up: [f64; 3],
    /// Into the picture.
    pub forward: [f64; 3],
}

impl Default for Camera {
    fn default() -> Self {
        Self { position: [0.0, 500.0, 0.0], aim: Aim::Angles { yaw: 0.0, pitch: 8.0 }, fov_y: 60.0 }
    }
}

impl Camera {
    /// The camera's frame. A [`Aim::LookAt`] at the camera itself, which [`Camera::validate`] refuses, looks north.
    #[must_use]
    pub fn basis(&self) -> Basis {
        let (yaw, pitch) = self.yaw_pitch();
        let ((sin_yaw, cos_yaw), (sin_pitch, cos_pitch)) = (yaw.sin_cos(), pitch.sin_cos());
        Basis {
            right: [cos_yaw, 0.0, sin_yaw],
            up: [-sin_pitch * sin_yaw, cos_pitch, sin_pitch * cos_yaw],
            forward: [cos_pitch * sin_yaw, sin_pitch, -cos_pitch * cos_yaw],
        }
    }

    /// Unit direction of the ray through the centre of pixel (`x`, `y`) of a picture of `width` by `height` pixels.
    #[must_use]
    pub fn ray(&self, x: u32, y: u32, width: u32, height: u32) -> [f64; 3] {
        let Basis { right, up, forward } = self.basis();
        let half_height = (self.fov_y.to_radians() * 0.5).tan();
        let half_width = half_height * f64::from(width) / f64::from(height);
        let across = ((f64::from(x) + 0.5) / f64::from(width) * 2.0 - 1.0) * half_width;
        let upwards = (1.0 - (f64::from(y) + 0.5) / f64::from(height) * 2.0) * half_height;
        let scale = (1.0 + across * across + upwards * upwards).sqrt().recip();
        std::array::from_fn(|i| (forward[i] + across * right[i] + upwards * up[i]) * scale)
    }

    /// Yaw and pitch [radians], whichever way the aim is given.
    pub(super) fn yaw_pitch(&self) -> (f64, f64) {
        match self.aim {
            Aim::Angles { yaw, pitch } => (yaw.to_radians(), pitch.to_radians()),
            Aim::LookAt(target) => {
                let [x, y, z]: [f64; 3] = std::array::from_fn(|i| target[i] - self.position[i]);
                let horizontal = x.hypot(z);
                let yaw = if horizontal > 0.0 { x.atan2(-z) } else { 0.0 };
                (yaw, y.atan2(horizontal))
            }
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        self.validate_as("camera")
    }

    /// As [`Self::validate`], for the camera that errors call `name`.
    pub(super) fn validate_as(&self, name: &str) -> Result<()> {
        let field = |key: &str| format!("{name}.{key}");
        let coordinates = -check::MAX_COORDINATE..=check::MAX_COORDINATE;
        check::each_within(&field("position"), self.position, coordinates.clone(), "m")?;
        match self.aim {
            Aim::Angles { yaw, pitch } => {
                check::within(&field("yaw"), yaw, -1.0e6..=1.0e6, "degrees")?;
                check::within(&field("pitch"), pitch, -90.0..=90.0, "degrees")?;
            }
            Aim::LookAt(target) => {
                check::each_within(&field("look_at"), target, coordinates, "m")?;
                let away = (0..3).map(|i| (target[i] - self.position[i]).abs()).fold(0.0, f64::max);
                if away < 1.0e-6 {
                    let expected = format!("a point other than {name}.position");
                    return Err(Error::invalid(field("look_at"), format!("{target:?}"), expected));
                }
            }
        }
        check::within(&field("fov_y"), self.fov_y, 0.1..=170.0, "degrees")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EPS: f64 = 1e-12; // A few f64 roundings of numbers near 1.

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|i| a[i] * b[i]).sum()
    }

    fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    }

    fn assert_close(a: [f64; 3], b: [f64; 3]) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < EPS), "{a:?} is not {b:?}");
    }

    fn aimed(yaw: f64, pitch: f64) -> Camera {
        Camera { aim: Aim::Angles { yaw, pitch }, ..Camera::default() }
    }

    #[test]
    fn yaw_is_a_compass_angle_and_pitch_looks_up() {
        assert_close(aimed(0.0, 0.0).basis().forward, [0.0, 0.0, -1.0]);
        assert_close(aimed(90.0, 0.0).basis().forward, [1.0, 0.0, 0.0]);
        assert_close(aimed(180.0, 0.0).basis().forward, [0.0, 0.0, 1.0]);
        assert_close(aimed(0.0, 90.0).basis().forward, [0.0, 1.0, 0.0]);
        assert_close(aimed(0.0, 0.0).basis().right, [1.0, 0.0, 0.0]);
        assert_close(aimed(37.0, 0.0).basis().up, [0.0, 1.0, 0.0]);
    }

    #[test]
    fn the_basis_is_orthonormal_and_right_handed() {
        for (yaw, pitch) in [(0.0, 0.0), (33.0, -70.0), (200.0, 45.0), (-90.0, 90.0)] {
            let Basis { right, up, forward } = aimed(yaw, pitch).basis();
            for axis in [right, up, forward] {
                assert!((dot(axis, axis) - 1.0).abs() < EPS);
            }
            assert!(dot(right, up).abs() < EPS && dot(right, forward).abs() < EPS);
            assert_close(cross(right, up), forward.map(|c| -c));
        }
    }

    #[test]
    fn look_at_aims_at_its_target() {
        let position = [100.0, 500.0, -20.0];
        for target in [[400.0, 900.0, -20.0], [100.0, 500.0, 80.0], [-3.0, 2.0, 1.0], [100.0, 900.0, -20.0]] {
            let camera = Camera { position, aim: Aim::LookAt(target), fov_y: 60.0 };
            let to_target: [f64; 3] = std::array::from_fn(|i| target[i] - position[i]);
            let length = dot(to_target, to_target).sqrt();
            assert_close(camera.basis().forward, to_target.map(|c| c / length));
            camera.validate().unwrap();
        }
    }

    #[test]
    fn rays_go_through_pixel_centres_with_row_0_at_the_top() {
        let camera = Camera { fov_y: 90.0, ..aimed(0.0, 0.0) };
        assert_close(camera.ray(1, 1, 3, 3), [0.0, 0.0, -1.0]);
        // The centre of the top row of two is half-way between the axis and the 45° edge.
        let length = 1.25_f64.sqrt();
        assert_close(camera.ray(0, 0, 1, 2), [0.0, 0.5 / length, -1.0 / length]);
        assert!(camera.ray(2, 1, 3, 3)[0] > 0.0);
    }
}
