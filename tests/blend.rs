//! Compositing of constant-colour ellipsoids against the exact f64 integral along each pixel's ray.

use ash::vk;
use bytemuck::Zeroable;
use welkin::atmosphere::SkyLight;
use welkin::blend::medium::MediumParams;
use welkin::blend::{BlendInputs, Blender, CloudTargets, NO_CLOUD, Shading};
use welkin::detail::DetailTile;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Feature, Image, ImageDesc};
use welkin::params::{Aim, Blend, Camera, Clouds, Lighting, Precision};
use welkin::reference::segments::{self, Composite, Segment};
use welkin::shared::{FrameParams, Particle, ParticleLight};

const SIZE: u32 = 64;
const SIGMA_T: f32 = 0.07;

fn camera() -> Camera {
    Camera { position: [0.0; 3], aim: Aim::Angles { yaw: 0.0, pitch: 0.0 }, fov_y: 60.0 }
}

fn frame() -> FrameParams {
    let basis = camera().basis();
    let v = |a: [f64; 3]| a.map(|c| c as f32);
    FrameParams {
        tan_half_fov_y: 30f32.to_radians().tan(),
        right: v(basis.right),
        up: v(basis.up),
        forward: v(basis.forward),
        aspect: 1.0,
        width: SIZE,
        height: SIZE,
        low_width: SIZE,
        low_height: SIZE,
        to_sun: [0.0, 1.0, 0.0],
        sigma_t: SIGMA_T,
        fill: 1.0,
        ..bytemuck::Zeroable::zeroed()
    }
}

fn ball(centre: [f32; 3], semi_axes: [f32; 3], density: f32, colour: [f32; 3]) -> Particle {
    Particle { centre, density, rotation: [0.0, 0.0, 0.0, 1.0], semi_axes, fade: 1.0, colour, id: 0 }
}

/// A fixed sequence of numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    fn particle(&mut self, depth: f32, spread: f32) -> Particle {
        let mut r = || self.next();
        let q = [r() - 0.5, r() - 0.5, r() - 0.5, r() - 0.5];
        let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
        Particle {
            rotation: q.map(|c| c / length),
            ..ball(
                [spread * (r() - 0.5), spread * (r() - 0.5), -depth + spread * (r() - 0.5)],
                [20.0 + 40.0 * r(), 20.0 + 40.0 * r(), 20.0 + 40.0 * r()],
                0.05 + 0.5 * r(),
                [r(), r(), r()],
            )
        }
    }
}

/// The segment of pixel (x, y) in `p`, in f64, from the definition of an ellipsoid.
fn segment(p: &Particle, x: u32, y: u32, opaque: f64) -> Option<Segment> {
    let dir = camera().ray(x, y, SIZE, SIZE);
    let rotate = |v: [f64; 3]| -> [f64; 3] {
        let q = p.rotation.map(f64::from);
        let (u, w) = ([-q[0], -q[1], -q[2]], q[3]);
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let t = cross(u, v).map(|c| 2.0 * c);
        let c = cross(u, t);
        std::array::from_fn(|i| v[i] + w * t[i] + c[i])
    };
    let unit = |v: [f64; 3]| {
        let r = rotate(v);
        std::array::from_fn::<f64, 3, _>(|i| r[i] / f64::from(p.semi_axes[i]))
    };
    let (o, d) = (unit(p.centre.map(|c| -f64::from(c))), unit(dir));
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let (a, b, c) = (dot(d, d), dot(o, d), dot(o, o) - 1.0);
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 {
        return None;
    }
    let t_enter = ((-b - discriminant.sqrt()) / a).max(0.0);
    let t_exit = ((-b + discriminant.sqrt()) / a).min(opaque);
    (t_exit > t_enter).then(|| Segment {
        colour: p.colour.map(f64::from),
        optical_depth: f64::from(SIGMA_T) * f64::from(p.density * p.fade) * (t_exit - t_enter),
        t_enter,
        t_exit,
    })
}

struct Picture {
    cloud: Vec<[f32; 4]>,
    nearest: Vec<f32>,
}

fn open(validation: bool) -> Standalone {
    Standalone::new(Options { validation, ..Options::default() }).unwrap()
}

fn has_interlock(device: &Standalone) -> bool {
    let answer = device.gpu().capabilities().supports(Feature::FragmentShaderInterlock);
    if let Err(reason) = answer {
        println!("interlock not proved here: {reason}");
    }
    answer.is_ok()
}

/// Draws `particles`, in the order given, in front of something opaque at distance `opaque`.
fn draw(device: &mut Standalone, mode: Blend, particles: &[Particle], opaque: f32) -> Picture {
    let gpu = device.gpu().clone();
    let order: Vec<u32> = (0..particles.len() as u32).collect();
    let lights = vec![ParticleLight { sun: [0.0; 3], ambient: 0.0 }; particles.len()];
    let upload = |name, bytes: &[u8]| Buffer::upload(&gpu, name, bytes).unwrap();
    let frame = upload("frame", bytemuck::bytes_of(&frame()));
    let particle_buffer = upload("particles", bytemuck::cast_slice(particles));
    let order = upload("order", bytemuck::cast_slice(&order));
    let lights = upload("lights", bytemuck::cast_slice(&lights));
    let medium = upload("medium", bytemuck::bytes_of(&MediumParams::new(&Clouds::default())));
    let sky_light = Buffer::upload(&gpu, "sky light", &[SkyLight::zeroed()]).unwrap();
    let args = upload("args", bytemuck::bytes_of(&[4u32, particles.len() as u32, 0, 0]));
    let image = |name, extent, format| {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
        Image::new(&gpu, &ImageDesc { name, extent, format, usage }).unwrap()
    };
    let unused = image("unused table", [2, 2, 2], vk::Format::R16G16_SFLOAT);
    let depth = image("opaque", [SIZE, SIZE, 0], vk::Format::R32_SFLOAT);
    let detail = DetailTile::new(&gpu).unwrap();
    let targets = CloudTargets::new(&gpu, [SIZE, SIZE], Precision::F32).unwrap();
    let shading = Shading { lighting: Lighting::Flat, homogeneous: true };
    let blender = Blender::new(&gpu, mode, shading, [SIZE, SIZE], Precision::F32).unwrap();
    let pixels = (SIZE * SIZE) as usize;
    let cloud_bytes = Buffer::new(&gpu, "cloud bytes", 16 * pixels as u64, BufferKind::Readback).unwrap();
    let nearest_bytes = Buffer::new(&gpu, "nearest bytes", 4 * pixels as u64, BufferKind::Readback).unwrap();
    let inputs = BlendInputs {
        frame: &frame,
        particles: &particle_buffer,
        order: &order,
        lights: &lights,
        medium: &medium,
        sky_light: &sky_light,
        optical_depth_lut: &unused,
        scattering_lut: &unused,
        detail_tile: &detail.image,
        opaque_distance: &depth,
        draw_args: &args,
        draw_args_offset: 0,
    };
    device
        .frames()
        .run(|rec| {
            rec.clear_image(&depth, [opaque; 4]);
            blender.record(rec, &inputs, &targets)?;
            rec.copy_image_to_buffer(&targets.cloud, &cloud_bytes);
            rec.copy_image_to_buffer(&targets.nearest, &nearest_bytes);
            rec.make_visible_to_host(&cloud_bytes);
            rec.make_visible_to_host(&nearest_bytes);
            Ok(())
        })
        .unwrap();
    device.frames().state().forget();
    if let Some(messages) = device.messages() {
        assert_eq!(messages.all(), Vec::<String>::new());
    }
    Picture { cloud: cloud_bytes.read(0, pixels), nearest: nearest_bytes.read(0, pixels) }
}

/// Largest difference from what `reference` makes of each pixel's segments.
fn max_error(
    picture: &Picture,
    particles: &[Particle],
    opaque: f32,
    reference: impl Fn(&[Segment]) -> Composite,
) -> f64 {
    let mut worst = 0.0f64;
    let mut covered = 0;
    for y in 0..SIZE {
        for x in 0..SIZE {
            let s: Vec<Segment> = particles.iter().filter_map(|p| segment(p, x, y, f64::from(opaque))).collect();
            let expected = reference(&s);
            let got = picture.cloud[(y * SIZE + x) as usize];
            covered += usize::from(!s.is_empty());
            for (got, expected) in got.iter().zip(expected.radiance) {
                worst = worst.max((f64::from(*got) - expected).abs());
            }
            worst = worst.max((f64::from(got[3]) - expected.transmittance).abs());
            let near = s.iter().map(|s| s.t_enter).fold(f64::from(NO_CLOUD), f64::min);
            let distance = f64::from(picture.nearest[(y * SIZE + x) as usize]);
            assert!((distance - near).abs() <= 1e-3 * near.max(1.0), "nearest {distance} {near}");
        }
    }
    assert!(covered > 50, "only {covered} pixels see anything");
    worst
}

/// Grazing rays: f32 places the closest approach to about 1e-6 radii, and the chord grows with its square root.
const RAY_ROUNDING: f64 = 1e-3;

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

#[test]
fn attachments_hold_what_interlock_holds_by_either_path() {
    for without in [vec![], vec![Feature::DynamicRenderingLocalRead]] {
        let mut device = Standalone::new(Options { validation: true, without, ..Options::default() }).unwrap();
        let mut random = Random(7);
        let particles: Vec<Particle> = (0..50).map(|_| random.particle(220.0, 150.0)).collect();
        let picture = draw(&mut device, Blend::Attachment(1), &particles, NO_CLOUD);
        let error = max_error(&picture, &particles, NO_CLOUD, segments::merged);
        assert!(error < 2.0 * RAY_ROUNDING, "{error}");
        println!("{error} {:?}", device.gpu().described_pipelines());
        if has_interlock(&device) {
            let other = draw(&mut device, Blend::Interlock(1), &particles, NO_CLOUD);
            assert!(picture.cloud == other.cloud && picture.nearest == other.nearest);
        }
    }
}
