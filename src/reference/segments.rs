//! Segments of a ray through overlapping homogeneous media: the exact integral, and the merges that approximate it.
//!
//! The exact answer is an event sweep: between consecutive entries and exits the medium has `sigma = Σ sigma_i` and the
//! colour `Σ sigma_i C_i / Σ sigma_i`; the intervals are integrated front to back. It is the oracle of every blend mode.

/// A stretch of a ray through one homogeneous medium (`glsl/blend/merge.glsl`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// `C = L_in / (1 - T)`.
    pub colour: [f64; 3],
    /// Optical depth of the whole stretch.
    pub optical_depth: f64,
    /// Entry along the ray [m].
    pub t_enter: f64,
    /// Exit along the ray [m].
    pub t_exit: f64,
}

/// In-scattered radiance and transmittance of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Composite {
    /// Radiance that the media add.
    pub radiance: [f64; 3],
    /// Fraction of the background that is left.
    pub transmittance: f64,
}

fn opacity(tau: f64) -> f64 {
    -(-tau).exp_m1()
}

/// `C (1 − T) + T · behind` (Yusov, Eq. 8 and 13).
fn over(colour: [f64; 3], tau: f64, behind: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| colour[i] * opacity(tau) + (-tau).exp() * behind[i])
}

/// The homogeneous stretches between consecutive entries and exits, front to back: extinctions add up, colours are weighted
/// by them.
fn stretches(segments: &[Segment]) -> Vec<Segment> {
    let live: Vec<&Segment> = segments.iter().filter(|s| s.optical_depth > 0.0 && s.t_exit > s.t_enter).collect();
    let mut events: Vec<f64> = live.iter().flat_map(|s| [s.t_enter, s.t_exit]).collect();
    events.sort_by(f64::total_cmp);
    let mut result = Vec::new();
    for pair in events.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (mut tau, mut weighted) = (0.0, [0.0; 3]);
        for s in live.iter().filter(|s| s.t_enter <= a && s.t_exit >= b) {
            let part = s.optical_depth * (b - a) / (s.t_exit - s.t_enter);
            tau += part;
            weighted = std::array::from_fn(|i| weighted[i] + part * s.colour[i]);
        }
        if tau > 0.0 {
            result.push(Segment { colour: weighted.map(|w| w / tau), optical_depth: tau, t_enter: a, t_exit: b });
        }
    }
    result
}

/// The exact integral over any number of overlapping segments, in any order.
#[must_use]
pub fn exact(segments: &[Segment]) -> Composite {
    let mut result = Composite { radiance: [0.0; 3], transmittance: 1.0 };
    for s in stretches(segments) {
        for (radiance, colour) in result.radiance.iter_mut().zip(s.colour) {
            *radiance += result.transmittance * opacity(s.optical_depth) * colour;
        }
        result.transmittance *= (-s.optical_depth).exp();
    }
    result
}

/// Sorted alpha: each segment lies wholly in front of those before it in the list.
#[must_use]
pub fn alpha(back_to_front: &[Segment]) -> Composite {
    let mut result = Composite { radiance: [0.0; 3], transmittance: 1.0 };
    for s in back_to_front.iter().filter(|s| s.optical_depth > 0.0) {
        result.radiance = over(s.colour, s.optical_depth, result.radiance);
        result.transmittance *= (-s.optical_depth).exp();
    }
    result
}

/// The paper's merge (Yusov 5.5, Eq. 10–17): one pending homogeneous segment per ray, segments given back to front.
#[must_use]
pub fn merged(back_to_front: &[Segment]) -> Composite {
    let mut behind = [0.0; 3];
    let mut total = 0.0;
    let mut pending: Option<Segment> = None;
    for incoming in back_to_front.iter().filter(|s| s.optical_depth > 0.0) {
        total += incoming.optical_depth;
        let Some(old) = pending else {
            pending = Some(*incoming);
            continue;
        };
        let (near, far) = if incoming.t_enter <= old.t_enter { (*incoming, old) } else { (old, *incoming) };
        if near.t_exit <= far.t_enter {
            behind = over(far.colour, far.optical_depth, behind);
            pending = Some(near);
            continue;
        }
        let part = |s: &Segment, a: f64, b: f64| s.optical_depth * ((b - a) / (s.t_exit - s.t_enter)).clamp(0.0, 1.0);
        let end = near.t_exit.min(far.t_exit);
        let last = if far.t_exit > near.t_exit { far } else { near };
        behind = over(last.colour, part(&last, end, last.t_exit), behind);
        let (tau_near, tau_far) = (part(&near, far.t_enter, end), part(&far, far.t_enter, end));
        let both = tau_near + tau_far;
        let mixed = std::array::from_fn(|i| (near.colour[i] * tau_near + far.colour[i] * tau_far) / both);
        let front = part(&near, near.t_enter, far.t_enter);
        let radiance = over(near.colour, front, over(mixed, both, [0.0; 3]));
        let tau = front + both;
        let colour = radiance.map(|r| r / opacity(tau));
        pending = Some(Segment { colour, optical_depth: tau, t_enter: near.t_enter, t_exit: end });
    }
    let radiance = pending.map_or(behind, |p| over(p.colour, p.optical_depth, behind));
    Composite { radiance, transmittance: (-total).exp() }
}

/// What [`window`] makes of a ray, and how sure it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Windowed {
    /// The picture of the ray.
    pub composite: Composite,
    /// The narrowest choice between two reductions that both cost something: by which part the second best was dearer than
    /// the best; 1 without a choice. Arithmetic of fewer digits may choose otherwise where this is small.
    pub margin: f64,
}

/// Costs below this part of the incoming brightness are nothing to choose between.
const NO_COST: f64 = 1e-6;

/// How likely something that is still to come reaches behind what has been drawn, at the least (`glsl/blend/window.glsl`).
const LEAST_REACH: f64 = 0.03;

/// A window of `k` pending segments per ray (`glsl/blend/window.glsl`): overlaps are split, and of more than `k` stretches
/// those are merged or committed whose loss is expected to cost least. Segments come back to front, or in any other order at
/// the price of a larger error. `k = 1` is not the paper's merge, which is [`merged`].
///
/// # Panics
/// If `k` is 0.
#[must_use]
pub fn window(k: usize, back_to_front: &[Segment]) -> Windowed {
    assert!(k > 0, "a window of no segments");
    let mut pending: Vec<Segment> = Vec::new();
    let (mut behind, mut total, mut margin) = ([0.0; 3], 0.0, 1.0f64);
    for incoming in back_to_front.iter().filter(|s| s.optical_depth > 0.0) {
        total += incoming.optical_depth;
        pending.push(*incoming);
        pending = stretches(&pending);
        while pending.len() > k {
            let costs = reduction_costs(&pending, incoming);
            let mut ranked: Vec<usize> = (0..costs.len()).rev().collect();
            ranked.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
            let (best, second) = (ranked[0], ranked[1]);
            if costs[second] > NO_COST * incoming.colour.iter().sum::<f64>() {
                margin = margin.min(1.0 - costs[best] / costs[second]);
            }
            if best + 1 == pending.len() {
                behind = over(pending[best].colour, pending[best].optical_depth, behind);
            } else {
                pending[best] = joined(&pending[best], &pending[best + 1]);
            }
            pending.remove((best + 1).min(pending.len() - 1));
        }
    }
    let radiance = pending.iter().rev().fold(behind, |behind, s| over(s.colour, s.optical_depth, behind));
    Windowed { composite: Composite { radiance, transmittance: (-total).exp() }, margin }
}

/// What is expected to be lost by joining each stretch with the next one; for the last one, by committing it. The stretches
/// lie front to back, and `incoming` stands for what is still to come: it reaches about as far, and is as long and as bright.
fn reduction_costs(pending: &[Segment], incoming: &Segment) -> Vec<f64> {
    let length = incoming.t_exit - incoming.t_enter;
    let bright: f64 = incoming.colour.iter().sum();
    let mut seen = 1.0;
    let mut costs = Vec::new();
    for (i, p) in pending.iter().enumerate() {
        let reach = ((incoming.t_exit - p.t_enter) / length).clamp(LEAST_REACH, 1.0);
        let loss = match pending.get(i + 1) {
            None => opacity(p.optical_depth) * bright,
            Some(q) => {
                let density = (p.optical_depth + q.optical_depth) / (q.t_exit - p.t_enter);
                let uneven = (p.optical_depth - density * (p.t_exit - p.t_enter))
                    .abs()
                    .max((p.optical_depth - density * (q.t_enter - p.t_enter)).abs());
                let apart: f64 = (0..3).map(|c| (p.colour[c] - q.colour[c]).abs()).sum();
                let motley = apart * opacity(p.optical_depth).min(opacity(q.optical_depth));
                ((q.t_exit - p.t_enter) / length).min(1.0) * (uneven * bright + motley)
            }
        };
        costs.push(seen * reach * loss);
        seen *= (-p.optical_depth).exp();
    }
    costs
}

/// One homogeneous segment that looks like `near` in front of `far` (Yusov, Eq. 17).
fn joined(near: &Segment, far: &Segment) -> Segment {
    let radiance = over(near.colour, near.optical_depth, over(far.colour, far.optical_depth, [0.0; 3]));
    let optical_depth = near.optical_depth + far.optical_depth;
    Segment {
        colour: radiance.map(|r| r / opacity(optical_depth)),
        optical_depth,
        t_enter: near.t_enter,
        t_exit: far.t_exit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(c: f64, tau: f64, t_enter: f64, t_exit: f64) -> Segment {
        Segment { colour: [c, 1.0 - c, 0.5], optical_depth: tau, t_enter, t_exit }
    }

    fn assert_close(a: Composite, b: Composite, bound: f64) {
        assert!((a.transmittance - b.transmittance).abs() < bound, "{a:?} {b:?}");
        assert!((0..3).all(|i| (a.radiance[i] - b.radiance[i]).abs() < bound), "{a:?} {b:?}");
    }

    #[test]
    fn one_segment_is_equation_8() {
        let result = exact(&[segment(0.25, 2.0, 1.0, 3.0)]);
        assert!((result.radiance[0] - 0.25 * (1.0 - (-2.0f64).exp())).abs() < 1e-15);
        assert!((result.transmittance - (-2.0f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn disjoint_segments_are_alpha_blended() {
        let (far, near) = (segment(0.2, 1.0, 5.0, 6.0), segment(0.9, 0.5, 1.0, 2.0));
        assert_close(exact(&[near, far]), alpha(&[far, near]), 1e-14);
        assert_close(merged(&[far, near]), alpha(&[far, near]), 1e-14);
    }

    #[test]
    fn the_merge_is_exact_for_two_in_either_order_containment_included() {
        for (a, b) in
            [((1.0, 3.0), (2.0, 5.0)), ((1.0, 6.0), (2.0, 3.0)), ((2.0, 3.0), (2.0, 4.0)), ((1.0, 2.0), (1.0, 2.0))]
        {
            let (a, b) = (segment(0.1, 1.3, a.0, a.1), segment(0.8, 0.4, b.0, b.1));
            assert_close(merged(&[a, b]), exact(&[a, b]), 1e-13);
            assert_close(merged(&[b, a]), exact(&[a, b]), 1e-13);
        }
    }

    #[test]
    fn splitting_a_segment_changes_nothing() {
        let whole = segment(0.3, 2.0, 0.0, 4.0);
        let halves = [segment(0.3, 1.0, 0.0, 2.0), segment(0.3, 1.0, 2.0, 4.0)];
        assert_close(exact(&[whole]), exact(&halves), 1e-14);
    }

    /// A fixed sequence of numbers in [0, 1).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        /// 16 segments on a ray of which about 6 overlap anywhere, back to front by centre.
        fn ray(&mut self, tau: f64) -> Vec<Segment> {
            let mut one = |_| {
                let (centre, half) = (4.0 * self.next(), 0.5 + 0.5 * self.next());
                Segment {
                    colour: std::array::from_fn(|_| self.next()),
                    optical_depth: tau * (0.2 + 1.6 * self.next()),
                    t_enter: centre - half,
                    t_exit: centre + half,
                }
            };
            let mut ray: Vec<Segment> = (0..16).map(&mut one).collect();
            ray.sort_by(|a, b| (b.t_enter + b.t_exit).total_cmp(&(a.t_enter + a.t_exit)));
            ray
        }
    }

    /// RMS over rays and channels of what `model` makes of them, less the exact answer.
    fn rms(rays: &[Vec<Segment>], model: impl Fn(&[Segment]) -> Composite) -> f64 {
        let square = |ray: &Vec<Segment>| {
            let (got, exact) = (model(ray), exact(ray));
            (0..3).map(|i| (got.radiance[i] - exact.radiance[i]).powi(2)).sum::<f64>()
        };
        (rays.iter().map(square).sum::<f64>() / (3 * rays.len()) as f64).sqrt()
    }

    #[test]
    fn a_window_that_is_wide_enough_is_exact() {
        let mut random = Random(1);
        for _ in 0..100 {
            let ray = random.ray(1.0);
            assert_close(window(2 * ray.len(), &ray).composite, exact(&ray), 1e-12);
        }
        let pair = [segment(0.1, 1.3, 1.0, 6.0), segment(0.8, 0.4, 2.0, 3.0)];
        assert_close(window(3, &pair).composite, exact(&pair), 1e-13);
        assert_close(window(2, &pair).composite, exact(&pair), 1e-13);
    }

    /// The expected curve: what the plain strategy, always committing the farthest, was measured to reach for K = 1 (the
    /// paper's merge), 2, 4 and 8, with alpha before them. Windows must be within 20 % of it, or better.
    #[test]
    fn the_error_falls_with_the_window_as_expected() {
        for (tau, alphas, expected) in
            [(0.5, 0.046, [0.041, 0.031, 0.014, 0.0012]), (2.0, 0.127, [0.077, 0.051, 0.012, 0.0002])]
        {
            let mut random = Random(5);
            let rays: Vec<_> = (0..2000).map(|_| random.ray(tau)).collect();
            let errors = [1, 2, 4, 8].map(|k| match k {
                1 => rms(&rays, merged),
                k => rms(&rays, |ray| window(k, ray).composite),
            });
            println!("tau {tau}: alpha {:.4}, K = 1, 2, 4, 8: {errors:.6?}", rms(&rays, alpha));
            // The paper's merge and alpha blending leave no freedom: both sides are held.
            assert!((rms(&rays, alpha) / alphas - 1.0).abs() < 0.2);
            assert!((errors[0] / expected[0] - 1.0).abs() < 0.2);
            for (error, expected) in errors.into_iter().zip(expected) {
                assert!(error < 1.2 * expected, "{error} {expected}");
            }
        }
    }

    #[test]
    fn out_of_order_the_error_grows_and_still_falls_with_the_window() {
        let mut random = Random(9);
        let sorted: Vec<_> = (0..1000).map(|_| random.ray(1.0)).collect();
        let shuffled: Vec<_> = sorted
            .iter()
            .map(|ray| {
                let mut ray = ray.clone();
                for i in (1..ray.len()).rev() {
                    ray.swap(i, (random.next() * (i + 1) as f64) as usize);
                }
                ray
            })
            .collect();
        let error = |rays: &[Vec<Segment>], k| rms(rays, |ray| window(k, ray).composite);
        let alpha_error = rms(&shuffled, alpha);
        let mut previous = alpha_error;
        for k in [2, 4, 8] {
            let (in_order, any_order) = (error(&sorted, k), error(&shuffled, k));
            println!("K = {k}: {in_order:.6} in order, {any_order:.6} shuffled, alpha {alpha_error:.4}");
            assert!(in_order < any_order && any_order < 0.6 * previous);
            previous = any_order;
        }
    }

    #[test]
    fn three_overlapping_segments_tell_the_modes_apart() {
        // If the approximations agreed with the exact answer here, the comparisons above would mean little.
        let s = [segment(0.0, 1.0, 2.0, 6.0), segment(0.5, 1.0, 1.0, 5.0), segment(1.0, 1.0, 0.0, 4.0)];
        let error = |c: Composite| (c.radiance[0] - exact(&s).radiance[0]).abs();
        assert!(error(alpha(&s)) > 1e-2);
        assert!(error(merged(&s)) > 1e-4 && error(merged(&s)) < error(alpha(&s)));
    }
}
