//! Constant-colour ellipsoids drawn by a blend mode alone, and their exact f64 integral along each pixel's ray.
#![allow(dead_code)] // Each test file uses its own part.

use ash::vk;
use glam::DVec3;
use welkin::blend::medium::MediumParams;
use welkin::blend::{BlendInputs, Blender, CloudTargets, NO_CLOUD, NodeBudget, Shading};
use welkin::detail::DetailTile;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Feature, Image, ImageDesc, MethodBindings};
use welkin::grid::Counters;
use welkin::params::{Aim, Blend, Camera, Clouds, Lighting, Precision};
use welkin::reference::scene;
use welkin::reference::segments::{Composite, Segment};
use welkin::shared::{FrameParams, Particle};

pub const SIZE: u32 = 64;
pub const SIGMA_T: f32 = 0.07;

pub fn camera() -> Camera {
    Camera { position: [0.0; 3], aim: Aim::Angles { yaw: 0.0, pitch: 0.0 }, fov_y: 60.0 }
}

pub fn frame() -> FrameParams {
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

pub fn ball(centre: [f32; 3], semi_axes: [f32; 3], density: f32, colour: [f32; 3]) -> Particle {
    Particle { centre, density, rotation: [0.0, 0.0, 0.0, 1.0], semi_axes, fade: 1.0, colour, id: 0 }
}

/// A fixed sequence of numbers in [0, 1).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn particle(&mut self, depth: f32, spread: f32) -> Particle {
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

/// The segment of pixel (x, y) in `p`, in f64.
pub fn segment(p: &Particle, x: u32, y: u32, opaque: f64) -> Option<Segment> {
    let dir = scene::ray(&camera(), [SIZE, SIZE], [SIZE, SIZE], [x, y]);
    scene::Ellipsoid::of_particle(p, SIGMA_T).segment(DVec3::ZERO, dir, opaque)
}

/// Exact value of pixel (x, y), in f64.
pub fn pixel(particles: &[Particle], x: u32, y: u32, opaque: f32) -> scene::CloudPixel {
    let ellipsoids = particles.iter().map(|p| scene::Ellipsoid::of_particle(p, SIGMA_T)).collect();
    let dir = scene::ray(&camera(), [SIZE, SIZE], [SIZE, SIZE], [x, y]);
    scene::Scene { ellipsoids }.pixel(DVec3::ZERO, dir, f64::from(opaque))
}

#[derive(PartialEq)]
pub struct Picture {
    pub cloud: Vec<[f32; 4]>,
    pub nearest: Vec<f32>,
}

pub fn open(validation: bool) -> Standalone {
    Standalone::new(Options { validation, ..Options::default() }).unwrap()
}

pub fn has_interlock(device: &Standalone) -> bool {
    let answer = device.gpu().capabilities().supports(Feature::FragmentShaderInterlock);
    if let Err(reason) = answer {
        println!("interlock not proved here: {reason}");
    }
    answer.is_ok()
}

/// Draws `particles`, in the order given, in front of something opaque at distance `opaque`.
pub fn draw(device: &mut Standalone, mode: Blend, particles: &[Particle], opaque: f32) -> Picture {
    draw_with_budget(device, mode, NodeBudget::default(), particles, opaque).0
}

/// [`draw`] by a mode whose list has `budget`; and how often the list was too small.
pub fn draw_with_budget(
    device: &mut Standalone,
    mode: Blend,
    budget: NodeBudget,
    particles: &[Particle],
    opaque: f32,
) -> (Picture, u32) {
    let gpu = device.gpu().clone();
    let order: Vec<u32> = (0..particles.len() as u32).collect();
    let upload = |name, bytes: &[u8]| Buffer::upload(&gpu, name, bytes).unwrap();
    let frame = upload("frame", bytemuck::bytes_of(&frame()));
    let particle_buffer = upload("particles", bytemuck::cast_slice(particles));
    let order = upload("order", bytemuck::cast_slice(&order));
    let medium = upload("medium", bytemuck::bytes_of(&MediumParams::new(&Clouds::default())));
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
    let mut blender = Blender::with_nodes(&gpu, mode, shading, [SIZE, SIZE], Precision::F32, budget).unwrap();
    let pixels = (SIZE * SIZE) as usize;
    let cloud_bytes = Buffer::new(&gpu, "cloud bytes", 16 * pixels as u64, BufferKind::Readback).unwrap();
    let nearest_bytes = Buffer::new(&gpu, "nearest bytes", 4 * pixels as u64, BufferKind::Readback).unwrap();
    let counters = Buffer::array::<Counters>(&gpu, "counters", 1).unwrap();
    let counts = Buffer::new(&gpu, "counts", counters.size(), BufferKind::Readback).unwrap();
    let inputs = BlendInputs {
        frame: &frame,
        particles: &particle_buffer,
        order: &order,
        medium: &medium,
        optical_depth_lut: &unused,
        detail_tile: &detail.image,
        lighting: MethodBindings { method: Lighting::Flat.name(), resources: &[] },
        opaque_distance: &depth,
        draw_args: &args,
        draw_args_offset: 0,
        counters: &counters,
    };
    let mut grown = 0;
    loop {
        device
            .frames()
            .run(|rec| {
                rec.fill_buffer(&counters, 0, counters.size(), 0);
                rec.clear_image(&depth, [opaque; 4]);
                blender.record(rec, &inputs, &targets)?;
                rec.copy_image_to_buffer(&targets.cloud, &cloud_bytes);
                rec.copy_image_to_buffer(&targets.nearest, &nearest_bytes);
                rec.copy_buffer(&counters, &counts, counters.size());
                for buffer in [&cloud_bytes, &nearest_bytes, &counts] {
                    rec.make_visible_to_host(buffer);
                }
                Ok(())
            })
            .unwrap();
        device.frames().state().forget();
        if !blender.grow(&gpu, &counts.read::<Counters>(0, 1)[0]).unwrap() {
            break;
        }
        grown += 1;
        assert!(grown < 8, "the list does not settle");
    }
    if let Some(messages) = device.messages() {
        assert_eq!(messages.all(), Vec::<String>::new());
    }
    (Picture { cloud: cloud_bytes.read(0, pixels), nearest: nearest_bytes.read(0, pixels) }, grown)
}

/// Largest difference from what `reference` makes of each pixel's segments.
pub fn max_error(
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
pub const RAY_ROUNDING: f64 = 1e-3;
