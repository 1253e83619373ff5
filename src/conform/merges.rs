//! Welkin's own merge as a check: segments of rays, and what must come of them.

use super::{Lab, Sabotage, Verdict};
use crate::Result;
use crate::gpu::{Buffer, BufferKind};
use crate::reference::segments::{Segment, merged};
use crate::shared::assert_layout;
use bytemuck::{Pod, Zeroable};

/// A segment (`glsl/conform/segments.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ConformSegment {
    colour: [f32; 3],
    optical_depth: f32,
    t_enter: f32,
    t_exit: f32,
    reserved_a: f32,
    reserved_b: f32,
}
assert_layout!(ConformSegment, conform_segment, {
    colour: COLOUR, optical_depth: OPTICAL_DEPTH, t_enter: T_ENTER, t_exit: T_EXIT,
    reserved_a: RESERVED_A, reserved_b: RESERVED_B,
});

/// Rays through overlapping segments, back to front by their centres, as the particles of a cloud are drawn.
pub(super) struct Rays {
    pub rays: u32,
    pub layers: u32,
    segments: Vec<ConformSegment>,
}

/// Largest error of a radiance or a transmittance. The device computes in f32: some 1e-7 for each of the merges of a ray,
/// more where a thin segment's colour is divided by its opacity; 1e-4 is what Welkin promises of each mode.
const TOLERANCE: f64 = 1e-4;

impl Rays {
    /// The same ones each time.
    pub fn new(rays: u32, layers: u32) -> Self {
        let mut random = 7u32;
        let mut uniform = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) as f32 / (1 << 24) as f32
        };
        let mut segments = Vec::new();
        for _ in 0..rays {
            let mut ray: Vec<ConformSegment> = (0..layers)
                .map(|_| {
                    let (centre, half) = (4.0 + 0.25 * layers as f32 * uniform(), 0.5 + 0.5 * uniform());
                    ConformSegment {
                        colour: [uniform(), uniform(), uniform()],
                        optical_depth: 0.1 + 0.9 * uniform(),
                        t_enter: centre - half,
                        t_exit: centre + half,
                        reserved_a: 0.0,
                        reserved_b: 0.0,
                    }
                })
                .collect();
            ray.sort_by(|a, b| (b.t_enter + b.t_exit).total_cmp(&(a.t_enter + a.t_exit)));
            segments.extend(ray);
        }
        Self { rays, layers, segments }
    }

    /// The segments on the device.
    pub fn upload(&self, lab: &Lab) -> Result<Buffer> {
        let size = std::mem::size_of_val(&self.segments[..]) as u64;
        let buffer = Buffer::new(lab.gpu(), "conform segments", size, BufferKind::Upload)?;
        buffer.write(0, &self.segments);
        Ok(buffer)
    }

    /// Specialization constants of the shaders.
    pub fn constants(&self, merge: u32) -> Vec<(&'static str, u32)> {
        vec![("MERGE", merge), ("RAYS", self.rays), ("LAYERS", self.layers)]
    }

    /// Radiance and transmittance of each ray, by the f64 model of the same merge.
    fn expected(&self) -> Vec<[f64; 4]> {
        let rays = self.segments.chunks_exact(self.layers as usize).map(|ray| {
            let ray: Vec<Segment> = ray
                .iter()
                .map(|s| Segment {
                    colour: s.colour.map(f64::from),
                    optical_depth: f64::from(s.optical_depth),
                    t_enter: f64::from(s.t_enter),
                    t_exit: f64::from(s.t_exit),
                })
                .collect();
            let composite = merged(&ray);
            let [r, g, b] = composite.radiance;
            [r, g, b, composite.transmittance]
        });
        rays.collect()
    }

    /// Compares the state of a picture of `width` (committed, pending) with the model; the largest error.
    pub fn compare(&self, lab: &Lab, width: u32, committed: &[[f32; 4]], pending: &[[f32; 4]]) -> Result<f64, Verdict> {
        let mut expected = self.expected();
        if lab.sabotage() == Some(Sabotage::Expected) {
            expected[0][1] += 10.0 * TOLERANCE;
        }
        let mut worst = (0.0, 0, [0.0; 4]);
        for (pixel, (c, p)) in committed.iter().zip(pending).enumerate() {
            let (c, p) = (c.map(f64::from), p.map(f64::from));
            let over = |i: usize| p[i] * -(-p[3]).exp_m1() + (-p[3]).exp() * c[i];
            let found = [over(0), over(1), over(2), (-c[3]).exp()];
            let e = expected[pixel % self.rays as usize];
            for (f, e) in found.iter().zip(e) {
                let error = (f - e).abs();
                if error > worst.0 || error.is_nan() {
                    worst = (if error.is_nan() { f64::INFINITY } else { error }, pixel as u32, found);
                }
            }
        }
        let (error, pixel, found) = worst;
        if error <= TOLERANCE {
            return Ok(error);
        }
        let e = expected[pixel as usize % self.rays as usize];
        Err(Verdict::fail(
            format!("radiance and transmittance {e:.5?} at ({}, {}), within {TOLERANCE}", pixel % width, pixel / width),
            format!("{found:.5?}"),
        ))
    }
}

/// Whether all of `hashes` are one.
pub(super) fn one_hash(lab: &Lab, hashes: &[blake3::Hash]) -> Result<(), Verdict> {
    let mut hashes = hashes.to_vec();
    if lab.sabotage() == Some(Sabotage::Expected)
        && let Some(last) = hashes.last_mut()
    {
        *last = blake3::hash(b"another");
    }
    let others = hashes.iter().filter(|hash| **hash != hashes[0]).count();
    if others > 0 {
        return Err(Verdict::fail(format!("{} equal results", hashes.len()), format!("{others} others")));
    }
    Ok(())
}
