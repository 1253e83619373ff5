//! Rows of rasterization-order attachment access: fragments that read the attachment which they write, as a subpass of a
//! render pass and by dynamic rendering local read.

use super::interlock::{Call, draws};
use super::merges::{Rays, one_hash};
use super::stack::{Merge, Push, Stack, chain, chain_or_sum, compare, lost, settle, short_chain};
use super::{Check, Group, Lab, Need, Sabotage, Step, Verdict};
use crate::Result;
use crate::gpu::{
    Attachment, BindingSet, BlendState, Buffer, BufferKind, Draw, DrawCall, Feedback, FeedbackPath, GraphicsPipeline,
    GraphicsState, Image, ImageDesc, PassState, PipelineKind, Program, Target,
};
use crate::shaders::{
    conform_attach_dump_frag as dump_shader, conform_attach_formats_frag as formats_shader,
    conform_attach_merge_frag as merge_shader, conform_attach_uint_frag as uint_shader,
    conform_attach_uint_ms_frag as uint_ms_shader,
};
use ash::vk;

const WHY: &str = "Mode `attachment` merges a particle into its pixel by reading the attachments that it writes: a fragment \
    that reads before the one drawn earlier has written leaves a wrong pixel";
const SPEC: &str = "VK_EXT_rasterization_order_attachment_access; VK_KHR_dynamic_rendering_local_read; Vulkan, \
    Rasterization Order and Render Pass";
const STATIC: &str = ". Also statically: the flags that pipeline and subpass are made with ask for rasterization order";

/// Everything that tells order can be broken in every way.
const FAILS: [Sabotage; 5] =
    [Sabotage::Expected, Sabotage::Unordered, Sabotage::Reversed, Sabotage::Commutative, Sabotage::Lost];

/// By which way attachments are read, and what orders it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Way {
    path: FeedbackPath,
    /// By barriers between draws in place of rasterization order.
    barriers: bool,
}

impl Way {
    fn name(self) -> &'static str {
        match self.path {
            FeedbackPath::LocalRead => "local-read",
            FeedbackPath::Subpass => "subpass",
        }
    }

    fn needs(self) -> Vec<Need> {
        let mut needs = Vec::new();
        if self.path == FeedbackPath::LocalRead {
            needs.push(Need::LocalRead);
        }
        if !self.barriers {
            needs.push(Need::AttachmentAccess);
        }
        needs
    }
}

pub(super) fn add(list: &mut Vec<Check>) {
    for path in [FeedbackPath::Subpass, FeedbackPath::LocalRead] {
        let way = Way { path, barriers: false };
        let by = match path {
            FeedbackPath::Subpass => "as input attachment of a subpass",
            FeedbackPath::LocalRead => "by dynamic rendering local read",
        };
        for samples in [1, 2, 4, 8] {
            let mut row = |name: &str, what: &str, calls: fn() -> Vec<Call>| {
                let what = format!(
                    "32 full layers at {samples}x as {what}, read {by}: a chain of multiplications and additions in r32ui, \
                     which no other order gives{}",
                    if samples > 1 { ", for each sample" } else { "" }
                );
                order_row(list, way, &format!("{name}.{samples}x"), what + STATIC, samples, calls, FAILS.to_vec());
            };
            row("instances", "instances of one draw", || vec![Call { first: 0, per_instance: 1, instances: 32 }]);
            row("primitives", "primitives of one instance", || vec![Call { first: 0, per_instance: 32, instances: 1 }]);
            row("draws", "8 draws of one pass with no barrier between them", || draws(8, 4));
            row("mixed", "4 draws of 4 instances of 2 primitives", || {
                (0..4).map(|i| Call { first: 8 * i, per_instance: 2, instances: 4 }).collect()
            });
            let what = format!(
                "32 full layers at {samples}x as a draw each, read {by}, a barrier between the draws in place of \
                 rasterization order: the same chain"
            );
            let fails = FAILS.into_iter().filter(|sabotage| *sabotage != Sabotage::Unordered).collect();
            let way = Way { barriers: true, ..way };
            order_row(list, way, &format!("barriers.{samples}x"), what, samples, || draws(32, 1), fails);
        }
        let mut row = |name: &str, what: &str, fails: &[Sabotage], run: fn(&mut Lab, Way) -> Step<String>| {
            let what = format!("{what}, read {by}{STATIC}");
            let name = format!("{}.{name}", way.name());
            let check = Check::new(Group::Attachment, name, what, move |lab| settle(run(lab, way)));
            list.push(check.why(WHY).spec(SPEC).needs(way.needs()).fails_by(fails.iter().copied()));
        };
        row("layers", "1024 full layers (quick: 256) in 16 draws: the same chain", &FAILS, |lab, way| {
            let layers = if lab.quick() { 256 } else { 1024 };
            chained(lab, way, &Stack::full(size(lab), layers), 1, &draws(16, layers / 16))
        });
        row(
            "coverage",
            "64 rectangles that each cover a part: the chain of exactly those over each pixel",
            &FAILS,
            |lab, way| chained(lab, way, &Stack::partial(size(lab), 64, 1), 1, &draws(1, 64)),
        );
        row(
            "formats",
            "4 attachments of rgba32f, rgba16f, rg32f and r32f, 32 layers: a chain of its own in each component",
            &FAILS,
            formats,
        );
        row(
            "merge",
            "16 overlapping segments on each of 64 rays through Welkin's own floating-point merge, in the 3 attachments that \
             mode `attachment` has: within 1e-4 of the f64 model of the same merge",
            &FAILS,
            |lab, way| merge(lab, way, 1).map(|r| r.map(|(error, _)| format!("largest error {error:.1e}"))),
        );
        row(
            "determinism",
            "the same merge 1000 times (quick: 50): one hash of all bits of the state",
            &FAILS[..2],
            determinism,
        );
    }
}

fn order_row(
    list: &mut Vec<Check>,
    way: Way,
    name: &str,
    what: String,
    samples: u32,
    calls: fn() -> Vec<Call>,
    fails: Vec<Sabotage>,
) {
    let mut needs = way.needs();
    if samples > 1 {
        needs.extend([Need::SampleShading, Need::ColourSamples(samples)]);
    }
    let check = Check::new(Group::Attachment, format!("{}.{name}", way.name()), what, move |lab| {
        let stack = Stack::full(size(lab), 32);
        settle(chained(lab, way, &stack, samples, &calls()))
    });
    list.push(check.why(WHY).spec(SPEC).needs(needs).fails_by(fails));
}

/// Side of the pictures [pixels].
fn size(lab: &Lab) -> u32 {
    if lab.quick() { 32 } else { 256 }
}

/// A pipeline that reads `formats`, whose description has been looked at.
fn pipeline(
    lab: &Lab,
    way: Way,
    program: &'static Program,
    constants: &[(&'static str, u32)],
    formats: &[vk::Format],
    samples: u32,
) -> Step<GraphicsPipeline> {
    let unordered = matches!(lab.sabotage(), Some(Sabotage::Unordered | Sabotage::UnorderedUnseen));
    let ordered = !way.barriers && !unordered;
    let state = GraphicsState {
        topology: vk::PrimitiveTopology::TRIANGLE_LIST,
        samples: vk::SampleCountFlags::from_raw(samples),
        attachments: formats.iter().map(|&format| Attachment { format, blend: BlendState::Replace }).collect(),
        feedback: Some(Feedback { path: way.path, ordered }),
        ..GraphicsState::default()
    };
    let pipeline = GraphicsPipeline::new(lab.gpu(), program, constants, state)?;
    let asks = match &pipeline.desc().kind {
        PipelineKind::Graphics(GraphicsState { feedback: Some(feedback), .. }) => {
            let subpass = vk::SubpassDescriptionFlags::RASTERIZATION_ORDER_ATTACHMENT_COLOR_ACCESS_EXT;
            let blend = vk::PipelineColorBlendStateCreateFlags::RASTERIZATION_ORDER_ATTACHMENT_ACCESS_EXT;
            feedback.subpass_flags().contains(subpass) && feedback.blend_flags().contains(blend)
        }
        _ => false,
    };
    if asks == way.barriers && lab.sabotage() != Some(Sabotage::UnorderedUnseen) {
        let flag = "RASTERIZATION_ORDER_ATTACHMENT_ACCESS";
        return Ok(Err(Verdict::fail(
            format!("a pipeline {} {flag}", if way.barriers { "without" } else { "with" }),
            "the opposite",
        )));
    }
    Ok(Ok(pipeline))
}

fn image(lab: &Lab, format: vk::Format, size: u32, samples: u32) -> Result<Image> {
    let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::INPUT_ATTACHMENT;
    let desc = ImageDesc { name: "conform attachment", extent: [size, size, 0], format, usage };
    Image::multisampled(lab.gpu(), &desc, vk::SampleCountFlags::from_raw(samples))
}

/// A chain over a stack in one r32ui attachment, by these calls.
fn chained(lab: &mut Lab, way: Way, stack: &Stack, samples: u32, calls: &[Call]) -> Step<String> {
    let format = vk::Format::R32_UINT;
    let program = if samples > 1 { &uint_ms_shader::PROGRAM } else { &uint_shader::PROGRAM };
    let constants = [("MERGE", chain_or_sum(lab) as u32)];
    let order = match pipeline(lab, way, program, &constants, &[format], samples)? {
        Ok(pipeline) => pipeline,
        Err(verdict) => return Ok(Err(verdict)),
    };
    let dump = match samples {
        1 => None,
        _ => match pipeline(lab, way, &dump_shader::PROGRAM, &[("SAMPLES", samples)], &[format], samples)? {
            Ok(pipeline) => Some(pipeline),
            Err(verdict) => return Ok(Err(verdict)),
        },
    };
    let size = stack.size;
    let state = image(lab, format, size, samples)?;
    let words = u64::from(size * size * samples);
    let readback = Buffer::new(lab.gpu(), "conform readback", 4 * words, BufferKind::Readback)?;
    let layers = stack.upload(lab)?;
    let whole = Stack::full(size, 1).upload(lab)?;
    let by_pixel = uint_shader::Bindings { layers: &layers, state: &state };
    let by_sample = uint_ms_shader::Bindings { layers: &layers, state: &state };
    let bindings: &dyn BindingSet = if samples > 1 { &by_sample } else { &by_pixel };
    let dump_bindings = dump_shader::Bindings { layers: &whole, state: &state, dump: &readback };
    let push = |c: &Call| Push { first: c.first, per_instance: c.per_instance, stride: size, lost: lost(lab) };
    let pushes: Vec<Push> = calls.iter().map(push).collect();
    let mut list: Vec<DrawCall<'_>> = calls
        .iter()
        .zip(&pushes)
        .map(|(call, push)| DrawCall {
            pipeline: &order,
            bindings,
            push: bytemuck::bytes_of(push),
            draw: Draw::Direct { vertices: 6 * call.per_instance, instances: call.instances },
        })
        .collect();
    let last = Push { first: 0, per_instance: 1, stride: size, lost: 0 };
    if let Some(pipeline) = &dump {
        let draw = Draw::Direct { vertices: 6, instances: 1 };
        list.push(DrawCall { pipeline, bindings: &dump_bindings, push: bytemuck::bytes_of(&last), draw });
    }
    lab.submit(|rec| {
        let targets = [Target { image: &state, clear: Some([0.0; 4]) }];
        rec.draw_pass([size; 2], &targets, PassState { separated: way.barriers, ..PassState::default() }, &list)?;
        if samples == 1 {
            rec.copy_image_to_buffer(&state, &readback);
        }
        rec.make_visible_to_host(&readback);
        Ok(())
    })?;
    let width = size * samples;
    let word = |i: u32| {
        let (x, y) = (i % width, i / width);
        stack.over(x / samples, y, samples, x % samples).fold(0, chain)
    };
    let expected = (0..width * size).map(word).collect();
    let what = format!("chain of {} layers", stack.layers());
    let found = readback.read(0, words as usize);
    let result = compare(lab, &what, width, expected, &found);
    Ok(result.map(|()| format!("{} layers in {} draws, {size}x{size}", stack.layers(), calls.len())))
}

/// Draws full layers into attachments of these formats and reads each back as bytes.
fn draw_floats(
    lab: &mut Lab,
    pipeline: &GraphicsPipeline,
    bindings: &dyn BindingSet,
    images: &[Image],
    texel_bytes: &[u64],
    layers: u32,
) -> Result<Vec<Vec<u8>>> {
    let [width, height, _] = images[0].extent();
    let pixels = u64::from(width * height);
    let buffers: Vec<Buffer> = texel_bytes
        .iter()
        .map(|bytes| Buffer::new(lab.gpu(), "conform readback", bytes * pixels, BufferKind::Readback))
        .collect::<Result<_>>()?;
    let push = Push { first: 0, per_instance: 1, stride: width, lost: lost(lab) };
    lab.submit(|rec| {
        let targets: Vec<_> = images.iter().map(|image| Target { image, clear: Some([0.0; 4]) }).collect();
        let draw = Draw::Direct { vertices: 6, instances: layers };
        rec.draw(pipeline, bindings, &push, [width, height], &targets, draw)?;
        for (image, buffer) in images.iter().zip(&buffers) {
            rec.copy_image_to_buffer(image, buffer);
            rec.make_visible_to_host(buffer);
        }
        Ok(())
    })?;
    Ok(buffers.iter().zip(texel_bytes).map(|(buffer, bytes)| buffer.read(0, (bytes * pixels) as usize)).collect())
}

fn formats(lab: &mut Lab, way: Way) -> Step<String> {
    const FORMATS: [(vk::Format, u64, usize); 4] = [
        (vk::Format::R32G32B32A32_SFLOAT, 16, 4),
        (vk::Format::R16G16B16A16_SFLOAT, 8, 4),
        (vk::Format::R32G32_SFLOAT, 8, 2),
        (vk::Format::R32_SFLOAT, 4, 1),
    ];
    let formats = FORMATS.map(|(format, ..)| format);
    let constants = [("MERGE", chain_or_sum(lab) as u32)];
    let pipeline = match pipeline(lab, way, &formats_shader::PROGRAM, &constants, &formats, 1)? {
        Ok(pipeline) => pipeline,
        Err(verdict) => return Ok(Err(verdict)),
    };
    let stack = Stack::full(size(lab), 32);
    let images: Vec<Image> = formats.iter().map(|&format| image(lab, format, stack.size, 1)).collect::<Result<_>>()?;
    let layers = stack.upload(lab)?;
    let bindings = formats_shader::Bindings {
        layers: &layers,
        state_a: &images[0],
        state_b: &images[1],
        state_c: &images[2],
        state_d: &images[3],
    };
    let found = draw_floats(lab, &pipeline, &bindings, &images, &FORMATS.map(|(_, bytes, _)| bytes), stack.layers())?;
    let pixels = (stack.size * stack.size) as usize;
    let mut component = 0;
    for ((format, _, components), bytes) in FORMATS.into_iter().zip(found) {
        let words: Vec<u32> = if format == vk::Format::R16G16B16A16_SFLOAT {
            bytes.chunks_exact(2).map(|b| half::f16::from_le_bytes([b[0], b[1]]).to_f32() as u32).collect()
        } else {
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]) as u32).collect()
        };
        let texel: Vec<u32> = (component..component + components as u32)
            .map(|c| (0..stack.layers()).fold(0, |state, layer| short_chain(state, layer + c)))
            .collect();
        component += components as u32;
        let what = format!("chains in {format:?}");
        if let Err(verdict) = compare(lab, &what, stack.size * components as u32, texel.repeat(pixels), &words) {
            return Ok(Err(verdict));
        }
    }
    Ok(Ok(format!("{formats:?}, {0}x{0}", stack.size)))
}

/// Welkin's own merge, so many times: the largest error of the first time, and a hash of each.
fn merge(lab: &mut Lab, way: Way, times: usize) -> Step<(f64, Vec<blake3::Hash>)> {
    const FORMATS: [vk::Format; 3] =
        [vk::Format::R32G32B32A32_SFLOAT, vk::Format::R32G32B32A32_SFLOAT, vk::Format::R32G32_SFLOAT];
    let rays = Rays::new(64, 16);
    let merge = if chain_or_sum(lab) == Merge::Sum { Merge::Sum } else { Merge::Set };
    let pipeline = match pipeline(lab, way, &merge_shader::PROGRAM, &rays.constants(merge as u32), &FORMATS, 1)? {
        Ok(pipeline) => pipeline,
        Err(verdict) => return Ok(Err(verdict)),
    };
    let stack = Stack::full(64, rays.layers);
    let images: Vec<Image> = FORMATS.iter().map(|&format| image(lab, format, stack.size, 1)).collect::<Result<_>>()?;
    let (layers, segments) = (stack.upload(lab)?, rays.upload(lab)?);
    let bindings = merge_shader::Bindings {
        layers: &layers,
        segments: &segments,
        committed_state: &images[0],
        pending_state: &images[1],
        extent_state: &images[2],
    };
    let (mut error, mut hashes) = (0.0, Vec::new());
    for time in 0..times {
        let state = draw_floats(lab, &pipeline, &bindings, &images, &[16, 16, 8], rays.layers)?;
        if time == 0 {
            let vectors =
                |bytes: &[u8]| -> Vec<[f32; 4]> { bytes.chunks_exact(16).map(bytemuck::pod_read_unaligned).collect() };
            match rays.compare(lab, stack.size, &vectors(&state[0]), &vectors(&state[1])) {
                Ok(largest) => error = largest,
                Err(verdict) => return Ok(Err(verdict)),
            }
        }
        hashes.push(blake3::hash(&state.concat()));
    }
    Ok(Ok((error, hashes)))
}

fn determinism(lab: &mut Lab, way: Way) -> Step<String> {
    let times = if lab.quick() { 50 } else { 1000 };
    Ok(match merge(lab, way, times)? {
        Ok((_, hashes)) => one_hash(lab, &hashes).map(|()| format!("{times} times")),
        Err(verdict) => Err(verdict),
    })
}
