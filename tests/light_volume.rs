//! The light that diffuses through the clouds, against `welkin::reference::volume`, conservation and closed forms.

#[path = "support/clouds.rs"]
mod clouds;

use clouds::{PLANET, Setup, Stages, open, read, silent};
use glam::DVec3;
use welkin::gpu::Buffer;
use welkin::gpu::standalone::Standalone;
use welkin::grid::{ParticleList, ParticleSet};
use welkin::lighting::tables::volume::{LightVolume, VACUUM, VolumeDesign, VolumeMedium, VolumeParams, VolumePlace};
use welkin::params::{Clouds, ParticleDesc, Style};
use welkin::reference::lighting::reach;
use welkin::reference::volume::{Volume, extinction};
use welkin::shared::{Particle, ParticleLight};

/// What a volume holds once `record` has run.
struct Light {
    params: VolumeParams,
    matter: Vec<[u32; 2]>,
    light: Vec<[f32; 2]>,
    radiance: Vec<f32>,
}

fn light(
    device: &mut Standalone,
    design: VolumeDesign,
    place: &VolumePlace,
    medium: &VolumeMedium,
    set: &ParticleSet,
    sun_depths: &Buffer,
) -> Light {
    let volume = LightVolume::new(device.gpu(), design, 2).unwrap();
    device.frames().run(|rec| rec.pass("volume", |rec| volume.record(rec, place, medium, set, sun_depths))).unwrap();
    let params = design.frame(place, medium);
    let voxels = params.dim * params.dim * params.layers;
    let (matter, light) = (read(device, volume.matter(), voxels), read(device, volume.light(), voxels));
    let radiance = read(device, volume.radiance(), voxels);
    device.frames().state().forget();
    Light { params, matter, light, radiance }
}

/// A list of particles, with nothing between any of them and the sun.
fn light_of_list(device: &mut Standalone, particles: &[ParticleDesc], medium: &VolumeMedium, own: f32) -> Light {
    let gpu = device.gpu().clone();
    let mut list = ParticleList::new(&gpu, particles, 2).unwrap();
    let set = ParticleSet::new(&gpu, list.count()).unwrap();
    device.frames().run(|rec| rec.pass("grid", |rec| list.record(rec, [0.0; 3], &set))).unwrap();
    let depths = Buffer::upload(&gpu, "depths", &vec![[0.0, 0.0, 0.0, own]; particles.len()]).unwrap();
    let [least, greatest] = list.bounds();
    let design = VolumeDesign::of_list(std::array::from_fn(|i| greatest[i] - least[i]), list.greatest_extent().into());
    let place = VolumePlace {
        centre: std::array::from_fn(|i| 0.5 * (least[i] + greatest[i])),
        origin: [0.0; 3],
        base: least[1],
        planet_radius: f64::INFINITY,
        to_sun: [0.0, 1.0, 0.0],
    };
    light(device, design, &place, medium, &set, &depths)
}

#[test]
fn a_sky_has_the_light_of_the_converged_solution_and_all_of_its_matter() {
    for albedo in [1.0, 0.9] {
        let mut setup = Setup::default();
        setup.clouds.albedo = albedo;
        let mut device = open();
        let stages = Stages::new(&device, &setup);
        let counters = stages.run(&mut device, &setup);
        let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
        let clouds = &setup.clouds;
        let (cutoff, thickness) = (f64::from(clouds.particle_cutoff), f64::from(clouds.thickness));
        let design = VolumeDesign::of_layer(setup.design().cell_edge(), setup.quality.cells, cutoff, thickness);
        let medium = VolumeMedium::new(clouds, 0.8);
        let place = VolumePlace {
            centre: std::array::from_fn(|i| setup.camera[i] - setup.origin[i]),
            origin: setup.origin,
            base: clouds.altitude.into(),
            planet_radius: 6.371e6,
            to_sun: setup.to_sun,
        };
        let Light { params, matter, light, .. } =
            light(&mut device, design, &place, &medium, &stages.set, stages.lighting.sun_depths());
        assert!(params.levels > 2, "the test wants levels in each other: {}", params.levels);
        let volume = Volume(&params);

        // The coarsest level holds everything, for it has the mean of what the finer ones hold.
        let last = params.levels as usize - 1;
        let [width, height] = volume.size(last);
        let held: f64 = volume.voxels(last).map(|voxel| extinction(matter[volume.index(last, voxel)])[0]).sum::<f64>();
        let given: f64 = particles
            .iter()
            .map(|p| f64::from(p.density * p.fade) * p.semi_axes.map(f64::from).iter().product::<f64>())
            .sum();
        let given = given * f64::from(medium.extinction) * 4.0 / 3.0 * std::f64::consts::PI;
        let held = held * width * width * height;
        assert!((held / given - 1.0).abs() < 5e-3, "voxels hold {held}, particles {given}");

        // So many sweeps come this close to as many as it takes.
        let expected = volume.fluence(&matter);
        for level in 0..params.levels as usize {
            let (mut error, mut total) = (0.0, 0.0);
            for index in volume.voxels(level).map(|voxel| volume.index(level, voxel)) {
                let weight = extinction(matter[index])[0];
                error += weight * (f64::from(light[index][1]) - expected[index]).powi(2);
                total += weight * expected[index].powi(2);
            }
            let relative = (error / total).sqrt();
            println!("albedo {albedo}, level {level}: {relative:.4}");
            // Voxels that are kilometres wide take longer, and nobody sees them from near.
            let bound = if volume.size(level)[0] < 3000.0 { 0.03 } else { 0.1 };
            assert!(relative < bound, "albedo {albedo}, level {level}: {relative}");
        }
        silent(&device);
    }
}

/// The sky of [`Setup`], its voxels and where they lie.
fn sky(device: &mut Standalone) -> (Setup, Stages, VolumeDesign, VolumeMedium, VolumePlace) {
    let setup = Setup::default();
    let stages = Stages::new(device, &setup);
    stages.run(device, &setup);
    let (clouds, edge) = (&setup.clouds, setup.design().cell_edge());
    let (cutoff, thickness) = (f64::from(clouds.particle_cutoff), f64::from(clouds.thickness));
    let design = VolumeDesign::of_layer(edge, setup.quality.cells, cutoff, thickness);
    let medium = VolumeMedium::new(clouds, 0.8);
    let place = VolumePlace {
        centre: std::array::from_fn(|i| setup.camera[i] - setup.origin[i]),
        origin: setup.origin,
        base: clouds.altitude.into(),
        planet_radius: PLANET,
        to_sun: setup.to_sun,
    };
    (setup, stages, design, medium, place)
}

#[test]
fn voxels_shine_as_in_the_reference() {
    let mut device = open();
    let (_, stages, design, medium, place) = sky(&mut device);
    let found = light(&mut device, design, &place, &medium, &stages.set, stages.lighting.sun_depths());
    let volume = Volume(&found.params);
    let fluence: Vec<f64> = found.light.iter().map(|light| f64::from(light[1])).collect();
    let expected = volume.radiance(&found.matter, &fluence);
    let brightest = expected.iter().copied().fold(0.0, f64::max);
    for (index, (&got, &expected)) in found.radiance.iter().zip(&expected).enumerate() {
        assert!((f64::from(got) - expected).abs() < 1e-5 * brightest, "voxel {index}: {got}, expected {expected}");
    }

    silent(&device);
}

#[test]
fn each_visible_particle_has_value_and_slope_of_the_look_up() {
    let mut device = open();
    let (setup, stages, design, medium, place) = sky(&mut device);
    let gpu = device.gpu().clone();
    let frame = setup.frame();
    let frame_buffer = Buffer::upload(&gpu, "frame", &[frame]).unwrap();
    let volume = LightVolume::new(&gpu, design, 2).unwrap();
    let depths = stages.lighting.sun_depths();
    let slot = device
        .frames()
        .run(|rec| {
            rec.pass("volume", |rec| {
                volume.record(rec, &place, &medium, &stages.set, depths)?;
                volume.record_seen(rec, &frame_buffer, &stages.set, &stages.compact, stages.lighting.lights())
            })?;
            stages.counters.record(rec, &stages.set);
            Ok(rec.slot())
        })
        .unwrap();
    let counters = stages.counters.read(slot);
    let params = design.frame(&place, &medium);
    let radiance: Vec<f32> = read(&mut device, volume.radiance(), params.dim * params.dim * params.layers);
    let radiance: Vec<f64> = radiance.into_iter().map(f64::from).collect();
    let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
    let lights: Vec<ParticleLight> = read(&mut device, stages.lighting.lights(), counters.stored);
    let order: Vec<u32> = read(&mut device, stages.compact.order(), counters.visible);
    assert!(counters.visible > 1000 && counters.visible < counters.stored / 2, "the test wants some that are seen");

    let mut seen = vec![false; particles.len()];
    let camera = DVec3::from(frame.camera.map(f64::from));
    let brightest = radiance.iter().copied().fold(0.0, f64::max);
    for index in order.into_iter().map(|index| index as usize) {
        seen[index] = true;
        let (particle, light) = (&particles[index], &lights[index]);
        let centre = DVec3::from(particle.centre.map(f64::from));
        let view = (centre - camera).normalize();
        let half_chord = reach(particle, view);
        let extinction = f64::from(frame.sigma_t * particle.density * particle.fade * frame.fill);
        let depth = (2.5 / extinction).min(1.0 / f64::from(VACUUM));
        let middle = centre + (depth - half_chord) * view;
        let (value, _) = Volume(&params).look_up(&radiance, middle.into());
        let crowd = f64::from(light.crowd);
        let [x, y, z, offset] = light.others.map(f64::from);
        let got = DVec3::new(x, y, z).dot(middle) + offset;
        assert!((got - crowd * value).abs() < 3e-4 * brightest, "particle {index}: {got}, expected {}", crowd * value);
        let steepest = brightest / f64::from(params.height);
        // Slopes jump from cell to cell: rounding of a place between two may take the other one's.
        let nudges = (0..3).flat_map(|axis| [0.05, -0.05].map(|by| DVec3::AXES[axis] * by)).chain([DVec3::ZERO]);
        let difference = nudges
            .map(|nudge| DVec3::from(Volume(&params).look_up(&radiance, (middle + nudge).into()).1))
            .map(|slope| (DVec3::new(x, y, z) - crowd * slope).length())
            .fold(f64::INFINITY, f64::min);
        assert!(difference < 1e-3 * steepest, "particle {index}: slope is {difference} off, the steepest {steepest}");
    }
    let unseen = lights.iter().zip(&seen).filter(|(_, seen)| !**seen);
    assert!(unseen.map(|(light, _)| light.others).all(|others| others == [0.0; 4]));
    silent(&device);
}

/// Boxes follow the camera by two voxels at a time: what is looked at in them must not show it.
#[test]
fn light_does_not_jump_when_the_boxes_move() {
    let mut device = open();
    let (setup, stages, design, medium, place) = sky(&mut device);
    let mut at = |x: f64| {
        let place = VolumePlace { centre: [x - setup.origin[0], place.centre[1], place.centre[2]], ..place };
        light(&mut device, design, &place, &medium, &stages.set, stages.lighting.sun_depths())
    };
    // They move where the camera is half way between two even voxels.
    let even = 2.0 * design.edge * (setup.camera[0] / (2.0 * design.edge)).round();
    let (before, after) = (at(even + 0.99 * design.edge), at(even + 1.01 * design.edge));
    let (old, new) = (Volume(&before.params), Volume(&after.params));
    assert_eq!(new.size(0), old.size(0));
    let moved = ((after.params.corner[0][0] - before.params.corner[0][0]) / after.params.corner[0][2]).round() as i32;
    assert_eq!(moved, 2, "the test wants boxes that move");
    let (dim, rim) = (before.params.dim as i32, 2);
    let (mut error, mut total) = (0.0, 0.0);
    for [x, y, z] in old.voxels(0).filter(|[x, _, z]| [x, z].iter().all(|&&i| (rim + 2..dim - rim - 2).contains(&i))) {
        let (a, b) = (old.index(0, [x, y, z]), new.index(0, [x - moved, y, z]));
        let weight = extinction(before.matter[a])[0];
        error += weight * f64::from(before.light[a][1] - after.light[b][1]).powi(2);
        total += weight * f64::from(before.light[a][1]).powi(2);
    }
    let relative = (error / total).sqrt();
    println!("light moves by {relative:.5}");
    assert!(relative < 0.02, "{relative}");
    silent(&device);
}

/// A deck of grey ellipsoids so flat and wide that it is a slab, lit from above: what leaves it below, over what leaves it at
/// both sides, is that of P1 for a slab with Marshak's conditions.
#[test]
fn a_deck_lets_through_what_diffusion_does() {
    let mut device = open();
    for depth in [4.0, 16.0f32] {
        // Overlapping layers of blades, each 40 km wide: homogeneous but for the outermost.
        let (thickness, count) = (1000.0, 50);
        let flat = |i: usize| ParticleDesc {
            centre: [0.0, 1000.0 + thickness * (i as f64 + 0.5) / count as f64, 0.0],
            radii: [20_000.0, 40.0, 20_000.0],
            density: 1.0,
            ..ParticleDesc::default()
        };
        let particles: Vec<_> = (0..count).map(flat).collect();
        // Extinction such that the slab has this transport optical depth: a blade's column is 4/3 of its semi-axis.
        let column = count as f32 * 4.0 / 3.0 * 40.0;
        let medium = VolumeMedium { extinction: depth / column, albedo: 1.0, asymmetry: 0.0, shade: 0.0, body: 1.0 };
        let gpu = device.gpu().clone();
        let mut list = ParticleList::new(&gpu, &particles, 2).unwrap();
        let set = ParticleSet::new(&gpu, list.count()).unwrap();
        device.frames().run(|rec| rec.pass("grid", |rec| list.record(rec, [0.0; 3], &set))).unwrap();
        let depths = Buffer::upload(&gpu, "depths", &vec![[0.0f32; 4]; particles.len()]).unwrap();
        let design = VolumeDesign { dim: 32, layers: 27, levels: 1, edge: 1000.0, height: 42.0, fitted: false };
        let to_sun = [0.0, 1.0, 0.0];
        let place = VolumePlace {
            centre: [0.0; 3],
            origin: [0.0; 3],
            base: 1000.0 - 20.0,
            planet_radius: f64::INFINITY,
            to_sun,
        };
        // No shade: the slab is lit evenly throughout, q = σ. Then φ'' = -3 s q is a parabola between its Marshak ends.
        let Light { params, matter, light, .. } = light(&mut device, design, &place, &medium, &set, &depths);
        let volume = Volume(&params);
        let column: Vec<_> = (0..params.layers as i32).map(|y| volume.index(0, [16, y, 16])).collect();
        let middle = column[column.len() / 2];
        let s = extinction(matter[middle])[0];
        let h = thickness;
        // -φ'/(3s) = φ/2 at both ends: φ = 3 s q (h x - x²)/2 + q h, its middle 3 s q h²/8 + q h.
        let closed = s * (3.0 * s * h * h / 8.0 + h);
        let got = f64::from(light[middle][1]);
        let exact = volume.fluence(&matter)[middle];
        println!("τ = {depth}: φ {got}, converged {exact}, closed form {closed}");
        assert!((exact / closed - 1.0).abs() < 0.02, "τ = {depth}: {exact}, closed form {closed}");
        assert!((got / exact - 1.0).abs() < 0.03, "τ = {depth}: {got}, converged {exact}");
    }
    silent(&device);
}

/// A voxel's matter is that of the ellipsoid wherever it lies, and its sunlight that of the way through it.
#[test]
fn a_ball_is_splat_whole_and_lit_through() {
    let mut device = open();
    let ball = |x: f64, y: f64| ParticleDesc {
        centre: [x, y, -x],
        radii: [300.0; 3],
        density: 0.5,
        ..ParticleDesc::default()
    };
    for (x, y) in [(0.0, 1000.0), (37.0, 1011.0), (1234.5, 777.0)] {
        let clouds = Clouds { style: Style::Homogeneous, ..Clouds::default() };
        let medium = VolumeMedium { asymmetry: 0.0, albedo: 0.5, ..VolumeMedium::new(&clouds, 1.0) };
        assert_eq!((medium.body, medium.shade, medium.extinction), (1.0, 1.0, clouds.sigma_t));
        let own = 2.0 * 300.0 * 0.5 * clouds.sigma_t;
        let Light { params, matter, .. } = light_of_list(&mut device, &[ball(x, y)], &medium, own);
        let volume = Volume(&params);
        let [width, height] = volume.size(0);
        let mut sum = [0.0; 2];
        for voxel in volume.voxels(0) {
            let [sigma, lit] = extinction(matter[volume.index(0, voxel)]);
            assert!(lit <= sigma * 1.0001);
            sum = [sum[0] + sigma, sum[1] + lit];
        }
        let sigma = 0.5 * f64::from(clouds.sigma_t);
        let mass = 4.0 / 3.0 * std::f64::consts::PI * 300.0f64.powi(3) * sigma;
        let got = sum.map(|s| s * width * width * height);
        assert!((got[0] / mass - 1.0).abs() < 2e-3, "{} of {mass}", got[0]);
        // What a ball takes out of a beam: π r² (1 - 2 (1 - (1 + τ) e^(-τ)) / τ²), τ its diameter. A voxel takes the light at the
        // middle of its part, averaged along the light alone; across it the mean of exp(-τ) is greater: 9 % are missing.
        let tau = 2.0 * sigma * 300.0;
        let taken =
            std::f64::consts::PI * 300.0f64.powi(2) * (1.0 - 2.0 * (1.0 - (1.0 + tau) * (-tau).exp()) / (tau * tau));
        println!("at {x}, {y}: {:.4} of its matter, {:.4} of what it takes out", got[0] / mass, got[1] / taken);
        assert!((got[1] / taken - 1.0).abs() < 0.1, "{} of {taken}", got[1]);
    }
    silent(&device);
}

#[test]
fn voxels_stay_where_they_are_while_the_camera_moves() {
    let design = VolumeDesign::of_layer(150.0, 96, 4.0e4, 900.0);
    let medium = VolumeMedium::new(&Clouds::default(), 0.8);
    let at = |x: f64, origin: f64| {
        let place = VolumePlace {
            centre: [x - origin, 500.0, 3.0],
            origin: [origin, 0.0, 0.0],
            base: 1000.0,
            planet_radius: 6.371e6,
            to_sun: [0.0, 1.0, 0.0],
        };
        design.frame(&place, &medium)
    };
    for (x, origin) in [(0.0, 0.0), (31.0, 0.0), (7_777.0, 0.0), (250_010.0, 245_760.0)] {
        let params = at(x, origin);
        for level in 0..params.levels as usize {
            let [corner, _, edge, _] = params.corner[level].map(f64::from);
            let index = (corner + origin) / edge;
            assert!((index - index.round()).abs() < 1e-3, "level {level}: voxels begin at {index}");
            let middle = corner + 0.5 * f64::from(params.dim) * edge;
            assert!((middle - (x - origin)).abs() <= 1.01 * edge, "level {level} is centred at {middle}, not {x}");
            if level > 0 {
                let inner = (f64::from(params.corner[level - 1][0]) - corner) / edge;
                assert!((inner - f64::from(params.stack[level][0])).abs() < 1e-3, "level {level}: {inner}");
            }
        }
    }
}
