//! The solver of `lut::transport` in f64 on the CPU: oracle of the device's passes.

use super::monte_carlo::{Medium, parallel};
use super::sphere::RayCoordinates;
use crate::lut::transport::basis::{legendre, order_norm};
use crate::lut::transport::krylov::{Convergence, Gmres};
use crate::lut::transport::plan::{Beam, Plan, Resolution, rotations};
use std::f64::consts::PI;

/// Radiance leaving a ball.
pub struct Solution {
    j_max: usize,
    /// `[view][j][k]` of the ray frame, multiple scattering only.
    field: Vec<Vec<Vec<[f64; 2]>>>,
    /// Work done per J.
    pub convergence: Vec<Convergence>,
}

/// Solves a ball for the view rays given by their zenith cosines. `orders`: stop after that many events.
pub fn solve(
    medium: &Medium,
    optical_radius: f64,
    resolution: Resolution,
    mus: &[f64],
    orders: Option<u32>,
) -> Solution {
    let plan = Plan::new(medium, optical_radius, resolution, mus);
    let beam = Beam::new(&plan);
    let rotations = rotations(resolution.j_max);
    let per_j = parallel(resolution.j_max + 1, |j| {
        let rotation = &rotations[j];
        let apply = |source: &[f64]| {
            let mut field = plan.emit(&plan.inner, j, rotation, source);
            plan.sweep(&plan.inner, j, &mut field);
            plan.scatter(j, rotation, &field)
        };
        let second = apply(&plan.sun_source(j, &beam));
        let (source, convergence) = match orders {
            None => {
                let mut gmres = Gmres::new(&second, 1e-5, 40);
                while let Some(v) = gmres.request() {
                    let applied = apply(v);
                    gmres.supply(&applied, &second);
                }
                gmres.finish()
            }
            Some(n) => {
                let (mut sum, mut term) = (second.clone(), second);
                for _ in 3..=n {
                    term = apply(&term);
                    sum.iter_mut().zip(&term).for_each(|(s, t)| *s += t);
                }
                (sum, Convergence { applications: n as usize, residual: 0.0 })
            }
        };
        let mut field = plan.emit(&plan.outer, j, rotation, &source);
        plan.sweep(&plan.outer, j, &mut field);
        let width = j / 2 + 1;
        let views: Vec<Vec<[f64; 2]>> = (plan.outer.rays.iter())
            .map(|&(start, count)| field[(start + count - 1) * width..][..width].to_vec())
            .collect();
        (views, convergence)
    });
    let convergence = per_j.iter().map(|(_, c)| *c).collect();
    let field = (0..mus.len()).map(|v| per_j.iter().map(|(views, _)| views[v].clone()).collect()).collect();
    Solution { j_max: resolution.j_max, field, convergence }
}

impl Solution {
    /// Radiance [1/sr] on view ray `view` for a sun in the direction of the coordinates.
    pub fn radiance(&self, view: usize, c: &RayCoordinates) -> f64 {
        // In the frame of the ray (direction of travel v, side y, normal n): sun = -cosΘ v + sinΘ (cosψ y + sinψ n).
        let (along, side, normal) = (-c.theta.cos(), c.theta.sin() * c.psi.cos(), c.theta.sin() * c.psi.sin());
        let gamma = (-side).atan2(along);
        let table = legendre(normal, self.j_max, self.j_max);
        let mut sum = 0.0;
        for (j, row) in self.field[view].iter().enumerate() {
            for (k, [re, im]) in row.iter().enumerate() {
                let n = j % 2 + 2 * k;
                let (sin, cos) = (n as f64 * gamma).sin_cos();
                sum += order_norm(n) * table[j][n] * (re * cos + im * sin);
            }
        }
        sum
    }

    /// Mean over all sun directions of the radiance on a view ray [1/sr].
    pub fn mean_radiance(&self, view: usize) -> f64 {
        self.field[view][0][0][0] / (4.0 * PI).sqrt()
    }
}
