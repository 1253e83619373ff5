//! 16-bit floats in images: what is stored, what is loaded.

use super::{expected, hash, pipeline, read};
use crate::Result;
use crate::conform::{Check, Group, Lab, Verdict};
use crate::gpu::{Buffer, BufferKind, Image, ImageDesc};
use crate::shaders::{conform_blocks_load_comp as load, conform_blocks_store_comp as store};
use ash::vk;
use half::f16;

const SPEC: &str = "Vulkan 1.3, Fundamentals: 16-Bit Floating-Point Numbers; Floating-Point Format Conversions (rounded to \
                    one of the two neighbours, overflow to the largest or to infinity, infinities and NaN kept)";

pub(super) fn add(list: &mut Vec<Check>) {
    for (name, format, components) in [
        ("r16f", vk::Format::R16_SFLOAT, 1),
        ("rg16f", vk::Format::R16G16_SFLOAT, 2),
        ("rgba16f", vk::Format::R16G16B16A16_SFLOAT, 4),
    ] {
        list.push(
            Check::new(
                Group::Blocks,
                format!("half.store.{name}"),
                format!(
                    "f32 numbers stored in an {name} image: what 16 bits can hold exactly is kept, what lies between goes to \
                     a neighbour, too large numbers to the largest or to infinity, infinities and NaN stay"
                ),
                move |lab| stored(lab, format, components),
            )
            .why("Tables, noise and, by default, the clouds' radiance are kept in 16 bits")
            .spec(SPEC),
        );
    }
    list.push(
        Check::new(
            Group::Blocks,
            "half.load",
            "all 65536 patterns of 16 bits in an r16f image load as the f32 number that they stand for; numbers below 2^-14 \
             may load as 0",
            loaded,
        )
        .why("Tables from the cache and exported ones are these bits")
        .spec(SPEC),
    );
}

/// Numbers of every kind.
fn numbers(count: usize) -> Vec<f32> {
    let largest = 65_504.0f32;
    let mut numbers = vec![
        0.0,
        -0.0,
        1.0,
        -1.0,
        largest,
        -largest,
        65_519.9,
        -65_519.9,
        65_520.0,
        1.0e6,
        -1.0e6,
        f32::MAX,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        2.0f32.powi(-14),
        2.0f32.powi(-24),
        2.0f32.powi(-25),
        1.0e-10,
        f32::MIN_POSITIVE,
    ];
    // Exact ones, and ones at random distances between them, over all exponents.
    while numbers.len() < count {
        let word = hash(numbers.len() as u32);
        let exact = f16::from_bits((word & 0xffff) as u16).to_f32();
        let between = f32::from_bits(exact.to_bits() | (word >> 16 & 0x1fff));
        numbers.push(if word >> 30 == 0 { exact } else { between });
    }
    numbers
}

/// What became of the numbers that 16 bits cannot hold.
#[derive(Default)]
struct Tally {
    nearest: u32,
    towards_zero: u32,
    other: u32,
    flushed: u32,
}

impl Tally {
    fn text(&self) -> String {
        let Self { nearest, towards_zero, other, flushed } = *self;
        let rounding = match (nearest > 0, towards_zero > 0, other > 0) {
            (_, false, false) => "rounds to the nearest",
            (false, true, false) => "rounds towards zero",
            _ => "rounds now one way, now the other",
        };
        let small = if flushed > 0 { "flushed to 0" } else { "kept" };
        format!("{rounding}; numbers below 2^-14 are {small}")
    }

    /// Whether `stored` may stand for `number`; tallies how it was rounded.
    fn allows(&mut self, number: f32, stored: f16) -> bool {
        if number.is_nan() {
            return stored.is_nan();
        }
        let nearest = f16::from_f32(number);
        let (towards_zero, away) = neighbours(number);
        if number.abs() < 2.0f32.powi(-14) && stored.to_f32() == 0.0 {
            self.flushed += u32::from(nearest.to_f32() != 0.0);
            return true;
        }
        if stored.to_f32() == number {
            return true;
        }
        if number.is_infinite() || (towards_zero.to_f32() == number) {
            return false; // An exact number, or an infinity, that has changed.
        }
        let (is_nearest, is_towards_zero) = (stored == nearest, stored == towards_zero);
        match (is_nearest, is_towards_zero) {
            (true, false) => self.nearest += 1,
            (false, true) => self.towards_zero += 1,
            (false, false) => self.other += 1,
            (true, true) => {}
        }
        stored == towards_zero || stored == away
    }
}

/// The 16-bit numbers next to `number`: not beyond it, and the one after that (infinity after the largest).
fn neighbours(number: f32) -> (f16, f16) {
    let nearest = f16::from_f32(number);
    let below = if nearest.to_f32().abs() > number.abs() { f16::from_bits(nearest.to_bits() - 1) } else { nearest };
    (below, f16::from_bits(below.to_bits() + 1))
}

fn stored(lab: &mut Lab, format: vk::Format, components: usize) -> Result<Verdict> {
    let gpu = lab.gpu().clone();
    let side = if lab.quick() { 64u32 } else { 512 };
    let texels = (side * side) as usize;
    let numbers = numbers(4 * texels);
    let usage = vk::ImageUsageFlags::STORAGE;
    let target = Image::new(&gpu, &ImageDesc { name: "conform halves", extent: [side, side, 0], format, usage })?;
    let program = pipeline(lab, &store::PROGRAM)?;
    let source = Buffer::upload(&gpu, "conform numbers", &numbers)?;
    let bytes = Buffer::new(&gpu, "conform halves", (2 * components * texels) as u64, BufferKind::Readback)?;
    lab.frames().run(|rec| {
        rec.clear_image(&target, [0.25; 4]);
        rec.dispatch(&program, &store::Bindings { source: &source, target: &target }, &(), [side, side, 1])?;
        rec.copy_image_to_buffer(&target, &bytes);
        rec.make_visible_to_host(&bytes);
        Ok(())
    })?;
    let halves: Vec<u16> = bytes.read(0, components * texels);
    let mut tally = Tally::default();
    for (texel, stored) in halves.chunks_exact(components).enumerate() {
        for (component, &bits) in stored.iter().enumerate() {
            let number = numbers[4 * texel + component];
            let stored = f16::from_bits(expected(lab, u32::from(bits)) as u16);
            if !tally.allows(number, stored) {
                let (a, b) = neighbours(number);
                return Ok(Verdict::fail(format!("{number:e} stored as {a} or {b}"), format!("{stored}")));
            }
        }
    }
    Ok(Verdict::Pass(format!("{} numbers; {}", halves.len(), tally.text())))
}

fn loaded(lab: &mut Lab) -> Result<Verdict> {
    let gpu = lab.gpu().clone();
    let patterns: Vec<u16> = (0..=u16::MAX).collect();
    let (format, usage) = (vk::Format::R16_SFLOAT, vk::ImageUsageFlags::STORAGE);
    let source = Image::new(&gpu, &ImageDesc { name: "conform halves", extent: [256, 256, 0], format, usage })?;
    let program = pipeline(lab, &load::PROGRAM)?;
    let upload = Buffer::upload(&gpu, "conform halves", &patterns)?;
    let values = Buffer::array::<u32>(&gpu, "conform numbers", patterns.len())?;
    lab.frames().run(|rec| {
        rec.copy_buffer_to_image(&upload, &source);
        rec.dispatch(&program, &load::Bindings { source: &source, values: &values }, &(), [256, 256, 1])
    })?;
    let values: Vec<u32> = read(lab, &values, patterns.len())?;
    let mut flushed = 0;
    for (&pattern, bits) in patterns.iter().zip(values) {
        let number = f16::from_bits(pattern).to_f32();
        let value = f32::from_bits(expected(lab, bits));
        let small = number != 0.0 && number.abs() < 2.0f32.powi(-14);
        if small && value == 0.0 {
            flushed += 1;
        } else if value != number && !(value.is_nan() && number.is_nan()) {
            return Ok(Verdict::fail(format!("{pattern:#06x} loads as {number:e}"), format!("{value:e}")));
        }
    }
    let small = if flushed > 0 { "load as 0" } else { "are exact" };
    Ok(Verdict::Pass(format!("65536 patterns; numbers below 2^-14 {small}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_neighbours_of_a_number_are_next_to_it() {
        let one_up = f16::from_bits(f16::ONE.to_bits() + 1);
        for (number, below, above) in [
            (1.0002, f16::ONE, one_up),
            (1.0009, f16::ONE, one_up),
            (-1.0002, -f16::ONE, -one_up),
            (65_519.0, f16::MAX, f16::INFINITY),
            (1.0e6, f16::MAX, f16::INFINITY),
            (1.0e-10, f16::from_bits(0), f16::from_bits(1)),
        ] {
            assert_eq!(neighbours(number), (below, above), "{number}");
        }
    }

    #[test]
    fn what_a_device_may_not_do_is_seen() {
        let allows = |number, stored: f32| Tally::default().allows(number, f16::from_f32(stored));
        assert!(allows(1.0, 1.0) && allows(f32::NAN, f32::NAN) && allows(f32::INFINITY, f32::INFINITY));
        assert!(allows(2.0f32.powi(-20), 0.0) && allows(70_000.0, 65_504.0) && allows(70_000.0, f32::INFINITY));
        assert!(!allows(1.0, 1.001) && !allows(f32::NAN, 0.0) && !allows(f32::INFINITY, 65_504.0));
        assert!(!allows(1.0, 0.0) && !allows(2.0f32.powi(-13), 0.0) && !allows(70_000.0, 65_472.0));
        assert!(!allows(1.0002, 1.002) && !allows(1.0, -1.0));
    }
}
