//! Multiple forward scattering on the device against `welkin::reference::forward`: all pairs of particles, in f64.

#[path = "support/clouds.rs"]
mod clouds;
mod support;

use clouds::{Setup, Stages, open, read, silent};
use glam::{DQuat, EulerRot};
use welkin::gpu::Feature;
use welkin::gpu::standalone::Standalone;
use welkin::grid::{ParticleList, ParticleSet};
use welkin::lighting::forward::serial::Serial;
use welkin::lighting::forward::{IncidentPass, forward_share};
use welkin::params::{Clouds, Coverage, Forward, ForwardPhase, LIGHT_CAPACITY, ParticleDesc, Quality, Splat};
use welkin::reference::forward::{Pass, as_published, incident};
use welkin::shared::Particle;
use welkin::tiling::{ListOrder, Slab, Tiling, TilingParams};

fn to_light(elevation: f64, azimuth: f64) -> [f64; 3] {
    let (elevation, azimuth) = (elevation.to_radians(), azimuth.to_radians());
    [elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos()]
}

fn pass_of(clouds: &Clouds) -> Pass {
    Pass {
        splat: clouds.forward.splat,
        forward: forward_share(clouds),
        solid_angle: clouds.forward.solid_angle.into(),
        resolution: clouds.forward.resolution,
    }
}

/// The greatest relative error of component `light` of all particles, and the least and the greatest light expected.
fn worst(device: &[[f32; LIGHT_CAPACITY]], light: usize, expected: &[f64]) -> (f64, f64, f64) {
    assert_eq!(device.len(), expected.len());
    let (mut worst, mut least, mut greatest) = (0.0f64, 1.0f64, 0.0f64);
    for (got, &expected) in device.iter().zip(expected) {
        // Below 1e-12 there is no light, and f32 ends some decades further.
        worst = worst.max((f64::from(got[light]) - expected).abs() / expected.max(1e-12));
        (least, greatest) = (least.min(expected), greatest.max(expected));
    }
    (worst, least, greatest)
}

/// A heap of turned ellipsoids, `count` of them.
fn heap(count: usize) -> Vec<ParticleDesc> {
    let mut state = 7u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1u64 << 24) as f64
    };
    (0..count)
        .map(|_| {
            let turn = DQuat::from_euler(EulerRot::XYZ, 6.0 * random(), 6.0 * random(), 6.0 * random());
            ParticleDesc {
                centre: [900.0 * random() - 450.0, 2000.0 + 700.0 * random(), -900.0 * random()],
                radii: std::array::from_fn(|_| (40.0 + 90.0 * random()) as f32),
                rotation: turn.to_array().map(|c| c as f32),
                density: (0.1 + 0.7 * random()) as f32,
                ..ParticleDesc::default()
            }
        })
        .collect()
}

/// A list on the device, and the ways to light it.
struct Lit {
    list: ParticleList,
    set: ParticleSet,
    pass: IncidentPass,
}

impl Lit {
    fn new(device: &Standalone, particles: &[ParticleDesc]) -> Self {
        let gpu = device.gpu();
        let list = ParticleList::new(gpu, particles, 2).unwrap();
        let set = ParticleSet::new(gpu, list.count()).unwrap();
        let pass = IncidentPass::new(gpu, set.capacity()).unwrap();
        Self { list, set, pass }
    }

    fn particles(&self) -> Vec<Particle> {
        (0..self.list.count() as usize).map(|i| self.list.particle(i, [0.0; 3])).collect()
    }

    fn tiles(&self, to_light: [f64; 3], extinction: f32) -> TilingParams {
        let [least, greatest] = self.list.bounds();
        let middle = [0, 1, 2].map(|axis| 0.5 * (least[axis] + greatest[axis]));
        let slab = Slab {
            centre: middle,
            base: least[1],
            thickness: greatest[1] - least[1],
            half_widths: &[(0.5 * (greatest[0] - least[0])).max(0.5 * (greatest[2] - least[2]))],
            greatest_extent: self.list.greatest_extent(),
            planet_radius: f64::INFINITY,
        };
        TilingParams::new(to_light, &slab, extinction)
    }

    /// Light number `at` of all particles, from lists in `order`.
    fn run(
        &mut self,
        device: &mut Standalone,
        order: ListOrder,
        tiles: &TilingParams,
        at: u32,
        clouds: &Clouds,
    ) -> Vec<[f32; LIGHT_CAPACITY]> {
        let gpu = device.gpu().clone();
        let tiling = Tiling::with_order(&gpu, 1, self.set.capacity(), 1 << 20, 2, order).unwrap();
        let Self { list, set, pass } = self;
        device.frames().state().forget();
        device
            .frames()
            .run(|rec| {
                list.record(rec, [0.0; 3], set)?;
                tiling.record(rec, tiles, set)?;
                pass.record(rec, at, (&tiling, rec.slot()), set, clouds)
            })
            .unwrap();
        read(device, self.pass.incident(), self.list.count())
    }
}

fn orders(device: &Standalone) -> Vec<ListOrder> {
    let interlock = device.gpu().capabilities().supports(Feature::FragmentShaderInterlock).is_ok();
    [ListOrder::Sort, ListOrder::Interlock].into_iter().take(1 + usize::from(interlock)).collect()
}

#[test]
fn light_on_every_particle_of_a_list_is_the_references_and_the_same_from_interlock_and_sorting() {
    let mut device = open();
    let mut lit = Lit::new(&device, &heap(500));
    let particles = lit.particles();
    let forward = Forward::default();
    let cases = [
        Forward { ..forward.clone() },
        Forward { splat: Splat::Polynomial, solid_angle: 1.5, ..forward.clone() },
        Forward { phase: ForwardPhase::Scene, resolution: 32, ..forward.clone() },
        Forward { resolution: 256, ..forward },
    ];
    for (case, forward) in cases.into_iter().enumerate() {
        let clouds = Clouds { forward, albedo: 0.9, ..Clouds::default() };
        for elevation in [90.0, 35.0, 4.0] {
            let tiles = lit.tiles(to_light(elevation, 150.0), 0.03);
            let expected = incident(&particles, &tiles, &pass_of(&clouds));
            let mut before = None;
            for order in orders(&device) {
                let got = lit.run(&mut device, order, &tiles, 0, &clouds);
                let (worst, least, greatest) = worst(&got, 0, &expected);
                // Found below 3e-5. Vulkan lets exp(-τ) err by 3 + 2 τ ulp, 3e-6 at τ = 10, in each of some hundred factors.
                assert!(worst < 1e-3, "case {case}, {elevation}°, {order:?}: {worst}");
                assert!(least < 0.05 && greatest > 0.9, "there must be light and shade: {least} {greatest}");
                let bits = got.iter().map(|light| light[0].to_bits()).collect::<Vec<_>>();
                assert_eq!(*before.get_or_insert_with(|| bits.clone()), bits, "{order:?}");
            }
        }
    }
    silent(&device);
}

#[test]
fn light_on_every_particle_of_a_grid_is_the_references() {
    let mut setup = Setup::default();
    setup.quality = Quality { cells: 24, rings: 3, layers: 3, ..Quality::default() };
    setup.clouds.coverage = Coverage::Uniform(0.4);
    let mut device = open();
    let stages = Stages::new(&device, &setup);
    let gpu = device.gpu().clone();
    for elevation in [90.0, 35.0, 6.0] {
        setup.to_sun = to_light(elevation, 150.0);
        let counters = stages.run(&mut device, &setup);
        let tiles = setup.tiling_params();
        let particles: Vec<Particle> = read(&mut device, stages.set.particles(), counters.stored);
        let pass = IncidentPass::new(&gpu, stages.set.capacity()).unwrap();
        for order in orders(&device) {
            let tiling = Tiling::with_order(&gpu, 3, stages.set.capacity(), 1 << 20, 2, order).unwrap();
            device.frames().state().forget();
            device
                .frames()
                .run(|rec| {
                    tiling.record(rec, &tiles, &stages.set)?;
                    pass.record(rec, 0, (&tiling, rec.slot()), &stages.set, &setup.clouds)
                })
                .unwrap();
            let got: Vec<[f32; LIGHT_CAPACITY]> = read(&mut device, pass.incident(), counters.stored);
            let expected = incident(&particles, &tiles, &pass_of(&setup.clouds));
            let (worst, least, greatest) = worst(&got, 0, &expected);
            // Places are good to 4 mm in f32, of particles that measure some 1000 m here.
            assert!(worst < 1e-3, "{elevation}°, {order:?}, {} particles: {worst}", particles.len());
            assert!(least < 0.5 && greatest > 0.9, "{least} {greatest}");
        }
    }
    silent(&device);
}

#[test]
fn each_of_several_lights_has_its_own_number_and_leaves_the_others_alone() {
    let mut device = open();
    let mut lit = Lit::new(&device, &heap(200));
    let (particles, clouds) = (lit.particles(), Clouds::default());
    let directions = [to_light(35.0, 150.0), [0.0, 1.0, 0.0], to_light(5.0, 20.0), to_light(-30.0, 300.0)];
    let tiles = directions.map(|direction| lit.tiles(direction, 0.03));
    let mut got = Vec::new();
    for (at, tiles) in tiles.iter().enumerate() {
        got = lit.run(&mut device, ListOrder::Sort, tiles, at as u32, &clouds);
    }
    for (at, tiles) in tiles.iter().enumerate() {
        let (worst, ..) = worst(&got, at, &incident(&particles, tiles, &pass_of(&clouds)));
        assert!(worst < 1e-3, "light {at}: {worst}"); // as for one
    }
    silent(&device);
}

#[test]
fn the_serial_pass_blends_what_the_papers_say() {
    let mut device = open();
    let lit = Lit::new(&device, &heap(60));
    let (particles, tiles) = (lit.particles(), lit.tiles(to_light(50.0, 150.0), 0.03));
    let clouds = Clouds { albedo: 0.9, ..Clouds::default() };
    let serial = Serial::new(&device.gpu().clone(), 32).unwrap();
    let (got, _) = serial.run(device.frames(), &particles, &tiles, &clouds).unwrap();
    let expected = as_published(&particles, &tiles, &pass_of(&clouds), 32);
    let least = expected.iter().copied().fold(1.0, f64::min);
    assert!(least < 0.5, "there must be shade: {least}");
    for (index, (got, expected)) in got.iter().zip(&expected).enumerate() {
        // Found below 1e-3. Half floats are rounded by up to 2^-12 at each of up to some ten splats.
        assert!((f64::from(*got) - expected).abs() < 2e-3, "particle {index}: {got}, expected {expected}");
    }
    silent(&device);
}

/// A ball in two lights, in one of them below another ball.
const SHADED: &str = r#"
camera = { position = [0, 1000, 0], look_at = [0, 1000, -600], fov_y = 20 }
sky = { model = "none" }
quality = { downscale = 1, precision = "f32" }
[clouds]
source = "particles"
lighting = "forward"
style = "homogeneous"
sigma_t = 0.07
albedo = 0.9
forward_solid_angle = 1e-6
particle = [
    { centre = [0, 1000, -600], radii = [100, 100, 100], density = 0.1 },
    { centre = [0, 1300, -600], radii = [100, 100, 100], density = 0.05 },
]
light = [
    { direction = [0, 1, 0], colour = [2, 1, 0.5] },
    { direction = [0.6, 0, 0.8], colour = [0.2, 0.4, 0.8] },
    { from = "sky" },
]
"#;

#[test]
fn a_ball_shows_what_comes_in_of_each_light_scattered_once_to_the_eye() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sky.toml"), SHADED).unwrap();
    let picture = folder.path().join("out.npy");
    let output = support::welkin()
        .arg("render")
        .arg(folder.path().join("sky.toml"))
        .arg("-o")
        .arg(&picture)
        .args(["--size", "65x65"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(picture).unwrap();
    let radiance: Vec<f32> = npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap();
    // Through the middle of the ball, optical depth 1.4; that of the other along the light is 0.7.
    let rayleigh = |cos: f64| 0.75 * (1.0 + cos * cos) / (4.0 * std::f64::consts::PI);
    let [above, beside] = [rayleigh(0.0) * (-0.7f64).exp(), rayleigh(-0.8)];
    for (i, (first, second)) in [(2.0, 0.2), (1.0, 0.4), (0.5, 0.8)].into_iter().enumerate() {
        let expected = 0.9 * (above * first + beside * second) * (1.0 - (-1.4f64).exp());
        let got = f64::from(radiance[(32 * 65 + 32) * 3 + i]);
        // The square that it reads is 0.4 m wide, of a splat of 200 m: 1e-5 of its opacity.
        assert!((got / expected - 1.0).abs() < 1e-4, "{i}: {got}, expected {expected}");
    }
}
