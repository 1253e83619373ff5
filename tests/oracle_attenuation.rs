//! The attenuation volume on the device against `welkin::reference::attenuation`, which adds every particle to every voxel
//! behind it in f64, and against exact integrals through the ellipsoids.

#[path = "support/clouds.rs"]
mod clouds;

use clouds::{PLANET, Setup, Stages, open, read, silent};
use glam::{DQuat, DVec3, EulerRot};
use welkin::gpu::standalone::Standalone;
use welkin::gpu::{Buffer, BufferKind};
use welkin::grid::{ParticleList, ParticleSet};
use welkin::lighting::attenuation::volume::{AttenuationDesign, AttenuationParams, AttenuationVolume};
use welkin::lighting::tables::volume::{VolumeMedium, VolumePlace};
use welkin::params::{Clouds, ParticleDesc, Precision, Style};
use welkin::reference::attenuation::Attenuation;
use welkin::reference::lighting::sun_optical_depth;
use welkin::shared::Particle;

fn to_sun(elevation: f64, azimuth: f64) -> [f64; 3] {
    let (elevation, azimuth) = (elevation.to_radians(), azimuth.to_radians());
    [elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos()]
}

/// Numbers in [0, 1).
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1u64 << 24) as f64
    }
}

/// Ellipsoids turned any way, in a box `extent` wide, high and deep.
fn ellipsoids(count: usize, extent: [f64; 3], radius: f64) -> Vec<ParticleDesc> {
    let mut random = random(7);
    let mut one = || {
        let centre = [0, 1, 2].map(|axis| 2000.0 + extent[axis] * (random() - 0.5));
        let radii = [0, 1, 2].map(|_| (radius * (0.5 + random())) as f32);
        let turn = DQuat::from_euler(EulerRot::XYZ, 6.0 * random(), 6.0 * random(), 6.0 * random());
        let rotation = turn.to_array().map(|c| c as f32);
        ParticleDesc { centre, radii, rotation, density: 0.1 + 0.3 * random() as f32, ..ParticleDesc::default() }
    };
    (0..count).map(|_| one()).collect()
}

/// Homogeneous particles: all of the ellipsoid dims.
fn medium() -> VolumeMedium {
    VolumeMedium::new(&Clouds { style: Style::Homogeneous, ..Clouds::default() }, 1.0)
}

/// Particles on the device and as they are there, and the volume's box around them.
struct List {
    set: ParticleSet,
    particles: Vec<Particle>,
    extent: [f64; 3],
    place: VolumePlace,
}

fn list(device: &mut Standalone, particles: &[ParticleDesc], to_sun: [f64; 3]) -> List {
    let gpu = device.gpu().clone();
    let mut list = ParticleList::new(&gpu, particles, 2).unwrap();
    let set = ParticleSet::new(&gpu, list.count()).unwrap();
    let origin = [2048.0, 0.0, 2048.0];
    device.frames().run(|rec| list.record(rec, origin, &set)).unwrap();
    let [least, greatest] = list.bounds();
    let place = VolumePlace {
        centre: std::array::from_fn(|i| 0.5 * (least[i] + greatest[i]) - origin[i]),
        origin,
        base: least[1],
        planet_radius: f64::INFINITY,
        to_sun,
    };
    let particles = (0..particles.len()).map(|i| list.particle(i, origin)).collect();
    List { set, particles, extent: std::array::from_fn(|i| greatest[i] - least[i]), place }
}

/// Every voxel's optical depth.
fn depths(
    device: &mut Standalone,
    design: AttenuationDesign,
    place: &VolumePlace,
    medium: &VolumeMedium,
    set: &ParticleSet,
) -> (AttenuationParams, Vec<f32>) {
    let gpu = device.gpu().clone();
    let volume = AttenuationVolume::new(&gpu, Some(design), Precision::F32, 2).unwrap();
    let voxels = design.extent().map(|n| n as usize).iter().product::<usize>();
    let readback = Buffer::new(&gpu, "depths", 4 * voxels as u64, BufferKind::Readback).unwrap();
    device
        .frames()
        .run(|rec| {
            rec.pass("attenuation", |rec| volume.record(rec, place, medium, set))?;
            rec.copy_image_to_buffer(volume.image(), &readback);
            rec.make_visible_to_host(&readback);
            Ok(())
        })
        .unwrap();
    device.frames().state().forget();
    (design.frame(place, medium), readback.read(0, voxels))
}

/// Asserts that transmittances agree within `bound` of themselves: optical depths within `bound`, or that share of them where
/// nothing is left of the light. Rounding to units of 1/65536 is 1.5e-5 at most a particle; places in f32 make the rest, most of
/// it at outlines, where a way grows as the root of the distance. Hence also a tighter bound for the root mean square.
fn assert_agree(name: &str, got: &[f32], expected: &[f64], bound: f64) {
    assert_eq!(got.len(), expected.len());
    let (mut worst, mut deepest, mut sum) = (0.0f64, 0.0f64, 0.0);
    for (index, (&got, &expected)) in got.iter().zip(expected).enumerate() {
        let difference = (f64::from(got) - expected).abs() / expected.max(1.0);
        assert!(difference < bound, "{name}, voxel {index}: {got}, expected {expected}");
        (worst, deepest) = (worst.max(difference), deepest.max(expected));
        sum += difference * difference;
    }
    let mean = (sum / got.len() as f64).sqrt();
    assert!(mean < 5e-5, "{name}: {mean:.1e}");
    println!("{name}: {} voxels up to {deepest:.1}, worst {worst:.1e}, mean {mean:.1e}", got.len());
    assert!(deepest > 5.0, "{name}: the scene wants shade");
}

#[test]
fn every_voxel_of_a_heap_in_a_high_sun_and_of_a_field_in_a_low_one_is_that_of_the_reference() {
    let mut device = open();
    let scenes = [
        ("heap", ellipsoids(60, [1200.0, 800.0, 1000.0], 250.0), to_sun(42.0, 245.0), 64),
        ("field", ellipsoids(3000, [9000.0, 500.0, 7000.0], 60.0), to_sun(12.0, 100.0), 96),
        ("tower in a sun at the horizon", ellipsoids(200, [500.0, 4000.0, 500.0], 80.0), to_sun(-0.3, 10.0), 48),
    ];
    for (name, particles, to_sun, resolution) in scenes {
        let list = list(&mut device, &particles, to_sun);
        let design = AttenuationDesign::of_list(list.extent, resolution);
        let (params, got) = depths(&mut device, design, &list.place, &medium(), &list.set);
        assert_agree(name, &got, &Attenuation(&params).depths(&list.particles), 1e-3);
    }
    silent(&device);
}

#[test]
fn every_voxel_of_every_level_of_a_sky_is_that_of_the_reference() {
    let mut device = open();
    for (elevation, bound) in [(35.0, 2e-3), (1.0, 2e-2)] {
        let setup = Setup { to_sun: to_sun(elevation, 150.0), ..Setup::default() };
        let stages = Stages::new(&device, &setup);
        let counters = stages.run(&mut device, &setup);
        let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
        let clouds = &setup.clouds;
        let (cell, thickness) = (setup.design().cell_edge(), f64::from(clouds.thickness));
        let design = AttenuationDesign::of_layer(cell, clouds.particle_cutoff.into(), thickness, 64);
        assert!(design.levels() > 2, "the test wants levels in each other");
        let place = VolumePlace {
            centre: std::array::from_fn(|i| setup.camera[i] - setup.origin[i]),
            origin: setup.origin,
            base: clouds.altitude.into(),
            planet_radius: PLANET,
            to_sun: setup.to_sun,
        };
        let (params, got) = depths(&mut device, design, &place, &VolumeMedium::new(clouds, 0.8), &stages.set);
        // Columns of a low sun are sheared 19 to 1, which should make places across the light as much less exact; only voxels at
        // outlines are off by more than 1e-3. That rounding is all of it has not been shown.
        assert_agree(&format!("sky at {elevation}°"), &got, &Attenuation(&params).depths(&particles), bound);
    }
    silent(&device);
}

#[test]
fn the_order_of_particles_changes_no_bit() {
    let mut device = open();
    let mut particles = ellipsoids(500, [1500.0, 800.0, 1500.0], 120.0);
    let mut volumes = Vec::new();
    for seed in 1..4 {
        let list = list(&mut device, &particles, to_sun(42.0, 245.0));
        let design = AttenuationDesign::of_list(list.extent, 48);
        let (_, got) = depths(&mut device, design, &list.place, &medium(), &list.set);
        volumes.push(got.into_iter().map(f32::to_bits).collect::<Vec<_>>());
        let mut random = random(seed);
        for i in (1..particles.len()).rev() {
            particles.swap(i, (random() * (i + 1) as f64) as usize);
        }
    }
    assert!(volumes[0] == volumes[1] && volumes[1] == volumes[2]);
    silent(&device);
}

/// Transmittance at points inside the particles, looked up in the device's volume, against exact integrals.
#[test]
fn transmittance_converges_to_the_exact_one_at_first_order_or_better() {
    let mut device = open();
    let particles = ellipsoids(40, [1200.0, 800.0, 1000.0], 250.0);
    let sun = to_sun(42.0, 245.0);
    let list = list(&mut device, &particles, sun);
    let mut random = random(3);
    let points: Vec<DVec3> = (0..4000)
        .map(|i| {
            let p = &list.particles[i % list.particles.len()];
            let ball = DVec3::new(random(), random(), random()) * 1.1 - 0.55;
            let axes = DVec3::from_array(p.semi_axes.map(f64::from));
            let turn = DQuat::from_array(p.rotation.map(f64::from));
            DVec3::from_array(p.centre.map(f64::from)) + turn * (axes * ball)
        })
        .collect();
    let medium = VolumeMedium { extinction: 0.008, ..medium() };
    let extinction = f64::from(medium.extinction);
    let transmittance =
        |point: DVec3| (-sun_optical_depth(&list.particles, point, DVec3::from_array(sun), extinction, None)).exp();
    let exact: Vec<f64> = points.iter().map(|&point| transmittance(point)).collect();
    let lit = exact.iter().filter(|t| **t > 0.1).count();
    assert!(lit > 400 && lit < 3600, "the test wants light and shade: {lit}");
    let error = |resolution: u32, device: &mut Standalone| {
        let design = AttenuationDesign::of_list(list.extent, resolution);
        let (params, got) = depths(device, design, &list.place, &medium, &list.set);
        let got: Vec<f64> = got.into_iter().map(f64::from).collect();
        let volume = Attenuation(&params);
        let sum: f64 = points
            .iter()
            .zip(&exact)
            .map(|(&point, exact)| ((-volume.look_up(&got, point)).exp() - exact).powi(2))
            .sum();
        (sum / points.len() as f64).sqrt()
    };
    let errors = [32, 64, 128, 256].map(|resolution| error(resolution, &mut device));
    println!("root mean square error of transmittance at 32³, 64³, 128³, 256³: {errors:.5?}");
    // Outlines, where a way grows as the root of the distance, hold it to first order; inside it is second.
    for (pair, n) in errors.windows(2).zip([32, 64, 128]) {
        assert!(pair[1] < 0.55 * pair[0], "from {n}³ on the error only falls from {} to {}", pair[0], pair[1]);
    }
    assert!(errors[2] < 0.01, "{errors:?}");
    silent(&device);
}

#[test]
fn voxels_of_a_sky_stay_where_they_are_while_the_camera_moves() {
    let design = AttenuationDesign::of_layer(150.0, 4.0e4, 900.0, 64);
    let at = |x: f64, origin: f64| {
        let place = VolumePlace {
            centre: [x - origin, 500.0, 3.0],
            origin: [origin, 0.0, 0.0],
            base: 1000.0,
            planet_radius: f64::INFINITY,
            to_sun: to_sun(30.0, 60.0),
        };
        design.frame(&place, &medium())
    };
    let point = DVec3::new(1234.0, 1400.0, -777.0);
    for level in 0..design.levels() as usize {
        let place = |x: f64, origin: f64| {
            Attenuation(&at(x, origin)).place(level, point - DVec3::new(origin, 0.0, 0.0)).fract()
        };
        for (x, origin) in [(31.0, 0.0), (7_777.0, 0.0), (5_010.0, 2048.0)] {
            let moved = (place(x, origin) - place(0.0, 0.0)).abs();
            // f32 offsets of up to 100 voxels; a fraction may wrap.
            assert!(moved.map(|m| m.min(1.0 - m)).max_element() < 1e-3, "level {level}, {x}: {moved}");
        }
    }
}

#[test]
fn a_volume_larger_than_the_device_has_is_named_by_its_key() {
    let device = open();
    let limit = device.gpu().capabilities().max_image_dimension_3d;
    let design = AttenuationDesign::of_list([1.0; 3], limit + 1);
    let Err(error) = AttenuationVolume::new(device.gpu(), Some(design), Precision::F16, 2) else {
        panic!("it was made")
    };
    let message = error.to_string();
    let expected = format!("clouds.attenuation_resolution = {}: expected at most {limit}", limit + 1);
    assert!(message.starts_with(&expected), "{message}");
    silent(&device);
}
