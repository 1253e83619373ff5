//! The coverage picture: grey, black for a clear sky and white for an overcast one. Its values are coverage itself, linear
//! whatever transfer function the file names.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{self as openexr, ReadChannels, ReadLayers};
use image::DynamicImage;

use crate::params::CoverageMap;
use crate::{Error, Result};

/// Longest side of a picture: that of [`CoverageMap`].
const MAX_SIDE: u32 = 16_384;

/// Channels that differ by no more than this are equal: JPEG and WebP round that far off when they go through luma and
/// chroma, two steps of 8 bits.
const TOLERANCE: f32 = 2.01 / 255.0;

/// What a file holds, whatever its format.
struct Raster {
    size: [u32; 2],
    /// One plane, or red, green and blue.
    planes: Vec<Vec<f32>>,
    /// Some pixel is not opaque.
    translucent: bool,
}

/// Reads the picture at `path` into a map of `extent` metres' width that lies and points as `offset` and `rotation` say.
/// `note` is told what is left out of account.
pub fn load(
    path: &Path,
    (extent, offset, rotation): (f32, [f64; 2], f64),
    note: &mut dyn FnMut(&str),
) -> Result<CoverageMap> {
    let fault = |reason: String| Error::file(path, format!("{reason} (clouds.coverage_map)"));
    let bytes = std::fs::read(path).map_err(|error| fault(format!("cannot be read: {error}")))?;
    let raster = match bytes.get(..6) {
        Some(b"\x93NUMPY") => from_npy(&bytes),
        Some([0x76, 0x2f, 0x31, 0x01, ..]) => from_exr(&bytes),
        _ => from_picture(&bytes),
    };
    let raster = raster.map_err(&fault)?;
    if raster.translucent {
        note(&format!("{}: its alpha channel is ignored (clouds.coverage_map)", path.display()));
    }
    let [width, height] = raster.size;
    let values = grey(raster).map_err(fault)?;
    Ok(CoverageMap { width, height, values, extent, offset, rotation })
}

/// The one value of each pixel, or a sentence on where it has several.
fn grey(raster: Raster) -> std::result::Result<Vec<f32>, String> {
    let width = raster.size[0] as usize;
    let [red, green, blue] = match <[Vec<f32>; 3]>::try_from(raster.planes) {
        Ok(colour) => colour,
        Err(planes) => return planes.into_iter().next().ok_or_else(|| "holds no channel".into()),
    };
    let pixels = red.into_iter().zip(green).zip(blue).enumerate();
    pixels
        .map(|(index, ((r, g), b))| {
            let channels = [("red", r), ("green", g), ("blue", b)];
            let (least, greatest) = channels.iter().fold((channels[0], channels[0]), |(least, greatest), &channel| {
                (
                    if channel.1 < least.1 { channel } else { least },
                    if channel.1 > greatest.1 { channel } else { greatest },
                )
            });
            if greatest.1 - least.1 > TOLERANCE {
                return Err(format!(
                    "is a coloured picture: at column {}, row {} {} is {:.3} but {} is {:.3}: expected grey; convert it, \
                     for example with: magick PICTURE -colorspace Gray GREY.png",
                    index % width,
                    index / width,
                    greatest.0,
                    greatest.1,
                    least.0,
                    least.1
                ));
            }
            // Equal channels stay what they are, bit for bit.
            Ok(if r == g && g == b { r } else { (r + g + b) / 3.0 })
        })
        .collect()
}

/// PNG, JPEG, WebP.
fn from_picture(bytes: &[u8]) -> std::result::Result<Raster, String> {
    let unreadable = |error: String| format!("is no readable picture: {error}: expected PNG, JPEG, WebP, EXR or NPY");
    let mut reader = image::ImageReader::new(Cursor::new(bytes));
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(4 << 30); // 8 bytes for each of the most pixels, twice
    reader.limits(limits);
    let reader = reader.with_guessed_format().map_err(|error| unreadable(error.to_string()))?;
    if reader.format().is_none() {
        return Err(unreadable("its first bytes are those of no known format".into()));
    }
    let picture = reader.decode().map_err(|error| unreadable(error.to_string()))?;
    let size = [picture.width(), picture.height()];
    let colour = picture.color();
    let channels = usize::from(colour.channel_count());
    let samples: Vec<f32> = match picture {
        DynamicImage::ImageLuma8(p) => units(&p.into_raw()),
        DynamicImage::ImageLumaA8(p) => units(&p.into_raw()),
        DynamicImage::ImageRgb8(p) => units(&p.into_raw()),
        DynamicImage::ImageRgba8(p) => units(&p.into_raw()),
        DynamicImage::ImageLuma16(p) => units(&p.into_raw()),
        DynamicImage::ImageLumaA16(p) => units(&p.into_raw()),
        DynamicImage::ImageRgb16(p) => units(&p.into_raw()),
        DynamicImage::ImageRgba16(p) => units(&p.into_raw()),
        other => return Err(format!("is {:?}: expected 8 or 16 bits a channel", other.color())),
    };
    let plane = |channel: usize| samples.iter().skip(channel).step_by(channels).copied();
    let colours = channels - usize::from(colour.has_alpha());
    Ok(Raster {
        size,
        planes: (0..colours).map(|channel| plane(channel).collect()).collect(),
        translucent: colour.has_alpha() && plane(channels - 1).any(|alpha| alpha < 1.0),
    })
}

/// Whole numbers of which the greatest stands for 1.
trait Unit: Copy {
    fn unit(self) -> f32;
}

impl Unit for u8 {
    fn unit(self) -> f32 {
        f32::from(self) / 255.0
    }
}

impl Unit for u16 {
    fn unit(self) -> f32 {
        f32::from(self) / 65_535.0
    }
}

fn units<T: Unit>(samples: &[T]) -> Vec<f32> {
    samples.iter().map(|sample| sample.unit()).collect()
}

/// A picture's size, if it is one.
fn checked_size(width: u64, height: u64) -> std::result::Result<[u32; 2], String> {
    let side = |side: u64| u32::try_from(side).ok().filter(|side| (1..=MAX_SIDE).contains(side));
    match (side(width), side(height)) {
        (Some(width), Some(height)) => Ok([width, height]),
        _ => Err(format!("has {width}x{height} values: expected 1x1 to {MAX_SIDE}x{MAX_SIDE}")),
    }
}

/// A NumPy array of shape (rows, columns).
fn from_npy(bytes: &[u8]) -> std::result::Result<Raster, String> {
    let unreadable = |error: std::io::Error| format!("is no readable NumPy array: {error}");
    let file = npyz::NpyFile::new(bytes).map_err(unreadable)?;
    let &[rows, columns] = file.shape() else {
        return Err(format!("has the shape {:?}: expected two axes, rows and columns", file.shape()));
    };
    let (size, order, dtype) = (checked_size(columns, rows)?, file.order(), file.dtype().descr());
    let wrong = || format!("holds values of type {dtype}: expected u1, u2, f4 or f8");
    // Whole numbers span 0 to their greatest, floats are coverage as they are.
    let values = match dtype.trim_matches(['\'', '<', '>', '|', '=']) {
        "u1" => file.into_vec::<u8>().map(|v| units(&v)),
        "u2" => file.into_vec::<u16>().map(|v| units(&v)),
        "f4" => file.into_vec::<f32>(),
        "f8" => file.into_vec::<f64>().map(|v| v.into_iter().map(|v| v as f32).collect()),
        _ => return Err(wrong()),
    };
    let values = values.map_err(unreadable)?;
    let [width, height] = size.map(|side| side as usize);
    if values.len() != width * height {
        return Err(format!("ends after {} of {} values", values.len(), width * height));
    }
    let values = match order {
        npyz::Order::C => values,
        npyz::Order::Fortran => (0..width * height).map(|i| values[i % width * height + i / width]).collect(),
    };
    Ok(Raster { size, planes: vec![values], translucent: false })
}

/// OpenEXR: one channel of any name, or R, G and B; and perhaps A.
fn from_exr(bytes: &[u8]) -> std::result::Result<Raster, String> {
    let unreadable = |error: exr::error::Error| format!("is no readable OpenEXR picture: {error}");
    let meta = exr::meta::MetaData::read_from_buffered(bytes, false).map_err(unreadable)?;
    for header in &meta.headers {
        checked_size(header.layer_size.width() as u64, header.layer_size.height() as u64)?;
        if header.own_attributes.layer_position != header.shared_attributes.display_window.position
            || header.layer_size != header.shared_attributes.display_window.size
        {
            return Err("is a cropped OpenEXR picture: expected its data window to be its display window".into());
        }
    }
    let picture = openexr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(unreadable)?;
    let layer = picture.layer_data;
    let size = checked_size(layer.size.width() as u64, layer.size.height() as u64)?;
    let mut colours = Vec::new();
    let mut translucent = false;
    for channel in layer.channel_data.list {
        if channel.sampling != openexr::Vec2(1, 1) {
            return Err(format!(
                "has a channel {} of less than one value a pixel: expected Y or R, G, B",
                channel.name
            ));
        }
        let values: Vec<f32> = match channel.sample_data {
            openexr::FlatSamples::F16(values) => values.into_iter().map(|v| v.to_f32()).collect(),
            openexr::FlatSamples::F32(values) => values,
            openexr::FlatSamples::U32(_) => {
                return Err(format!("has a channel {} of whole numbers: expected half or float", channel.name));
            }
        };
        if channel.name.eq_case_insensitive("A") {
            translucent |= values.iter().any(|&alpha| alpha < 1.0);
        } else {
            colours.push((channel.name.to_string(), values));
        }
    }
    colours.sort_by_key(|(name, _)| ["R", "G", "B"].iter().position(|known| known == name));
    let names: Vec<_> = colours.iter().map(|(name, _)| name.as_str()).collect();
    if names.len() != 1 && names != ["R", "G", "B"] {
        return Err(format!("has the channels {}: expected one, or R, G and B", names.join(", ")));
    }
    Ok(Raster { size, planes: colours.into_iter().map(|(_, values)| values).collect(), translucent })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayAlphaImage, GrayImage, ImageFormat, Luma, LumaA, Rgb, Rgb32FImage, RgbImage, Rgba, RgbaImage};

    const PLACE: (f32, [f64; 2], f64) = (5.0e4, [1.0, 2.0], 30.0);

    /// Loads `bytes` as a file; the map, or the complaint, and the notes.
    fn read(bytes: &[u8]) -> (std::result::Result<CoverageMap, String>, Vec<String>) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("map");
        std::fs::write(&path, bytes).unwrap();
        let mut notes = Vec::new();
        let map = load(&path, PLACE, &mut |text| notes.push(text.to_owned())).map_err(|error| error.to_string());
        (map, notes)
    }

    fn encoded(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        picture.into().write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    /// A ramp: 0, 51, 102, … 255 over 3 × 2 pixels.
    fn level(x: u32, y: u32) -> u8 {
        (51 * (x + 3 * y)) as u8
    }

    const RAMP: [f32; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];

    /// Reads to the ramp within `bound`.
    fn assert_ramp(bytes: &[u8], bound: f32) -> Vec<String> {
        let (map, notes) = read(bytes);
        let map = map.unwrap();
        assert_eq!((map.width, map.height, map.extent, map.offset, map.rotation), (3, 2, 5.0e4, [1.0, 2.0], 30.0));
        for (value, expected) in map.values.iter().zip(RAMP) {
            assert!((value - expected).abs() <= bound, "{:?}", map.values);
        }
        notes
    }

    #[test]
    fn grey_is_grey_however_it_is_saved() {
        let rgb = RgbImage::from_fn(3, 2, |x, y| Rgb([level(x, y); 3]));
        assert!(
            assert_ramp(&encoded(GrayImage::from_fn(3, 2, |x, y| Luma([level(x, y)])), ImageFormat::Png), 0.0)
                .is_empty()
        );
        assert!(assert_ramp(&encoded(rgb.clone(), ImageFormat::Png), 0.0).is_empty());
        assert!(assert_ramp(&encoded(rgb.clone(), ImageFormat::WebP), 0.0).is_empty());
        let opaque = RgbaImage::from_fn(3, 2, |x, y| Rgba([level(x, y), level(x, y), level(x, y), 255]));
        assert!(assert_ramp(&encoded(opaque, ImageFormat::Png), 0.0).is_empty());
        let float = Rgb32FImage::from_fn(3, 2, |x, y| Rgb([RAMP[(x + 3 * y) as usize]; 3]));
        assert!(assert_ramp(&encoded(float, ImageFormat::OpenExr), 0.0).is_empty());
        // Steps of a fifth within a block of JPEG are off by a few of 255 codes.
        assert!(assert_ramp(&encoded(rgb, ImageFormat::Jpeg), 0.06).is_empty());
    }

    #[test]
    fn a_palette_that_expands_to_grey_is_grey() {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 3, 2);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette((0..6_u8).rev().flat_map(|i| [51 * i; 3]).collect::<Vec<_>>());
        encoder.write_header().unwrap().write_image_data(&[5, 4, 3, 2, 1, 0]).unwrap();
        assert!(assert_ramp(&bytes, 0.0).is_empty());
    }

    #[test]
    fn alpha_is_ignored_with_a_note() {
        let grey = GrayAlphaImage::from_fn(3, 2, |x, y| LumaA([level(x, y), 10]));
        let notes = assert_ramp(&encoded(grey, ImageFormat::Png), 0.0);
        assert!(notes.len() == 1 && notes[0].contains("its alpha channel is ignored"), "{notes:?}");
    }

    #[test]
    fn channels_that_differ_by_rounding_are_averaged_and_coloured_pictures_are_told_where() {
        let nearly = RgbImage::from_fn(3, 2, |x, y| Rgb([level(x, y).max(2), level(x, y).max(1), level(x, y)]));
        assert_ramp(&encoded(nearly, ImageFormat::Png), 1.001 / 255.0);
        let coloured = RgbImage::from_fn(3, 2, |x, y| Rgb([if (x, y) == (1, 1) { 255 } else { 51 }, 51, 60 - 9]));
        let message = read(&encoded(coloured, ImageFormat::Png)).0.unwrap_err();
        let expected =
            "is a coloured picture: at column 1, row 1 red is 1.000 but green is 0.200: expected grey; convert it";
        assert!(message.contains(expected) && message.contains("-colorspace Gray"), "{message}");
    }

    fn npy<T: npyz::Serialize + npyz::AutoSerialize + Copy>(
        shape: &[u64],
        order: npyz::Order,
        values: &[T],
    ) -> Vec<u8> {
        use npyz::WriterBuilder;
        let mut bytes = Vec::new();
        let options = npyz::WriteOptions::<T>::new().default_dtype().shape(shape).order(order).writer(&mut bytes);
        let mut writer = options.begin_nd().unwrap();
        writer.extend(values.iter().copied()).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn arrays_are_read_in_either_order_and_any_of_four_types() {
        use npyz::Order::{C, Fortran};
        let codes: Vec<u8> = (0..6).map(|i| 51 * i).collect();
        assert_ramp(&npy(&[2, 3], C, &codes), 0.0);
        assert_ramp(&npy(&[2, 3], C, &codes.iter().map(|&v| u16::from(v) * 257).collect::<Vec<_>>()), 0.0);
        assert_ramp(&npy(&[2, 3], C, &RAMP), 0.0);
        assert_ramp(&npy(&[2, 3], Fortran, &[0.0_f64, 0.6, 0.2, 0.8, 0.4, 1.0]), 1e-7); // f64 is rounded to f32
        let message = |bytes: &[u8]| read(bytes).0.unwrap_err();
        assert!(message(&npy(&[6], C, &RAMP)).contains("has the shape [6]: expected two axes"));
        assert!(message(&npy(&[2, 3], C, &[1_i32; 6])).contains("i4': expected u1, u2, f4 or f8"));
        let whole = npy(&[2, 3], C, &RAMP);
        assert!(message(&whole[..whole.len() - 4]).contains("is no readable NumPy array"));
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (99999, 2), }                    \n";
        let huge = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
        assert!(message(&huge).contains("has 2x99999 values: expected 1x1 to 16384x16384"), "{}", message(&huge));
    }

    fn exr(channels: &[(&str, openexr::FlatSamples)]) -> Vec<u8> {
        use openexr::WritableImage;
        let channels = channels.iter().map(|(name, data)| openexr::AnyChannel::new(*name, data.clone())).collect();
        let mut bytes = Cursor::new(Vec::new());
        let picture = openexr::Image::from_channels((3, 2), openexr::AnyChannels::sort(channels));
        picture.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn exr_may_hold_one_channel_or_three_equal_ones() {
        let float = openexr::FlatSamples::F32(RAMP.to_vec());
        let half = openexr::FlatSamples::F16(RAMP.map(openexr::f16::from_f32).to_vec());
        assert!(assert_ramp(&exr(&[("Y", float.clone())]), 0.0).is_empty());
        assert!(assert_ramp(&exr(&[("coverage", half)]), 3e-4).is_empty()); // eleven bits
        let clear = openexr::FlatSamples::F32(vec![0.5; 6]);
        assert_eq!(assert_ramp(&exr(&[("Y", float.clone()), ("A", clear.clone())]), 0.0).len(), 1);
        let message = read(&exr(&[("R", float.clone()), ("G", float.clone()), ("B", clear)])).0.unwrap_err();
        assert!(message.contains("at column 0, row 0 blue is 0.500 but red is 0.000"), "{message}");
        let message = read(&exr(&[("u", float.clone()), ("v", float)])).0.unwrap_err();
        assert!(message.contains("has the channels u, v: expected one, or R, G and B"), "{message}");
    }

    #[test]
    fn what_is_no_picture_is_told_so() {
        for bytes in
            [&b""[..], b"P", b"not a picture at all", b"\x89PNG\r\n\x1a\n", b"\x76\x2f\x31\x01xx", b"\x93NUMPYx"]
        {
            let message = read(bytes).0.unwrap_err();
            assert!(message.contains("is no readable ") && message.contains("clouds.coverage_map"), "{message}");
        }
    }
}
