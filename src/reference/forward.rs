//! Multiple forward scattering (`glsl/lighting/forward/`, Harris 2.2–2.3, Stoian 3–4) in `f64`, over all pairs of particles:
//! no tiles, no lists.

use glam::{DQuat, DVec3};

use super::phase::PhaseFunction;
use super::quadrature::gauss_legendre;
use super::tiling::{light_depth, light_key, receiver_level};
use crate::params::Splat;
use crate::shared::Particle;
use crate::tiling::TilingParams;

/// What light meets, beside the particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pass {
    /// How opacity falls off.
    pub splat: Splat,
    /// Albedo times [`cone_share`].
    pub forward: f64,
    /// γ [sr].
    pub solid_angle: f64,
    /// Texels along an edge of a level; 0: points are where they are.
    pub resolution: u32,
}

/// Share of scattered light that stays within a cone of `solid_angle` [sr] around its way: 2π ∫ p dcos over the cone. For a
/// narrow cone the papers' p(l, −l) γ / 4π; 1 for the whole sphere.
#[must_use]
pub fn cone_share(phase: PhaseFunction, g: f64, solid_angle: f64) -> f64 {
    use std::f64::consts::PI;
    let half = 0.5 * (solid_angle / (2.0 * PI)).clamp(0.0, 2.0);
    // Exact far beyond the decay of 0.99^l over the narrow cones that hold such a peak.
    let (nodes, weights) = gauss_legendre(200);
    let sum: f64 = nodes.iter().zip(&weights).map(|(x, w)| w * phase.eval(1.0 - half * (1.0 - x), g)).sum();
    (2.0 * PI * half * sum).min(1.0)
}

/// Opacity of a splat over that of its middle, at q = f² from there; f = 1 is the rim.
#[must_use]
pub fn opacity_share(q: f64, splat: Splat) -> f64 {
    match splat {
        _ if q >= 1.0 => 0.0,
        Splat::Gaussian => 1.0 + (-2.0 * q).exp_m1() / (1.0 - (-2.0f64).exp()),
        Splat::Polynomial => 1.0 - q * (3.0 - 2.0 * q.sqrt()),
    }
}

/// T + g / I: one step of Harris's Eq. 4 through a splat of optical depth `tau` in its middle.
#[must_use]
pub fn passes(q: f64, tau: f64, pass: &Pass) -> f64 {
    let share = opacity_share(q, pass.splat);
    let scattered = -(-tau).exp_m1();
    1.0 - share + share * ((-tau).exp() + pass.forward * scattered)
}

/// A particle in the plane perpendicular to the light.
struct Footprint {
    /// Place along u and v, from the tiles' centre [m].
    at: [f64; 2],
    /// Maps (u, v) from the centre to where the outline is the unit circle [1/m].
    outline: [DVec3; 2],
    /// Half of what it measures along u and v [m].
    extent: [f64; 2],
    /// In the middle.
    tau: f64,
}

fn vec(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

impl Footprint {
    fn new(particle: &Particle, t: &TilingParams) -> Self {
        let inverse = DQuat::from_array(particle.rotation.map(f64::from)).inverse();
        let axes = vec(particle.semi_axes);
        let relative = vec(particle.centre) - vec(t.centre);
        let along = inverse * vec(t.to_sun) / axes;
        let across = [vec(t.u_axis), vec(t.v_axis)];
        Self {
            at: across.map(|axis| relative.dot(axis)),
            outline: across.map(|axis| {
                let axis = inverse * axis / axes;
                axis - along * (axis.dot(along) / along.length_squared())
            }),
            extent: across.map(|axis| (axes * (inverse * axis)).length()),
            tau: 2.0 / along.length()
                * f64::from(t.extinction)
                * f64::from(particle.density)
                * f64::from(particle.fade),
        }
    }

    /// Squared distance of a point from the middle; 1 at the outline.
    fn q(&self, at: [f64; 2]) -> f64 {
        let [u, v] = [at[0] - self.at[0], at[1] - self.at[1]];
        (self.outline[0] * u + self.outline[1] * v).length_squared()
    }
}

/// The four points at which a particle reads the light, from the tiles' centre along u and v [m]; none outside all levels.
fn reads(particle: &Particle, footprint: &Footprint, t: &TilingParams, pass: &Pass) -> Option<[[f64; 2]; 4]> {
    let level = receiver_level(particle.centre, t)? as usize;
    let away = vec(particle.centre) - vec(t.centre);
    let top = f64::from(t.base) - (away.x * away.x + away.z * away.z) * f64::from(t.inverse_diameter)
        + f64::from(t.thickness);
    let below = (top - f64::from(particle.centre[1])).max(0.0);
    let way = if t.to_sun[1] > 1e-3 { below / f64::from(t.to_sun[1]) } else { f64::INFINITY };
    let rect = t.level_rect[level].map(f64::from);
    let dim = f64::from(t.tile_dim);
    Some([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]].map(|sign| {
        std::array::from_fn(|axis| {
            let size = (pass.solid_angle.sqrt() * way).min(footprint.extent[axis]);
            let mut at = (footprint.at[axis] + 0.25 * sign[axis] * size - rect[axis]) * rect[axis + 2];
            if pass.resolution > 0 {
                let texels = f64::from(pass.resolution) / dim;
                at = ((at * texels).floor() + 0.5) / texels;
            }
            at.clamp(0.0, dim) / rect[axis + 2] + rect[axis]
        })
    }))
}

/// Particles as light meets them: by the depth of their centres, ties by index.
fn front_to_back(particles: &[Particle], t: &TilingParams) -> Vec<usize> {
    let mut order: Vec<usize> = (0..particles.len()).collect();
    order.sort_by_key(|&i| (light_key(light_depth(particles[i].centre, t)), i));
    order
}

/// Light that comes in on each particle, 1 outside the clouds: each point of the light buffer keeps its own recurrence.
#[must_use]
pub fn incident(particles: &[Particle], t: &TilingParams, pass: &Pass) -> Vec<f64> {
    let footprints: Vec<_> = particles.iter().map(|particle| Footprint::new(particle, t)).collect();
    let order = front_to_back(particles, t);
    let mut incident = vec![1.0; particles.len()];
    for (rank, &k) in order.iter().enumerate() {
        let Some(points) = reads(&particles[k], &footprints[k], t, pass) else { continue };
        let mut light = [1.0; 4];
        for &j in &order[..rank] {
            let in_front = &footprints[j];
            for (light, at) in light.iter_mut().zip(points) {
                if (at[0] - in_front.at[0]).abs() < in_front.extent[0]
                    && (at[1] - in_front.at[1]).abs() < in_front.extent[1]
                {
                    *light *= passes(in_front.q(at), in_front.tau, pass);
                }
            }
        }
        incident[k] = 0.25 * light.iter().sum::<f64>();
    }
    incident
}

/// The same as the papers have it: a buffer of `resolution`² texels over the first level, of which a particle reads the one at
/// its centre and which it then blends with a splat of one colour (Harris, Fig. 4).
#[must_use]
pub fn as_published(particles: &[Particle], t: &TilingParams, pass: &Pass, resolution: usize) -> Vec<f64> {
    let rect = t.level_rect[0].map(f64::from);
    let texels = resolution as f64 / f64::from(t.tile_dim);
    let mut buffer = vec![1.0; resolution * resolution];
    let mut incident = vec![1.0; particles.len()];
    for k in front_to_back(particles, t) {
        let footprint = Footprint::new(&particles[k], t);
        let texel = |value: f64, axis: usize| (value - rect[axis]) * rect[axis + 2] * texels;
        let within = |value: f64| (value.floor().max(0.0) as usize).min(resolution - 1);
        let [x, y] = [0, 1].map(|axis| within(texel(footprint.at[axis], axis)));
        let light = buffer[y * resolution + x];
        incident[k] = light;
        let range = |axis: usize| {
            let [least, greatest] = [-1.0, 1.0].map(|s| texel(footprint.at[axis] + s * footprint.extent[axis], axis));
            within(least)..=within(greatest)
        };
        let scattered = -(-footprint.tau).exp_m1();
        for y in range(1) {
            for x in range(0) {
                let place = |i: usize, axis: usize| (i as f64 + 0.5) / texels / rect[axis + 2] + rect[axis];
                let share = opacity_share(footprint.q([place(x, 0), place(y, 1)]), pass.splat);
                let there = &mut buffer[y * resolution + x];
                *there = *there * (1.0 - share * scattered) + share * scattered * pass.forward * light;
            }
        }
    }
    incident
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiling::Slab;
    use std::f64::consts::PI;

    fn tiles(to_light: [f64; 3]) -> TilingParams {
        let slab = Slab {
            centre: [0.0, 1000.0, 0.0],
            base: 0.0,
            thickness: 2000.0,
            half_widths: &[1000.0],
            greatest_extent: 100.0,
            planet_radius: f64::INFINITY,
        };
        TilingParams::new(to_light, &slab, 0.01)
    }

    fn ball(centre: [f32; 3], density: f32) -> Particle {
        let rotation = [0.0, 0.0, 0.0, 1.0];
        Particle { centre, density, rotation, semi_axes: [100.0; 3], fade: 1.0, colour: [1.0; 3], id: 0 }
    }

    fn pass(forward: f64) -> Pass {
        Pass { splat: Splat::Gaussian, forward, solid_angle: 1e-12, resolution: 0 }
    }

    #[test]
    fn a_narrow_cone_takes_the_papers_share_and_the_whole_sphere_all() {
        let rayleigh = |angle| cone_share(PhaseFunction::CornetteShanks, 0.0, angle);
        for angle in [1e-6, 0.09, 1.0] {
            // 2π ∫ 3/(16π) (1 + c²) dc in closed form.
            let least = 1.0 - angle / (2.0 * PI);
            let exact = 0.375 * (1.0 - least + (1.0 - least.powi(3)) / 3.0);
            assert!((rayleigh(angle) - exact).abs() < 1e-12, "{angle}"); // f64 rounding
        }
        assert!((rayleigh(1e-6) / (1.5 * 1e-6 / (4.0 * PI)) - 1.0).abs() < 1e-6); // second order in the angle
        for phase in [PhaseFunction::CornetteShanks, PhaseFunction::HenyeyGreenstein] {
            for g in [0.0, 0.7, 0.9] {
                assert!((cone_share(phase, g, 4.0 * PI) - 1.0).abs() < 1e-9, "{phase:?} {g}"); // of the quadrature
            }
        }
    }

    #[test]
    fn splats_are_full_in_the_middle_and_nothing_at_the_rim() {
        for splat in [Splat::Gaussian, Splat::Polynomial] {
            assert_eq!((opacity_share(0.0, splat), opacity_share(1.0, splat)), (1.0, 0.0));
            assert!(opacity_share(1.0 - 1e-9, splat) < 1e-8);
        }
        assert_eq!(opacity_share(0.25, Splat::Polynomial), 0.5);
    }

    #[test]
    fn nothing_in_front_leaves_all_light_and_two_in_line_take_their_transmittances() {
        let (t, up) = (tiles([0.0, 1.0, 0.0]), |y: f32, density: f32| ball([0.0, y, 0.0], density));
        let particles = [up(200.0, 1.0), up(1500.0, 0.5), up(900.0, 0.25)];
        // τ = 0.01 · 200 m · density.
        let (first, second) = ((-1.0f64).exp(), (-0.5f64).exp());
        let direct = incident(&particles, &t, &pass(0.0));
        for (got, expected) in direct.iter().zip([first * second, 1.0, first]) {
            assert!((got - expected).abs() < 1e-7, "{direct:?}"); // the extinction 0.01 is an f32
        }
        // With scattering each takes the share that it does not let pass or scatter on.
        let some = incident(&particles, &t, &pass(0.3));
        let step = |clear: f64| clear + 0.3 * (1.0 - clear);
        for (got, expected) in some.iter().zip([step(first) * step(second), 1.0, step(first)]) {
            assert!((got - expected).abs() < 1e-7, "{some:?}");
        }
    }

    fn crowd() -> Vec<Particle> {
        let mut state = 1u64;
        let mut random = || super::super::monte_carlo::next_uniform(&mut state) as f32;
        (0..200)
            .map(|_| {
                let centre = [1600.0 * random() - 800.0, 2000.0 * random(), 1600.0 * random() - 800.0];
                ball(centre, 3.0 * random())
            })
            .collect()
    }

    #[test]
    fn energy_never_grows_for_any_cone_and_all_of_it_goes_on_at_albedo_1_in_the_whole_sphere() {
        let t = tiles([0.0, 0.8, 0.6]);
        let particles = crowd();
        let mut before = vec![0.0; particles.len()];
        for angle in [0.09, 1.0, 4.0, 4.0 * PI] {
            let forward = cone_share(PhaseFunction::CornetteShanks, 0.0, angle);
            let light = incident(&particles, &t, &pass(forward));
            for (light, before) in light.iter().zip(&before) {
                assert!(*light <= 1.0 + 1e-12 && light >= before, "{angle}: {light} after {before}");
            }
            before = light;
        }
        assert!(before.iter().all(|light| (light - 1.0).abs() < 1e-7));
    }

    #[test]
    fn a_fine_buffer_blended_as_published_differs_by_where_scattered_light_is_taken() {
        let t = tiles([0.0, 1.0, 0.0]);
        let particles = crowd();
        let error = |forward: f64| {
            let (own, published) =
                (incident(&particles, &t, &pass(forward)), as_published(&particles, &t, &pass(forward), 1024));
            own.iter().zip(&published).map(|(a, b)| (a - b).abs()).sum::<f64>() / own.len() as f64
        };
        // Texels of 2 m: what is not scattered is the same but for their size.
        assert!(error(0.0) < 5e-3, "{}", error(0.0));
        assert!(error(0.1) < 2e-2, "{}", error(0.1));
    }
}
