//! The whole frame up to the cloud targets: determinism, growth of lists, leaks, motion.

use ash::vk;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Image, ImageDesc};
use welkin::params::{Camera, Params, Preset, SkyModel};
use welkin::renderer::{Renderer, TableImages};

const SIZE: [u32; 2] = [96, 64];

fn params() -> Params {
    let mut params = Params::default();
    params.quality = Preset::Low.quality();
    params.quality.downscale = 1;
    params
}

/// Constant tables: what they hold does not matter here.
struct Tables {
    optical_depth: Image,
    scattering: Image,
}

impl Tables {
    fn new(device: &mut Standalone) -> Self {
        let gpu = device.gpu().clone();
        let image = |name, extent| {
            let (format, usage) = (vk::Format::R16G16_SFLOAT, vk::ImageUsageFlags::SAMPLED);
            Image::new(&gpu, &ImageDesc { name, extent, format, usage }).unwrap()
        };
        let tables =
            Self { optical_depth: image("optical depth", [4, 16, 4]), scattering: image("scattering", [4, 4, 32]) };
        device
            .frames()
            .run(|rec| {
                rec.clear_image(&tables.optical_depth, [0.7, 0.1, 0.0, 0.0]);
                rec.clear_image(&tables.scattering, [0.5, 0.2, 0.0, 0.0]);
                Ok(())
            })
            .unwrap();
        tables
    }

    fn images(&self) -> TableImages<'_> {
        TableImages { optical_depth: &self.optical_depth, scattering: &self.scattering, fill: 0.7 }
    }
}

fn open(validation: bool) -> Standalone {
    Standalone::new(Options { validation, ..Options::default() }).unwrap()
}

/// Renders until no list grows any more; returns the bits of the cloud target.
fn render(device: &mut Standalone, renderer: &mut Renderer, camera: &Camera, tables: &Tables) -> Vec<u16> {
    let gpu = device.gpu().clone();
    let size = u64::from(SIZE[0] * SIZE[1]) * 8;
    let bytes = Buffer::new(&gpu, "cloud bytes", size, BufferKind::Readback).unwrap();
    for _ in 0..4 {
        let (slot, ()) = device
            .frames()
            .submit(|rec| {
                renderer.record(rec, camera, tables.images())?;
                rec.copy_image_to_buffer(&renderer.targets().cloud, &bytes);
                rec.make_visible_to_host(&bytes);
                Ok(())
            })
            .unwrap();
        device.frames().wait().unwrap();
        if !renderer.finish(&gpu, slot).unwrap() {
            return bytes.read(0, size as usize / 2);
        }
        device.frames().state().forget();
    }
    panic!("the lists keep growing");
}

#[test]
fn one_scene_gives_the_same_bits_in_twenty_runs() {
    let mut device = open(true);
    let tables = Tables::new(&mut device);
    let params = params();
    let gpu = device.gpu().clone();
    let mut first = None;
    for _ in 0..20 {
        let mut renderer = Renderer::new(&gpu, &params, SIZE, 2).unwrap();
        let picture = render(&mut device, &mut renderer, &params.camera, &tables);
        device.frames().state().forget();
        assert_eq!(*first.get_or_insert_with(|| picture.clone()), picture);
    }
    let transmittance = first.unwrap().chunks(4).map(|p| half::f16::from_bits(p[3]).to_f32()).fold(1.0, f32::min);
    assert!(transmittance < 0.1, "no cloud in sight: the comparison would mean nothing");
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

#[test]
fn a_thousand_frames_of_a_moving_camera_leak_nothing() {
    let mut device = open(false);
    let tables = Tables::new(&mut device);
    let mut params = params();
    (params.quality.cells, params.quality.rings) = (24, 1);
    // The sky's tables take most of such a small frame on a CPU; every other pass runs a thousand times.
    params.sky.model = SkyModel::None;
    let gpu = device.gpu().clone();
    let before = gpu.memory_use();
    {
        let mut renderer = Renderer::new(&gpu, &params, SIZE, 2).unwrap();
        let mut camera = params.camera;
        render(&mut device, &mut renderer, &camera, &tables);
        let mut warm = gpu.memory_use();
        let mut grown = 0;
        for _ in 0..1000 {
            camera.position[0] += 137.0;
            let (slot, ()) = device.frames().submit(|rec| renderer.record(rec, &camera, tables.images())).unwrap();
            if slot == 1 {
                device.frames().wait().unwrap();
                if renderer.finish(&gpu, slot).unwrap() {
                    device.frames().state().forget();
                    warm = gpu.memory_use();
                    grown += 1;
                }
            }
            assert_eq!(gpu.memory_use().allocations, warm.allocations);
            assert_eq!(gpu.memory_use().bytes, warm.bytes);
        }
        assert!(grown < 20, "lists grew {grown} times");
        device.frames().wait().unwrap();
        device.frames().state().forget();
    }
    assert_eq!(gpu.memory_use(), before);
}

#[test]
fn two_renderers_share_a_device() {
    let mut device = open(true);
    let tables = Tables::new(&mut device);
    let gpu = device.gpu().clone();
    let near = params();
    let mut high = params();
    high.camera.position[1] = 4000.0;
    let mut a = Renderer::new(&gpu, &near, SIZE, 2).unwrap();
    let mut b = Renderer::new(&gpu, &high, SIZE, 2).unwrap();
    let alone = render(&mut device, &mut a, &near.camera, &tables);
    render(&mut device, &mut b, &high.camera, &tables);
    assert_eq!(render(&mut device, &mut a, &near.camera, &tables), alone);
    device.frames().state().forget();
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}
