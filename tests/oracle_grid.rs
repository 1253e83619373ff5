//! Cells and particles on the device against `welkin::reference::grid`: decisions equal, floats within rounding.

#[path = "support/clouds.rs"]
mod clouds;

use clouds::{Setup, Stages, open, read, silent};
use welkin::params::{Animation, Coverage, CoverageMap};
use welkin::reference::grid;
use welkin::shared::Particle;

/// Positions reach 6e4 m, where f32 has steps of 4 mm, and go through five operations; directions and sizes through about
/// twenty operations of 6e-8 relative error each, or three units in the last place where the shader divides.
fn assert_alike(device: &Particle, reference: &Particle) {
    assert_eq!(device.id, reference.id);
    let near = |a: f32, b: f32, bound: f32| assert!((a - b).abs() <= bound, "{a} {b}\n{device:?}\n{reference:?}");
    for i in 0..3 {
        near(device.centre[i], reference.centre[i], 0.02);
        near(device.semi_axes[i], reference.semi_axes[i], 4e-6 * reference.semi_axes[i]);
        near(device.colour[i], reference.colour[i], 0.0);
    }
    for i in 0..4 {
        near(device.rotation[i], reference.rotation[i], 4e-6);
    }
    near(device.density, reference.density, 1e-6);
    near(device.fade, reference.fade, 0.0);
}

fn compare(setup: &Setup, map: &[f32]) {
    let mut device = open();
    let stages = Stages::new(&device, setup);
    let counters = stages.run(&mut device, setup);
    let expected = grid::generate(&setup.grid_params(), map);

    let valid = expected.shapes.iter().filter(|shape| shape.layers > 0).count();
    assert!(valid > 500, "the scene must hold clouds to say anything: {valid} cells");
    assert_eq!(counters.cells, expected.shapes.len() as u32);
    assert_eq!(counters.valid_cells, valid as u32);
    assert_eq!(counters.generated, expected.particles.len() as u32);
    assert_eq!(counters.stored, counters.generated);

    let shapes: Vec<[f32; 4]> = read(&mut device, stages.grid.cell_shapes(), counters.cells);
    for (cell, (device, reference)) in shapes.iter().zip(&expected.shapes).enumerate() {
        // Exact: the number of layers hangs on these.
        let reference =
            [reference.height, reference.body, reference.weight, (reference.layers + 64 * reference.puffs) as f32];
        assert_eq!(*device, reference, "cell {cell}");
    }
    assert_eq!(read::<u32>(&mut device, stages.grid.cell_first(), counters.cells), expected.first);
    assert_eq!(read::<u32>(&mut device, stages.set.cells(), counters.stored), expected.cell_and_layer);
    let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
    for (device, reference) in particles.iter().zip(&expected.particles) {
        assert_alike(device, reference);
    }
    silent(&device);
}

#[test]
fn cells_and_particles_are_those_of_the_reference() {
    compare(&Setup::default(), &[]);
}

#[test]
fn a_coverage_image_is_sampled_alike_and_repeats() {
    let values: Vec<f32> = (0..15).map(|i| (i * 7 % 15) as f32 / 14.0).collect();
    // 9 km wide: some eight repeats across the rings, on both sides of the origin.
    let map =
        CoverageMap { width: 5, height: 3, values: values.clone(), extent: 9_000.0, offset: [0.0; 2], rotation: 0.0 };
    let mut setup = Setup { camera: [0.0, 500.0, 0.0], origin: [0.0; 3], ..Setup::default() };
    setup.clouds.coverage = Coverage::Map(map);
    compare(&setup, &values);
}

/// A sheared wind and clouds that grow, at `time`.
fn in_motion(time: f64) -> Setup {
    let wind = vec![[4.0, -1.0], [9.0, 2.0], [11.0, 6.0]];
    Setup { animation: Animation { wind, evolution: 1.0 / 600.0, time, ..Animation::default() }, ..Setup::default() }
}

#[test]
fn clouds_in_wind_and_evolution_are_those_of_the_reference_at_any_time() {
    compare(&in_motion(0.0), &[]);
    compare(&in_motion(1234.5), &[]);
}

#[test]
fn clouds_in_pure_wind_are_those_that_a_camera_sees_moving_the_other_way() {
    // 1024 m: a step of the floating origin, hence the same floats.
    let (wind, time) = (vec![[10.24, -20.48]], 100.0);
    let mut windy = Setup::default();
    windy.animation = Animation { wind, time, ..Animation::default() };
    let still = Setup::default();
    let away = |p: [f64; 3]| [p[0] - 1024.0, p[1], p[2] + 2048.0];
    let moved = Setup { camera: away(still.camera), origin: away(still.origin), ..Setup::default() };
    assert_eq!(windy.grid_params().ring_first, moved.grid_params().ring_first);
    let (windy, moved) = (grid::generate(&windy.grid_params(), &[]), grid::generate(&moved.grid_params(), &[]));
    assert_eq!(windy.cell_and_layer, moved.cell_and_layer);
    for (a, b) in windy.particles.iter().zip(&moved.particles) {
        assert_eq!(a.id, b.id);
        assert_eq!((a.semi_axes, a.rotation, a.density), (b.semi_axes, b.rotation, b.density));
        // The corners of rings differ by an f32 rounding of 6e4 m, and so do fades, by 4 mm in four cells.
        assert!((0..3).all(|i| (a.centre[i] - b.centre[i]).abs() < 0.02) && (a.fade - b.fade).abs() < 1e-4);
    }
}

#[test]
fn nothing_pops_while_clouds_drift_and_grow() {
    let at = |time: f64| {
        let grid = grid::generate(&in_motion(time).grid_params(), &[]);
        let strength = |p: &Particle| p.fade * p.density;
        grid.particles.iter().map(|p| (p.id, (strength(p), *p))).collect::<std::collections::HashMap<_, _>>()
    };
    for start in [0.0, 700.0] {
        // A frame of 60 Hz: 3e-5 lives, in which the field changes by less than 3e-4 (src/reference/density.rs has 0.015 in
        // 1e-3 lives), an appearing column by 20 times 1.5 of that, and a layer's fade by a tenth of it at most.
        let (before, after) = (at(start), at(start + 1.0 / 60.0));
        assert!(before.len() > 10_000);
        for (id, (strength, particle)) in &before {
            let (later, other) = after.get(id).map_or((0.0, *particle), |(later, other)| (*later, *other));
            assert!((strength - later).abs() < 0.02, "{id}: {strength} {later}\n{particle:?}\n{other:?}");
            if *strength > 0.02 {
                let size = particle.semi_axes.iter().zip(other.semi_axes).map(|(a, b)| (a - b).abs() / a);
                assert!(size.fold(0.0f32, f32::max) < 0.02, "{particle:?}\n{other:?}");
                let way = (0..3).map(|i| (particle.centre[i] - other.centre[i]).abs()).fold(0.0f32, f32::max);
                assert!(way < 3.0, "{way} m\n{particle:?}\n{other:?}"); // 0.2 m of wind; the rest is growth
            }
        }
        let born = after.iter().filter(|(id, _)| !before.contains_key(id));
        assert!(born.map(|(_, (strength, _))| *strength).fold(0.0f32, f32::max) < 0.02);
    }
}

#[test]
fn a_coverage_image_that_is_moved_and_turned_is_sampled_alike() {
    let values: Vec<f32> = (0..20).map(|i| (i * 13 % 20) as f32 / 19.0).collect();
    let mut setup = Setup { camera: [0.0, 500.0, 0.0], origin: [0.0; 3], ..Setup::default() };
    for (offset, rotation) in [([4_321.0, -98_765.4], -33.0), ([0.0, 0.0], 180.0)] {
        let map = CoverageMap { width: 4, height: 5, values: values.clone(), extent: 7_000.0, offset, rotation };
        setup.clouds.coverage = Coverage::Map(map);
        compare(&setup, &values);
    }
}

/// By plain geometry in f64, so that neither sign nor sense hang on the formula that device and oracle share.
#[test]
fn a_coverage_image_lies_where_it_is_put_and_its_top_points_where_it_is_turned() {
    let mut setup = Setup { camera: [0.0, 500.0, 0.0], origin: [0.0; 3], ..Setup::default() };
    // One white texel, the middle one of the top row of 3 × 3: 2 km towards its top from the picture's centre.
    let mut values = vec![0.0; 9];
    values[1] = 1.0;
    let offset = [3_000.0, 1_000.0];
    for (rotation, [east, north]) in [(0.0, [0.0, 2_000.0]), (90.0, [2_000.0, 0.0]), (-90.0, [-2_000.0, 0.0])] {
        let map = CoverageMap { width: 3, height: 3, values: values.clone(), extent: 6_000.0, offset, rotation };
        setup.clouds.coverage = Coverage::Map(map);
        let params = setup.grid_params();
        let peak = [offset[0] + east, offset[1] - north];
        let distance = |cell: u32| {
            let centre = grid::cell_place(cell, &params).centre.map(f64::from);
            (centre[0] - peak[0]).hypot(centre[1] - peak[1])
        };
        let ring = 0..params.ring_dim * params.ring_dim;
        let nearest = ring.min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap();
        let value = grid::coverage_at(&grid::cell_place(nearest, &params), &values, &params);
        // Bilinear: falls by 1 over 2 km along each axis.
        let expected = 1.0 - 2.0 * distance(nearest) / 2_000.0;
        assert!(distance(nearest) < 200.0 && f64::from(value) > expected, "{rotation}°: {value} of {expected}");
    }
}

#[test]
fn output_is_bit_equal_run_to_run() {
    let setup = Setup::default();
    let mut device = open();
    let stages = Stages::new(&device, &setup);
    let mut runs = (0..5).map(|_| {
        let counters = stages.run(&mut device, &setup);
        let particles: Vec<u8> = read(&mut device, stages.set.particles(), counters.stored * 64);
        let lights: Vec<u8> = read(&mut device, stages.lighting.lights(), counters.stored * 16);
        let order: Vec<u32> = read(&mut device, stages.compact.order(), counters.visible);
        (counters, particles, lights, order)
    });
    let first = runs.next().unwrap();
    assert!(runs.all(|run| run == first));
    silent(&device);
}

#[test]
fn a_list_that_is_too_short_counts_on_and_is_cured_by_growing() {
    let setup = Setup::default();
    let mut device = open();
    let mut stages = Stages::with_capacity(&device, &setup, 1000);
    let short = stages.run(&mut device, &setup);
    let needed = grid::generate(&setup.grid_params(), &[]).particles.len() as u32;
    assert_eq!((short.generated, short.stored), (needed, 1000));
    let gpu = device.gpu().clone();
    assert!(stages.set.grow(&gpu, &short).unwrap());
    assert!(stages.compact.grow(&gpu, &stages.set).unwrap());
    assert!(stages.lighting.grow(&gpu, &stages.set).unwrap());
    stages.tiling.grow(&gpu, &short, &stages.set).unwrap();
    device.frames().state().forget();
    let cured = stages.run(&mut device, &setup);
    assert_eq!((cured.generated, cured.stored), (needed, needed));
    assert!(!stages.set.grow(&gpu, &cured).unwrap());
    silent(&device);
}
