//! Spherical harmonics of two frames, and the rotation between them.
//!
//! For fixed degree J a field on the sphere of sun directions that is even under reflection in the plane of a ray can be
//! written in a frame whose axis is the radius vector (functions R_m, m = 0..=J, all cosines) or in one whose axis is the
//! normal of that plane (functions N_n, n = J, J-2, ..., cosines and sines). Moving along the ray turns the second frame
//! about its own axis, which only changes phases; scattering is diagonal in the first.

use std::f64::consts::PI;

/// Normalised associated Legendre functions of one argument: `∫ P̄_lm² dx = 1 / 2π`, no Condon–Shortley phase.
///
/// `table[l][m]` for `m <= l <= l_max` and `m <= m_max`.
pub fn legendre(x: f64, l_max: usize, m_max: usize) -> Vec<Vec<f64>> {
    let s = (1.0 - x * x).max(0.0).sqrt();
    let mut table: Vec<Vec<f64>> = (0..=l_max).map(|l| vec![0.0; l.min(m_max) + 1]).collect();
    let mut diagonal = (0.25 / PI).sqrt();
    for m in 0..=m_max.min(l_max) {
        if m > 0 {
            diagonal *= s * ((2 * m + 1) as f64 / (2 * m) as f64).sqrt();
        }
        table[m][m] = diagonal;
        let mut below = 0.0;
        for l in m + 1..=l_max {
            let (lf, mf) = (l as f64, m as f64);
            let a = ((4.0 * lf * lf - 1.0) / (lf * lf - mf * mf)).sqrt();
            let b = (((lf - 1.0) * (lf - 1.0) - mf * mf) / (4.0 * (lf - 1.0) * (lf - 1.0) - 1.0)).max(0.0).sqrt();
            let value = a * (x * table[l - 1][m] - b * below);
            below = table[l - 1][m];
            table[l][m] = value;
        }
    }
    table
}

/// 1 for order 0, √2 for others: makes cosines and sines of equal norm.
pub fn order_norm(m: usize) -> f64 {
    if m == 0 { 1.0 } else { std::f64::consts::SQRT_2 }
}

/// The orthogonal matrix from R_m to N_n for degree `j`: entry `[k][m]` with `n = j % 2 + 2 k`.
///
/// Even m meet only the cosines of N_n, odd m only the sines. Both sets are compared on the great circle in the plane of
/// the ray, where R_m is an associated Legendre function of the angle and N_n a cosine or sine times a constant.
pub fn rotation(j: usize) -> Vec<Vec<f64>> {
    let samples = 2 * j + 4;
    let equator = legendre(0.0, j, j);
    let mut matrix = vec![vec![0.0; j + 1]; j / 2 + 1];
    for i in 0..samples {
        let gamma = 2.0 * PI * i as f64 / samples as f64;
        let circle = legendre(gamma.cos(), j, j);
        for (k, row) in matrix.iter_mut().enumerate() {
            let n = j % 2 + 2 * k;
            let (sin, cos) = (n as f64 * gamma).sin_cos();
            // Fourier coefficient: mean for n = 0, twice the mean times cos or sin otherwise.
            let scale = (if n == 0 { 1.0 } else { 2.0 }) / (samples as f64 * order_norm(n) * equator[j][n]);
            for (m, entry) in row.iter_mut().enumerate() {
                // Beyond half a turn the azimuth about the radius is π, which gives the sign (-1)^m.
                let sign = if m % 2 == 1 && gamma.sin() < 0.0 { -1.0 } else { 1.0 };
                *entry += scale * sign * order_norm(m) * circle[j][m] * if m % 2 == 0 { cos } else { sin };
            }
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rotation_is_orthogonal() {
        for j in [0, 1, 2, 7, 30, 64] {
            let matrix = rotation(j);
            for a in 0..=j {
                for b in 0..=j {
                    if a % 2 != b % 2 {
                        continue; // cosines against sines: orthogonal by kind
                    }
                    let dot: f64 = matrix.iter().map(|row| row[a] * row[b]).sum();
                    assert!((dot - f64::from(u8::from(a == b))).abs() < 1e-9, "{j} {a} {b} {dot}");
                }
            }
        }
    }

    #[test]
    fn the_rotation_carries_one_basis_into_the_other_off_the_plane_too() {
        // A direction in the frame of the radius r and t (in plane) and normal n.
        let (r, t, n) = (0.36f64, 0.48f64, 0.8f64);
        for j in [1usize, 4, 9] {
            let matrix = rotation(j);
            let about_radius = legendre(r, j, j);
            let about_normal = legendre(n, j, j);
            let (phi, gamma) = (n.atan2(t), t.atan2(r));
            for m in 0..=j {
                let left = order_norm(m) * about_radius[j][m] * (m as f64 * phi).cos();
                let right: f64 = (matrix.iter().enumerate())
                    .map(|(k, row)| {
                        let n = j % 2 + 2 * k;
                        let (sin, cos) = (n as f64 * gamma).sin_cos();
                        row[m] * order_norm(n) * about_normal[j][n] * if m % 2 == 0 { cos } else { sin }
                    })
                    .sum();
                assert!((left - right).abs() < 1e-12, "{j} {m}: {left} {right}");
            }
        }
    }
}
