//! Sunlight and skylight on the device against `welkin::reference::lighting`: brute force over all pairs, in f64.

#[path = "support/clouds.rs"]
mod clouds;

use clouds::{Setup, Stages, open, read, silent};
use glam::DVec3;
use welkin::params::Coverage;
use welkin::reference::grid;
use welkin::reference::lighting::{SunShares, chord_ahead, reach, smooth, sun_optical_depth, sun_shares};
use welkin::shared::{Particle, ParticleLight};

fn to_sun(elevation: f64) -> [f64; 3] {
    let (elevation, azimuth) = (elevation.to_radians(), 150.0f64.to_radians());
    [elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos()]
}

#[test]
fn no_occluder_is_missed_whatever_the_suns_height() {
    for elevation in [0.5, 5.0, 35.0, 90.0] {
        let mut setup = Setup { to_sun: to_sun(elevation), ..Setup::default() };
        if elevation < 10.0 {
            setup.clouds.coverage = Coverage::Uniform(0.15); // or everything lies in shadow
        }
        let mut device = open();
        let stages = Stages::new(&device, &setup);
        let counters = stages.run(&mut device, &setup);
        assert_eq!(counters.truncated, 0);
        let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
        let device_values: Vec<ParticleLight> = read(&mut device, stages.lighting.sun_light(), counters.stored);
        let t = setup.tiling_params();
        let (mut least, mut greatest) = (1.0f64, 0.0f64);
        for index in (0..particles.len()).step_by(particles.len() / 400) {
            let start = DVec3::from_array(particles[index].centre.map(f64::from));
            let sun = DVec3::from_array(setup.to_sun);
            let pole = reach(&particles[index], sun) * sun;
            let extinction = f64::from(t.extinction);
            let tau = [start + pole, start, start - pole]
                .map(|point| sun_optical_depth(&particles, point, sun, extinction, Some(index)));
            let p = &particles[index];
            let own = 2.0 * pole.length() * extinction * f64::from(p.density) * f64::from(p.fade);
            let clouds = &setup.clouds;
            let SunShares { diffuse, gathered, direct } = sun_shares(tau, own, clouds.xi.into(), clouds.transfer);
            let got = f64::from(device_values[index].gathered);
            assert!((got - gathered).abs() < 1e-3, "{elevation}°, particle {index}: {got}, expected {gathered}");
            for i in 0..3 {
                // f32 positions relative to a particle are good to 4 mm of some 100 m; the direction to 1e-7 of up to
                // 8e4 m.
                for (got, expected) in
                    [(device_values[index].diffuse[i], diffuse[i]), (device_values[index].direct[i], direct[i])]
                {
                    let got = f64::from(got);
                    assert!(
                        (got - expected).abs() < 1e-3,
                        "{elevation}°, particle {index}: {got}, expected {expected}"
                    );
                }
                (least, greatest) = (least.min(direct[i]), greatest.max(direct[i]));
            }
        }
        assert!(
            least < 0.5 && greatest > 0.9,
            "{elevation}°: the scene must hold light and shadow: {least} {greatest}"
        );
        silent(&device);
    }
}

#[test]
fn smoothing_and_skylight_are_those_of_the_reference() {
    let mut setup = Setup::default();
    setup.clouds.smoothing = 0.8;
    let mut device = open();
    let stages = Stages::new(&device, &setup);
    let counters = stages.run(&mut device, &setup);
    let sun_light: Vec<ParticleLight> = read(&mut device, stages.lighting.sun_light(), counters.stored);
    let [pole, _, far] = [0, 1, 2].map(|i| sun_light.iter().map(|t| f64::from(t.diffuse[i])).collect::<Vec<_>>());
    let lights: Vec<ParticleLight> = read(&mut device, stages.set.lights(), counters.stored);
    let params = setup.grid_params();
    let grid = grid::generate(&params, &[]);
    for (index, light) in lights.iter().enumerate() {
        let smoothing = f64::from(setup.clouds.smoothing);
        let (sun, sky) = smooth(&grid, &params, &pole, smoothing, index);
        let (shade, _) = smooth(&grid, &params, &far, smoothing, index);
        // Sums of ten f32, one exponential each.
        assert!((f64::from(light.diffuse[0]) - sun).abs() < 1e-5, "{index}: {light:?} {sun}");
        assert!((f64::from(light.diffuse[2]) - shade).abs() < 1e-5);
        assert_eq!(light.direct, sun_light[index].direct, "only what was scattered is smoothed");
        assert!((f64::from(light.ambient) - sky).abs() < 1e-5, "{index}: {light:?} {sky}");
    }
    silent(&device);
}

fn ball(x: f32, density: f32) -> Particle {
    let (centre, rotation) = ([x, 3000.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
    Particle { centre, density, rotation, semi_axes: [100.0; 3], fade: 1.0, colour: [1.0; 3], id: 0 }
}

/// Known slip of the authors' released code: the receiver's density took the occluder's place.
#[test]
fn an_occluder_counts_with_its_own_density() {
    let particles = [ball(0.0, 5.0), ball(300.0, 0.25)];
    let tau = sun_optical_depth(&particles, DVec3::new(0.0, 3000.0, 0.0), DVec3::X, 0.01, Some(0));
    assert!((tau - 0.01 * 0.25 * 200.0).abs() < 1e-9); // f64 rounding
}

/// Known slip: smoothing skipped the neighbour below layer 1.
#[test]
fn layer_one_is_smoothed_with_the_layer_below_it() {
    let setup = Setup::default();
    let params = setup.grid_params();
    let grid = grid::generate(&params, &[]);
    let index = grid.cell_and_layer.iter().position(|packed| packed & 31 == 1).expect("a column of two layers");
    let mut transmittance = vec![0.0; grid.particles.len()];
    transmittance[index - 1] = 1.0;
    assert!(smooth(&grid, &params, &transmittance, 0.7, index).0 > 0.01);
}

#[test]
fn the_chord_ahead_is_whole_in_front_half_from_the_centre_none_behind() {
    let ball = ball(0.0, 1.0);
    let chord = |x: f64| chord_ahead(&ball, DVec3::new(x, 3000.0, 0.0), DVec3::X);
    for (x, expected) in [(-500.0, 200.0), (0.0, 100.0), (50.0, 50.0), (101.0, 0.0)] {
        assert!((chord(x) - expected).abs() < 1e-9, "{x}: {}", chord(x)); // f64 rounding
    }
}
