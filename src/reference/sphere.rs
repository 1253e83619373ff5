//! Geometry of rays in the unit ball, and the coordinates by which the scattering tables know them.

use glam::DVec3;

/// A ray of the tables: what the eye sees of a ball lit from one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayCoordinates {
    /// Scattering angle [rad], `cos = -dot(to_sun, to_eye)`; 0 looks into the sun.
    pub theta: f64,
    /// Azimuth about the ray from the side of the ball it runs on to the sun [rad], 0..=π.
    pub psi: f64,
    /// Cosine of the ray's zenith angle at its entry point; the chord is `2 mu`.
    pub mu: f64,
}

/// A ray into the unit ball with the direction to the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LitRay {
    /// Where the ray from the eye enters, on the unit sphere.
    pub entry: DVec3,
    /// Unit direction from the eye into the ball.
    pub dir: DVec3,
    /// Unit direction to the sun.
    pub to_sun: DVec3,
}

impl RayCoordinates {
    /// Coordinates of a ray. GLSL twin: `scattering_coordinates`.
    pub fn of(ray: &LitRay) -> Self {
        let mu = (-ray.entry.dot(ray.dir)).clamp(0.0, 1.0);
        let cos_theta = ray.to_sun.dot(ray.dir);
        let theta = ray.to_sun.cross(ray.dir).length().atan2(cos_theta);
        let side = ray.entry + mu * ray.dir;
        let sun = ray.to_sun - cos_theta * ray.dir;
        Self { theta, psi: side.cross(sun).length().atan2(side.dot(sun)), mu }
    }

    /// A ray with these coordinates (they fix it up to a rotation and a reflection of the whole).
    pub fn ray(&self) -> LitRay {
        let b = (1.0 - self.mu * self.mu).max(0.0).sqrt();
        let (st, ct) = self.theta.sin_cos();
        LitRay {
            entry: DVec3::new(b, 0.0, self.mu),
            dir: DVec3::NEG_Z,
            to_sun: DVec3::new(st * self.psi.cos(), st * self.psi.sin(), -ct),
        }
    }
}

/// Distance from a point of the unit ball along a unit direction to the surface.
pub fn distance_to_surface(point: DVec3, dir: DVec3) -> f64 {
    let b = point.dot(dir);
    let c = (1.0 - point.length_squared()).max(0.0);
    let root = (b * b + c).sqrt();
    // -b + root, without cancellation when b > 0.
    if b > 0.0 { c / (b + root) } else { root - b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_and_rays_are_inverse() {
        for theta in [0.1, 1.0, 2.0, 3.0] {
            for psi in [0.0, 0.7, 1.9, 3.1] {
                for mu in [0.05, 0.4, 0.9] {
                    let c = RayCoordinates { theta, psi, mu };
                    let back = RayCoordinates::of(&c.ray());
                    let error = (back.theta - theta).abs() + (back.psi - psi).abs() + (back.mu - mu).abs();
                    assert!(error < 1e-12, "{c:?} {back:?}");
                }
            }
        }
    }

    #[test]
    fn the_distance_ends_on_the_surface() {
        let point = DVec3::new(0.3, -0.5, 0.2);
        for dir in [DVec3::X, DVec3::NEG_Y, DVec3::new(0.6, 0.0, -0.8)] {
            assert!(((point + dir * distance_to_surface(point, dir)).length() - 1.0).abs() < 1e-14);
        }
    }
}
