//! Cells and particles on the device against `welkin::reference::grid`: decisions equal, floats within rounding.

#[path = "support/clouds.rs"]
mod clouds;

use clouds::{Setup, Stages, open, read, silent};
use welkin::params::{Coverage, CoverageMap};
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
    let map = CoverageMap { width: 5, height: 3, values: values.clone(), extent: 9_000.0 };
    let mut setup = Setup { camera: [0.0, 500.0, 0.0], origin: [0.0; 3], ..Setup::default() };
    setup.clouds.coverage = Coverage::Map(map);
    compare(&setup, &values);
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
