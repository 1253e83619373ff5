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

/// `C (1 − T) + T · behind` (Yusov, Eq. 8 and 13).
fn over(colour: [f64; 3], tau: f64, behind: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| -colour[i] * (-tau).exp_m1() + (-tau).exp() * behind[i])
}

/// The exact integral over any number of overlapping segments, in any order.
#[must_use]
pub fn exact(segments: &[Segment]) -> Composite {
    let live: Vec<&Segment> = segments.iter().filter(|s| s.optical_depth > 0.0 && s.t_exit > s.t_enter).collect();
    let mut events: Vec<f64> = live.iter().flat_map(|s| [s.t_enter, s.t_exit]).collect();
    events.sort_by(f64::total_cmp);
    let mut result = Composite { radiance: [0.0; 3], transmittance: 1.0 };
    for pair in events.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (mut tau, mut weighted) = (0.0, [0.0; 3]);
        for s in live.iter().filter(|s| s.t_enter <= a && s.t_exit >= b) {
            let part = s.optical_depth * (b - a) / (s.t_exit - s.t_enter);
            tau += part;
            weighted = std::array::from_fn(|i| weighted[i] + part * s.colour[i]);
        }
        if tau > 0.0 {
            let opacity = -(-tau).exp_m1();
            for (radiance, w) in result.radiance.iter_mut().zip(weighted) {
                *radiance += result.transmittance * opacity * w / tau;
            }
            result.transmittance *= (-tau).exp();
        }
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
        let colour = radiance.map(|r| r / -(-tau).exp_m1());
        pending = Some(Segment { colour, optical_depth: tau, t_enter: near.t_enter, t_exit: end });
    }
    let radiance = pending.map_or(behind, |p| over(p.colour, p.optical_depth, behind));
    Composite { radiance, transmittance: (-total).exp() }
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

    #[test]
    fn three_overlapping_segments_tell_the_modes_apart() {
        // If the approximations agreed with the exact answer here, the comparisons above would mean little.
        let s = [segment(0.0, 1.0, 2.0, 6.0), segment(0.5, 1.0, 1.0, 5.0), segment(1.0, 1.0, 0.0, 4.0)];
        let error = |c: Composite| (c.radiance[0] - exact(&s).radiance[0]).abs();
        assert!(error(alpha(&s)) > 1e-2);
        assert!(error(merged(&s)) > 1e-4 && error(merged(&s)) < error(alpha(&s)));
    }
}
