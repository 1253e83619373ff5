//! Everything about one ball that does not depend on the source: points, weights, projections. Also the operator in f64.

use super::basis::{legendre, order_norm, rotation};
use super::grid::{Ray, impact_parameters, interpolation, shells, step_weights};
use crate::reference::monte_carlo::Medium;
use crate::reference::quadrature::gauss_legendre;
use crate::threads::parallel;
use std::f64::consts::PI;

/// How finely a ball is resolved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Highest degree of the directional expansion of the source.
    pub l_max: usize,
    /// Highest total angular momentum, i.e. degree in the sun's direction.
    pub j_max: usize,
    /// Number of shells.
    pub shells: usize,
    /// Optical depth between the outermost two shells.
    pub finest: f64,
    /// Largest angle between neighbouring directions on a shell [rad].
    pub gap: f64,
    /// Longest step along a ray [radii].
    pub step: f64,
}

impl Resolution {
    /// What the medium and the optical radius need; `detail` scales it (1 = full).
    pub fn for_medium(medium: &Medium, optical_radius: f64, detail: f64) -> Self {
        // The source is p_l times the radiance's moment; the directional tail left out is below these bounds.
        let g = medium.g.clamp(0.05, 0.95);
        let product = (medium.g * medium.g_sun).clamp(0.02, 0.9);
        let l = (1.5e-3f64.ln() / product.ln()).max(0.03f64.ln() / g.ln());
        let l_max = ((l * detail.sqrt()).ceil() as usize).clamp(4, 32);
        let octaves = (optical_radius / 0.5).log2().max(0.0);
        Self {
            l_max,
            j_max: (((l_max as f64 + 5.0 + 0.82 * octaves * octaves) * detail).round() as usize).max(l_max),
            shells: ((15.0 + 3.3 * octaves) * detail.sqrt()).round() as usize,
            finest: 0.02,
            gap: PI / (l_max as f64 + 4.0),
            step: 0.05 / detail,
        }
    }
}

/// A point on a ray.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// First of the four shells between which the source is interpolated.
    pub first: usize,
    /// Weights of the four.
    pub weights: [f64; 4],
    /// Cosine and sine of the angle from the radius vector to the direction.
    pub cos: f64,
    /// See `cos`.
    pub sin: f64,
    /// Attenuation over the step that ends here and weights of the source at its start, its end and a third point.
    pub step: [f64; 4],
    /// The third point, relative to this one (+1 or -2; 0 = none).
    pub third: i32,
}

/// Rays with their points, one after the other.
#[derive(Clone, Debug, Default)]
pub struct RaySet {
    /// First point and number of points of each ray.
    pub rays: Vec<(usize, usize)>,
    /// All points.
    pub points: Vec<Point>,
    /// Directional basis at each point, `lm_count` values each.
    pub basis: Vec<f64>,
    /// (shell, point) wherever a ray crosses a shell.
    pub crossings: Vec<(usize, usize)>,
}

impl RaySet {
    fn push(&mut self, ray: &Ray, radii: &[f64], optical_radius: f64, lm: &[(usize, usize)], l_max: usize) {
        let start = self.points.len();
        let tau = |k: usize| optical_radius * ray.x[k];
        for k in 0..ray.x.len() {
            let (r, mu) = ray.local(k);
            let (first, weights) = interpolation(radii, r);
            let (step, third) = if k == 0 {
                ([0.0; 4], 0)
            } else if k + 1 < ray.x.len() {
                (step_weights(tau(k) - tau(k - 1), Some(tau(k + 1) - tau(k - 1))), 1)
            } else if k >= 2 {
                (step_weights(tau(k) - tau(k - 1), Some(tau(k - 2) - tau(k - 1))), -2)
            } else {
                (step_weights(tau(k) - tau(k - 1), None), 0)
            };
            let sin = if r > 0.0 { (ray.b / r).min(1.0) } else { 0.0 };
            let table = legendre(mu, l_max, l_max);
            self.basis.extend(lm.iter().map(|&(l, m)| order_norm(m) * table[l][m]));
            if let Some(shell) = ray.shell[k] {
                self.crossings.push((shell, self.points.len()));
            }
            self.points.push(Point { first, weights, cos: mu, sin, step, third });
        }
        self.rays.push((start, ray.x.len()));
    }
}

/// One ball, ready to be solved for every total angular momentum.
pub struct Plan {
    /// Optical radius.
    pub optical_radius: f64,
    /// Resolution.
    pub resolution: Resolution,
    /// Radii of the shells.
    pub radii: Vec<f64>,
    /// (l, m) of each component, grouped by m.
    pub lm: Vec<(usize, usize)>,
    /// Rays that the iteration integrates along.
    pub inner: RaySet,
    /// Rays of the table's view angles.
    pub outer: RaySet,
    /// For each crossing of `inner`, weights that project the radiance there on each component.
    pub projection: Vec<f64>,
    /// Albedo times Legendre moments of an event between events.
    pub moments: Vec<f64>,
    /// The same for the event that meets the sun.
    pub sun_moments: Vec<f64>,
}

impl Plan {
    /// Prepares a ball; `view_mus` are the zenith cosines of the rays on which the radiance leaving is wanted.
    pub fn new(medium: &Medium, optical_radius: f64, resolution: Resolution, view_mus: &[f64]) -> Self {
        let Resolution { l_max, .. } = resolution;
        let radii = shells(optical_radius, resolution.shells, resolution.finest);
        let lm: Vec<(usize, usize)> = (0..=l_max).flat_map(|m| (m..=l_max).map(move |l| (l, m))).collect();
        let (mut inner, mut outer) = (RaySet::default(), RaySet::default());
        for b in impact_parameters(&radii, optical_radius, resolution.gap) {
            let ray = Ray::new(b, &radii, resolution.step);
            inner.push(&ray, &radii, optical_radius, &lm, l_max);
        }
        for mu in view_mus {
            let b = (1.0 - mu * mu).max(0.0).sqrt();
            outer.push(&Ray::new(b, &radii, resolution.step), &radii, optical_radius, &lm, l_max);
        }
        let projection = projection(&inner, radii.len(), &lm, l_max);
        let moments = |g| medium.phase.moments(g, l_max).into_iter().map(|p| p * medium.albedo).collect();
        Self {
            optical_radius,
            resolution,
            radii,
            inner,
            outer,
            projection,
            moments: moments(medium.g),
            sun_moments: moments(medium.g_sun),
            lm,
        }
    }

    /// Components with m <= j; they come first.
    pub fn components(&self, j: usize) -> usize {
        self.lm.iter().take_while(|(_, m)| *m <= j).count()
    }

    /// The first-event source of total angular momentum `j`: `[component][shell]`.
    ///
    /// `ϖ Σ_lm (-1)^l g_l y_lm(v) ... exp(-τ)`, with the beam's attenuation expanded in the sun's zenith angle.
    pub fn sun_source(&self, j: usize, beam: &Beam) -> Vec<f64> {
        let (n, components) = (self.radii.len(), self.components(j));
        let mut source = vec![0.0; components * n];
        let mut product = vec![0.0; beam.nodes];
        for (c, &(l, m)) in self.lm[..components].iter().enumerate() {
            let sign = if l % 2 == 0 { 1.0 } else { -1.0 };
            for (k, p) in product.iter_mut().enumerate() {
                *p = beam.legendre[k][l][m] * beam.legendre[k][j][m];
            }
            for i in 0..n {
                let row = &beam.attenuation[i * beam.nodes..(i + 1) * beam.nodes];
                let t: f64 = row.iter().zip(&product).map(|(a, b)| a * b).sum();
                source[c * n + i] = sign * self.sun_moments[l] * t;
            }
        }
        source
    }

    /// Source at the points of `rays` in the frame of each ray, `[point][n]` as (re, im), from `[component][shell]`.
    pub fn emit(&self, rays: &RaySet, j: usize, rotation: &[Vec<f64>], source: &[f64]) -> Vec<[f64; 2]> {
        let (n, lms, components) = (self.radii.len(), self.lm.len(), self.components(j));
        let width = j / 2 + 1;
        let mut out = vec![[0.0; 2]; rays.points.len() * width];
        let mut order = vec![0.0; j.min(self.resolution.l_max) + 1];
        for (p, point) in rays.points.iter().enumerate() {
            order.fill(0.0);
            for (c, &(_, m)) in self.lm[..components].iter().enumerate() {
                let s = &source[c * n + point.first..];
                let value: f64 = (0..4).map(|t| point.weights[t] * s[t]).sum();
                order[m] += rays.basis[p * lms + c] * value;
            }
            for (k, row) in rotation.iter().enumerate() {
                let (mut re, mut im) = (0.0, 0.0);
                for (m, a) in order.iter().enumerate() {
                    if m % 2 == 0 { re += row[m] * a } else { im += row[m] * a }
                }
                // e^{-i n α}: the frame of the ray instead of that of the radius.
                let (s, c) = ((j % 2 + 2 * k) as f64 * point.sin.atan2(point.cos)).sin_cos();
                out[p * width + k] = [re * c + im * s, im * c - re * s];
            }
        }
        out
    }

    /// Integrates along the rays, in place: source in, radiance at every point out.
    pub fn sweep(&self, rays: &RaySet, j: usize, field: &mut [[f64; 2]]) {
        let width = j / 2 + 1;
        for &(start, count) in &rays.rays {
            for k in 0..width {
                for part in 0..2 {
                    let source: Vec<f64> = (0..count).map(|q| field[(start + q) * width + k][part]).collect();
                    let mut radiance = 0.0;
                    field[start * width + k][part] = 0.0;
                    for q in 1..count {
                        let point = &rays.points[start + q];
                        let w = point.step;
                        radiance = w[0] * radiance + w[1] * source[q - 1] + w[2] * source[q];
                        if point.third != 0 {
                            radiance += w[3] * source[(q as i64 + i64::from(point.third)) as usize];
                        }
                        field[(start + q) * width + k][part] = radiance;
                    }
                }
            }
        }
    }

    /// Scatters the radiance at the crossings: `[component][shell]` of the next source.
    pub fn scatter(&self, j: usize, rotation: &[Vec<f64>], field: &[[f64; 2]]) -> Vec<f64> {
        let (n, lms, components) = (self.radii.len(), self.lm.len(), self.components(j));
        let width = j / 2 + 1;
        let mut out = vec![0.0; components * n];
        let mut order = vec![0.0; j.min(self.resolution.l_max) + 1];
        for (x, &(shell, p)) in self.inner.crossings.iter().enumerate() {
            let point = &self.inner.points[p];
            order.fill(0.0);
            for (k, row) in rotation.iter().enumerate() {
                let (s, c) = ((j % 2 + 2 * k) as f64 * point.sin.atan2(point.cos)).sin_cos();
                let [re, im] = field[p * width + k];
                let (re, im) = (re * c - im * s, im * c + re * s);
                for (m, a) in order.iter_mut().enumerate() {
                    *a += row[m] * if m % 2 == 0 { re } else { im };
                }
            }
            for (c, &(_, m)) in self.lm[..components].iter().enumerate() {
                out[c * n + shell] += self.projection[x * lms + c] * order[m];
            }
        }
        for (c, &(l, _)) in self.lm[..components].iter().enumerate() {
            out[c * n..(c + 1) * n].iter_mut().for_each(|v| *v *= self.moments[l]);
        }
        out
    }
}

/// The un-scattered beam on the shells: attenuation by zenith angle of the sun, times quadrature weights.
pub struct Beam {
    nodes: usize,
    /// `[shell][node]`, with 2π sinθ dθ.
    attenuation: Vec<f64>,
    /// `[node][l][m]` up to the largest J, m up to l_max.
    legendre: Vec<Vec<Vec<f64>>>,
}

impl Beam {
    /// Tabulates the beam for a plan.
    pub fn new(plan: &Plan) -> Self {
        let per_half = 48 + plan.resolution.j_max;
        let (x, w) = gauss_legendre(per_half);
        // θ = π/2 ± π/2 · sinh(a t)/sinh(a): dense at the edge of the shadow, which is 1/R wide.
        let a = (2.0 * plan.optical_radius).asinh().max(1e-3) * 0.8;
        let mut angles = Vec::new();
        for side in [-1.0, 1.0] {
            for (x, w) in x.iter().zip(&w) {
                let t = 0.5 * (1.0 + x);
                let slope = 0.5 * PI * a * (a * t).cosh() / a.sinh();
                angles.push((0.5 * PI + side * 0.5 * PI * (a * t).sinh() / a.sinh(), 0.5 * w * slope));
            }
        }
        let l = plan.resolution.j_max.max(plan.resolution.l_max);
        let legendre = angles.iter().map(|(t, _)| legendre(t.cos(), l, plan.resolution.l_max)).collect();
        let mut attenuation = Vec::with_capacity(plan.radii.len() * angles.len());
        for r in &plan.radii {
            for (theta, weight) in &angles {
                let (s, c) = theta.sin_cos();
                let root = (1.0 - r * r * s * s).max(0.0).sqrt();
                let path = if c > 0.0 { (1.0 - r * r) / (root + r * c) } else { root - r * c };
                attenuation.push(2.0 * PI * s * weight * (-plan.optical_radius * path).exp());
            }
        }
        Self { nodes: angles.len(), attenuation, legendre }
    }
}

/// Weighted least squares: the weights that give each component of the radiance on a shell from its crossings.
fn projection(rays: &RaySet, shells: usize, lm: &[(usize, usize)], l_max: usize) -> Vec<f64> {
    let lms = lm.len();
    let fit = l_max + 4;
    let mut on_shell = vec![Vec::new(); shells];
    for (x, &(shell, point)) in rays.crossings.iter().enumerate() {
        on_shell[shell].push((rays.points[point].cos, x));
    }
    on_shell.iter_mut().for_each(|nodes| nodes.sort_by(|a, b| a.0.total_cmp(&b.0)));
    let rows = parallel(shells, |shell| {
        let nodes = &on_shell[shell];
        let last = nodes.len() - 1;
        let share: Vec<f64> =
            (0..=last).map(|k| 0.5 * (nodes[(k + 1).min(last)].0 - nodes[k.saturating_sub(1)].0)).collect();
        let tables: Vec<_> = nodes.iter().map(|(mu, _)| legendre(*mu, fit, l_max)).collect();
        let mut rows = vec![0.0; nodes.len() * lms];
        for m in 0..=l_max {
            let size = fit + 1 - m;
            let y = |k: usize, a: usize| order_norm(m) * tables[k][m + a][m];
            let mut gram = vec![0.0; size * size];
            for (k, d) in share.iter().enumerate() {
                for a in 0..size {
                    for b in 0..size {
                        gram[a * size + b] += d * y(k, a) * y(k, b);
                    }
                }
            }
            let inverse = invert_positive(gram, size);
            for (k, d) in share.iter().enumerate() {
                for (c, _) in lm.iter().enumerate().filter(|(_, lm)| lm.1 == m) {
                    let a = lm[c].0 - m;
                    let sum: f64 = (0..size).map(|b| inverse[a * size + b] * y(k, b)).sum();
                    rows[k * lms + c] = d * sum;
                }
            }
        }
        rows
    });
    let mut result = vec![0.0; rays.crossings.len() * lms];
    for (nodes, rows) in on_shell.iter().zip(&rows) {
        for ((_, x), row) in nodes.iter().zip(rows.chunks_exact(lms)) {
            result[x * lms..][..lms].copy_from_slice(row);
        }
    }
    result
}

/// Inverse of a symmetric positive matrix (row major), lightly regularised; Gauss–Jordan.
fn invert_positive(mut a: Vec<f64>, n: usize) -> Vec<f64> {
    let trace: f64 = (0..n).map(|i| a[i * n + i]).sum::<f64>() / n as f64;
    let mut inverse = vec![0.0; n * n];
    for i in 0..n {
        a[i * n + i] += 1e-10 * trace;
        inverse[i * n + i] = 1.0;
    }
    for i in 0..n {
        let scale = 1.0 / a[i * n + i];
        for k in 0..n {
            a[i * n + k] *= scale;
            inverse[i * n + k] *= scale;
        }
        for r in (0..n).filter(|&r| r != i) {
            let factor = a[r * n + i];
            if factor != 0.0 {
                for k in 0..n {
                    a[r * n + k] -= factor * a[i * n + k];
                    inverse[r * n + k] -= factor * inverse[i * n + k];
                }
            }
        }
    }
    inverse
}

/// The rotation matrices of every degree up to `j_max`.
pub fn rotations(j_max: usize) -> Vec<Vec<Vec<f64>>> {
    (0..=j_max).map(rotation).collect()
}
