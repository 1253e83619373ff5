//! Gauss–Legendre nodes and weights.

use std::f64::consts::PI;

/// Nodes in (-1, 1), ascending, and weights (sum 2) of the `n`-point rule; exact to degree 2n - 1.
pub fn gauss_legendre(n: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut nodes, mut weights) = (vec![0.0; n], vec![0.0; n]);
    for i in 0..n {
        let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..100 {
            let (mut p0, mut p1) = (1.0, x);
            for l in 2..=n {
                (p0, p1) = (p1, ((2 * l - 1) as f64 * x * p1 - (l - 1) as f64 * p0) / l as f64);
            }
            slope = n as f64 * (x * p1 - p0) / (x * x - 1.0);
            let step = p1 / slope;
            x -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        nodes[n - 1 - i] = x;
        weights[n - 1 - i] = 2.0 / ((1.0 - x * x) * slope * slope);
    }
    (nodes, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_polynomials_exactly() {
        let (x, w) = gauss_legendre(12);
        let integral: f64 = x.iter().zip(&w).map(|(x, w)| w * (x.powi(22) + x.powi(7) + 1.0)).sum();
        assert!((integral - 2.0 / 23.0 - 2.0).abs() < 1e-13);
    }
}
