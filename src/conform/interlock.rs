//! Rows of fragment shader interlock: what the interlock group of the Vulkan CTS checks, with 2 and 8 samples besides.
//!
//! Rectangles that cover the picture are drawn over each other, an instance each. A fragment reads the word of its pixel (or
//! sample), sets the bit of its layer and writes it back; where order is asked for, it clears everything unless it finds the
//! bits of all layers before it. In the end every bit must be set.

use super::stack::{Merge, Push, Stack, compare, lost, settle};
use super::variant::{Bound, interlocked};
use super::{Check, Group, Interlock, Lab, Need, Sabotage, Verdict};
use crate::Result;
use crate::gpu::{
    Buffer, BufferKind, DepthState, Draw, DrawCall, GraphicsPipeline, GraphicsState, Image, ImageDesc, PassState,
    Program,
};
use crate::shaders::{conform_order_frag as by_pixel, conform_order_sample_frag as by_sample};
use ash::vk;

/// What every row of interlock is for.
pub(super) const WHY: &str = "Mode `interlock` merges a particle into its pixel by read, change and write: a fragment that \
    comes twice, not at all, out of turn or at the same time as another leaves a wrong pixel";

/// Where it is written.
pub(super) const SPEC: &str = "VK_EXT_fragment_shader_interlock; Vulkan, Fragment Shader Interlock";

/// How the state is reached, and what goes on around the critical section.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Case {
    pub interlock: Interlock,
    pub samples: u32,
    /// The pipeline asks for an invocation for each sample.
    pub shaded: bool,
    pub in_buffer: bool,
    pub discard: bool,
}

impl Case {
    /// A pixel's fragments, in order, into an image.
    pub const PLAIN: Self =
        Self { interlock: Interlock::PixelOrdered, samples: 1, shaded: false, in_buffer: false, discard: false };

    /// Whether the shader runs for each sample.
    pub fn per_sample(self) -> bool {
        self.shaded || self.interlock.sample()
    }

    /// Words of the state side by side for one pixel.
    pub fn spread(self) -> u32 {
        if self.per_sample() { self.samples } else { 1 }
    }

    /// Bits that a layer has in a word.
    fn bits(self) -> u32 {
        if self.per_sample() { 1 } else { self.samples }
    }

    fn name(self) -> String {
        let resource = if self.in_buffer { "buffer" } else { "image" };
        let shaded = if self.shaded { "-shaded" } else { "" };
        let discard = if self.discard { ".discard" } else { "" };
        format!("{resource}.{}.{}x{shaded}{discard}", self.interlock.name(), self.samples)
    }

    fn what(self) -> String {
        let Self { samples, .. } = self;
        let word = if self.per_sample() { "sample" } else { "pixel" };
        format!(
            "{} full layers at {samples}x{}, {} interlock, state in {}{}: every layer's bit is in the word of every \
             {word}{}. Also statically: the SPIR-V asks for it once, at the top level",
            32 / self.bits(),
            if self.shaded { " with sample shading" } else { "" },
            self.interlock.name(),
            if self.in_buffer { "a buffer" } else { "an image" },
            if self.discard { ", half of the columns discarded before or within the critical section" } else { "" },
            if self.interlock.ordered() { ", each found all before it" } else { "" },
        )
    }

    pub fn needs(self) -> Vec<Need> {
        let mut needs = vec![if self.interlock.sample() { Need::SampleInterlock } else { Need::PixelInterlock }];
        if self.per_sample() {
            needs.push(Need::SampleShading);
        }
        if self.samples > 1 {
            needs.push(Need::Samples(self.samples));
        }
        needs
    }
}

pub(super) fn add(list: &mut Vec<Check>) {
    for in_buffer in [false, true] {
        for interlock in Interlock::ALL {
            for (samples, shaded) in [(1, false), (2, false), (2, true), (4, false), (4, true), (8, false), (8, true)] {
                for discard in [false, true] {
                    let case = Case { interlock, samples, shaded, in_buffer, discard };
                    let mut fails = vec![Sabotage::Expected, Sabotage::Unordered, Sabotage::Lost];
                    if interlock.ordered() {
                        fails.push(Sabotage::Reversed);
                    }
                    let check =
                        Check::new(Group::Interlock, case.name(), case.what(), move |lab| settle(bits(lab, case)));
                    list.push(check.why(WHY).spec(SPEC).needs(case.needs()).fails_by(fails));
                }
            }
        }
    }
}

/// Every bit must come, at every size.
fn bits(lab: &mut Lab, case: Case) -> Result<Result<String, Verdict>> {
    let sizes: &[u32] = match (lab.sabotage(), lab.quick(), case.samples) {
        (Some(_), ..) => &[8],
        (None, true, _) => &[8, 64],
        (None, false, 1 | 4) => &[8, 16, 32, 64, 128, 256, 512, 1024],
        (None, false, _) => &[8, 16, 32, 64, 128, 256],
    };
    let merge = if case.interlock.ordered() { Merge::SetInOrder } else { Merge::Set };
    let pipeline = match Order::new(lab, case, merge, false, false) {
        Ok(Ok(pipeline)) => pipeline,
        Ok(Err(verdict)) => return Ok(Err(verdict)),
        Err(error) => return Err(error),
    };
    for &size in sizes {
        let stack = Stack::full(size, 32 / case.bits());
        let calls = [Call { first: 0, per_instance: 1, instances: stack.layers() }];
        let found = draw(lab, case, &stack, &[&pipeline], &calls, false)?;
        let width = size * case.spread();
        let word = |i: u32| if case.discard && i % 2 == 1 { 0 } else { u32::MAX };
        let expected = (0..width * size).map(word).collect();
        if let Err(verdict) = compare(lab, &format!("{size}x{size}"), width, expected, &found) {
            return Ok(Err(verdict));
        }
    }
    Ok(Ok(format!("sizes {sizes:?}")))
}

/// A pipeline of `glsl/conform/order.glsl`.
pub(super) struct Order {
    program: &'static Program,
    pipeline: GraphicsPipeline,
}

const DEPTH_FORMAT: vk::Format = vk::Format::D16_UNORM; // The one that every device has.

impl Order {
    /// Looks at the SPIR-V, then builds; `early` puts tests before the shader, `depth` asks for the depth test.
    pub fn new(lab: &Lab, case: Case, merge: Merge, early: bool, depth: bool) -> Result<Result<Self, Verdict>> {
        let source = if case.per_sample() { &by_sample::PROGRAM } else { &by_pixel::PROGRAM };
        let program = match interlocked(lab, source, case.interlock, early) {
            Ok(program) => program,
            Err(verdict) => return Ok(Err(verdict)),
        };
        let mut constants = vec![
            ("MERGE", merge as u32),
            ("IN_BUFFER", u32::from(case.in_buffer)),
            ("DISCARD", u32::from(case.discard)),
            ("BITS", case.bits()),
        ];
        if case.per_sample() {
            constants.push(("SAMPLES", case.samples));
        }
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            samples: vk::SampleCountFlags::from_raw(case.samples),
            sample_shading: case.shaded,
            depth: depth.then_some(DepthState { format: DEPTH_FORMAT, compare: vk::CompareOp::LESS, write: true }),
            ..GraphicsState::default()
        };
        let pipeline = GraphicsPipeline::new(lab.gpu(), program, &constants, state)?;
        Ok(Ok(Self { program, pipeline }))
    }
}

/// One draw of a pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Call {
    pub first: u32,
    pub per_instance: u32,
    pub instances: u32,
}

/// `n` draws of `each` layers.
pub(super) fn draws(n: u32, each: u32) -> Vec<Call> {
    (0..n).map(|i| Call { first: i * each, per_instance: 1, instances: each }).collect()
}

/// Draws `stack` by `calls`, which take turns with the pipelines, and reads the state back.
pub(super) fn draw(
    lab: &mut Lab,
    case: Case,
    stack: &Stack,
    orders: &[&Order],
    calls: &[Call],
    depth: bool,
) -> Result<Vec<u32>> {
    let gpu = lab.gpu().clone();
    let (width, height) = (stack.size * case.spread(), stack.size);
    let words = u64::from(width) * u64::from(height);
    let unused = |used: bool, n: u32| if used { n } else { 1 };
    let image = Image::new(
        &gpu,
        &ImageDesc {
            name: "conform state image",
            extent: [unused(!case.in_buffer, width), unused(!case.in_buffer, height), 0],
            format: vk::Format::R32_UINT,
            usage: vk::ImageUsageFlags::STORAGE,
        },
    )?;
    let size = if case.in_buffer { 4 * words } else { 4 };
    let buffer = Buffer::new(&gpu, "conform state buffer", size, BufferKind::Device)?;
    let readback = Buffer::new(&gpu, "conform readback", 4 * words, BufferKind::Readback)?;
    let layers = stack.upload(lab)?;
    let depth_image = match depth {
        false => None,
        true => Some(Image::multisampled(
            &gpu,
            &ImageDesc {
                name: "conform depth",
                extent: [stack.size, stack.size, 0],
                format: DEPTH_FORMAT,
                usage: vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            },
            vk::SampleCountFlags::from_raw(case.samples),
        )?),
    };
    let pixel = by_pixel::Bindings { layers: &layers, state_image: &image, state_buffer: &buffer };
    let sample = by_sample::Bindings { layers: &layers, state_image: &image, state_buffer: &buffer };
    let bound: Vec<Bound<'_>> = orders
        .iter()
        .map(|order| Bound { program: order.program, bindings: if case.per_sample() { &sample } else { &pixel } })
        .collect();
    let pushes: Vec<Push> = calls
        .iter()
        .map(|c| Push { first: c.first, per_instance: c.per_instance, stride: width, lost: lost(lab) })
        .collect();
    let draws: Vec<DrawCall<'_>> = (0..)
        .zip(calls.iter().zip(&pushes))
        .map(|(i, (call, push)): (usize, _)| DrawCall {
            pipeline: &orders[i % orders.len()].pipeline,
            bindings: &bound[i % orders.len()],
            push: bytemuck::bytes_of(push),
            draw: Draw::Direct { vertices: 6 * call.per_instance, instances: call.instances },
        })
        .collect();
    lab.submit(|rec| {
        rec.clear_image(&image, [0.0; 4]);
        rec.fill_buffer(&buffer, 0, size, 0);
        let pass = PassState { depth: depth_image.as_ref().map(|image| (image, 1.0)), ..PassState::default() };
        rec.draw_pass([stack.size; 2], &[], pass, &draws)?;
        if case.in_buffer {
            rec.copy_buffer(&buffer, &readback, size);
        } else {
            rec.copy_image_to_buffer(&image, &readback);
        }
        rec.make_visible_to_host(&readback);
        Ok(())
    })?;
    Ok(readback.read(0, words as usize))
}
