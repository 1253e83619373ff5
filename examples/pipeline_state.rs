//! Every pipeline state object of a frame as data: printed as Welkin describes it, changed by the host, printed as built.
//!
//! Here the host has a 16-bit float image of its own, wants the clouds in it as premultiplied colour with an alpha for its
//! compositor, and makes the particles homogeneous by a specialization constant.
//!
//! `cargo run --release --example pipeline_state -- clouds.png [all]` (with `all`, also those that the host leaves alone)

use ash::vk;
use std::error::Error;
use std::path::Path;
use welkin::Params;
use welkin::frame::{FrameInputs, FrameOutput, Lent, Output, OutputKind};
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{
    Access, BlendState, Buffer, BufferKind, Image, ImageDesc, PipelineDesc, PipelineFactory, PipelineKind,
};
use welkin::output::{Picture, PngDepth};
use welkin::params::{Aim, Camera, Lighting, ParticleDesc, SkyModel, Source};
use welkin::renderer::Renderer;

const SIZE: [u32; 2] = [320, 180];

/// Changes three things, and prints them before and after.
struct Director {
    print_all: bool,
}

impl PipelineFactory for Director {
    fn describe(&self, desc: PipelineDesc) -> PipelineDesc {
        let mut changed = desc.clone();
        if let (PipelineKind::Graphics(state), "film/present.frag") = (&mut changed.kind, desc.program.name) {
            state.attachments[0].format = vk::Format::R16G16B16A16_SFLOAT;
            state.attachments[0].blend = BlendState::Custom(inverted_alpha());
        }
        for (name, value) in &mut changed.specialization {
            // The scene's style is pyroclastic, but this host wants smooth bodies.
            if *name == "HOMOGENEOUS" {
                *value = 1;
            }
        }
        let (before, after) = (desc.to_string(), changed.to_string());
        if before != after {
            println!("-- described\n{before}\n-- built\n{after}");
        } else if self.print_all {
            println!("{before}");
        }
        changed
    }
}

/// Colour as it comes; alpha = 1 - transmittance, over an image that the host has cleared to an alpha of 1.
fn inverted_alpha() -> vk::PipelineColorBlendAttachmentState {
    vk::PipelineColorBlendAttachmentState::default()
        .color_write_mask(vk::ColorComponentFlags::RGBA)
        .blend_enable(true)
        .src_color_blend_factor(vk::BlendFactor::ONE)
        .dst_color_blend_factor(vk::BlendFactor::ZERO)
        .color_blend_op(vk::BlendOp::ADD)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(vk::BlendFactor::ONE)
        .alpha_blend_op(vk::BlendOp::REVERSE_SUBTRACT)
}

fn scene() -> Params {
    let ball = |x: f64, y: f64, radius: f32, colour| ParticleDesc {
        centre: [x, y, -2000.0],
        radii: [radius, 0.7 * radius, radius],
        density: 0.05,
        colour,
        ..ParticleDesc::default()
    };
    let mut params = Params {
        camera: Camera { aim: Aim::Angles { yaw: 0.0, pitch: 0.0 }, ..Camera::default() },
        ..Params::default()
    };
    params.clouds.lighting = Lighting::Flat;
    params.clouds.source = Source::Particles(vec![
        ball(-350.0, 450.0, 420.0, [0.9, 0.6, 0.4]),
        ball(250.0, 550.0, 520.0, [0.6, 0.7, 0.9]),
        ball(0.0, 780.0, 330.0, [0.95, 0.95, 0.9]),
    ]);
    params.sky.model = SkyModel::None;
    params.quality.downscale = 1;
    params
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let path = args.next().unwrap_or("clouds.png".into());
    let print_all = args.next().is_some_and(|arg| arg == "all");

    let mut device =
        Standalone::new(Options { factory: Some(Box::new(Director { print_all })), ..Options::default() })?;
    let gpu = device.gpu().clone();
    let params = scene();
    let mut renderer = Renderer::new(&gpu, &params, SIZE, device.frames().slots())?;
    let output = Output::new(&gpu, OutputKind::Radiance, vk::Format::R8G8B8A8_UNORM)?;
    println!("{} pipelines; the output is now {:?}", gpu.described_pipelines().len(), output.format());

    let image = |name, [w, h]: [u32; 2], depth, format, usage| {
        Image::new(&gpu, &ImageDesc { name, extent: [w, h, depth], format, usage })
    };
    let target = image("compositor", SIZE, 0, output.format(), vk::ImageUsageFlags::COLOR_ATTACHMENT)?;
    // The scene still asks for tables, which homogeneous flat particles never read.
    let table = image("no table", [1, 1], 2, vk::Format::R16G16_SFLOAT, vk::ImageUsageFlags::SAMPLED)?;
    let tables = welkin::renderer::TableImages { optical_depth: &table, scattering: &table, fill: 1.0 };
    let bytes = Buffer::new(&gpu, "picture", u64::from(SIZE[0] * SIZE[1]) * 8, BufferKind::Readback)?;
    let general = vk::ImageLayout::GENERAL;
    loop {
        let (slot, ()) = device.frames().submit(|rec| {
            rec.clear_image(&target, [0.0, 0.0, 0.0, 1.0]);
            let lent =
                Lent { image: &target, entry: (Access::TransferWrite, general), exit: (Access::TransferRead, general) };
            let inputs = FrameInputs::new(&params.camera, tables);
            renderer.record_frame(rec, &inputs, Some(&FrameOutput { output: &output, target: lent }))?;
            rec.acquire(&target, Access::TransferRead, general);
            rec.copy_image_to_buffer(&target, &bytes);
            rec.make_visible_to_host(&bytes);
            Ok(())
        })?;
        device.frames().wait()?;
        if !renderer.finish(&gpu, slot)? {
            break;
        }
        device.frames().state().forget();
    }

    // A compositor's checkerboard shows the alpha.
    let texels: Vec<[u16; 4]> = bytes.read(0, (SIZE[0] * SIZE[1]) as usize);
    let display: Vec<_> = texels
        .iter()
        .enumerate()
        .map(|(i, texel)| {
            let [r, g, b, alpha] = texel.map(|bits| half::f16::from_bits(bits).to_f32());
            let (x, y) = (i as u32 % SIZE[0], i as u32 / SIZE[0]);
            let board = if (x / 8 + y / 8) % 2 == 0 { 0.1 } else { 0.3 };
            [r, g, b].map(|c| (c + (1.0 - alpha) * board).clamp(0.0, 1.0).powf(1.0 / 2.2))
        })
        .collect();
    let radiance = vec![[0.0; 3]; display.len()]; // Not of interest here: a PNG holds the toned picture.
    let picture = Picture { width: SIZE[0], height: SIZE[1], radiance, transmittance: None, display };
    picture.write(Path::new(&path), PngDepth::Eight)?;
    println!("wrote {path}");
    Ok(())
}
