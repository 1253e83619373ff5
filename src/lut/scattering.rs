//! The scattering table on the device (Yusov 4.2, 4.3): solve for every second level of optical radius and fill its
//! texels; then fill the levels between.

use super::axes::{LEVELS, ScatteringShape};
use super::transport::basis::{legendre, order_norm};
use super::transport::device::{DevicePlan, Pipelines};
use super::transport::krylov::Gmres;
use super::transport::plan::{Beam, Plan, Resolution, rotations};
use crate::Result;
use crate::gpu::{Buffer, ComputePipeline, Frames, Gpu, Image, ImageDesc, Sampled, Sampler};
use crate::reference::monte_carlo::Medium;
use crate::shaders::{lut_scattering_between_comp as between, lut_scattering_comp as fill};
use crate::threads::parallel;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Total angular momenta below this are solved on the host in f64: they converge slowest, feel rounding most, and are
/// so small that the device would only wait.
const HOST_J: usize = 4;

/// Residual at which a solution counts as converged, relative to the source of second events. The scattered energy then
/// errs by less than 1e-3 even at the largest optical radius (measured: docs/tables.md). Diffusion, which makes the error
/// larger than the residual, is a matter of low total angular momenta: for others thirty times this is enough.
fn tolerance(j: usize) -> f64 {
    3e-5 * (j as f64 / 4.0).powi(2).clamp(1.0, 30.0)
}

/// Applications after which an iteration starts anew from where it is. The slowest, at the largest optical radius, need
/// some 60 in one go and 100 if interrupted after 40.
const RESTART: usize = 80;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct FillPush {
    point_count: u32,
    terms: u32,
    level: u32,
    optical_radius: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct BetweenPush {
    levels: [u32; 4],
    weights: [f32; 4],
    level: u32,
    pad: [u32; 3],
}

/// What was found out while solving a level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelReport {
    /// Optical radius of the level.
    pub optical_radius: f64,
    /// How often the operator was applied, at most over all total angular momenta.
    pub applications: f64,
    /// Largest final residual, relative.
    pub residual: f64,
    /// Fraction of the light that meets the ball which leaves it after two or more events.
    pub multiple: f64,
}

impl LevelReport {
    pub(crate) const BYTES: usize = 32;

    pub(crate) fn to_bytes(self) -> Vec<u8> {
        [self.optical_radius, self.applications, self.residual, self.multiple]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect()
    }

    pub(crate) fn from_bytes(bytes: &[u8]) -> Self {
        let [optical_radius, applications, residual, multiple] =
            [0, 1, 2, 3].map(|i| f64::from_le_bytes(std::array::from_fn(|k| bytes[8 * i + k])));
        Self { optical_radius, applications, residual, multiple }
    }
}

/// The table of both kinds of scattering.
pub struct ScatteringTable {
    shape: ScatteringShape,
    table: Image,
}

impl ScatteringTable {
    /// An empty table.
    pub fn new(gpu: &Arc<Gpu>, shape: ScatteringShape) -> Result<Self> {
        let usage = vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED;
        let (extent, format) = (shape.image_extent(), vk::Format::R16G16_SFLOAT);
        let table = Image::new(gpu, &ImageDesc { name: "scattering table", extent, format, usage })?;
        Ok(Self { shape, table })
    }

    /// The table with the sampler that `scattering_lookup.glsl` needs.
    pub fn sampled(&self) -> Sampled<'_> {
        self.table.sampled(Sampler::LinearClamp)
    }

    /// The image that holds it.
    pub fn image(&self) -> &Image {
        &self.table
    }

    /// Its shape.
    pub fn shape(&self) -> ScatteringShape {
        self.shape
    }

    /// Solves the levels that are to be solved and fills the table. `orders`: stop after that many events instead of converging. `detail`
    /// scales the resolution (1 = full). `progress` is told the fraction done and may stop the build, which then returns
    /// `None`.
    pub fn build(
        &self,
        frames: &mut Frames,
        medium: &Medium,
        orders: Option<u32>,
        detail: f64,
        progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
    ) -> Result<Option<Vec<LevelReport>>> {
        let gpu = frames.gpu().clone();
        let pipelines = Pipelines::new(&gpu)?;
        let pipeline = ComputePipeline::new(&gpu, &fill::PROGRAM, &[])?;
        let (solved, rest): (Vec<u32>, Vec<u32>) = (0..LEVELS).partition(|&level| ScatteringShape::solved(level));
        let resolution = |level| Resolution::for_medium(medium, ScatteringShape::optical_radius(level), detail);
        let j_max = solved.iter().map(|&level| resolution(level).j_max).max().unwrap_or(0);
        let rotations = rotations(j_max);
        let harmonics = Buffer::upload(&gpu, "sun harmonics", &self.harmonics(j_max))?;
        // Time that a level takes grows about so (measured); good enough for a bar.
        let cost = |level: u32| 1.0 + 0.6 * ScatteringShape::optical_radius(level).powf(0.75) as f32;
        let total: f32 = solved.iter().map(|&level| cost(level)).sum();
        let (mut reports, mut done) = (Vec::new(), 0.0);
        for level in solved {
            let optical_radius = ScatteringShape::optical_radius(level);
            let mus: Vec<f64> = (0..self.shape.mu)
                .map(|k| self.shape.coordinates([0, 0, k], optical_radius).mu.max(1e-3 / optical_radius))
                .collect();
            let plan = Plan::new(medium, optical_radius, resolution(level), &mus);
            let device = DevicePlan::new(&gpu, &pipelines, &plan, &rotations)?;
            let share = cost(level) / total;
            let mut inner = |fraction: f32| progress(done + share * fraction);
            let Some((sources, report)) = solve(frames, &plan, &device, &rotations, orders, &mut inner)? else {
                return Ok(None);
            };
            let (jobs, length) = device.prepare_view(&sources)?;
            let mus: Vec<f32> = mus.iter().map(|&mu| mu as f32).collect();
            let mus = Buffer::upload(&gpu, "view cosines", &mus)?;
            let terms = (0..=plan.resolution.j_max).map(|j| j / 2 + 1).sum::<usize>();
            frames.run(|rec| {
                rec.pass("scattering table", |rec| {
                    device.view(rec, &jobs, length)?;
                    let bindings = fill::Bindings {
                        rays: &device.outer().rays,
                        harmonics: &harmonics,
                        mus: &mus,
                        field: device.field(),
                        table: &self.table,
                    };
                    let push = FillPush {
                        point_count: device.outer().point_count() as u32,
                        terms: terms as u32,
                        level,
                        optical_radius: optical_radius as f32,
                    };
                    rec.dispatch(&pipeline, &bindings, &push, [self.shape.theta * self.shape.psi, self.shape.mu, 1])
                })
            })?;
            reports.push(report);
            done += share;
        }
        self.fill_between(frames, &rest)?;
        Ok(progress(1.0).is_continue().then_some(reports))
    }

    /// Fills levels from those that are solved.
    fn fill_between(&self, frames: &mut Frames, levels: &[u32]) -> Result<()> {
        let pipeline = ComputePipeline::new(frames.gpu(), &between::PROGRAM, &[])?;
        let [theta, psi, _] = self.table.extent();
        frames.run(|rec| {
            rec.pass("scattering table", |rec| {
                for &level in levels {
                    let (from, weights) = ScatteringShape::filled_from(level);
                    let push = BetweenPush { levels: from, weights: weights.map(|w| w as f32), level, pad: [0; 3] };
                    let bindings = between::Bindings { table: &self.table };
                    rec.dispatch(&pipeline, &bindings, &push, [theta, psi, self.shape.mu])?;
                }
                Ok(())
            })
        })
    }

    /// Real harmonics of the sun's direction in the frame of the ray at each (Θ, ψ): `[j, k][direction]`, cosine and sine.
    fn harmonics(&self, j_max: usize) -> Vec<[f32; 2]> {
        let ScatteringShape { theta, psi, .. } = self.shape;
        let directions = (theta * psi) as usize;
        let terms: usize = (0..=j_max).map(|j| j / 2 + 1).sum();
        let columns = parallel(directions, |d| {
            let c = self.shape.coordinates([d as u32 % theta, d as u32 / theta, 0], 1.0);
            let (along, side, normal) = (-c.theta.cos(), c.theta.sin() * c.psi.cos(), c.theta.sin() * c.psi.sin());
            let gamma = (-side).atan2(along);
            let table = legendre(normal, j_max, j_max);
            let mut column = Vec::with_capacity(terms);
            for (j, row) in table.iter().enumerate() {
                for n in (j % 2..=j).step_by(2) {
                    let (sin, cos) = (n as f64 * gamma).sin_cos();
                    let value = order_norm(n) * row[n];
                    column.push([(value * cos) as f32, (value * sin) as f32]);
                }
            }
            column
        });
        let mut harmonics = vec![[0.0; 2]; terms * directions];
        for (d, column) in columns.iter().enumerate() {
            for (term, value) in column.iter().enumerate() {
                harmonics[term * directions + d] = *value;
            }
        }
        harmonics
    }
}

type Sources = Vec<Vec<f64>>;

/// The sources of multiple scattering for every total angular momentum.
fn solve(
    frames: &mut Frames,
    plan: &Plan,
    device: &DevicePlan<'_>,
    rotations: &[Vec<Vec<f64>>],
    orders: Option<u32>,
    progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
) -> Result<Option<(Sources, LevelReport)>> {
    let j_max = plan.resolution.j_max;
    let beam = Beam::new(plan);
    let first: Sources = parallel(j_max + 1, |j| plan.sun_source(j, &beam));
    if progress(0.1).is_break() {
        return Ok(None);
    }
    let requests: Vec<(usize, &[f64])> = first.iter().enumerate().map(|(j, s)| (j, s.as_slice())).collect();
    let second = device.apply(frames, &requests)?;
    let mut report = LevelReport { optical_radius: plan.optical_radius, ..LevelReport::default() };
    if let Some(orders) = orders {
        let (mut sum, mut term) = (second.clone(), second);
        if orders < 2 {
            sum.iter_mut().flatten().for_each(|s| *s = 0.0);
        }
        for order in 3..=orders {
            let requests: Vec<(usize, &[f64])> = term.iter().enumerate().map(|(j, s)| (j, s.as_slice())).collect();
            term = device.apply(frames, &requests)?;
            for (sum, term) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
                *sum += term;
            }
            if progress(order as f32 / orders as f32).is_break() {
                return Ok(None);
            }
        }
        report.applications = f64::from(orders.max(2) - 1);
        report.multiple = scattered_energy(plan, rotations, &sum[0]);
        return Ok(Some((sum, report)));
    }

    let mut solvers: Vec<Gmres> =
        second.iter().enumerate().map(|(j, b)| Gmres::new(b, tolerance(j), RESTART)).collect();
    let mut round = 0;
    loop {
        let active: Vec<(usize, Vec<f64>)> = (solvers.iter().enumerate().skip(HOST_J))
            .filter_map(|(j, solver)| solver.request().map(|v| (j, v.to_vec())))
            .collect();
        if active.is_empty() {
            break;
        }
        let requests: Vec<(usize, &[f64])> = active.iter().map(|(j, v)| (*j, v.as_slice())).collect();
        let applied = device.apply(frames, &requests)?;
        for ((j, _), applied) in active.iter().zip(&applied) {
            solvers[*j].supply(applied, &second[*j]);
        }
        round += 1;
        // Rounds needed grow with the optical radius; this only moves the bar.
        let expected = 5.0 + plan.optical_radius.sqrt() as f32 * 2.0;
        if progress(0.1 + 0.9 * (round as f32 / expected).min(0.95)).is_break() {
            return Ok(None);
        }
    }
    let low: Vec<Gmres> = solvers.drain(..HOST_J.min(j_max + 1)).collect();
    let low: Vec<std::sync::Mutex<Option<Gmres>>> = low.into_iter().map(|s| std::sync::Mutex::new(Some(s))).collect();
    let low = parallel(low.len(), |j| {
        let mut solver = low[j].lock().ok().and_then(|mut slot| slot.take())?;
        while let Some(v) = solver.request() {
            let mut field = plan.emit(&plan.inner, j, &rotations[j], v);
            plan.sweep(&plan.inner, j, &mut field);
            let applied = plan.scatter(j, &rotations[j], &field);
            solver.supply(&applied, &second[j]);
        }
        Some(solver)
    });
    let mut sources = Vec::with_capacity(j_max + 1);
    for solver in low.into_iter().flatten().chain(solvers) {
        let (source, convergence) = solver.finish();
        report.applications = report.applications.max(convergence.applications as f64);
        report.residual = report.residual.max(convergence.residual);
        sources.push(source);
    }
    report.multiple = scattered_energy(plan, rotations, &sources[0]);
    Ok(Some((sources, report)))
}

/// Power that leaves along all rays, relative to the beam's: `4π ∫ 2π b L̄(b) db / π`, with L̄ the mean over sun directions,
/// which is the part of total angular momentum 0. Between rays L̄ is linear in the zenith cosine.
fn scattered_energy(plan: &Plan, rotations: &[Vec<Vec<f64>>], source: &[f64]) -> f64 {
    let mut field = plan.emit(&plan.inner, 0, &rotations[0], source);
    plan.sweep(&plan.inner, 0, &mut field);
    let mut leaving: Vec<(f64, f64)> = (plan.inner.rays.iter())
        .map(|&(start, count)| {
            let last = start + count - 1;
            (plan.inner.points[last].cos, field[last][0] / (4.0 * PI).sqrt())
        })
        .collect();
    leaving.sort_by(|a, b| a.0.total_cmp(&b.0));
    // b db = mu dmu; the integral of a linear function times mu over each interval.
    let pieces = leaving.windows(2).map(|w| {
        let ((m0, l0), (m1, l1)) = (w[0], w[1]);
        (m1 - m0) * (l0 * (2.0 * m0 + m1) + l1 * (m0 + 2.0 * m1)) / 6.0
    });
    8.0 * PI * pieces.sum::<f64>()
}
