//! Compositing of constant-colour ellipsoids against the exact f64 integral along each pixel's ray.

#[path = "support/blend.rs"]
mod support;

use support::{RAY_ROUNDING, Random, SIZE, ball, draw, has_interlock, max_error, open, segment};
use welkin::blend::NO_CLOUD;
use welkin::params::Blend;
use welkin::reference::segments::{self, Segment};
use welkin::shared::Particle;

#[test]
fn two_overlapping_ellipsoids_match_the_exact_integral_under_interlock() {
    let mut device = open(true);
    if !has_interlock(&device) {
        return;
    }
    let a = ball([-10.0, 0.0, -150.0], [40.0, 30.0, 35.0], 0.5, [0.9, 0.2, 0.1]);
    let b = ball([15.0, 5.0, -170.0], [45.0, 35.0, 50.0], 0.3, [0.1, 0.4, 0.8]);
    let inside = ball([-10.0, 0.0, -150.0], [20.0, 15.0, 10.0], 0.8, [0.0, 1.0, 0.0]);
    for pair in [[a, b], [b, a], [a, inside], [inside, a]] {
        let picture = draw(&mut device, Blend::Interlock(1), &pair, NO_CLOUD);
        let error = max_error(&picture, &pair, NO_CLOUD, segments::exact);
        assert!(error < RAY_ROUNDING, "{error}");
    }
}

#[test]
fn every_mode_follows_its_own_reference_on_random_heaps() {
    let mut device = open(true);
    let mut random = Random(7);
    for count in [3, 10, 50] {
        let particles: Vec<Particle> = (0..count).map(|_| random.particle(220.0, 150.0)).collect();
        let picture = draw(&mut device, Blend::Alpha, &particles, NO_CLOUD);
        let error = max_error(&picture, &particles, NO_CLOUD, segments::alpha);
        assert!(error < RAY_ROUNDING, "alpha, {count}: {error}");
        if has_interlock(&device) {
            let picture = draw(&mut device, Blend::Interlock(1), &particles, NO_CLOUD);
            let error = max_error(&picture, &particles, NO_CLOUD, segments::merged);
            // A merge decides by comparing distances: where two ends coincide to rounding, either decision is right and
            // the colours differ by the sliver between them.
            assert!(error < 2.0 * RAY_ROUNDING, "interlock, {count}: {error}");
        }
    }
}

#[test]
fn transmittance_is_exactly_the_sum_of_optical_depths_in_any_order() {
    let mut device = open(true);
    let mut random = Random(99);
    for count in [3, 10, 50] {
        let mut particles: Vec<Particle> = (0..count).map(|_| random.particle(300.0, 200.0)).collect();
        let modes = if has_interlock(&device) { vec![Blend::Interlock(1), Blend::Alpha] } else { vec![Blend::Alpha] };
        for mode in modes {
            let forward = draw(&mut device, mode, &particles, NO_CLOUD);
            particles.reverse();
            let backward = draw(&mut device, mode, &particles, NO_CLOUD);
            let only_transmittance = |s: &[Segment]| segments::exact(s).transmittance;
            for y in 0..SIZE {
                for x in 0..SIZE {
                    let s: Vec<Segment> =
                        particles.iter().filter_map(|p| segment(p, x, y, f64::from(NO_CLOUD))).collect();
                    let index = (y * SIZE + x) as usize;
                    let (a, b) = (f64::from(forward.cloud[index][3]), f64::from(backward.cloud[index][3]));
                    assert!((a - only_transmittance(&s)).abs() < RAY_ROUNDING);
                    assert!((a - b).abs() < 1e-5, "{mode}: {a} {b}"); // f32 sums in two orders.
                }
            }
        }
    }
}

#[test]
fn the_eye_inside_a_particle_and_opaque_things_in_front_cut_segments() {
    let mut device = open(true);
    let around = ball([5.0, -3.0, 2.0], [60.0, 50.0, 70.0], 0.4, [0.7, 0.7, 0.2]);
    let cut_by_eye_plane = ball([50.0, 0.0, 0.0], [55.0, 20.0, 20.0], 0.3, [0.2, 0.9, 0.9]);
    let behind_eye = ball([0.0, 0.0, 200.0], [30.0, 30.0, 30.0], 1.0, [1.0, 0.0, 0.0]);
    let far = ball([0.0, 0.0, -180.0], [50.0, 50.0, 50.0], 0.5, [0.9, 0.3, 0.4]);
    let particles = [far, around, behind_eye, cut_by_eye_plane];
    for opaque in [NO_CLOUD, 180.0, 40.0] {
        let picture = draw(&mut device, Blend::Alpha, &particles, opaque);
        let error = max_error(&picture, &particles, opaque, segments::alpha);
        assert!(error < RAY_ROUNDING, "alpha behind {opaque}: {error}");
        if has_interlock(&device) {
            let picture = draw(&mut device, Blend::Interlock(1), &particles, opaque);
            let error = max_error(&picture, &particles, opaque, segments::merged);
            assert!(error < RAY_ROUNDING, "interlock behind {opaque}: {error}");
        }
    }
}

#[test]
fn a_distant_particle_keeps_its_shape() {
    // At 90 km the eye is a thousand radii away: the textbook discriminant would have lost the silhouette.
    let mut device = open(true);
    let particles = [ball([3000.0, 2000.0, -90_000.0], [9000.0, 6000.0, 7000.0], 1e-3, [1.0, 0.5, 0.25])];
    let picture = draw(&mut device, Blend::Alpha, &particles, NO_CLOUD);
    let error = max_error(&picture, &particles, NO_CLOUD, segments::exact);
    assert!(error < RAY_ROUNDING, "{error}");
}

#[test]
fn the_same_scene_gives_the_same_bits_twenty_times() {
    let mut device = open(false);
    let mut random = Random(3);
    let particles: Vec<Particle> = (0..40).map(|_| random.particle(220.0, 150.0)).collect();
    let modes = if has_interlock(&device) { vec![Blend::Interlock(1), Blend::Alpha] } else { vec![Blend::Alpha] };
    for mode in modes {
        let first = draw(&mut device, mode, &particles, NO_CLOUD);
        for _ in 1..20 {
            let again = draw(&mut device, mode, &particles, NO_CLOUD);
            assert!(first.cloud == again.cloud && first.nearest == again.nearest);
        }
    }
}
