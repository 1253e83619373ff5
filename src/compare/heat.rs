//! Differences as pictures: one value a pixel, shown through magma with a legend below.

use std::path::Path;

use image::ExtendedColorType;

use super::Difference;
use crate::Result;
use crate::output::{encode_png, write_atomic};

/// What a heat map's values mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// ꟻLIP, 0 to 1, linear.
    Flip,
    /// Greatest difference of linear radiance over the channels, six decades up to 1.
    Radiance,
}

/// Decades that [`Scale::Radiance`] shows below 1.
const DECADES: f64 = 6.0;

impl Scale {
    /// Code 0 to 255 of a value.
    fn code(self, value: f64) -> u8 {
        let share = match self {
            Self::Flip => value,
            Self::Radiance => 1.0 + value.log10() / DECADES, // −∞ of 0 clamps to 0.
        };
        (255.0 * share.clamp(0.0, 1.0)).round() as u8
    }

    /// Where on the scale, 0 to 1, which label stands.
    #[must_use]
    pub fn ticks(self) -> Vec<(f64, String)> {
        match self {
            Self::Flip => (0..=5).map(|i| f64::from(i) / 5.0).map(|v| (v, format!("{v}"))).collect(),
            Self::Radiance => {
                let decades = DECADES as i32;
                (-decades..=0).map(|e| (1.0 + f64::from(e) / DECADES, format!("{:e}", 10.0_f64.powi(e)))).collect()
            }
        }
    }
}

/// One code a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeatMap {
    scale: Scale,
    width: u32,
    codes: Vec<u8>,
}

impl HeatMap {
    /// The heat map of `difference` on `scale`; pictures have `width` columns.
    #[must_use]
    pub fn new(scale: Scale, difference: &Difference, width: u32) -> Self {
        let values = match scale {
            Scale::Flip => &difference.flip,
            Scale::Radiance => &difference.radiance,
        };
        Self { scale, width, codes: values.iter().map(|value| scale.code(*value)).collect() }
    }

    /// Writes the map in colour as a PNG, with a legend of 24 rows below the picture.
    ///
    /// # Errors
    /// [`Error::File`](crate::Error::File) when the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut pixels: Vec<[u8; 3]> = self.codes.iter().map(|code| magma(*code)).collect();
        pixels.extend(legend(self.scale, self.width as usize));
        let size = [self.width, pixels.len() as u32 / self.width];
        write_atomic(path, |file| encode_png(file, size, ExtendedColorType::Rgb8, pixels.as_flattened()))
    }

    /// The codes as the bytes of a grey PNG file of the picture's size.
    ///
    /// # Errors
    /// [`Error::File`](crate::Error::File) when it cannot be encoded.
    pub fn grey_png(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let size = [self.width, self.codes.len() as u32 / self.width];
        encode_png(&mut bytes, size, ExtendedColorType::L8, &self.codes)
            .map_err(|error| crate::Error::file("a PNG in memory", error))?;
        Ok(bytes)
    }
}

/// Every 16th colour of the map "magma" by N. Smith and S. van der Walt (matplotlib, CC0): lightness grows evenly with the
/// value, for those who cannot tell red from green as well.
const MAGMA: [[u8; 3]; 17] = [
    [0, 0, 4],
    [10, 8, 34],
    [29, 17, 71],
    [54, 16, 107],
    [81, 18, 124],
    [106, 28, 129],
    [131, 38, 129],
    [156, 46, 127],
    [183, 55, 121],
    [208, 65, 111],
    [231, 82, 99],
    [245, 107, 92],
    [252, 137, 97],
    [254, 167, 114],
    [254, 196, 136],
    [253, 226, 163],
    [252, 253, 191],
];

/// The colour of `code` in the map "magma", sRGB.
#[must_use]
pub fn magma(code: u8) -> [u8; 3] {
    let (at, part) = (usize::from(code / 16), i32::from(code % 16));
    let step = if at == 15 { 15 } else { 16 }; // The last colour is that of code 255.
    std::array::from_fn(|c| {
        let [from, to] = [MAGMA[at][c], MAGMA[at + 1][c]].map(i32::from);
        (from + ((to - from) * part + step / 2).div_euclid(step)) as u8
    })
}

const LEGEND_ROWS: usize = 24;
const MARGIN: usize = 4;

/// The rows below a map: a bar of all colours, and numbers under it as far as there is room.
fn legend(scale: Scale, width: usize) -> Vec<[u8; 3]> {
    const INK: [u8; 3] = [230, 230, 230];
    let mut pixels = vec![[24u8; 3]; width * LEGEND_ROWS];
    let bar = width.saturating_sub(2 * MARGIN).max(1);
    for x in 0..bar.min(width) {
        let colour = magma((255 * x / (bar - 1).max(1)) as u8);
        (MARGIN..12).for_each(|y| pixels[y * width + (MARGIN + x).min(width - 1)] = colour);
    }
    let mut free = 0; // Columns to the left of it are taken.
    let ticks = scale.ticks();
    for (index, (at, label)) in ticks.iter().enumerate() {
        let length = label.len() * (GLYPH_WIDTH + 1) - 1;
        let centre = MARGIN + (at * (bar - 1) as f64).round() as usize;
        let left = centre.saturating_sub(length / 2).max(MARGIN).min(width.saturating_sub(MARGIN + length));
        // The last label says what the scale ends at: the one before it gives way.
        let last = width.saturating_sub(MARGIN + ticks.last().map_or(0, |(_, l)| l.len() * (GLYPH_WIDTH + 1)) + 4);
        if left < free || left + length > width || (index + 1 < ticks.len() && left + length > last) {
            continue;
        }
        free = left + length + 4;
        (12..14).for_each(|y| pixels[y * width + centre.min(width - 1)] = INK);
        for (i, character) in label.chars().enumerate() {
            for (row, bits) in glyph(character).into_iter().enumerate() {
                for column in (0..GLYPH_WIDTH).filter(|column| bits >> (GLYPH_WIDTH - 1 - column) & 1 == 1) {
                    pixels[(15 + row) * width + left + i * (GLYPH_WIDTH + 1) + column] = INK;
                }
            }
        }
    }
    pixels
}

const GLYPH_WIDTH: usize = 5;

/// Seven rows of five bits, for the characters that labels are made of.
fn glyph(character: char) -> [u8; 7] {
    match character {
        '0' => [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00110, 0b01000, 0b10000, 0b11111],
        '3' => [0b01110, 0b10001, 0b00001, 0b00110, 0b00001, 0b10001, 0b01110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
        'e' => [0b00000, 0b00000, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110],
        '-' => [0b00000, 0b00000, 0b00000, 0b11111, 0b00000, 0b00000, 0b00000],
        '.' => [0b00000, 0b00000, 0b00000, 0b00000, 0b00000, 0b01100, 0b01100],
        _ => [0; 7],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::Errors;

    #[test]
    fn magma_runs_from_black_to_pale_yellow_and_never_darkens() {
        assert_eq!((magma(0), magma(128), magma(255)), ([0, 0, 4], [183, 55, 121], [252, 253, 191]));
        let lightness = |code: u8| {
            let [r, g, b] = magma(code).map(|c| (f64::from(c) / 255.0).powf(2.2));
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((0..255u8).all(|code| lightness(code + 1) >= lightness(code) - 1e-4));
    }

    #[test]
    fn scales_meet_their_labels() {
        for scale in [Scale::Flip, Scale::Radiance] {
            for (at, label) in scale.ticks() {
                let value: f64 = label.parse().unwrap();
                assert_eq!(scale.code(value), (255.0 * at).round() as u8, "{label}");
            }
        }
        assert_eq!([0.0, 1e-9, 7.0].map(|v| Scale::Radiance.code(v)), [0, 0, 255]);
    }

    #[test]
    fn a_map_of_any_width_has_the_picture_above_its_legend() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("heat.png");
        for width in [1, 3, 40, 300] {
            let values: Vec<f64> = (0..width * 2).map(|i| f64::from(i) / f64::from(width * 2)).collect();
            let difference = Difference { errors: Errors::default(), flip: values.clone(), radiance: values };
            let map = HeatMap::new(Scale::Flip, &difference, width);
            map.write(&path).unwrap();
            let back = image::open(&path).unwrap().into_rgb8();
            assert_eq!((back.width(), back.height()), (width, 2 + LEGEND_ROWS as u32));
            assert_eq!(back.get_pixel(width - 1, 1).0, magma(map.codes[map.codes.len() - 1]));
            if width == 300 {
                let row: Vec<_> = (0..width).map(|x| back.get_pixel(x, 2 + 8).0).collect();
                assert_eq!((row[MARGIN], row[295]), (magma(0), magma(255)));
                assert!((0..width).any(|x| back.get_pixel(x, 2 + 18).0 == [230; 3]), "no numbers");
            }
            let grey = image::load_from_memory(&map.grey_png().unwrap()).unwrap().into_luma8();
            assert_eq!(grey.into_raw(), map.codes);
        }
    }
}
