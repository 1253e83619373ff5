//! Rows of fragment shader interlock that the CTS does not have: draws, pipelines and primitives of one pass, many layers,
//! wide state, floating-point merges, partial coverage, depth test, determinism.

use super::interlock::{Call, Case, Order, SPEC, WHY, draw, draws};
use super::merges::{Rays, one_hash};
use super::stack::{Merge, Push, Stack, chain, chain_or_sum, compare, lost, settle};
use super::variant::{Bound, interlocked};
use super::{Check, Group, Interlock, Lab, Need, Sabotage, Step};
use crate::Result;
use crate::gpu::{
    BindingSet, Buffer, BufferKind, Draw, DrawCall, Gpu, GraphicsPipeline, GraphicsState, Image, ImageDesc, Program,
};
use crate::shaders::{conform_merge_frag as merge_shader, conform_wide_frag as wide_shader};
use ash::vk;
use std::sync::Arc;

/// Everything that tells order can be broken in every way.
const FAILS: [Sabotage; 5] =
    [Sabotage::Expected, Sabotage::Unordered, Sabotage::Reversed, Sabotage::Commutative, Sabotage::Lost];

const STATIC: &str = ". Also statically: the SPIR-V asks for ordered interlock once, at the top level";

pub(super) fn add(list: &mut Vec<Check>) {
    let mut row = |name: &str, what: &str, needs: Vec<Need>, run: fn(&mut Lab) -> Step<String>| {
        let check = Check::new(Group::Interlock, name, format!("{what}{STATIC}"), move |lab| settle(run(lab)));
        list.push(check.why(WHY).spec(SPEC).needs(needs).fails_by(FAILS));
    };
    let pixel = || vec![Need::PixelInterlock];
    row(
        "order.instances",
        "32 layers as instances of one draw: a chain of multiplications and additions, which no other order gives",
        pixel(),
        |lab| chained(lab, 32, &[Call { first: 0, per_instance: 1, instances: 32 }], 1),
    );
    row("order.primitives", "the same chain, 32 layers as primitives of one instance", pixel(), |lab| {
        chained(lab, 32, &[Call { first: 0, per_instance: 32, instances: 1 }], 1)
    });
    row(
        "order.draws",
        "the same chain, 32 layers in 8 draws of one pass with no barrier between them",
        pixel(),
        |lab| chained(lab, 32, &draws(8, 4), 1),
    );
    row(
        "order.pipelines",
        "the same chain, 32 layers in 8 draws of one pass by two pipelines in turns",
        pixel(),
        |lab| chained(lab, 32, &draws(8, 4), 2),
    );
    row("order.layers", "the same chain over 1024 layers (quick: 256), so that no bit mask would do", pixel(), |lab| {
        let layers = if lab.quick() { 256 } else { 1024 };
        chained(lab, layers, &draws(layers / 64, 64), 1)
    });
    row(
        "coverage.1x",
        "64 rectangles that each cover a part: the chain of exactly those over each pixel, in order",
        pixel(),
        |lab| partial(lab, Case::PLAIN),
    );
    for samples in [2, 4, 8] {
        let what = format!(
            "the same at {samples}x, a chain for each sample by sample-ordered interlock: exactly the rectangles that cover \
             the sample, which no edge touches{STATIC}"
        );
        let case = Case { interlock: Interlock::SampleOrdered, samples, ..Case::PLAIN };
        let needs = case.needs().into_iter().chain([Need::StandardSampleLocations]);
        let name = format!("coverage.{samples}x");
        let check = Check::new(Group::Interlock, name, what, move |lab| settle(partial(lab, case)));
        list.push(check.why(WHY).spec(SPEC).needs(needs).fails_by(FAILS));
    }
    let mut row = |name: &str, what: &str, run: fn(&mut Lab) -> Step<String>| {
        let check = Check::new(Group::Interlock, name, format!("{what}{STATIC}"), move |lab| settle(run(lab)));
        list.push(check.why(WHY).spec(SPEC).needs([Need::PixelInterlock]).fails_by(FAILS));
    };
    row(
        "depth.early",
        "64 rectangles at many depths, `early_fragment_tests`: only fragments that are nearer than all before them merge",
        |lab| depth(lab, true),
    );
    row(
        "depth.late",
        "the same without `early_fragment_tests`: every fragment merges, as the test comes after the shader",
        |lab| depth(lab, false),
    );
    row(
        "wide",
        "32 layers, a state of 40 bytes in three images as mode `interlock` has: every word is made of another word of the \
         state, so that words of different layers never go together unseen",
        wide,
    );
    row(
        "merge",
        "16 overlapping segments on each of 64 rays through Welkin's own floating-point merge, in the images that mode \
         `interlock` has: within 1e-4 of the f64 model of the same merge",
        |lab| merge(lab, 1).map(|result| result.map(|(error, _)| format!("largest error {error:.1e}"))),
    );
    let check = Check::new(
        Group::Interlock,
        "determinism",
        format!("the same merge 1000 times (quick: 50): one hash of all bits of the state{STATIC}"),
        |lab| settle(determinism(lab)),
    );
    list.push(
        check.why(WHY).spec(SPEC).needs([Need::PixelInterlock]).fails_by([Sabotage::Expected, Sabotage::Unordered]),
    );
}

/// A chain over full layers by these calls, which take turns with so many pipelines.
fn chained(lab: &mut Lab, layers: u32, calls: &[Call], pipelines: usize) -> Step<String> {
    let size = if lab.quick() { 32 } else { 256 };
    let stack = Stack::full(size, layers);
    let mut orders = Vec::new();
    for early in [false, true].into_iter().take(pipelines) {
        // The second one differs in an execution mode that changes nothing here: there is no depth test.
        match Order::new(lab, Case::PLAIN, chain_or_sum(lab), early, false)? {
            Ok(order) => orders.push(order),
            Err(verdict) => return Ok(Err(verdict)),
        }
    }
    let orders: Vec<&Order> = orders.iter().collect();
    let found = draw(lab, Case::PLAIN, &stack, &orders, calls, false)?;
    let expected = (0..layers).fold(0, chain);
    let what = format!("chain of {layers} layers");
    let result = compare(lab, &what, size, vec![expected; (size * size) as usize], &found);
    Ok(result.map(|()| format!("{layers} layers in {} draws, {size}x{size}", calls.len())))
}

/// A chain over rectangles that cover a part each.
fn partial(lab: &mut Lab, case: Case) -> Step<String> {
    let size = if lab.quick() { 32 } else { 256 };
    let stack = Stack::partial(size, 64, case.samples);
    let order = match Order::new(lab, case, chain_or_sum(lab), false, false)? {
        Ok(order) => order,
        Err(verdict) => return Ok(Err(verdict)),
    };
    let calls = [Call { first: 0, per_instance: 1, instances: stack.layers() }];
    let found = draw(lab, case, &stack, &[&order], &calls, false)?;
    let width = size * case.spread();
    let word = |i: u32| {
        let (x, y) = (i % width, i / width);
        stack.over(x / case.samples, y, case.samples, x % case.samples).fold(0, chain)
    };
    let expected = (0..width * size).map(word).collect();
    Ok(compare(lab, "chain of the rectangles over a sample", width, expected, &found)
        .map(|()| format!("64 rectangles, {size}x{size}")))
}

/// A chain of what passes a depth test, or of everything where the test comes late.
fn depth(lab: &mut Lab, early: bool) -> Step<String> {
    let size = if lab.quick() { 32 } else { 256 };
    let mut stack = Stack::partial(size, 64, 1);
    for (i, depth) in (0u32..).zip(&mut stack.depths) {
        *depth = (1 + i * 37 % 61) as f32 / 64.0;
    }
    let order = match Order::new(lab, Case::PLAIN, chain_or_sum(lab), early, true)? {
        Ok(order) => order,
        Err(verdict) => return Ok(Err(verdict)),
    };
    let calls = [Call { first: 0, per_instance: 1, instances: stack.layers() }];
    let found = draw(lab, Case::PLAIN, &stack, &[&order], &calls, true)?;
    let word = |i: u32| {
        let mut nearest = 1.0;
        stack.over(i % size, i / size, 1, 0).fold(0, |state, layer| {
            let depth = stack.depths[layer as usize];
            let passes = depth < nearest;
            if passes {
                nearest = depth;
            }
            if passes || !early { chain(state, layer) } else { state }
        })
    };
    let expected = (0..size * size).map(word).collect();
    let what = if early { "chain of the nearest so far" } else { "chain of all" };
    Ok(compare(lab, what, size, expected, &found).map(|()| format!("64 rectangles, {size}x{size}")))
}

/// The state of mode `interlock`.
struct State {
    images: [Image; 3],
    layers: Buffer,
    size: u32,
}

impl State {
    fn new(lab: &Lab, stack: &Stack, [wide, narrow]: [vk::Format; 2]) -> Result<Self> {
        let gpu: &Arc<Gpu> = lab.gpu();
        let size = stack.size;
        let image = |name, format| {
            let usage = vk::ImageUsageFlags::STORAGE;
            Image::new(gpu, &ImageDesc { name, extent: [size, size, 0], format, usage })
        };
        Ok(Self {
            images: [image("conform a", wide)?, image("conform b", wide)?, image("conform c", narrow)?],
            layers: stack.upload(lab)?,
            size,
        })
    }

    /// Draws the layers and reads 4, 4 and 2 words of each pixel.
    fn draw(
        &self,
        lab: &mut Lab,
        pipeline: &GraphicsPipeline,
        bindings: &dyn BindingSet,
        count: u32,
    ) -> Result<[Vec<u32>; 3]> {
        let pixels = (self.size * self.size) as usize;
        let push = Push { first: 0, per_instance: 1, stride: self.size, lost: lost(lab) };
        let parts: Vec<Buffer> = [16, 16, 8]
            .iter()
            .map(|bytes| Buffer::new(lab.gpu(), "conform part", bytes * pixels as u64, BufferKind::Readback))
            .collect::<Result<_>>()?;
        lab.submit(|rec| {
            self.images.iter().for_each(|image| rec.clear_image(image, [0.0; 4]));
            let draw = Draw::Direct { vertices: 6, instances: count };
            let call = DrawCall { pipeline, bindings, push: bytemuck::bytes_of(&push), draw };
            rec.draw_all([self.size; 2], &[], &[call])?;
            for (image, part) in self.images.iter().zip(&parts) {
                rec.copy_image_to_buffer(image, part);
                rec.make_visible_to_host(part);
            }
            Ok(())
        })?;
        Ok([parts[0].read(0, 4 * pixels), parts[1].read(0, 4 * pixels), parts[2].read(0, 2 * pixels)])
    }
}

fn pipeline(lab: &Lab, program: &'static Program, constants: &[(&'static str, u32)]) -> Result<GraphicsPipeline> {
    let state = GraphicsState { topology: vk::PrimitiveTopology::TRIANGLE_LIST, ..GraphicsState::default() };
    GraphicsPipeline::new(lab.gpu(), program, constants, state)
}

fn wide(lab: &mut Lab) -> Step<String> {
    let program = match interlocked(lab, &wide_shader::PROGRAM, Interlock::PixelOrdered, false) {
        Ok(program) => program,
        Err(verdict) => return Ok(Err(verdict)),
    };
    let stack = Stack::full(if lab.quick() { 32 } else { 256 }, 32);
    let pipeline = pipeline(lab, program, &[("MERGE", chain_or_sum(lab) as u32)])?;
    let state = State::new(lab, &stack, [vk::Format::R32G32B32A32_UINT, vk::Format::R32G32_UINT])?;
    let [state_a, state_b, state_c] = [&state.images[0], &state.images[1], &state.images[2]];
    let bindings = wide_shader::Bindings { layers: &state.layers, state_a, state_b, state_c };
    let bindings = Bound { program, bindings: &bindings };
    let found = state.draw(lab, &pipeline, &bindings, stack.layers())?;
    let mut words = [0u32; 10];
    for layer in 0..stack.layers() {
        words = std::array::from_fn(|i| chain(words[(i + 1) % 10], layer + i as u32));
    }
    let pixels = (stack.size * stack.size) as usize;
    for (part, (words, found)) in [&words[..4], &words[4..8], &words[8..]].into_iter().zip(&found).enumerate() {
        let what = format!("chain in image {part}");
        if let Err(verdict) = compare(lab, &what, words.len() as u32 * stack.size, words.repeat(pixels), found) {
            return Ok(Err(verdict));
        }
    }
    Ok(Ok(format!("32 layers, {0}x{0}", stack.size)))
}

/// Welkin's own merge, so many times: the largest error of the first time, and a hash of each.
fn merge(lab: &mut Lab, times: usize) -> Step<(f64, Vec<blake3::Hash>)> {
    let program = match interlocked(lab, &merge_shader::PROGRAM, Interlock::PixelOrdered, false) {
        Ok(program) => program,
        Err(verdict) => return Ok(Err(verdict)),
    };
    let rays = Rays::new(64, 16);
    let stack = Stack::full(64, rays.layers);
    let merge = if chain_or_sum(lab) == Merge::Sum { Merge::Sum } else { Merge::Set };
    let pipeline = pipeline(lab, program, &rays.constants(merge as u32))?;
    let segments = rays.upload(lab)?;
    let state = State::new(lab, &stack, [vk::Format::R32G32B32A32_SFLOAT, vk::Format::R32G32_SFLOAT])?;
    let bindings = merge_shader::Bindings {
        layers: &state.layers,
        segments: &segments,
        committed_state: &state.images[0],
        pending_state: &state.images[1],
        extent_state: &state.images[2],
    };
    let bindings = Bound { program, bindings: &bindings };
    let (mut error, mut hashes) = (0.0, Vec::new());
    for time in 0..times {
        let [committed, pending, extent] = state.draw(lab, &pipeline, &bindings, rays.layers)?;
        if time == 0 {
            let vectors = |words: &[u32]| -> Vec<[f32; 4]> { bytemuck::cast_slice(words).to_vec() };
            match rays.compare(lab, stack.size, &vectors(&committed), &vectors(&pending)) {
                Ok(largest) => error = largest,
                Err(verdict) => return Ok(Err(verdict)),
            }
        }
        hashes.push(blake3::hash(bytemuck::cast_slice(&[committed, pending, extent].concat())));
    }
    Ok(Ok((error, hashes)))
}

fn determinism(lab: &mut Lab) -> Step<String> {
    let times = if lab.quick() { 50 } else { 1000 };
    Ok(match merge(lab, times)? {
        Ok((_, hashes)) => one_hash(lab, &hashes).map(|()| format!("{times} times")),
        Err(verdict) => Err(verdict),
    })
}
