//! The tables for other programs: plain arrays in C order with every axis named, and where the light goes.

use super::Tables;
use super::axes::{DENSITY_LEVELS, OpticalDepthShape, STEPS, ScatteringShape};
use crate::Result;
use crate::gpu::Frames;
use crate::reference::scattering::{
    directly_transmitted, multiple_scattering_model, opacity, single_fraction, single_scattering_model,
};

/// One axis of an exported table.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportAxis {
    /// Short name.
    pub name: &'static str,
    /// What it is, in a sentence.
    pub meaning: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// Coordinates in order: one list, or one for each optical radius.
    pub values: Vec<Vec<f64>>,
}

/// A table with its axes, the slowest first.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportTable {
    /// Name, also of the file.
    pub name: &'static str,
    /// What the values are.
    pub quantity: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// The axes.
    pub axes: Vec<ExportAxis>,
    /// Values in C order.
    pub values: Vec<f32>,
}

/// Where the light that meets a ball goes, as fractions of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyBalance {
    /// Optical radius of the ball.
    pub optical_radius: f64,
    /// Crosses without an event.
    pub transmitted: f64,
    /// Leaves after one event.
    pub single: f64,
    /// Leaves after two or more.
    pub multiple: f64,
}

impl EnergyBalance {
    /// Everything that leaves; 1 without absorption (and without truncation of the orders).
    pub fn total(&self) -> f64 {
        self.transmitted + self.single + self.multiple
    }
}

impl Tables {
    /// The energy balance of each density level.
    pub fn energy(&self) -> Vec<EnergyBalance> {
        let exported = |report: &&super::LevelReport| {
            (0..DENSITY_LEVELS).any(|level| density_level(level) == report.optical_radius)
        };
        let balance = |report: &super::LevelReport| EnergyBalance {
            optical_radius: report.optical_radius,
            transmitted: directly_transmitted(report.optical_radius),
            single: single_fraction(&self.params().medium, report.optical_radius),
            multiple: report.multiple,
        };
        self.reports().iter().filter(exported).map(balance).collect()
    }

    /// Reads the tables back: `optical_depth`, `first_matter`, `single`, `multiple`.
    pub fn export(&self, frames: &mut Frames) -> Result<Vec<ExportTable>> {
        let [mean, first] = optical_depth(self.optical_depth.shape(), &self.read_optical_depth(frames)?);
        let albedo = self.params().medium.albedo;
        let [single, multiple] = scattering(self.scattering.shape(), &self.read_scattering(frames)?, albedo);
        Ok(vec![mean, first, single, multiple])
    }
}

fn axis(name: &'static str, unit: &'static str, meaning: &'static str, values: Vec<f64>) -> ExportAxis {
    ExportAxis { name, meaning, unit, values: vec![values] }
}

/// `[phi_s][theta_s][phi_v][theta_v]` from the image's `[phi_v][theta_v · n + theta_s][phi_s]`.
fn optical_depth(shape: OpticalDepthShape, texels: &[[f32; 2]]) -> [ExportTable; 2] {
    let azimuths = |n: u32| (0..n).map(|i| OpticalDepthShape::azimuth(i, n)).collect();
    let axes = vec![
        axis(
            "phi_s",
            "rad",
            "azimuth of the entry point on the unit sphere about +y, from +x to +z",
            azimuths(shape.phi_s),
        ),
        axis(
            "theta_s",
            "rad",
            "zenith of the entry point, from +y",
            (0..shape.theta).map(|i| shape.theta_s(i)).collect(),
        ),
        axis(
            "phi_v",
            "rad",
            "azimuth of the ray's direction in the tangent plane of the entry point, from growing theta_s to growing phi_s",
            azimuths(shape.phi_v),
        ),
        axis(
            "theta_v",
            "rad",
            "zenith of the ray's direction, from the way to the centre; the chord is 2 cos(theta_v) radii",
            (0..shape.theta).map(|i| shape.theta_v(i)).collect(),
        ),
    ];
    let [n_s, n_t, n_v] = [shape.phi_s, shape.theta, shape.phi_v].map(|n| n as usize);
    let component = |c: usize| {
        let mut values = Vec::with_capacity(texels.len());
        for i in 0..n_s {
            for j in 0..n_t {
                for k in 0..n_v {
                    values.extend((0..n_t).map(|l| texels[(k * n_t * n_t + l * n_t + j) * n_s + i][c]));
                }
            }
        }
        values
    };
    [
        ExportTable {
            name: "optical_depth",
            quantity: "mean density along the chord, relative to the particle's; times sigma_t times the chord it is the \
                       optical depth",
            unit: "1",
            axes: axes.clone(),
            values: component(0),
        },
        ExportTable {
            name: "first_matter",
            quantity: "distance from the entry point to the first matter as a fraction of the chord, 1 where there is none",
            unit: "1",
            axes,
            values: component(1),
        },
    ]
}

/// Optical radius of a density level.
fn density_level(level: u32) -> f64 {
    ScatteringShape::optical_radius(level * STEPS)
}

/// `[theta][psi][mu][optical_radius]` from the image's `[level · n_mu + mu][psi][theta]`; models and opacity restored. Of the
/// levels, only the density levels.
fn scattering(shape: ScatteringShape, texels: &[[f32; 2]], albedo: f64) -> [ExportTable; 2] {
    let radii: Vec<f64> = (0..DENSITY_LEVELS).map(density_level).collect();
    let axes = vec![
        axis(
            "theta",
            "rad",
            "scattering angle: 0 when the eye looks into the sun, pi when the sun is behind it",
            (0..shape.theta).map(|i| shape.coordinates([i, 0, 0], 1.0).theta).collect(),
        ),
        axis(
            "psi",
            "rad",
            "azimuth of the sun about the ray, from the side of the sphere on which the ray runs; symmetric, so 0 to pi",
            (0..shape.psi).map(|j| shape.coordinates([0, j, 0], 1.0).psi).collect(),
        ),
        ExportAxis {
            name: "mu",
            meaning: "cosine of the zenith angle of the ray where the eye's ray enters the sphere: the chord is 2 mu \
                      radii, the impact parameter sqrt(1 - mu^2)",
            unit: "1",
            values: radii
                .iter()
                .map(|r| (0..shape.mu).map(|k| shape.coordinates([0, 0, k], *r).mu).collect())
                .collect(),
        },
        axis("optical_radius", "1", "sigma_t times density times radius of the homogeneous sphere", radii.clone()),
    ];
    let mut values = [Vec::with_capacity(texels.len()), Vec::with_capacity(texels.len())];
    for i in 0..shape.theta {
        for j in 0..shape.psi {
            for k in 0..shape.mu {
                for (level, &r) in radii.iter().enumerate() {
                    let c = shape.coordinates([i, j, k], r);
                    let texel = ((level as u32 * STEPS * shape.mu + k) * shape.psi + j) * shape.theta + i;
                    let [single, multiple] = texels[texel as usize].map(f64::from);
                    let (ray, opacity) = (c.ray(), opacity(2.0 * r * c.mu));
                    let single = (single + single_scattering_model(&ray, r)).max(0.0);
                    let multiple = (multiple * multiple_scattering_model(&ray, r)).max(0.0);
                    values[0].push((albedo * single * opacity) as f32);
                    values[1].push((multiple * opacity) as f32);
                }
            }
        }
    }
    let [single, multiple] = values;
    [
        ExportTable {
            name: "single",
            quantity: "single scattering without the phase function (Yusov, Eq. 9) leaving a homogeneous sphere towards the \
                       eye, for a parallel beam of unit irradiance: times p(theta) it is radiance",
            unit: "1",
            axes: axes.clone(),
            values: single,
        },
        ExportTable {
            name: "multiple",
            quantity: "radiance of light scattered twice or more leaving a homogeneous sphere towards the eye, for a \
                       parallel beam of unit irradiance",
            unit: "1/sr",
            axes,
            values: multiple,
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::scattering::single_scattering;

    #[test]
    fn exported_single_scattering_is_equation_9_at_its_own_coordinates() {
        // With nothing stored, what is exported is the closed-form model, which is within a few per cent of Eq. 9.
        let shape = ScatteringShape::COARSE;
        let [single, multiple] =
            scattering(shape, &vec![[0.0, 0.25]; shape.level_len() * crate::lut::axes::LEVELS as usize], 1.0);
        let length = |a: &ExportAxis| a.values[0].len();
        assert_eq!(single.axes.iter().map(length).product::<usize>(), single.values.len());
        let (theta, psi) = (&single.axes[0].values[0], &single.axes[1].values[0]);
        let (mus, radii) = (&single.axes[2].values, &single.axes[3].values[0]);
        for (i, j, k, level) in [(3, 5, 4, 2), (15, 23, 9, 7), (9, 12, 6, 5)] {
            let at = ((i * psi.len() + j) * mus[0].len() + k) * radii.len() + level;
            let c = crate::reference::sphere::RayCoordinates { theta: theta[i], psi: psi[j], mu: mus[level][k] };
            let truth = single_scattering(&c.ray(), radii[level]);
            assert!((f64::from(single.values[at]) - truth).abs() < 0.03 * truth.max(0.1), "{i} {j} {k} {level}");
            assert!(multiple.values[at] > 0.0);
        }
    }

    #[test]
    fn exported_optical_depth_is_transposed_to_the_order_of_its_axes() {
        let shape = OpticalDepthShape { phi_s: 3, theta: 4, phi_v: 5 };
        let mut texels = vec![[0.0; 2]; 3 * 16 * 5];
        let (i, j, k, l) = (2, 1, 3, 2);
        texels[(k * 16 + l * 4 + j) * 3 + i] = [1.0, 0.5];
        let [mean, first] = optical_depth(shape, &texels);
        let at = ((i * 4 + j) * 5 + k) * 4 + l;
        assert_eq!((mean.values[at], first.values[at]), (1.0, 0.5));
        assert_eq!(mean.values.iter().sum::<f32>(), 1.0);
    }
}
