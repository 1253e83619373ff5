//! Linear filtering of 3D tables, with the formats and the samplers that Welkin reads its tables with.

use super::{hash, pipeline, read};
use crate::Result;
use crate::conform::{Check, Group, Lab, Sabotage, Verdict};
use crate::gpu::{Buffer, Image, ImageDesc, Sampler};
use crate::shaders::conform_blocks_sample_comp as sample;
use ash::vk;
use half::f16;

const SPEC: &str = "Vulkan 1.3, Texel Filtering (weights with at least subTexelPrecisionBits), Wrapping Operation; Required \
                    Format Support: VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT for 16-bit float formats";
/// Texels of the table: no two sides alike, none a power of two in y.
const SIZE: [usize; 3] = [16, 7, 8];

/// A format by its name and components.
const FORMATS: [(&str, vk::Format, usize); 3] = [
    ("r16f", vk::Format::R16_SFLOAT, 1),
    ("rg16f", vk::Format::R16G16_SFLOAT, 2),
    ("rgba16f", vk::Format::R16G16B16A16_SFLOAT, 4),
];

/// A sampler by its name, and along which axes it repeats.
const SAMPLERS: [(&str, Sampler, [bool; 3]); 3] = [
    ("clamp", Sampler::LinearClamp, [false; 3]),
    ("repeat", Sampler::LinearRepeat, [true; 3]),
    ("repeat-clamp-repeat", Sampler::LinearRepeatClampRepeat, [true, false, true]),
];

pub(super) fn add(list: &mut Vec<Check>) {
    for (format, _, _) in FORMATS {
        for (wrap, _, _) in SAMPLERS {
            list.push(
                Check::new(
                    Group::Blocks,
                    format!("filter.{format}.{wrap}"),
                    format!(
                        "a 3D {format} table sampled at texel centres, between them and outside of it, coordinates {wrap}: \
                         trilinear interpolation in f64, as closely as the device's weights allow"
                    ),
                    move |lab| filtered(lab, format, wrap),
                )
                .why("Optical depth, scattering and noise are looked up so, several times for each fragment")
                .spec(SPEC),
            );
        }
    }
}

/// Texel `i` of `n` under a wrapping mode.
fn wrapped(i: i64, n: usize, repeat: bool) -> usize {
    let n = n as i64;
    (if repeat { i.rem_euclid(n) } else { i.clamp(0, n - 1) }) as usize
}

fn filtered(lab: &mut Lab, format: &str, wrap: &str) -> Result<Verdict> {
    let (Some(&(_, format, components)), Some(&(_, mut sampler, repeats))) =
        (FORMATS.iter().find(|row| row.0 == format), SAMPLERS.iter().find(|row| row.0 == wrap))
    else {
        return Ok(Verdict::fail("a known format and sampler", format!("{format}, {wrap}")));
    };
    if lab.sabotage() == Some(Sabotage::Unordered) {
        sampler = if wrap == "clamp" { Sampler::LinearRepeat } else { Sampler::LinearClamp }; // a wrong flag
    }
    let gpu = lab.gpu().clone();
    let count = SIZE.iter().product::<usize>();
    // Multiples of 2⁻⁹ below 2: f16 holds them exactly.
    let texels: Vec<f16> =
        (0..count * components).map(|i| f16::from_f64(f64::from(hash(i as u32) % 1024) / 512.0)).collect();
    let extent = SIZE.map(|side| side as u32);
    let usage = vk::ImageUsageFlags::SAMPLED;
    let volume = Image::new(&gpu, &ImageDesc { name: "conform table", extent, format, usage })?;
    let upload = Buffer::upload(&gpu, "conform texels", &texels)?;

    let places = places(if lab.quick() { 2000 } else { 50_000 });
    let program = pipeline(lab, &sample::PROGRAM)?;
    let source = Buffer::upload(&gpu, "conform places", &places)?;
    let values = Buffer::array::<[f32; 4]>(&gpu, "conform values", places.len())?;
    lab.frames().run(|rec| {
        rec.copy_buffer_to_image(&upload, &volume);
        let bindings = sample::Bindings { volume: volume.sampled(sampler), places: &source, values: &values };
        rec.dispatch(&program, &bindings, &(), [places.len() as u32, 1, 1])
    })?;
    let values: Vec<[f32; 4]> = read(lab, &values, places.len())?;

    let step = 0.5f64.powi(gpu.capabilities().sub_texel_bits as i32);
    let mut worst = 0.0f64; // in units of what is allowed
    for (place, value) in places.iter().zip(&values) {
        for component in 0..4 {
            let (mut expected, slack) = if component < components {
                let texel = |at: [usize; 3]| {
                    texels[((at[2] * SIZE[1] + at[1]) * SIZE[0] + at[0]) * components + component].to_f64()
                };
                interpolated(place, repeats, step, texel)
            } else {
                (f64::from(u8::from(component == 3)), 0.0) // Components that a format lacks read as 0, 0, 1.
            };
            if lab.sabotage() == Some(Sabotage::Expected) {
                expected += 0.1;
            }
            let error = (f64::from(value[component]) - expected).abs();
            if error > slack {
                let place = [place[0], place[1], place[2]];
                let found = format!("{} at {place:?}", value[component]);
                return Ok(Verdict::fail(format!("{expected:.6} within {slack:.1e}"), found));
            }
            worst = worst.max(if slack > 0.0 { error / slack } else { 0.0 });
        }
    }
    let bits = gpu.capabilities().sub_texel_bits;
    Ok(Verdict::Pass(format!(
        "{} places, weights of {bits} bits, at most {worst:.2} of the error allowed",
        places.len()
    )))
}

/// Places around and inside the table: texel centres and edges first, then anywhere.
fn places(count: usize) -> Vec<[f32; 4]> {
    let mut places = Vec::with_capacity(count);
    for k in 0..3 * SIZE[0] as u32 {
        let at = |n: usize, half: f64| ((f64::from(k % (3 * n as u32)) + half) / n as f64 - 1.0) as f32;
        places.push([at(SIZE[0], 0.5), at(SIZE[1], 0.5), at(SIZE[2], 0.5), 0.0]);
        places.push([at(SIZE[0], 0.0), at(SIZE[1], 0.5), at(SIZE[2], 0.0), 0.0]);
    }
    while places.len() < count {
        let seed = 4 * places.len() as u32;
        let [x, y, z] = [0, 1, 2].map(|axis| (f64::from(hash(seed + axis)) / f64::from(u32::MAX) * 4.0 - 1.5) as f32);
        places.push([x, y, z, 0.0]);
    }
    places
}

/// The value at `place`, and how far off a device may be.
fn interpolated(place: &[f32; 4], repeats: [bool; 3], step: f64, texel: impl Fn([usize; 3]) -> f64) -> (f64, f64) {
    let at: [f64; 3] = std::array::from_fn(|axis| f64::from(place[axis]) * SIZE[axis] as f64 - 0.5);
    let corner = |k: usize, shift: [i64; 3]| -> f64 {
        texel(std::array::from_fn(|axis| {
            let i = at[axis].floor() as i64 + (k >> axis & 1) as i64 + shift[axis];
            wrapped(i, SIZE[axis], repeats[axis])
        }))
    };
    let mut value = 0.0;
    for k in 0..8 {
        let weight: f64 = (0..3)
            .map(|axis| {
                let f = at[axis] - at[axis].floor();
                if k >> axis & 1 == 1 { f } else { 1.0 - f }
            })
            .product();
        value += weight * corner(k, [0; 3]);
    }
    // A weight may be off by a step of the sub-texel grid, which moves the place by as much along an axis: the value then
    // changes with the slope there, at most the greatest difference of neighbours along that axis, in this cell or, next to
    // a texel centre, in the neighbouring one. The coordinate itself, up to 2.5 · 16 texels in f32, adds 2⁻¹⁸ texels.
    let mut slack = 0.0;
    for axis in 0..3 {
        let mut slope = 0.0f64;
        for k in (0..8).filter(|k| k >> axis & 1 == 0) {
            for side in [-1, 0, 1] {
                let mut shift = [0; 3];
                shift[axis] = side;
                slope = slope.max((corner(k | 1 << axis, shift) - corner(k, shift)).abs());
            }
        }
        slack += slope * (step + 3.8e-6);
    }
    // Values below 2 may be blended with the 11 bits of the format: half a unit in the last place for each of three axes.
    (value, slack + 3.0 * 0.5f64.powi(11))
}
