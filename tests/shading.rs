//! A lone particle in front of a known background: Eq. 8 of Yusov, in f64, from the same tables.

use ash::vk;
use bytemuck::Zeroable;
use glam::DVec3;
use std::ops::ControlFlow;
use std::path::Path;
use welkin::atmosphere::SkyLight;
use welkin::blend::medium::MediumParams;
use welkin::blend::{BlendInputs, Blender, CloudTargets, NO_CLOUD, Shading};
use welkin::detail::DetailTile;
use welkin::film::Film;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Feature, Image, ImageDesc, MethodBindings, Resource, Sampler};
use welkin::grid::Counters;
use welkin::lighting::attenuation::volume::AttenuationVolume;
use welkin::lighting::tables::volume::{LightVolume, VolumeDesign};
use welkin::lut::{Detail, TableParams, Tables};
use welkin::params::{Aim, Blend, Camera, Clouds, Lighting, Precision, Style};
use welkin::reference::phase::PhaseFunction;
use welkin::reference::scattering::ScatteringLookup;
use welkin::reference::sphere::{LitRay, RayCoordinates};
use welkin::shared::{FrameParams, Particle, ParticleLight};

const SIZE: u32 = 48;
const BACKGROUND: [f32; 3] = [0.3, 0.5, 0.7];
const SIGMA_T: f64 = 0.07;

fn camera() -> Camera {
    Camera { position: [0.0; 3], aim: Aim::Angles { yaw: 0.0, pitch: 0.0 }, fov_y: 50.0 }
}

fn frame(to_sun: DVec3) -> FrameParams {
    let basis = camera().basis();
    let v = |a: [f64; 3]| a.map(|c| c as f32);
    FrameParams {
        tan_half_fov_y: 25f32.to_radians().tan(),
        right: v(basis.right),
        up: v(basis.up),
        forward: v(basis.forward),
        aspect: 1.0,
        width: SIZE,
        height: SIZE,
        low_width: SIZE,
        low_height: SIZE,
        to_sun: v(to_sun.to_array()),
        sigma_t: SIGMA_T as f32,
        fill: 1.0,
        ..FrameParams::zeroed()
    }
}

/// Eq. 8 of one ray: L_in + T L_B.
fn expected(p: &Particle, dir: DVec3, to_sun: DVec3, table: &ScatteringLookup, clouds: &Clouds) -> [f64; 3] {
    let rotation = glam::DQuat::from_array(p.rotation.map(f64::from));
    let axes = DVec3::from_array(p.semi_axes.map(f64::from));
    let unit = |v: DVec3| (rotation.inverse() * v) / axes;
    let (o, d) = (unit(-DVec3::from_array(p.centre.map(f64::from))), unit(dir));
    let metres = 1.0 / d.length();
    let dir_us = d * metres;
    let closest = o - o.dot(dir_us) * dir_us;
    if closest.length_squared() >= 1.0 {
        return BACKGROUND.map(f64::from);
    }
    let mu = (1.0 - closest.length_squared()).sqrt();
    let sigma = SIGMA_T * f64::from(p.density);
    let tau = sigma * 2.0 * mu * metres;
    let ray = LitRay { entry: closest - mu * dir_us, dir: dir_us, to_sun: unit(to_sun).normalize() };
    let c = RayCoordinates::of(&ray);
    let opacity = |tau: f64| -(-tau).exp_m1();
    // The colour C = L_in / (1 - T) of each kind, from the homogeneous sphere that stands for it.
    let source = |radiance: f64, radius: f64| radiance / opacity(2.0 * radius * c.mu);
    let radius = sigma * metres;
    let single = source(table.single(&c, radius), radius);
    let multiple = source(table.multiple(&c, radius), radius);
    let phase = PhaseFunction::CornetteShanks.eval(to_sun.dot(dir), f64::from(clouds.g_single));
    let colour = f64::from(clouds.albedo) * phase * single + multiple;
    BACKGROUND.map(|b| colour * opacity(tau) + (-tau).exp() * f64::from(b))
}

#[test]
fn a_lone_ellipsoid_composites_to_equation_8() {
    let mut device = Standalone::new(Options { validation: true, ..Options::default() }).unwrap();
    let gpu = device.gpu().clone();
    let clouds = Clouds { style: Style::Homogeneous, ..Clouds::default() };
    let table_params = TableParams::new(&clouds, Detail::Coarse);
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let tables = Tables::load_or_build(device.frames(), &table_params, Some(cache), &mut |_| ControlFlow::Continue(()))
        .unwrap()
        .unwrap();
    let lookup = ScatteringLookup::new(tables.scattering.shape(), tables.read_scattering(device.frames()).unwrap());

    let mut modes = vec![Blend::Alpha];
    match gpu.capabilities().supports(Feature::FragmentShaderInterlock) {
        Ok(()) => modes.push(Blend::Interlock(1)),
        Err(reason) => println!("interlock not proved here: {reason}"),
    }
    let rotation = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.4, 0.9, -0.3).to_array();
    let thin = Particle {
        centre: [8.0, -5.0, -260.0],
        density: 0.15,
        rotation,
        semi_axes: [70.0, 95.0, 60.0],
        fade: 1.0,
        colour: [0.0; 3],
        id: 0,
    };
    let thick = Particle { density: 2.0, ..thin };
    for to_sun in [DVec3::new(0.3, 0.8, 0.5), DVec3::new(-0.2, 0.3, -0.9), DVec3::new(0.9, 0.1, -0.2)] {
        let to_sun = to_sun.normalize();
        for particle in [thin, thick] {
            for mode in &modes {
                let scene = render(&mut device, *mode, &particle, to_sun, &tables, &clouds);
                let mut covered = 0;
                for y in 0..SIZE {
                    for x in 0..SIZE {
                        let dir = DVec3::from_array(camera().ray(x, y, SIZE, SIZE));
                        let wanted = expected(&particle, dir, to_sun, &lookup, &clouds);
                        let got = scene[(y * SIZE + x) as usize];
                        covered += usize::from(wanted[0] != f64::from(BACKGROUND[0]));
                        for i in 0..3 {
                            let error = (f64::from(got[i]) - wanted[i]).abs();
                            // The look-up filters f16 texels with 8-bit weights.
                            assert!(error <= 0.01 * wanted[i], "{mode} {to_sun} ({x}, {y}): {got:?} {wanted:?}");
                        }
                    }
                }
                assert!(covered > 200, "the particle is not in the picture");
            }
        }
    }
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

fn render(
    device: &mut Standalone,
    mode: Blend,
    particle: &Particle,
    to_sun: DVec3,
    tables: &Tables,
    clouds: &Clouds,
) -> Vec<[f32; 4]> {
    let gpu = device.gpu().clone();
    let sky = SkyLight { sun_irradiance_clouds: [1.0; 3], ..SkyLight::zeroed() };
    let upload = |name, bytes: &[u8]| Buffer::upload(&gpu, name, bytes).unwrap();
    let frame = upload("frame", bytemuck::bytes_of(&frame(to_sun)));
    let particles = upload("particles", bytemuck::bytes_of(particle));
    let order = upload("order", bytemuck::bytes_of(&0u32));
    let lights = upload("lights", bytemuck::bytes_of(&ParticleLight::OPEN));
    let medium = upload("medium", bytemuck::bytes_of(&MediumParams::new(clouds)));
    let sky_light = upload("sky light", bytemuck::bytes_of(&sky));
    let args = upload("args", bytemuck::bytes_of(&[4u32, 1, 0, 0]));
    let image = |name, format| {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
        Image::new(&gpu, &ImageDesc { name, extent: [SIZE, SIZE, 0], format, usage }).unwrap()
    };
    let depth = image("opaque", vk::Format::R32_SFLOAT);
    let background = image("background", vk::Format::R32G32B32A32_SFLOAT);
    let detail = DetailTile::new(&gpu).unwrap();
    let targets = CloudTargets::new(&gpu, [SIZE, SIZE], Precision::F32).unwrap();
    let film = Film::new(&gpu, [SIZE, SIZE], Precision::F32).unwrap();
    let shading = Shading { lighting: Lighting::Tables, homogeneous: true };
    let blender = Blender::new(&gpu, mode, shading, [SIZE, SIZE], Precision::F32).unwrap();
    let counters = Buffer::array::<Counters>(&gpu, "counters", 1).unwrap();
    let pixels = (SIZE * SIZE) as usize;
    let bytes = Buffer::new(&gpu, "scene bytes", 16 * pixels as u64, BufferKind::Readback).unwrap();
    let volume = LightVolume::new(&gpu, VolumeDesign::none(), 1).unwrap();
    let shadows = AttenuationVolume::new(&gpu, None, Precision::F32, 1).unwrap();
    let light = [
        ("lights", Resource::Buffer(&lights)),
        ("sky_light", Resource::Buffer(&sky_light)),
        ("scattering_lut", Resource::Sampled(tables.scattering.image().sampled(Sampler::LinearClamp))),
        ("volume", Resource::Buffer(volume.params(0))),
        ("light_volume", Resource::Sampled(volume.image().sampled(Sampler::LinearClamp))),
        ("attenuation", Resource::Buffer(shadows.params(0))),
        ("attenuation_volume", Resource::Sampled(shadows.image().sampled(Sampler::LinearClamp))),
    ];
    let inputs = BlendInputs {
        frame: &frame,
        particles: &particles,
        order: &order,
        medium: &medium,
        optical_depth_lut: tables.optical_depth.image(),
        detail_tile: &detail.image,
        lighting: MethodBindings { method: Lighting::Tables.name(), resources: &light },
        opaque_distance: &depth,
        draw_args: &args,
        draw_args_offset: 0,
        counters: &counters,
    };
    device
        .frames()
        .run(|rec| {
            rec.clear_image(&depth, [NO_CLOUD; 4]);
            rec.clear_image(&background, [BACKGROUND[0], BACKGROUND[1], BACKGROUND[2], 1.0]);
            blender.record(rec, &inputs, &targets)?;
            film.record_composite(rec, &targets.cloud, &depth, &depth, &background)?;
            rec.copy_image_to_buffer(&film.scene, &bytes);
            rec.make_visible_to_host(&bytes);
            Ok(())
        })
        .unwrap();
    device.frames().state().forget();
    bytes.read(0, pixels)
}
