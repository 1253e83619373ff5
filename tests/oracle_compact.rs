//! Visibility, packing and sorting on the device against `welkin::reference::compact` and the standard library.

#[path = "support/clouds.rs"]
mod clouds;

use clouds::{Setup, Stages, open, read, silent};
use welkin::compact::{Compact, Scan, Sort, VERTICES_PER_PARTICLE, frustum_planes};
use welkin::gpu::Buffer;
use welkin::reference::compact::{draw_order, reach_into};
use welkin::reference::density::pcg;
use welkin::shared::Particle;

#[test]
fn every_particle_in_view_is_drawn_once_back_to_front() {
    let setup = Setup::default();
    let mut device = open();
    let stages = Stages::new(&device, &setup);
    let counters = stages.run(&mut device, &setup);
    let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
    let order: Vec<u32> = read(&mut device, stages.compact.order(), counters.visible);

    let frame = setup.frame();
    let planes = frustum_planes(&frame);
    let mut visible = vec![false; particles.len()];
    order.iter().for_each(|&index| visible[index as usize] = true);
    assert_eq!(visible.iter().filter(|seen| **seen).count(), order.len(), "a particle is drawn twice");
    let mut seen = 0;
    for (particle, visible) in particles.iter().zip(&visible) {
        let reach = reach_into(particle, &planes);
        // Between 0 and the shader's slack (0.1 % of the size + 0.05 m, and as much again for f32) either is right.
        let slack = 0.002 * f64::from(particle.semi_axes.iter().fold(0.0f32, |a, &b| a.max(b))) + 0.1;
        assert!(*visible || reach <= 0.0, "culled although it reaches {reach} m into view: {particle:?}");
        assert!(!*visible || reach >= -slack, "drawn although it is {} m out of view: {particle:?}", -reach);
        seen += u32::from(reach > 0.0);
    }
    assert!(seen > 200 && seen < counters.stored / 2, "the view must hold some and miss some: {seen}");
    assert_eq!(order, draw_order(&particles, &visible, frame.camera));

    let args: Vec<u32> = read(&mut device, stages.compact.args(), 12);
    let draw = &args[Compact::DRAW_ARGS as usize / 4..];
    assert_eq!(draw, [VERTICES_PER_PARTICLE, counters.visible, 0, 0]);
    silent(&device);
}

#[test]
fn a_plane_through_the_eye_keeps_what_surrounds_the_eye() {
    let setup = Setup::default();
    let frame = setup.frame();
    let planes = frustum_planes(&frame);
    let at = |offset: f32, radius: f32| Particle {
        centre: std::array::from_fn(|i| frame.camera[i] + offset * frame.forward[i]),
        density: 1.0,
        rotation: [0.0, 0.0, 0.0, 1.0],
        semi_axes: [radius; 3],
        fade: 1.0,
        colour: [1.0; 3],
        id: 0,
    };
    assert!(reach_into(&at(0.0, 100.0), &planes) > 0.0);
    assert!(reach_into(&at(-50.0, 100.0), &planes) > 0.0);
    assert!(reach_into(&at(-101.0, 100.0), &planes) < 0.0);
    assert!(reach_into(&at(1.0e4, 1.0), &planes) > 0.0);
}

/// Lengths around the blocks of 1024 and rounds of 1024 blocks that the shaders work in.
const LENGTHS: [u32; 8] = [0, 1, 63, 1023, 1024, 1025, 70_000, 1_100_000];

#[test]
fn prefix_sums_are_exact_for_any_length() {
    let mut device = open();
    let gpu = device.gpu().clone();
    let longest = LENGTHS[7];
    let scan = Scan::new(&gpu, longest).unwrap();
    let numbers: Vec<u32> = (0..longest).map(|i| pcg(i) % 25).collect();
    let values = Buffer::upload(&gpu, "values", &numbers).unwrap();
    let scanned = Buffer::array::<u32>(&gpu, "scanned", longest as usize).unwrap();
    let total = Buffer::array::<u32>(&gpu, "total", 1).unwrap();
    for length in LENGTHS {
        device.frames().run(|rec| scan.record(rec, &values, length, &scanned, &total)).unwrap();
        let mut sum = 0;
        let expected: Vec<u32> = numbers[..length as usize]
            .iter()
            .map(|number| {
                sum += number;
                sum - number
            })
            .collect();
        assert_eq!(read::<u32>(&mut device, &total, 1), [sum], "{length}");
        if length > 0 {
            assert!(read::<u32>(&mut device, &scanned, length) == expected, "{length}");
        }
    }
    silent(&device);
}

#[test]
fn sorting_is_stable_for_any_length() {
    let mut device = open();
    let gpu = device.gpu().clone();
    let longest = LENGTHS[6];
    let sort = Sort::new(&gpu, longest).unwrap();
    // Few different high bits and many equal keys: ties must keep their order.
    let all: Vec<u32> = (0..longest).map(|i| if i % 3 == 0 { pcg(i) } else { pcg(i) % 100 }).collect();
    for length in LENGTHS.into_iter().filter(|&length| length <= longest) {
        let unsorted = &all[..length as usize];
        let keys = Buffer::upload(&gpu, "keys", unsorted).unwrap();
        let indices = Buffer::upload(&gpu, "indices", &(0..length).collect::<Vec<u32>>()).unwrap();
        let count = Buffer::upload(&gpu, "count", &[7, length]).unwrap();
        let args = Buffer::upload(&gpu, "args", &[0, length.div_ceil(1024), 1, 1]).unwrap();
        device.frames().run(|rec| sort.record(rec, (&count, 1), (&args, 4), &keys, &indices)).unwrap();
        let mut expected: Vec<u32> = (0..length).collect();
        expected.sort_by_key(|&i| unsorted[i as usize]);
        if length > 0 {
            assert!(read::<u32>(&mut device, &indices, length) == expected, "{length}");
        }
    }
    silent(&device);
}
