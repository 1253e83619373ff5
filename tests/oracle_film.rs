//! Upsampling, compositing and tone curve on the device against their f64 oracle.

use bytemuck::Pod;
use welkin::film::{Film, gain};
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Image, ImageDesc};
use welkin::params::{self, Precision, SkyModel, ToneCurve};
use welkin::reference::film::{Plane, filmic, srgb_encode, upsample};

const SIZE: [u32; 2] = [46, 31];

/// A number in [0, 1) for each index (pcg, its output function).
fn random(index: u32) -> f32 {
    let state = index.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    ((word >> 22) ^ word) as f32 / 4_294_967_296.0
}

fn image<T: Pod>(device: &mut Standalone, [w, h]: [u32; 2], format: ash::vk::Format, texels: &[T]) -> Image {
    let usage = ash::vk::ImageUsageFlags::SAMPLED | ash::vk::ImageUsageFlags::STORAGE;
    let image = Image::new(device.gpu(), &ImageDesc { name: "input", extent: [w, h, 0], format, usage }).unwrap();
    let upload = Buffer::upload(device.gpu(), "upload", texels).unwrap();
    device
        .frames()
        .run(|rec| {
            rec.copy_buffer_to_image(&upload, &image);
            Ok(())
        })
        .unwrap();
    image
}

fn read<T: Pod>(device: &mut Standalone, image: &Image) -> Vec<T> {
    let count = (image.extent()[0] * image.extent()[1]) as usize;
    let bytes = (count * size_of::<T>()) as u64;
    let readback = Buffer::new(device.gpu(), "readback", bytes, BufferKind::Readback).unwrap();
    device
        .frames()
        .run(|rec| {
            rec.copy_image_to_buffer(image, &readback);
            rec.make_visible_to_host(&readback);
            Ok(())
        })
        .unwrap();
    readback.read(0, count)
}

#[test]
fn the_composite_and_its_picture_follow_the_oracle() {
    let mut device = Standalone::new(Options { validation: true, ..Options::default() }).unwrap();
    let (rgba, r) = (ash::vk::Format::R32G32B32A32_SFLOAT, ash::vk::Format::R32_SFLOAT);
    for downscale in [1u32, 2, 4] {
        let low = SIZE.map(|n| n.div_ceil(downscale));
        let [w, h] = SIZE;
        let cloud: Vec<[f32; 4]> =
            (0..low[0] * low[1]).map(|i| std::array::from_fn(|c| random(4 * i + c as u32))).collect();
        // A hill 5 km away before the sky, its slope through the middle of blocks.
        let distance = |x: u32, y: u32| if 3 * x + 2 * y < 90 { 1e30 } else { 5000.0 + 10.0 * x as f32 };
        let opaque: Vec<f32> = (0..w * h).map(|i| distance(i % w, i / w)).collect();
        let low_opaque: Vec<f32> = (0..low[0] * low[1])
            .map(|i| distance((i % low[0] * downscale).min(w - 1), (i / low[0] * downscale).min(h - 1)))
            .collect();
        let behind: Vec<[f32; 4]> =
            (0..w * h).map(|i| std::array::from_fn(|c| random(7919 + 4 * i + c as u32))).collect();
        let images = [
            image(&mut device, low, rgba, &cloud),
            image(&mut device, low, r, &low_opaque),
            image(&mut device, SIZE, r, &opaque),
            image(&mut device, SIZE, rgba, &behind),
        ];
        let film = Film::new(device.gpu(), SIZE, Precision::F32).unwrap();
        let settings = params::Film { exposure_ev: -0.5, curve: ToneCurve::Filmic };
        device
            .frames()
            .run(|rec| {
                film.record_composite(rec, &images[0], &images[1], &images[2], &images[3])?;
                film.record_tonemap(rec, &settings, SkyModel::Atmosphere)
            })
            .unwrap();
        let scene: Vec<[f32; 4]> = read(&mut device, &film.scene);
        let picture: Vec<[u16; 4]> = read(&mut device, &film.picture);
        let gain = gain(&settings, SkyModel::Atmosphere);
        let wide: Vec<[f64; 4]> = cloud.iter().map(|t| t.map(f64::from)).collect();
        let wide_opaque: Vec<f64> = low_opaque.iter().copied().map(f64::from).collect();
        let [lw, lh] = low.map(i64::from);
        for (i, got) in scene.iter().enumerate() {
            let pixel = [(i as u32 % w) as i64, (i as u32 / w) as i64];
            let layer = if downscale == 1 {
                wide[i] // a copy
            } else {
                upsample(
                    &Plane { width: lw, height: lh, texels: &wide },
                    &Plane { width: lw, height: lh, texels: &wide_opaque },
                    f64::from(opaque[i]),
                    pixel,
                    SIZE.map(i64::from),
                )
            };
            for c in 0..3 {
                let expected = layer[c] + layer[3] * f64::from(behind[i][c]);
                // f32 rounding of sums of sixteen products, and of an exponential of a logarithm.
                assert!((f64::from(got[c]) - expected).abs() < 2e-5, "{pixel:?}: {got:?} and {expected}");
                let shown = srgb_encode(filmic(f64::from(got[c]) * f64::from(gain[c])));
                // 16 bits, and f32 powers.
                let error = (f64::from(picture[i][c]) / 65535.0 - shown).abs();
                assert!(error < 2e-5, "{pixel:?}: {} and {shown}", picture[i][c]);
            }
            assert!((f64::from(got[3]) - layer[3]).abs() < 2e-5);
            if downscale == 1 {
                assert_eq!(got[3].to_bits(), cloud[i][3].to_bits(), "transmittance is passed through exactly");
            }
        }
    }
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}
