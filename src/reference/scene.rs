//! Whole scenes of explicit particles, composited exactly in f64: what the cloud targets of a perfect blend mode hold.
//!
//! Every pixel's ray is cut by every ellipsoid, and the segments are integrated by
//! [`segments::exact`]. Homogeneous ellipsoids of constant colour (`style = "homogeneous"`,
//! `lighting = "flat"`) have segments in closed form; these are the scenes that the oracle covers.

use glam::{DQuat, DVec3};

use super::segments::{self, Segment};
use crate::params::{Camera, Clouds, Lighting, ParticleDesc, Source, Style};
use crate::shared::Particle;
use crate::{Error, Result};

/// A homogeneous ellipsoid of constant colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Centre [m].
    pub centre: DVec3,
    /// Semi-axes [m].
    pub semi_axes: DVec3,
    /// Local to world, unit length.
    pub rotation: DQuat,
    /// Extinction inside [1/m].
    pub extinction: f64,
    /// Radiance C of an opaque stretch.
    pub colour: [f64; 3],
}

impl Ellipsoid {
    /// What the device makes of `particle` in a medium of extinction `sigma_t` [1/m]; relative to the same origin.
    #[must_use]
    pub fn of_particle(particle: &Particle, sigma_t: f32) -> Self {
        Self {
            centre: DVec3::from_array(particle.centre.map(f64::from)),
            semi_axes: DVec3::from_array(particle.semi_axes.map(f64::from)),
            rotation: DQuat::from_array(particle.rotation.map(f64::from)).normalize(),
            extinction: f64::from(sigma_t) * f64::from(particle.density) * f64::from(particle.fade),
            colour: particle.colour.map(f64::from),
        }
    }

    /// The particle of a scene in a medium of extinction `sigma_t` [1/m].
    #[must_use]
    pub fn of_desc(desc: &ParticleDesc, sigma_t: f32) -> Self {
        Self {
            centre: DVec3::from_array(desc.centre),
            semi_axes: DVec3::from_array(desc.radii.map(f64::from)),
            rotation: DQuat::from_array(desc.rotation.map(f64::from)).normalize(),
            extinction: f64::from(sigma_t) * f64::from(desc.density),
            colour: desc.colour.map(f64::from),
        }
    }

    /// Squared distance of a ray from the centre, in the space where the ellipsoid is the unit ball: it hits below 1.
    #[must_use]
    pub fn closest_squared(&self, eye: DVec3, dir: DVec3) -> f64 {
        let (o, d) = self.in_unit_ball(eye, dir);
        (o - d * (o.dot(d) / d.dot(d))).length_squared()
    }

    fn in_unit_ball(&self, eye: DVec3, dir: DVec3) -> (DVec3, DVec3) {
        let inverse = self.rotation.inverse();
        (inverse * (eye - self.centre) / self.semi_axes, inverse * dir / self.semi_axes)
    }

    /// The stretch of the ray from `eye` along the unit vector `dir` that lies inside, before the distance `opaque` [m].
    #[must_use]
    pub fn segment(&self, eye: DVec3, dir: DVec3, opaque: f64) -> Option<Segment> {
        let (o, d) = self.in_unit_ball(eye, dir);
        let closest = -o.dot(d) / d.dot(d);
        let half_squared = (1.0 - (o + closest * d).length_squared()) / d.dot(d);
        if half_squared <= 0.0 {
            return None;
        }
        let t_enter = (closest - half_squared.sqrt()).max(0.0);
        let t_exit = (closest + half_squared.sqrt()).min(opaque);
        let optical_depth = self.extinction * (t_exit - t_enter);
        (t_exit > t_enter && optical_depth > 0.0).then_some(Segment {
            colour: self.colour,
            optical_depth,
            t_enter,
            t_exit,
        })
    }
}

/// One pixel of the cloud targets ([`CloudTargets`](crate::blend::CloudTargets)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPixel {
    /// In-scattered radiance [W m⁻² sr⁻¹].
    pub radiance: [f64; 3],
    /// Fraction of the light behind that comes through.
    pub transmittance: f64,
    /// Distance to the first cloud [m]; none where there is none.
    pub nearest: Option<f64>,
}

/// Ellipsoids, seen from anywhere.
#[derive(Clone, Debug)]
pub struct Scene {
    /// In any order: it does not matter.
    pub ellipsoids: Vec<Ellipsoid>,
}

impl Scene {
    /// The clouds of a scene.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for clouds that have no closed form: only explicit particles of constant density and colour.
    pub fn new(clouds: &Clouds) -> Result<Self> {
        match &clouds.source {
            Source::Particles(list) if clouds.lighting == Lighting::Flat && clouds.style == Style::Homogeneous => {
                let ellipsoids = list.iter().map(|desc| Ellipsoid::of_desc(desc, clouds.sigma_t)).collect();
                Ok(Self { ellipsoids })
            }
            _ => Err(Error::Unsupported {
                needed: "a scene other than particles of homogeneous style under flat lighting".into(),
                by: "the exact oracle".into(),
            }),
        }
    }

    /// What all ellipsoids cut out of the ray from `eye` along the unit vector `dir`, before the distance `opaque` [m].
    #[must_use]
    pub fn segments(&self, eye: DVec3, dir: DVec3, opaque: f64) -> Vec<Segment> {
        self.ellipsoids.iter().filter_map(|ellipsoid| ellipsoid.segment(eye, dir, opaque)).collect()
    }

    /// The exact integral along that ray.
    #[must_use]
    pub fn pixel(&self, eye: DVec3, dir: DVec3, opaque: f64) -> CloudPixel {
        let segments = self.segments(eye, dir, opaque);
        let composite = segments::exact(&segments);
        CloudPixel {
            radiance: composite.radiance,
            transmittance: composite.transmittance,
            nearest: segments.iter().map(|s| s.t_enter).min_by(f64::total_cmp),
        }
    }

    /// Cloud targets of `low` pixels (rows from the top) of a picture of `full` pixels: what a
    /// [`Renderer`](crate::renderer::Renderer) blends for it, where nothing opaque stands in the way.
    #[must_use]
    pub fn targets(&self, camera: &Camera, full: [u32; 2], low: [u32; 2]) -> Vec<CloudPixel> {
        let eye = DVec3::from_array(camera.position);
        let pixels = (0..low[1]).flat_map(|y| (0..low[0]).map(move |x| [x, y]));
        pixels.map(|pixel| self.pixel(eye, ray(camera, full, low, pixel), f64::INFINITY)).collect()
    }
}

/// Unit direction through the centre of `pixel` of an image of `low` pixels that shows a picture of `full` pixels.
#[must_use]
pub fn ray(camera: &Camera, full: [u32; 2], low: [u32; 2], pixel: [u32; 2]) -> DVec3 {
    let basis = camera.basis();
    let tangent = (camera.fov_y.to_radians() * 0.5).tan();
    let aspect = f64::from(full[0]) / f64::from(full[1]);
    let ndc = [0, 1].map(|i| (2.0 * f64::from(pixel[i]) + 1.0) / f64::from(low[i]) - 1.0);
    let [right, up, forward] = [basis.right, basis.up, basis.forward].map(DVec3::from_array);
    (forward + tangent * (aspect * ndc[0] * right - ndc[1] * up)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BALL: Ellipsoid = Ellipsoid {
        centre: DVec3::new(0.0, 0.0, -10.0),
        semi_axes: DVec3::new(2.0, 3.0, 4.0),
        rotation: DQuat::IDENTITY,
        extinction: 0.25,
        colour: [1.0, 0.5, 0.0],
    };

    #[test]
    fn a_ray_through_the_middle_is_cut_at_the_poles_and_by_what_is_opaque() {
        let segment = BALL.segment(DVec3::ZERO, DVec3::NEG_Z, f64::INFINITY).unwrap();
        assert_eq!((segment.t_enter, segment.t_exit, segment.optical_depth), (6.0, 14.0, 2.0));
        let cut = BALL.segment(DVec3::ZERO, DVec3::NEG_Z, 8.0).unwrap();
        assert_eq!((cut.t_exit, cut.optical_depth), (8.0, 0.5));
        let inside = BALL.segment(BALL.centre, DVec3::Y, f64::INFINITY).unwrap();
        assert_eq!((inside.t_enter, inside.t_exit), (0.0, 3.0));
        assert_eq!(BALL.segment(DVec3::ZERO, DVec3::Z, f64::INFINITY), None);
        assert_eq!(BALL.segment(DVec3::ZERO, DVec3::NEG_Z, 5.0), None);
    }

    #[test]
    fn turning_ellipsoid_and_ray_together_changes_nothing() {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
        let turned = Ellipsoid { centre: turn * BALL.centre, rotation: turn * BALL.rotation, ..BALL };
        let dir = DVec3::new(0.05, 0.1, -1.0).normalize();
        let (a, b) = (BALL.segment(DVec3::ZERO, dir, 1e9), turned.segment(DVec3::ZERO, turn * dir, 1e9));
        let (a, b) = (a.unwrap(), b.unwrap());
        assert!((a.t_enter - b.t_enter).abs() < 1e-12 && (a.optical_depth - b.optical_depth).abs() < 1e-12);
    }

    #[test]
    fn only_scenes_in_closed_form_are_taken() {
        assert!(Scene::new(&Clouds::default()).unwrap_err().to_string().contains("homogeneous"));
        let clouds = Clouds {
            source: Source::Particles(vec![ParticleDesc::default()]),
            lighting: Lighting::Flat,
            style: Style::Homogeneous,
            ..Clouds::default()
        };
        assert_eq!(Scene::new(&clouds).unwrap().ellipsoids.len(), 1);
    }
}
