//! Rectangles drawn over each other, and the numbers that tell in which order they came.

use super::{Lab, Sabotage, Verdict};
use crate::gpu::{Buffer, BufferKind, Gpu};
use crate::shared::assert_layout;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

use crate::Result;

/// A rectangle (`glsl/conform/layer.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct ConformLayer {
    /// Opposite corners in clip space.
    pub bounds: [f32; 4],
    /// 0 to 1.
    pub depth: f32,
    /// Place in the order.
    pub index: u32,
    pub reserved_a: u32,
    pub reserved_b: u32,
}
assert_layout!(ConformLayer, conform_layer, {
    bounds: BOUNDS, depth: DEPTH, index: INDEX, reserved_a: RESERVED_A, reserved_b: RESERVED_B,
});

/// Push constants of the layers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Push {
    pub first: u32,
    pub per_instance: u32,
    pub stride: u32,
    pub lost: u32,
}

/// The merges of `glsl/conform/layer.glsl`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Merge {
    Set = 0,
    SetInOrder = 1,
    Chain = 2,
    Sum = 3,
}

/// Layers over a square picture.
pub(super) struct Stack {
    /// Side [pixels], a power of two.
    pub size: u32,
    /// Corners of each layer [1/16 pixel].
    pub rectangles: Vec<[u32; 4]>,
    /// Depth of each layer, 0 to 1.
    pub depths: Vec<f32>,
}

impl Stack {
    /// `layers` that cover everything.
    pub fn full(size: u32, layers: u32) -> Self {
        Self {
            size,
            rectangles: vec![[0, 0, 16 * size, 16 * size]; layers as usize],
            depths: vec![0.5; layers as usize],
        }
    }

    /// `layers` that each cover a part; no edge touches a sample of the standard places for `samples`.
    pub fn partial(size: u32, layers: u32, samples: u32) -> Self {
        // Standard samples lie on odd quarters (2 samples), eighths (4) and sixteenths (8), the only one in the middle.
        let (step, off) = match samples {
            2 => (4, 2),
            _ => (8, 4),
        };
        let mut random = 1u32;
        let mut edge = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) % (16 * size / step) * step + if samples == 1 || samples == 2 { off } else { 0 }
        };
        let rectangles = (0..layers).map(|layer| {
            let (a, b, c, d) = (edge(), edge(), edge(), edge());
            if layer == 1 {
                return [0, 0, 16 * size, 16 * size]; // so that the fragment lost on purpose is one
            }
            [a.min(b), c.min(d), a.max(b) + step, c.max(d) + step]
        });
        Self { size, rectangles: rectangles.collect(), depths: vec![0.5; layers as usize] }
    }

    /// Number of layers.
    pub fn layers(&self) -> u32 {
        self.rectangles.len() as u32
    }

    /// The layers on the device, in the order in which they are drawn.
    pub fn upload(&self, lab: &Lab) -> Result<Buffer> {
        let clip = |x: u32| 2.0 * (x as f32 / 16.0) / self.size as f32 - 1.0;
        let mut layers: Vec<ConformLayer> = (0u32..)
            .zip(self.rectangles.iter().zip(&self.depths))
            .map(|(index, (r, depth))| ConformLayer {
                bounds: r.map(clip),
                depth: *depth,
                index,
                reserved_a: 0,
                reserved_b: 0,
            })
            .collect();
        if lab.sabotage() == Some(Sabotage::Reversed) {
            layers.reverse();
        }
        let gpu: &Arc<Gpu> = lab.gpu();
        let buffer = Buffer::new(gpu, "layers", std::mem::size_of_val(&layers[..]) as u64, BufferKind::Upload)?;
        buffer.write(0, &layers);
        Ok(buffer)
    }

    /// The layers over sample `sample` of `samples` of a pixel, in order.
    pub fn over(&self, x: u32, y: u32, samples: u32, sample: u32) -> impl Iterator<Item = u32> {
        let [sx, sy] = locations(samples)[sample as usize];
        let (px, py) = (16 * x + sx, 16 * y + sy);
        let inside = move |r: &[u32; 4]| (r[0]..r[2]).contains(&px) && (r[1]..r[3]).contains(&py);
        (0u32..).zip(&self.rectangles).filter(move |(_, r)| inside(r)).map(|(layer, _)| layer)
    }
}

/// The standard sample locations [1/16 pixel] (Vulkan, "Multisampling").
pub(super) fn locations(samples: u32) -> &'static [[u32; 2]] {
    match samples {
        1 => &[[8, 8]],
        2 => &[[12, 12], [4, 4]],
        4 => &[[6, 2], [14, 6], [2, 10], [10, 14]],
        _ => &[[9, 5], [7, 11], [13, 9], [5, 3], [3, 13], [1, 7], [11, 15], [15, 1]],
    }
}

/// `chain` of `glsl/conform/layer.glsl`.
pub(super) fn chain(state: u32, layer: u32) -> u32 {
    let term = (layer + 1).wrapping_mul(2_654_435_761);
    state.wrapping_mul(1_664_525).wrapping_add(term ^ (term >> 15))
}

/// `short_chain` of `glsl/conform/layer.glsl`.
pub(super) fn short_chain(state: u32, layer: u32) -> u32 {
    let term = (layer + 1).wrapping_mul(2_654_435_761) >> 21;
    (state * 613 + term) & 2047
}

/// The merge that a check of order runs: the chain, unless a test breaks it.
pub(super) fn chain_or_sum(lab: &Lab) -> Merge {
    if lab.sabotage() == Some(Sabotage::Commutative) { Merge::Sum } else { Merge::Chain }
}

/// Whether one fragment is to be lost.
pub(super) fn lost(lab: &Lab) -> u32 {
    u32::from(lab.sabotage() == Some(Sabotage::Lost))
}

/// Compares the words of a picture of `width`; an error tells how many differ, and the first.
pub(super) fn compare(lab: &Lab, what: &str, width: u32, mut expected: Vec<u32>, found: &[u32]) -> Result<(), Verdict> {
    if lab.sabotage() == Some(Sabotage::Expected)
        && let Some(middle) = expected.len().checked_div(2)
    {
        expected[middle] ^= 1;
    }
    let mut wrong = (0u32..).zip(expected.iter().zip(found)).filter(|(_, (e, f))| e != f);
    match wrong.next() {
        None if expected.len() == found.len() => Ok(()),
        None => Err(Verdict::fail(format!("{what}: {} words", expected.len()), format!("{}", found.len()))),
        Some((index, (e, f))) => {
            let (x, y, others) = (index % width, index / width, wrong.count());
            Err(Verdict::fail(
                format!("{what}: {e:#010x} at ({x}, {y})"),
                format!("{f:#010x}; {} of {} words differ", others + 1, expected.len()),
            ))
        }
    }
}

/// A check's steps that may end it early.
pub(super) fn settle(result: Result<Result<String, Verdict>>) -> Result<Verdict> {
    result.map(|inner| inner.map_or_else(|verdict| verdict, Verdict::Pass))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_edge_touches_a_sample() {
        for samples in [1, 2, 4, 8] {
            for r in &Stack::partial(16, 200, samples).rectangles {
                assert!(r[0] < r[2] && r[1] < r[3], "{r:?}");
                for [x, y] in locations(samples) {
                    assert!(
                        r[0] % 16 != *x && r[2] % 16 != *x && r[1] % 16 != *y && r[3] % 16 != *y,
                        "{samples} {r:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_chains_tell_orders_apart() {
        let run = |order: &[u32], step: fn(u32, u32) -> u32| order.iter().fold(0, |state, layer| step(state, *layer));
        for step in [chain as fn(u32, u32) -> u32, short_chain] {
            let straight: Vec<u32> = (0..32).collect();
            for i in 0..31 {
                let mut swapped = straight.clone();
                swapped.swap(i, i + 1);
                assert_ne!(run(&straight, step), run(&swapped, step), "{i}");
                let without: Vec<u32> = straight.iter().copied().filter(|l| *l != i as u32).collect();
                assert_ne!(run(&straight, step), run(&without, step), "{i}");
            }
        }
    }
}
