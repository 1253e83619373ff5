//! Path tracing against closed forms, the tables' Monte Carlo oracle, the exact event sweep, and itself.

use glam::{DQuat, DVec3};
use std::ops::ControlFlow;
use std::time::Instant;
use welkin::Params;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::params::{
    Aim, Camera, Coverage, Lighting, ParticleDesc, Preset, SkyModel, Source, Style, Sun, SunPosition,
};
use welkin::pathtrace::{Environment, Estimator, PathOptions, PathTracer, PixelSums, State, SunShape};
use welkin::reference::grid::generate;
use welkin::reference::monte_carlo::{Medium, multiple_scattering};
use welkin::reference::path::Sunlit;
use welkin::reference::phase::PhaseFunction;
use welkin::reference::scattering::single_scattering;
use welkin::reference::scene::{Ellipsoid, Scene};
use welkin::reference::segments::{self, Segment};
use welkin::reference::sphere::LitRay;

fn open() -> Standalone {
    Standalone::new(Options { validation: true, ..Options::default() }).unwrap()
}

fn silent(device: &Standalone) {
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

fn ball(centre: [f64; 3], radii: [f32; 3], density: f32, colour: [f32; 3]) -> ParticleDesc {
    ParticleDesc { centre, radii, density, colour, ..ParticleDesc::default() }
}

/// Black sky, no tables, an eye at the origin that looks along -z at particles.
fn scene(particles: Vec<ParticleDesc>, style: Style) -> Params {
    let mut params = Params::default();
    params.camera = Camera { position: [0.0; 3], aim: Aim::Angles { yaw: 0.0, pitch: 0.0 }, fov_y: 40.0 };
    params.clouds.source = Source::Particles(particles);
    params.clouds.style = style;
    params.sky.model = SkyModel::None;
    params
}

/// Overlapping turned ellipsoids of different densities.
fn heap(count: u32) -> Vec<ParticleDesc> {
    let mut state = 5u64;
    let mut r = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    (0..count)
        .map(|_| {
            let q = [r() - 0.5, r() - 0.5, r() - 0.5, r() - 0.5];
            let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
            ParticleDesc {
                centre: [
                    f64::from(150.0 * (r() - 0.5)),
                    f64::from(150.0 * (r() - 0.5)),
                    f64::from(-350.0 + 150.0 * r()),
                ],
                radii: [20.0 + 40.0 * r(), 20.0 + 40.0 * r(), 20.0 + 40.0 * r()],
                rotation: q.map(|c| c / length),
                density: 0.1 + r(),
                colour: [r(), r(), r()],
                ..ParticleDesc::default()
            }
        })
        .collect()
}

fn traced(device: &mut Standalone, params: &Params, size: [u32; 2], options: PathOptions, samples: u32) -> PathTracer {
    let mut tracer = PathTracer::new(device.frames(), params, size, &options).unwrap();
    gather(device, &mut tracer, samples);
    tracer
}

fn gather(device: &mut Standalone, tracer: &mut PathTracer, samples: u32) {
    assert!(tracer.run(device.frames(), samples, &mut |_| ControlFlow::Continue(())).unwrap().is_continue());
    assert_eq!(tracer.samples(), samples);
}

/// The segments that particles cut out of a pixel's ray, from the definition of an ellipsoid.
fn cut(params: &Params, particles: &[ParticleDesc], size: [u32; 2], pixel: usize) -> Vec<Segment> {
    let (x, y) = (pixel as u32 % size[0], pixel as u32 / size[0]);
    let dir = DVec3::from_array(params.camera.ray(x, y, size[0], size[1]));
    let eye = DVec3::from_array(params.camera.position);
    let segment = |p: &ParticleDesc| {
        let turn = DQuat::from_array(p.rotation.map(f64::from)).normalize().inverse();
        let axes = DVec3::from_array(p.radii.map(f64::from));
        let (o, d) = (turn * (eye - DVec3::from_array(p.centre)) / axes, turn * dir / axes);
        let (a, b) = (d.length_squared(), o.dot(d));
        let closest = o - d * (b / a);
        let inside = 1.0 - closest.length_squared();
        let half = (inside.max(0.0) / a).sqrt();
        let (t_enter, t_exit) = ((-b / a - half).max(0.0), -b / a + half);
        (inside > 0.0 && t_exit > t_enter).then(|| Segment {
            colour: p.colour.map(f64::from),
            optical_depth: f64::from(params.clouds.sigma_t) * f64::from(p.density) * (t_exit - t_enter),
            t_enter,
            t_exit,
        })
    };
    particles.iter().filter_map(segment).collect()
}

/// A value that was traced, its standard error, and what it should be.
#[derive(Clone, Copy, Default)]
struct Check {
    mean: f64,
    error: f64,
    expected: f64,
}

/// Means over blocks of 4 × 4 pixels. (A lone pixel of a few hundred samples may have missed what is rare, and then knows
/// of no error.)
fn blocks(checks: &[Check], size: [u32; 2]) -> Vec<Check> {
    let (across, down) = (size[0] as usize / 4, size[1] as usize / 4);
    (0..across * down)
        .map(|block| {
            let corner = block / across * 4 * size[0] as usize + block % across * 4;
            let sum =
                (0..16).map(|i| checks[corner + i / 4 * size[0] as usize + i % 4]).fold(Check::default(), |a, b| {
                    Check { mean: a.mean + b.mean, error: a.error.hypot(b.error), expected: a.expected + b.expected }
                });
            Check { mean: sum.mean / 16.0, error: sum.error / 16.0, expected: sum.expected / 16.0 }
        })
        .collect()
}

/// Blocks deviate from what is expected by their own standard errors, or by no more than `rounding` where they have none.
fn assert_unbiased(checks: &[Check], rounding: f64, what: &str) {
    let (mut count, mut sum, mut worst) = (0u32, 0.0, 0.0f64);
    for &Check { mean, error, expected } in checks {
        if error < rounding {
            // With no error at all, what happens in one sample of a hundred may be missed in sixteen pixels of 128.
            let rounding = if error > 0.0 { rounding } else { rounding + 0.01 };
            assert!((mean - expected).abs() < 6.0 * error + rounding, "{what}: {mean} ± {error}, not {expected}");
            continue;
        }
        let z = (mean - expected) / error;
        (count, sum, worst) = (count + 1, sum + z * z, worst.max(z.abs()));
    }
    let (mean, spread) = (sum / f64::from(count), (2.0 / f64::from(count)).sqrt());
    println!("{what}: {count} blocks, mean square {mean:.3}, worst {worst:.2}");
    // Squares of standard normal numbers: mean 1, standard deviation √2. Four of those, and a tenth for tails of rare events.
    assert!(count > 10 && (mean - 1.0).abs() < 4.0 * spread + 0.1 && worst < 5.0, "{what}: {count} {mean} {worst}");
}

/// Standard error of a transmittance through homogeneous particles, where a ray gets through or does not.
fn binary_error(expected: f64, samples: u32) -> f64 {
    (expected * (1.0 - expected) / f64::from(samples)).sqrt()
}

fn error(m2: f32, samples: u32) -> f64 {
    (f64::from(m2) / (f64::from(samples) * f64::from(samples - 1))).sqrt()
}

#[test]
fn clouds_without_absorption_are_invisible_in_a_white_furnace() {
    let mut device = open();
    for density in [0.02, 0.2, 2.0] {
        for estimator in [Estimator::NextEvent, Estimator::Analogue] {
            let particles = heap(12).into_iter().map(|p| ParticleDesc { density: p.density * density, ..p }).collect();
            let params = scene(particles, Style::Pyroclastic);
            let environment = Environment::Uniform([1.0, 0.5, 0.25]);
            let options = PathOptions { environment, estimator, sun: SunShape::Disc, ..PathOptions::default() };
            let tracer = traced(&mut device, &params, [24, 24], options, 4);
            let mut covered = 0;
            for pixel in &tracer.state().pixels {
                covered += u32::from(pixel.transmittance < 0.9);
                for (radiance, sky) in pixel.radiance.iter().zip([1.0, 0.5, 0.25]) {
                    let sum = radiance + pixel.transmittance * sky;
                    // Every sample brings home exactly what its ray does not let through; the rest is f32 rounding.
                    assert!((sum - sky).abs() < 1e-5, "{density} {estimator:?}: {sum}");
                }
            }
            assert!(covered > 10, "the heap is in the picture");
        }
    }
    silent(&device);
}

#[test]
fn transmittance_of_sphere_and_slab_is_the_closed_form() {
    let mut device = open();
    let sphere = ball([0.0, 0.0, -300.0], [80.0; 3], 0.3, [1.0; 3]);
    // So wide that its two faces are planes: 100 m apart at the centre, 2e-4 less at the edge of the picture.
    let slab = ball([0.0, 0.0, -300.0], [2.0e4, 2.0e4, 50.0], 0.2, [1.0; 3]);
    for (particle, slab) in [(sphere, false), (slab, true)] {
        let params = scene(vec![particle], Style::Homogeneous);
        let size = [32, 32];
        let tracer = traced(&mut device, &params, size, PathOptions::default(), 128);
        let pixels = tracer.state().pixels;
        let check = |(i, p): (usize, &PixelSums)| {
            let expected = if slab {
                let dir = params.camera.ray(i as u32 % size[0], i as u32 / size[0], size[0], size[1]);
                (-f64::from(params.clouds.sigma_t) * 0.2 * 100.0 / -dir[2]).exp()
            } else {
                segments::exact(&cut(&params, &[particle], size, i)).transmittance
            };
            Check { mean: f64::from(p.transmittance), error: binary_error(expected, 128), expected }
        };
        let checks: Vec<_> = pixels.iter().enumerate().map(check).collect();
        assert_unbiased(&blocks(&checks, size), 1e-4, if slab { "slab" } else { "sphere" });
    }
    silent(&device);
}

#[test]
fn flat_scenes_converge_to_the_event_sweep() {
    let mut device = open();
    let particles = heap(30);
    let mut params = scene(particles.clone(), Style::Homogeneous);
    params.clouds.lighting = Lighting::Flat;
    let size = [32, 32];
    let tracer = traced(&mut device, &params, size, PathOptions::default(), 128);
    let pixels = tracer.state().pixels;
    let exact: Vec<_> = (0..pixels.len()).map(|i| segments::exact(&cut(&params, &particles, size, i))).collect();
    for c in 0..4 {
        let check = |(p, e): (&PixelSums, &segments::Composite)| match c {
            3 => {
                let error = binary_error(e.transmittance, 128);
                Check { mean: f64::from(p.transmittance), error, expected: e.transmittance }
            }
            c => {
                let error = error(p.radiance_m2[c], 128);
                Check { mean: f64::from(p.radiance[c]), error, expected: e.radiance[c] }
            }
        };
        let checks: Vec<_> = pixels.iter().zip(&exact).map(check).collect();
        assert_unbiased(&blocks(&checks, size), 1e-4, ["red", "green", "blue", "transmittance"][c]);
    }
    silent(&device);
}

#[test]
fn every_particle_of_the_procedural_grid_is_met() {
    let mut device = open();
    let mut params = Params::default();
    params.quality = Preset::Low.quality();
    params.clouds.style = Style::Homogeneous;
    params.clouds.coverage = Coverage::Uniform(0.3);
    params.clouds.sigma_t = 2.0e-4; // thin, so that most rays cross everything on their way
    params.sky.model = SkyModel::None;
    let size = [32, 20];
    let tracer = traced(&mut device, &params, size, PathOptions { seed: 3, ..PathOptions::default() }, 64);
    let design = welkin::grid::GridDesign::new(&params.clouds, &params.quality, welkin::definitions::PLANET_RADIUS);
    let list: Vec<ParticleDesc> = generate(&design.frame(params.camera.position, [0.0; 3]), &[])
        .particles
        .iter()
        .map(|p| ParticleDesc {
            rotation: p.rotation,
            ..ball(p.centre.map(f64::from), p.semi_axes, p.density * p.fade, [0.0; 3])
        })
        .collect();
    assert_eq!(list.len() as u32, tracer.cells().particles);
    let pixels = tracer.state().pixels;
    let check = |(i, p): (usize, &PixelSums)| {
        let expected = segments::exact(&cut(&params, &list, size, i)).transmittance;
        Check { mean: f64::from(p.transmittance), error: binary_error(expected, 64), expected }
    };
    let checks: Vec<_> = pixels.iter().enumerate().map(check).collect();
    // At 100 km positions have steps of 8 mm, of particles some 100 m across.
    assert_unbiased(&blocks(&checks, size), 1e-3, "grid");
    silent(&device);
}

#[test]
fn a_single_sphere_agrees_with_the_tables_monte_carlo() {
    let mut device = open();
    // Radius and optical radius; the paper's mixed medium.
    for (radius, elevation) in [(100.0f32, 20.0f64), (100.0, 60.0)] {
        let mut params = scene(vec![ball([0.0, 0.0, -2000.0], [radius; 3], 1.0, [0.0; 3])], Style::Homogeneous);
        params.clouds.sigma_t = 0.04;
        params.camera.fov_y = 4.0;
        params.sun =
            Sun { position: SunPosition::Angles { elevation, azimuth: 100.0 }, irradiance: [1.0; 3], ..Sun::default() };
        let optical_radius = f64::from(params.clouds.sigma_t * radius);
        let clouds = &params.clouds;
        let medium = Medium {
            phase: PhaseFunction::CornetteShanks,
            g_sun: f64::from(clouds.g_single),
            g: f64::from(clouds.g_multiple),
            albedo: 1.0,
        };
        let (size, samples) = ([16, 16], 64);
        let tracer = traced(&mut device, &params, size, PathOptions::default(), samples);
        let pixels = tracer.state().pixels;
        let to_sun = DVec3::from_array(params.sun.to_sun());
        let (mut sum, mut wanted, mut variance) = (0.0, 0.0, 0.0);
        for (i, pixel) in pixels.iter().enumerate() {
            let dir = DVec3::from_array(params.camera.ray(i as u32 % 16, i as u32 / 16, 16, 16));
            let o = DVec3::new(0.0, 0.0, 2000.0) / f64::from(radius);
            let closest = o - o.dot(dir) * dir;
            if closest.length_squared() > 0.98 {
                continue;
            }
            let ray = LitRay { entry: closest - (1.0 - closest.length_squared()).sqrt() * dir, dir, to_sun };
            let single = single_scattering(&ray, optical_radius) * medium.phase.eval(to_sun.dot(dir), medium.g_sun);
            let multiple = multiple_scattering(&medium, &ray, optical_radius, None, 500, 1 + i as u64);
            let (mean, own) = (f64::from(pixel.radiance[0]), error(pixel.radiance_m2[0], samples));
            let (expected, both) = (single + multiple.mean, own.hypot(multiple.error));
            (sum, wanted, variance) = (sum + mean, wanted + expected, variance + both * both);
        }
        let z = (sum - wanted) / variance.sqrt();
        println!("sphere, sun {elevation}: {sum:.4} and {wanted:.4}, {z:.2} standard errors of {:.4}", variance.sqrt());
        assert!(z.abs() < 3.0 && variance.sqrt() < 0.04 * wanted, "{sum} {wanted} {z}");
    }
    silent(&device);
}

/// A heap in the sun, against a loop on the CPU that shares no method with the device. Both tell their paths per second.
#[test]
fn a_heap_agrees_with_regular_tracking_on_the_cpu() {
    let mut device = open();
    let particles = heap(30);
    let mut params = scene(particles.clone(), Style::Homogeneous);
    params.sun = Sun {
        position: SunPosition::Angles { elevation: 40.0, azimuth: 240.0 },
        irradiance: [1.0; 3],
        ..Sun::default()
    };
    params.clouds.g_single = params.clouds.g_multiple; // a sharper peak is for the CPU loop to hit by chance
    let (size, samples) = ([24, 24], 128);
    let started = Instant::now();
    let tracer = traced(&mut device, &params, size, PathOptions::default(), samples);
    let device_rate = f64::from(size[0] * size[1] * samples) / started.elapsed().as_secs_f64();
    let pixels = tracer.state().pixels;
    let (clouds, to_sun) = (&params.clouds, DVec3::from_array(params.sun.to_sun()));
    let ellipsoids = particles.iter().map(|p| Ellipsoid::of_desc(p, clouds.sigma_t)).collect();
    let medium = Medium {
        phase: PhaseFunction::CornetteShanks,
        g_sun: clouds.g_single.into(),
        g: clouds.g_multiple.into(),
        albedo: 1.0,
    };
    let sunlit = Sunlit { scene: Scene { ellipsoids }, medium, to_sun };
    let (mut random, paths, started) = (1, 16u32, Instant::now());
    let (mut sum, mut wanted, mut variance) = (0.0, 0.0, 0.0);
    for (i, pixel) in pixels.iter().enumerate() {
        let dir = DVec3::from_array(params.camera.ray(i as u32 % size[0], i as u32 / size[0], size[0], size[1]));
        let values: Vec<f64> = (0..paths).map(|_| sunlit.path(DVec3::ZERO, dir, &mut random)).collect();
        let mean = values.iter().sum::<f64>() / f64::from(paths);
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        variance += squares / f64::from(paths * (paths - 1)) + error(pixel.radiance_m2[0], samples).powi(2);
        sum += f64::from(pixel.radiance[0]);
        wanted += mean;
    }
    let rate = f64::from(size[0] * size[1] * paths) / started.elapsed().as_secs_f64();
    println!("{device_rate:.0} paths/s on the device, {rate:.0} on one CPU thread");
    let z = (sum - wanted) / variance.sqrt();
    assert!(z.abs() < 3.0 && variance.sqrt() < 0.04 * wanted, "{sum} {wanted} {z} {}", variance.sqrt());
    silent(&device);
}

#[test]
fn two_estimators_have_one_mean() {
    let mut device = open();
    let mut thin = scene(vec![ball([0.0, 0.0, -300.0], [60.0; 3], 0.3, [0.0; 3])], Style::Homogeneous);
    thin.camera.fov_y = 22.0;
    (thin.clouds.g_single, thin.clouds.g_multiple) = (0.5, 0.3);
    let mut absorbing = scene(heap(8), Style::Homogeneous);
    absorbing.clouds.albedo = 0.8;
    (absorbing.clouds.g_single, absorbing.clouds.g_multiple) = (0.6, 0.4);
    let mut soft = scene(heap(12), Style::Radial);
    (soft.clouds.g_single, soft.clouds.g_multiple) = (0.6, 0.6);
    let mut rough = scene(heap(12), Style::Pyroclastic);
    rough.clouds.albedo = 0.95;
    (rough.clouds.g_single, rough.clouds.g_multiple) = (0.3, -0.2);
    for (name, mut params) in [("thin", thin), ("absorbing", absorbing), ("soft", soft), ("rough", rough)] {
        // So large that walks meet it now and then.
        params.sun = Sun { angular_radius: 10.0, irradiance: [1.0; 3], ..Sun::default() };
        let options = PathOptions { sun: SunShape::Disc, ..PathOptions::default() };
        let analogue = PathOptions { estimator: Estimator::Analogue, seed: 7, ..options };
        let mean = |tracer: &PathTracer| {
            let (samples, pixels) = (tracer.samples(), tracer.state().pixels);
            let sum = |of: &dyn Fn(&PixelSums) -> f64| pixels.iter().map(of).sum::<f64>();
            (sum(&|p| f64::from(p.radiance[0])), sum(&|p| error(p.radiance_m2[0], samples).powi(2)).sqrt())
        };
        let (a, da) = mean(&traced(&mut device, &params, [20, 20], options, 24));
        let (b, db) = mean(&traced(&mut device, &params, [20, 20], analogue, 160));
        println!("{name}: {a:.4} ± {da:.4} with rays to the sun, {b:.4} ± {db:.4} without");
        assert!((a - b).abs() < 3.0 * da.hypot(db), "{name}: {a} ± {da}, {b} ± {db}");
        assert!(da < 0.08 * a && db < 0.15 * b, "{name}: too noisy to tell");
    }
    silent(&device);
}

#[test]
fn the_variance_is_honest() {
    let mut device = open();
    let mut params = scene(heap(6), Style::Homogeneous);
    params.clouds.sigma_t = 0.03;
    params.camera.fov_y = 25.0;
    let mut tracer = PathTracer::new(device.frames(), &params, [8, 8], &PathOptions::default()).unwrap();
    let (mut told, mut sums) = (0.0, vec![[0.0f64; 2]; 64]);
    for seed in 0..64 {
        tracer.reseed(seed);
        gather(&mut device, &mut tracer, 16);
        for (pixel, sum) in tracer.state().pixels.iter().zip(&mut sums) {
            let value = f64::from(pixel.radiance[1]);
            *sum = [sum[0] + value, sum[1] + value * value];
            told += error(pixel.radiance_m2[1], 16).powi(2) / 64.0;
        }
    }
    let seen: f64 = sums.iter().map(|[s, s2]| (s2 - s * s / 64.0) / 63.0).sum();
    println!("variance of 64 seeds: {seen:.5} seen, {told:.5} told");
    assert!((told / seen - 1.0).abs() < 0.2, "{told} {seen}");
    silent(&device);
}

#[test]
fn the_same_seed_gives_the_same_bits_however_it_is_split_and_resumed() {
    let mut device = open();
    let params = scene(heap(6), Style::Pyroclastic);
    let options = PathOptions { seed: 11, ..PathOptions::default() };
    let at_once = traced(&mut device, &params, [20, 12], options, 9).state();

    let mut first = traced(&mut device, &params, [20, 12], options, 1);
    gather(&mut device, &mut first, 4);
    let broken = first.run(device.frames(), 9, &mut |_| ControlFlow::Break(())).unwrap();
    assert!(broken.is_break() && first.samples() == 4, "what is broken off leaves whole passes");
    let bytes = first.state().to_bytes();
    let mut second = PathTracer::new(device.frames(), &params, [20, 12], &options).unwrap();
    second.restore(State::from_bytes(&bytes).unwrap()).unwrap();
    gather(&mut device, &mut second, 9);
    assert!(second.state() == at_once);

    let other = traced(&mut device, &params, [20, 12], PathOptions { seed: 12, ..options }, 9);
    assert!(other.state().pixels != at_once.pixels);
    let refused = second.restore(other.state()).unwrap_err().to_string();
    assert!(refused.starts_with("state = of another picture: expected"), "{refused}");
    silent(&device);
}

#[test]
fn the_picture_is_the_renderers_over_black_and_over_a_sky() {
    let mut device = open();
    let mut params = scene(heap(8), Style::Homogeneous);
    params.clouds.lighting = Lighting::Flat;
    params.camera.position = [0.0, 800.0, 0.0];
    if let Source::Particles(list) = &mut params.clouds.source {
        list.iter_mut().for_each(|p| p.centre[1] += 900.0);
    }
    for model in [SkyModel::None, SkyModel::Atmosphere] {
        params.sky.model = model;
        let mut tracer = traced(&mut device, &params, [24, 16], PathOptions::default(), 16);
        let truth = tracer.develop(device.frames()).unwrap();
        let sky = truth.transmittance.iter().position(|&t| t == 1.0).unwrap();
        let cloud = truth.transmittance.iter().position(|&t| t < 0.5).unwrap();
        if model == SkyModel::None {
            assert_eq!(truth.radiance[sky], [0.0; 3]);
            assert_eq!(truth.radiance, truth.cloud);
        } else {
            assert!(truth.radiance[sky].iter().all(|&c| c > 0.0));
        }
        assert_eq!(truth.variance[sky], [0.0; 3]);
        assert!(truth.variance.iter().flatten().any(|&v| v > 0.0), "edges are drawn by chance");
        assert!((200.0..600.0).contains(&truth.distance[cloud]), "{}", truth.distance[cloud]);
        assert!(truth.distance[sky] == welkin::blend::NO_CLOUD);
    }
    silent(&device);
}

/// A ray along the walls of the grid's cells has components of 0: it must cross cells, not creep along them.
#[test]
fn a_sun_on_the_horizon_due_south_costs_no_more_steps_than_another() {
    let mut device = open();
    let steps = |device: &mut Standalone, elevation, azimuth| {
        let mut params = scene(vec![ball([0.0, 0.0, -300.0], [60.0; 3], 1.0, [1.0; 3])], Style::Homogeneous);
        params.sun = Sun { position: SunPosition::Angles { elevation, azimuth }, ..Sun::default() };
        traced(device, &params, [8, 8], PathOptions::default(), 16).work().steps as f64
    };
    let (along, across) = (steps(&mut device, 0.0, 180.0), steps(&mut device, 20.0, 200.0));
    assert!(along < 3.0 * across, "{along} steps, {across} for another sun");
    silent(&device);
}

/// A ball that reaches into more cells than a thread may visit on some drivers, for the small ones in it, and a pile of
/// particles in one place: lists as long.
#[test]
fn large_particles_among_small_ones_and_many_in_one_place_are_all_met() {
    let mut device = open();
    let mut particles = vec![ball([0.0, 0.0, -2000.0], [900.0; 3], 4e-3, [1.0; 3])];
    for i in 0..8 {
        let side = |bit: i32| if i >> bit & 1 == 1 { 500.0 } else { -500.0 };
        particles.push(ball([side(0), side(1), -2000.0 + side(2)], [12.0; 3], 1.0, [1.0; 3]));
    }
    for i in 0..700 {
        let near = |k: i32| 40.0 * ((f64::from(i * k) * 0.618_034).fract() - 0.5);
        particles.push(ball([near(1), near(7), -2000.0 + near(13)], [150.0; 3], 2e-4, [1.0; 3]));
    }
    let params = scene(particles.clone(), Style::Homogeneous);
    let size = [32, 32];
    let tracer = traced(&mut device, &params, size, PathOptions::default(), 128);
    let check = |(i, p): (usize, &PixelSums)| {
        let expected = segments::exact(&cut(&params, &particles, size, i)).transmittance;
        Check { mean: f64::from(p.transmittance), error: binary_error(expected, 128), expected }
    };
    let checks: Vec<_> = tracer.state().pixels.iter().enumerate().map(check).collect();
    println!("{:?}", tracer.cells());
    assert_unbiased(&blocks(&checks, size), 1e-4, "large and small");
    silent(&device);
}
