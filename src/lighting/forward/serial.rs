//! The papers' light pass as they have it (Harris 2.3, Stoian 3): one draw and one read-back for each particle.
//!
//! A measure of what it costs to wait for the device sixty thousand times, as in Shimada's Table 1; `welkin bench
//! --serial-forward` prints it. Frames never do this.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{DQuat, DVec3};
use half::f16;

use super::{forward_share, splat_index};
use crate::Result;
use crate::gpu::{
    Attachment, BlendState, Buffer, BufferKind, Draw, Frames, Gpu, GraphicsPipeline, GraphicsState, Image, ImageDesc,
    Target,
};
use crate::params::Clouds;
use crate::reference::tiling::{light_depth, light_key};
use crate::shaders::lighting_forward_serial_frag as shader;
use crate::shared::Particle;
use crate::tiling::TilingParams;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SerialPush {
    middle: [f32; 2],
    half_size: [f32; 2],
    extent: [f32; 2],
    reserved: [f32; 2],
    outline: [f32; 3],
    opacity: f32,
    colour: f32,
    profile: u32,
    end: [u32; 2],
}

const FORMAT: vk::Format = vk::Format::R16G16B16A16_SFLOAT;

/// The light buffer and what draws into it.
pub struct Serial {
    pipeline: GraphicsPipeline,
    buffer: Image,
    readback: Buffer,
    resolution: u32,
}

impl Serial {
    /// A buffer of `resolution`² texels; the papers have 32².
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(gpu: &Arc<Gpu>, resolution: u32) -> Result<Self> {
        let over = vk::PipelineColorBlendAttachmentState::default()
            .color_write_mask(vk::ColorComponentFlags::RGBA)
            .blend_enable(true)
            .src_color_blend_factor(vk::BlendFactor::ONE)
            .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
            .color_blend_op(vk::BlendOp::ADD)
            .src_alpha_blend_factor(vk::BlendFactor::ONE)
            .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
            .alpha_blend_op(vk::BlendOp::ADD);
        let state = GraphicsState {
            attachments: vec![Attachment { format: FORMAT, blend: BlendState::Custom(over) }],
            ..GraphicsState::default()
        };
        let texels = u64::from(resolution) * u64::from(resolution);
        Ok(Self {
            pipeline: GraphicsPipeline::new(gpu, &shader::PROGRAM, &[], state)?,
            buffer: Image::new(
                gpu,
                &ImageDesc {
                    name: "light buffer",
                    extent: [resolution, resolution, 1],
                    format: FORMAT,
                    usage: vk::ImageUsageFlags::COLOR_ATTACHMENT
                        | vk::ImageUsageFlags::TRANSFER_SRC
                        | vk::ImageUsageFlags::TRANSFER_DST,
                },
            )?,
            readback: Buffer::new(gpu, "light readback", texels * 8, BufferKind::Readback)?,
            resolution,
        })
    }

    /// Light that comes in on each of `particles`, and how long all of it took, the sorting on the host included. `tiles`:
    /// the light; its first level is what the buffer covers.
    ///
    /// # Errors
    /// What Vulkan says.
    pub fn run(
        &self,
        frames: &mut Frames,
        particles: &[Particle],
        tiles: &TilingParams,
        clouds: &Clouds,
    ) -> Result<(Vec<f32>, Duration)> {
        let start = Instant::now();
        let mut order: Vec<usize> = (0..particles.len()).collect();
        order.sort_by_key(|&i| (light_key(light_depth(particles[i].centre, tiles)), i));
        let (forward, profile) = (forward_share(clouds), splat_index(clouds.forward.splat));
        let mut incident = vec![1.0; particles.len()];
        frames.run(|rec| {
            rec.clear_image(&self.buffer, [1.0; 4]);
            Ok(())
        })?;
        let mut splat: Option<SerialPush> = None;
        for k in order {
            frames.run(|rec| {
                if let Some(push) = &splat {
                    let target = [Target { image: &self.buffer, clear: None }];
                    let draw = Draw::Direct { vertices: 4, instances: 1 };
                    rec.draw(&self.pipeline, &shader::Bindings {}, push, [self.resolution; 2], &target, draw)?;
                }
                rec.copy_image_to_buffer(&self.buffer, &self.readback);
                rec.make_visible_to_host(&self.readback);
                Ok(())
            })?;
            let (mut push, tau) = footprint(&particles[k], tiles);
            let texel = push.middle.map(|ndc| {
                let texel = ((ndc + 1.0) * 0.5 * self.resolution as f32).floor();
                (texel.max(0.0) as u32).min(self.resolution - 1)
            });
            let at = u64::from(texel[1] * self.resolution + texel[0]) * 8;
            let light = self.readback.read::<[f16; 4]>(at, 1)[0][0].to_f32();
            incident[k] = light;
            let opacity = -(-tau).exp_m1();
            (push.opacity, push.profile) = (opacity as f32, profile);
            push.colour = (opacity * forward) as f32 * light;
            splat = Some(push);
        }
        Ok((incident, start.elapsed()))
    }
}

/// Where and how large a particle's splat is, and its optical depth along the light.
fn footprint(particle: &Particle, t: &TilingParams) -> (SerialPush, f64) {
    let vec = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let inverse = DQuat::from_array(particle.rotation.map(f64::from)).inverse();
    let axes = vec(particle.semi_axes);
    let along = inverse * vec(t.to_sun) / axes;
    let [u, v] = [t.u_axis, t.v_axis].map(|axis| {
        let axis = inverse * vec(axis) / axes;
        axis - along * (axis.dot(along) / along.length_squared())
    });
    let (along_u, along_v) = (u.length(), u.dot(v) / u.length());
    let outline = [along_u, along_v, (v - u * (along_v / along_u)).length()].map(|c| c as f32);
    let extent = [t.u_axis, t.v_axis].map(|axis| (axes * (inverse * vec(axis))).length());
    let relative = vec(particle.centre) - vec(t.centre);
    let (rect, half) = (t.level_rect[0].map(f64::from), 0.5 * f64::from(t.tile_dim));
    let at = [relative.dot(vec(t.u_axis)), relative.dot(vec(t.v_axis))];
    let middle = std::array::from_fn(|axis| ((at[axis] - rect[axis]) * rect[axis + 2] / half - 1.0) as f32);
    let half_size = std::array::from_fn(|axis| (extent[axis] * rect[axis + 2] / half) as f32);
    let density = f64::from(particle.density) * f64::from(particle.fade);
    let tau = 2.0 / along.length() * f64::from(t.extinction) * density;
    (SerialPush { middle, half_size, extent: extent.map(|c| c as f32), outline, ..SerialPush::zeroed() }, tau)
}
