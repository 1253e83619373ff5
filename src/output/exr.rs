//! OpenEXR as compositors take it: scan lines from top to bottom, the colour space named, every value of a pixel in one part.
//!
//! Radiance is spectral, at 680, 550 and 440 nm, and stands for linear red, green and blue with the primaries and the white of
//! sRGB (Rec. 709, D65): the space in which a PNG shows it. That is what the file names.

use std::io::Cursor;
use std::path::Path;

use ::exr::meta::attribute::Chromaticities;
use ::exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, FlatSamples, Image, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, LineOrder, SmallVec, Text, Vec2, WritableImage, f16,
};

use super::write_atomic;
use crate::{Error, Result};

/// Compression of a file; all but nothing lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrCompression {
    /// None.
    None,
    /// Runs of equal bytes.
    Rle,
    /// Deflate, line by line.
    Zips,
    /// Deflate, 16 lines at a time.
    #[default]
    Zip,
    /// Wavelets.
    Piz,
}

/// Type of the colour channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrType {
    /// 16 bits. What is beyond ±65504 is written as that.
    Half,
    /// 32 bits.
    #[default]
    Float,
}

/// How a file is written, and what it says of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExrOptions {
    /// Compression.
    pub compression: ExrCompression,
    /// Type of radiance; other layers are floats.
    pub colour: ExrType,
    /// Attribute `owner`.
    pub owner: Option<String>,
    /// Attribute `scene`: the scene file and what was replaced in it.
    pub scene: Option<String>,
    /// Also write the layer `transmittance`, if the picture has one.
    pub aux: bool,
}

/// Values of all pixels under one channel's name.
pub struct ExrChannel<'a> {
    /// `R`, or `layer.channel`.
    pub name: String,
    /// One value a pixel, row by row.
    pub values: Box<dyn Iterator<Item = f32> + 'a>,
    /// Colour is written in the type that was asked for, anything else as float.
    pub colour: bool,
}

/// Radiance as the channels R, G and B, of `layer` if it is not empty.
pub fn colour<'a>(layer: &str, radiance: &'a [[f32; 3]]) -> Vec<ExrChannel<'a>> {
    let prefix = if layer.is_empty() { String::new() } else { format!("{layer}.") };
    let channel = |(index, letter): (usize, &str)| ExrChannel {
        name: format!("{prefix}{letter}"),
        values: Box::new(radiance.iter().map(move |rgb| rgb[index])),
        colour: true,
    };
    ["R", "G", "B"].into_iter().enumerate().map(channel).collect()
}

/// Writes `channels` of `size` pixels.
///
/// # Errors
/// [`Error::File`] when the file cannot be encoded or written.
pub fn write(path: &Path, size: [u32; 2], channels: Vec<ExrChannel<'_>>, options: &ExrOptions) -> Result<()> {
    let bytes =
        encode(size, channels, options).map_err(|error| Error::file(path, format!("cannot be encoded: {error}")))?;
    write_atomic(path, |file| file.write_all(&bytes))
}

fn encode(size: [u32; 2], channels: Vec<ExrChannel<'_>>, options: &ExrOptions) -> ::exr::error::Result<Vec<u8>> {
    let size = Vec2(size[0] as usize, size[1] as usize);
    let text = |value: &str| Text::from_slice_unchecked(value.as_bytes()); // UTF-8, as OpenEXR has it
    let mut attributes = LayerAttributes {
        software_name: Some(text(concat!("Welkin ", env!("CARGO_PKG_VERSION")))),
        owner: options.owner.as_deref().map(text),
        ..LayerAttributes::default()
    };
    if let Some(scene) = &options.scene {
        attributes.other.insert(text("scene"), AttributeValue::Text(text(scene)));
    }
    let compression = match options.compression {
        ExrCompression::None => Compression::Uncompressed,
        ExrCompression::Rle => Compression::RLE,
        ExrCompression::Zips => Compression::ZIP1,
        ExrCompression::Zip => Compression::ZIP16,
        ExrCompression::Piz => Compression::PIZ,
    };
    let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let half = |value: f32| f16::from_f32(value.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()));
    let list: SmallVec<[AnyChannel<FlatSamples>; 4]> = channels
        .into_iter()
        .map(|channel| {
            let samples = if channel.colour && options.colour == ExrType::Half {
                FlatSamples::F16(channel.values.map(half).collect())
            } else {
                FlatSamples::F32(channel.values.collect())
            };
            AnyChannel::new(text(&channel.name), samples)
        })
        .collect();
    let mut shared = ImageAttributes::new(IntegerBounds::new(Vec2(0, 0), size));
    shared.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    });
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(list));
    let mut bytes = Cursor::new(Vec::new()); // The encoder seeks.
    Image::new(shared, layer).write().non_parallel().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::exr::meta::{BlockDescription, MetaData};
    use ::exr::prelude::{ReadChannels, ReadLayers};

    const SIZE: [u32; 2] = [37, 21]; // Ends within a block of 16 lines.

    fn radiance() -> Vec<[f32; 3]> {
        (0..SIZE[0] * SIZE[1]).map(|i| [i as f32 * 0.37, 1.0e-5 * i as f32, 1000.5 - i as f32]).collect()
    }

    fn written(options: &ExrOptions, transmittance: &[f32]) -> Vec<u8> {
        let radiance = radiance();
        let mut channels = colour("", &radiance);
        channels.push(ExrChannel {
            name: "transmittance.Y".into(),
            values: Box::new(transmittance.iter().copied()),
            colour: false,
        });
        encode(SIZE, channels, options).unwrap()
    }

    /// Names, whether half, and values of the channels of `bytes`.
    fn channels(bytes: &[u8]) -> Vec<(String, bool, Vec<f32>)> {
        let image = ::exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .unwrap();
        let list = image.layer_data.channel_data.list.into_iter();
        list.map(|channel| {
            let half = matches!(channel.sample_data, FlatSamples::F16(_));
            (channel.name.to_string(), half, channel.sample_data.values_as_f32().collect())
        })
        .collect()
    }

    #[test]
    fn every_compression_keeps_every_bit_in_scan_lines_from_the_top() {
        use ExrCompression::{None, Piz, Rle, Zip, Zips};
        let transmittance: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(|i| 1.0 / (1.0 + i as f32)).collect();
        for (compression, expected) in [
            (None, Compression::Uncompressed),
            (Rle, Compression::RLE),
            (Zips, Compression::ZIP1),
            (Zip, Compression::ZIP16),
            (Piz, Compression::PIZ),
        ] {
            let bytes = written(&ExrOptions { compression, ..ExrOptions::default() }, &transmittance);
            let meta = MetaData::read_from_buffered(&bytes[..], true).unwrap();
            let [header] = &meta.headers[..] else { panic!("one part") };
            assert_eq!((header.compression, header.line_order), (expected, LineOrder::Increasing));
            assert_eq!(header.blocks, BlockDescription::ScanLines);
            let channels = channels(&bytes);
            let names: Vec<_> = channels.iter().map(|(name, half, _)| (name.as_str(), *half)).collect();
            assert_eq!(names, [("B", false), ("G", false), ("R", false), ("transmittance.Y", false)]);
            for (channel, index) in [(0, 2), (1, 1), (2, 0)] {
                let plane: Vec<f32> = radiance().iter().map(|rgb| rgb[index]).collect();
                assert_eq!(channels[channel].2, plane, "{compression:?}");
            }
            assert_eq!(channels[3].2, transmittance);
        }
    }

    #[test]
    fn halves_are_the_nearest_and_stay_finite_and_other_layers_stay_floats() {
        let options = ExrOptions { colour: ExrType::Half, ..ExrOptions::default() };
        let rgb = [[1.0e6, -1.0e6, 0.1], [65_504.0, 0.0, 1.0 / 3.0]];
        let mut given = colour("", &rgb);
        given.push(ExrChannel {
            name: "distance.Z".into(),
            values: Box::new([1.0e30, 123_456.7].into_iter()),
            colour: false,
        });
        let channels = channels(&encode([2, 1], given, &options).unwrap());
        let near = |v: f32| f16::from_f32(v).to_f32();
        assert_eq!(channels[0], ("B".into(), true, vec![near(0.1), near(1.0 / 3.0)]));
        assert_eq!(channels[1], ("G".into(), true, vec![-65_504.0, 0.0]));
        assert_eq!(channels[2], ("R".into(), true, vec![65_504.0, 65_504.0]));
        assert_eq!(channels[3], ("distance.Z".into(), false, vec![1.0e30, 123_456.7]));
    }

    #[test]
    fn the_file_says_what_it_is() {
        let options = ExrOptions {
            owner: Some("me".into()),
            scene: Some("sky.toml sun.azimuth=3".into()),
            ..ExrOptions::default()
        };
        let meta = MetaData::read_from_buffered(&written(&options, &[1.0; 37 * 21])[..], true).unwrap();
        let header = &meta.headers[0];
        let text = |text: &Option<Text>| text.as_ref().map(ToString::to_string);
        assert_eq!(text(&header.own_attributes.owner).as_deref(), Some("me"));
        let software = text(&header.own_attributes.software_name).unwrap();
        assert_eq!(software, format!("Welkin {}", env!("CARGO_PKG_VERSION")));
        let scene = header.own_attributes.other.iter().find(|(name, _)| **name == *"scene");
        assert_eq!(scene.unwrap().1, &AttributeValue::Text("sky.toml sun.azimuth=3".into()));
        let space = header.shared_attributes.chromaticities.unwrap();
        // ITU-R BT.709, as sRGB.
        assert_eq!((space.red, space.green, space.blue), (Vec2(0.64, 0.33), Vec2(0.30, 0.60), Vec2(0.15, 0.06)));
        assert_eq!(space.white, Vec2(0.3127, 0.3290));
    }
}
