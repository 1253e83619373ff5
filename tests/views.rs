//! Several views of one sky.

use ash::vk;
use welkin::frame::FrameInputs;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Image, ImageDesc};
use welkin::params::{Aim, Camera, Params, Precision, Preset};
use welkin::renderer::{Renderer, TableImages};
use welkin::sky::Sky;
use welkin::view::View;

const SIZE: [u32; 2] = [96, 64];
/// Half the distance between two eyes [m].
const EYE: f64 = 0.032;

fn params() -> Params {
    let mut params = Params { quality: Preset::Low.quality(), ..Params::default() };
    params.quality.downscale = 1;
    params.quality.precision = Precision::F32;
    params
}

/// Constant tables: what they hold does not matter here.
fn tables(device: &mut Standalone) -> [Image; 2] {
    let gpu = device.gpu().clone();
    let image = |name, extent| {
        let (format, usage) = (vk::Format::R16G16_SFLOAT, vk::ImageUsageFlags::SAMPLED);
        Image::new(&gpu, &ImageDesc { name, extent, format, usage }).unwrap()
    };
    let tables = [image("optical depth", [4, 16, 4]), image("scattering", [4, 4, 32])];
    device
        .frames()
        .run(|rec| {
            rec.clear_image(&tables[0], [0.7, 0.1, 0.0, 0.0]);
            rec.clear_image(&tables[1], [0.5, 0.2, 0.0, 0.0]);
            Ok(())
        })
        .unwrap();
    tables
}

fn images([optical_depth, scattering]: &[Image; 2]) -> TableImages<'_> {
    TableImages { optical_depth, scattering, fill: 0.7 }
}

/// Two eyes, and what is behind them: as far apart in direction as views can be.
fn cameras(params: &Params) -> Vec<Camera> {
    let at = |x: f64, yaw: f64, pitch: f64| {
        let [px, py, pz] = params.camera.position;
        Camera { position: [px + x, py, pz], aim: Aim::Angles { yaw, pitch }, ..params.camera }
    };
    vec![at(-EYE, 0.0, 12.0), at(EYE, 0.0, 12.0), at(0.0, 180.0, 30.0)]
}

/// Linear radiance of `camera`'s picture by a renderer of its own.
fn alone(device: &mut Standalone, params: &Params, camera: &Camera, tables: &[Image; 2]) -> Vec<[f32; 4]> {
    let gpu = device.gpu().clone();
    let mut renderer = Renderer::new(&gpu, params, SIZE, 1).unwrap();
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let bytes = Buffer::new(&gpu, "scene bytes", 16 * pixels as u64, BufferKind::Readback).unwrap();
    for _ in 0..6 {
        let (slot, ()) = device
            .frames()
            .submit(|rec| {
                renderer.record(rec, camera, images(tables))?;
                rec.copy_image_to_buffer(&renderer.film().scene, &bytes);
                rec.make_visible_to_host(&bytes);
                Ok(())
            })
            .unwrap();
        device.frames().wait().unwrap();
        let grew = renderer.finish(&gpu, slot).unwrap();
        device.frames().state().forget();
        if !grew {
            return bytes.read(0, pixels);
        }
    }
    panic!("the lists keep growing");
}

#[test]
fn views_of_one_sky_are_the_pictures_of_renderers_of_their_own() {
    let mut device = Standalone::new(Options { validation: true, frames_in_flight: 1, ..Options::default() }).unwrap();
    let (gpu, params) = (device.gpu().clone(), params());
    let tables = tables(&mut device);
    let cameras = cameras(&params);
    let expected: Vec<_> = cameras.iter().map(|camera| alone(&mut device, &params, camera, &tables)).collect();

    let mut sky = Sky::new(&gpu, &params, 1).unwrap();
    let mut views: Vec<_> = cameras.iter().map(|_| View::new(&gpu, &sky, SIZE).unwrap()).collect();
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let readback = || Buffer::new(&gpu, "scene bytes", 16 * pixels as u64, BufferKind::Readback).unwrap();
    let bytes: Vec<_> = cameras.iter().map(|_| readback()).collect();
    for turn in 0..6 {
        let (slot, ()) = device
            .frames()
            .submit(|rec| {
                sky.record(rec, params.camera.position, images(&tables).fill)?;
                for ((view, camera), bytes) in views.iter_mut().zip(&cameras).zip(&bytes) {
                    view.record(rec, &sky, &FrameInputs::new(camera, images(&tables)), None)?;
                    rec.copy_image_to_buffer(&view.film().scene, bytes);
                    rec.make_visible_to_host(bytes);
                }
                Ok(())
            })
            .unwrap();
        device.frames().wait().unwrap();
        let mut grew = false;
        for view in &views {
            grew |= sky.grow(&gpu, &view.counters(slot)).unwrap();
        }
        for view in &mut views {
            grew |= view.grow(&gpu, &sky, slot).unwrap();
        }
        device.frames().state().forget();
        if !grew {
            break;
        }
        assert!(turn < 5, "the lists keep growing");
    }
    for (expected, bytes) in expected.iter().zip(&bytes) {
        let got: Vec<[f32; 4]> = bytes.read(0, pixels);
        let brightest = expected.iter().flat_map(|p| &p[..3]).fold(0.0f32, |a, &b| a.max(b));
        let thinnest = expected.iter().map(|p| p[3]).fold(1.0f32, f32::min);
        assert!(brightest > 0.01 && thinnest < 0.5, "nothing to be seen: {brightest} {thinnest}");
        // Rings, levels and air follow the sky's centre: three centimetres aside they are not to be told from a view's own.
        let off =
            expected.iter().flatten().zip(got.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0f32, f32::max);
        assert!(off <= 1e-3, "radiance or transmittance is off by {off}");
    }
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}
