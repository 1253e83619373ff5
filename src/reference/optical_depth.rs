//! Density profiles and optical depth of the reference particle in f64. GLSL twins: `glsl/lut/profile.glsl`,
//! `glsl/lut/optical_depth.comp`.

use super::forward::opacity_share;
use crate::params::{Splat, Style};
use glam::{DVec3, IVec3};

fn hash(cell: IVec3, seed: u32) -> [u32; 3] {
    let step = |v: u32| v.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let mut v = [
        step((cell.x as u32).wrapping_add(seed.wrapping_mul(0x9e37_79b9))),
        step((cell.y as u32).wrapping_add(seed)),
        step((cell.z as u32).wrapping_add(!seed)),
    ];
    let mix = |v: &mut [u32; 3]| {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[2]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
    };
    mix(&mut v);
    v.iter_mut().for_each(|v| *v ^= *v >> 16);
    mix(&mut v);
    v.map(|v| v >> 8)
}

const UNIT: f64 = 1.0 / 16_777_216.0;

fn value_noise(p: DVec3, seed: u32) -> f64 {
    let cell = p.floor();
    let f = (p - cell).map(|f| f * f * f * (f * (f * 6.0 - 15.0) + 10.0));
    let mut sum = 0.0;
    for k in 0..8 {
        let corner = IVec3::new(k & 1, (k >> 1) & 1, k >> 2);
        let weight: f64 = (0..3).map(|a| if corner[a] == 1 { f[a] } else { 1.0 - f[a] }).product();
        sum += weight * f64::from(hash(cell.as_ivec3() + corner, seed)[0]);
    }
    sum * UNIT
}

fn fbm(mut p: DVec3, seed: u32) -> f64 {
    let (mut sum, mut amplitude) = (0.0, 8.0 / 15.0);
    for octave in 0..4 {
        sum += amplitude * value_noise(p, seed.wrapping_add(octave));
        p *= 2.17;
        amplitude *= 0.5;
    }
    sum
}

fn billow(p: DVec3, seed: u32) -> f64 {
    let base = p.floor().as_ivec3();
    let mut nearest = f64::MAX;
    for k in 0..27 {
        let cell = base + IVec3::new(k % 3, (k / 3) % 3, k / 9) - 1;
        let jitter = DVec3::from_array(hash(cell, seed).map(|v| f64::from(v) * UNIT));
        nearest = nearest.min((p - cell.as_dvec3() - jitter).length_squared());
    }
    (1.0 - nearest / 0.75).max(0.0)
}

fn depth(direction: DVec3, seed: u32) -> f64 {
    0.42 * (0.50 * (1.0 - billow(direction * 1.6 + 11.3, seed))
        + 0.31 * (1.0 - billow(direction * 3.7 + 5.1, seed.wrapping_add(1)))
        + 0.19 * (1.0 - billow(direction * 8.3 + 2.7, seed.wrapping_add(2))))
}

/// Density at a point of the unit ball, 0..=1.
pub fn profile_density(p: DVec3, style: Style, seed: u32) -> f64 {
    let r2 = p.length_squared();
    if r2 > 1.0 {
        return 0.0;
    }
    let r = r2.sqrt();
    let rim = ((1.0 - r) * 25.0).clamp(0.0, 1.0);
    match style {
        Style::Homogeneous => 1.0,
        Style::Gaussian => opacity_share(r2, Splat::Gaussian),
        Style::Polynomial => opacity_share(r2, Splat::Polynomial),
        Style::Radial => rim * (1.6 * (1.0 - r2) + 1.4 * (fbm(p * 2.3 + 7.7, seed) - 0.5)).clamp(0.0, 1.0),
        Style::Threshold => rim * (6.0 * (fbm(p * 2.6 + 3.1, seed) - (0.18 + 0.42 * r2))).clamp(0.0, 1.0),
        Style::Pyroclastic => {
            let direction = if r > 1e-6 { p / r } else { DVec3::Y };
            ((1.0 - r - depth(direction, seed)) * 22.0).clamp(0.0, 1.0)
        }
    }
}

/// Mean density along the chord of a ray that enters the unit ball at `entry` along `dir`, by the midpoint rule.
pub fn mean_density(entry: DVec3, dir: DVec3, style: Style, seed: u32, steps: u32) -> f64 {
    let chord = 2.0 * (-entry.dot(dir)).max(0.0);
    let at = |k: u32| entry + dir * chord * (f64::from(k) + 0.5) / f64::from(steps);
    (0..steps).map(|k| profile_density(at(k), style, seed)).sum::<f64>() / f64::from(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn puffs_of_the_papers_have_the_closed_forms_of_their_chords() {
        use glam::DVec3;
        // Half of ∫ (b² + t²)^(3/2) dt over the chord, whose ends have b² + t² = 1.
        let cubes = |b: f64, h: f64| 0.25 * h + 0.375 * b * b * h + 0.375 * b.powi(4) * (h / b).asinh();
        for b in [0.05f64, 0.3, 0.6, 0.95] {
            let h = (1.0 - b * b).sqrt();
            let polynomial = h - 3.0 * (b * b * h + h.powi(3) / 3.0) + 2.0 * cubes(b, h);
            let mean = |style| mean_density(DVec3::new(b, 0.0, -h), DVec3::Z, style, 0, 2000);
            // The midpoint rule: (2 h / 2000)² / 24 times a second derivative below 12.
            assert!((mean(Style::Polynomial) - polynomial / h).abs() < 1e-6, "{b}");
            // √(π/8) e^(-2 b²) erf(√2 h) by the series of erf.
            let x = std::f64::consts::SQRT_2 * h;
            let mut term = x;
            let mut erf = x;
            for n in 1..60 {
                term *= -x * x / f64::from(n);
                erf += term / f64::from(2 * n + 1);
            }
            erf *= 2.0 / std::f64::consts::PI.sqrt();
            let rim = (-2.0f64).exp();
            let gaussian = (std::f64::consts::PI / 8.0).sqrt() * (-2.0 * b * b).exp() * erf - h * rim;
            assert!((mean(Style::Gaussian) - gaussian / (h * (1.0 - rim))).abs() < 1e-6, "{b}");
        }
    }

    #[test]
    fn particles_are_compact_and_mostly_full_in_every_style() {
        for (style, least) in
            [(Style::Homogeneous, 0.99), (Style::Pyroclastic, 0.4), (Style::Radial, 0.3), (Style::Threshold, 0.3)]
        {
            for seed in 0..4 {
                let n = 24;
                let (mut sum, mut count) = (0.0, 0);
                for i in 0..n * n * n {
                    let p = (DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) + 0.5) * 2.0 / n as f64
                        - 1.0;
                    if p.length() < 1.0 {
                        let density = profile_density(p, style, seed);
                        assert!((0.0..=1.0).contains(&density));
                        sum += density;
                        count += 1;
                    }
                }
                let fill = sum / f64::from(count);
                assert!(fill > least, "{style:?} {seed}: {fill}");
                let centre = profile_density(DVec3::ZERO, style, seed);
                assert!(centre > 0.9, "{style:?} {seed}: hollow, {centre}");
            }
        }
    }
}
