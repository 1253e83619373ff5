//! A finished picture and its files.

use std::io::Write;
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError};

use super::exr::{self, ExrChannel, ExrOptions};
use super::{npy, write_atomic};
use crate::{Error, Result};

/// A picture in linear scene radiance and as it is to be shown; row by row, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear scene radiance before tone mapping [W m⁻² sr⁻¹ nm⁻¹].
    pub radiance: Vec<[f32; 3]>,
    /// Transmittance of the clouds in front of everything else.
    pub transmittance: Option<Vec<f32>>,
    /// After exposure and tone curve, **encoded** with the sRGB transfer function, 0 to 1: what a PNG holds.
    pub display: Vec<[f32; 3]>,
}

/// The format of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// PNG, sRGB: the toned picture.
    Png,
    /// OpenEXR: radiance, and more if [`ExrOptions`] say so.
    Exr,
    /// NumPy, f32, height × width × 3: radiance.
    Npy,
}

/// Bits per channel of a PNG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngDepth {
    /// 8 bits, with an ordered dither of half a step either way so that smooth skies show no bands.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}

impl Format {
    /// The format that the extension of `path` names.
    ///
    /// # Errors
    /// [`Error::File`] when it names none.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            Some("npy") => Ok(Self::Npy),
            _ => Err(Error::file(path, "names no picture format: expected a name that ends in .png, .exr or .npy")),
        }
    }
}

impl Picture {
    /// Writes the picture in the format that `path` names.
    ///
    /// # Errors
    /// [`Error::File`] when a value is not finite or the file cannot be written; nothing is left behind.
    pub fn write(&self, path: &Path, depth: PngDepth) -> Result<()> {
        self.write_with(path, depth, &ExrOptions::default())
    }

    /// As [`Self::write`], an EXR as `options` say.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn write_with(&self, path: &Path, depth: PngDepth, options: &ExrOptions) -> Result<()> {
        let format = Format::of(path)?;
        self.check(path)?;
        match (format, depth) {
            (Format::Png, PngDepth::Eight) => self.write_png(path, ExtendedColorType::Rgb8, &self.codes_8()),
            (Format::Png, PngDepth::Sixteen) => {
                self.write_png(path, ExtendedColorType::Rgb16, bytemuck::cast_slice(&self.codes_16()))
            }
            (Format::Exr, _) => self.write_exr(path, options),
            (Format::Npy, _) => npy::write(path, &self.shape(&[3]), self.radiance.iter().flatten().copied()),
        }
    }

    /// Writes the transmittance as a NumPy array, height × width.
    ///
    /// # Errors
    /// [`Error::File`] when there is none, a value is not finite or the file cannot be written.
    pub fn write_transmittance(&self, path: &Path) -> Result<()> {
        let Some(transmittance) = &self.transmittance else {
            return Err(Error::file(path, "cannot be written: this picture has no transmittance"));
        };
        self.check(path)?;
        npy::write(path, &self.shape(&[]), transmittance.iter().copied())
    }

    fn shape(&self, channels: &[u64]) -> Vec<u64> {
        [&[u64::from(self.height), u64::from(self.width)], channels].concat()
    }

    /// What is not finite in it, in words: which buffer, how many pixels, and the first of them. None of a sound picture.
    ///
    /// # Panics
    /// If a buffer does not hold one value a pixel.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let pixels = self.width as usize * self.height as usize;
        let lengths = [self.radiance.len(), self.display.len(), self.transmittance.as_ref().map_or(pixels, Vec::len)];
        assert!(lengths.iter().all(|&length| length == pixels), "a picture's buffers hold one value a pixel");
        let bad = |finite: &dyn Fn(usize) -> bool, what: &str| {
            let count = (0..pixels).filter(|&pixel| !finite(pixel)).count();
            let first = (0..pixels).find(|&pixel| !finite(pixel))?;
            let (x, y) = (first % self.width as usize, first / self.width as usize);
            Some(format!("{what} is not finite in {count} pixels, first at column {x}, row {y}"))
        };
        bad(&|pixel| self.radiance[pixel].iter().all(|v| v.is_finite()), "radiance")
            .or_else(|| bad(&|pixel| self.display[pixel].iter().all(|v| v.is_finite()), "the toned picture"))
            .or_else(|| {
                let transmittance = self.transmittance.as_ref()?;
                bad(&|pixel| transmittance[pixel].is_finite(), "transmittance")
            })
    }

    /// Refuses values that are not finite.
    fn check(&self, path: &Path) -> Result<()> {
        self.fault().map_or(Ok(()), |fault| Err(Error::file(path, format!("not written: {fault}"))))
    }

    /// Display values in 8 bits. The dither never changes a value that 8 bits hold exactly.
    fn codes_8(&self) -> Vec<u8> {
        let mut codes = Vec::with_capacity(self.display.len() * 3);
        for (pixel, colour) in self.display.iter().enumerate() {
            let (x, y) = (pixel as u32 % self.width, pixel as u32 / self.width);
            let dither = interleaved_gradient_noise(x, y) - 0.5;
            codes.extend(colour.map(|v| (v.clamp(0.0, 1.0) * 255.0 + dither).round() as u8));
        }
        codes
    }

    fn codes_16(&self) -> Vec<u16> {
        self.display.iter().flatten().map(|v| (v.clamp(0.0, 1.0) * 65_535.0).round() as u16).collect()
    }

    fn write_png(&self, path: &Path, colour: ExtendedColorType, bytes: &[u8]) -> Result<()> {
        write_atomic(path, |file| encode_png(file, [self.width, self.height], colour, bytes))
    }

    /// The toned picture as the bytes of a PNG file of 8 bits a channel.
    ///
    /// # Errors
    /// [`Error::File`] when a value is not finite.
    pub fn png(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.check(Path::new("a PNG in memory"))?;
        encode_png(&mut bytes, [self.width, self.height], ExtendedColorType::Rgb8, &self.codes_8())
            .map_err(|error| Error::file("a PNG in memory", error))?;
        Ok(bytes)
    }

    fn write_exr(&self, path: &Path, options: &ExrOptions) -> Result<()> {
        let mut channels = exr::colour("", &self.radiance);
        if let Some(transmittance) = self.transmittance.as_ref().filter(|_| options.aux) {
            let values = Box::new(transmittance.iter().copied());
            channels.push(ExrChannel { name: "transmittance.Y".into(), values, colour: false });
        }
        exr::write(path, [self.width, self.height], channels, options)
    }
}

/// `OUT.transmittance.npy` beside the picture file `OUT.png`.
#[must_use]
pub fn transmittance_path(picture: &Path) -> PathBuf {
    picture.with_extension("transmittance.npy")
}

/// The file of frame `frame` of a sequence: `OUT.0007.png` for `OUT.png`.
#[must_use]
pub fn numbered(picture: &Path, frame: u32) -> PathBuf {
    let extension = picture.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    picture.with_extension(format!("{frame:04}.{extension}"))
}

/// Writes `bytes` as a PNG of `size` pixels.
pub(crate) fn encode_png(
    file: &mut dyn Write,
    size: [u32; 2],
    colour: ExtendedColorType,
    bytes: &[u8],
) -> std::io::Result<()> {
    let encoder = PngEncoder::new_with_quality(file, CompressionType::Default, FilterType::Adaptive);
    encoder.write_image(bytes, size[0], size[1], colour).map_err(io_error)
}

fn io_error(error: ImageError) -> std::io::Error {
    match error {
        ImageError::IoError(error) => error,
        other => std::io::Error::other(other),
    }
}

/// A well-spread threshold 0 to 1 (1 excluded) for each pixel (Jimenez, "Next generation post-processing in Call of Duty:
/// Advanced Warfare", 2014).
fn interleaved_gradient_noise(x: u32, y: u32) -> f32 {
    let inner = (0.067_110_56 * f64::from(x) + 0.005_837_15 * f64::from(y)).fract();
    ((52.982_918_9 * inner).fract() as f32).min(1.0 - f32::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose values all differ.
    fn picture() -> Picture {
        let (width, height) = (5, 3);
        let pixels = 0..width * height;
        Picture {
            width,
            height,
            radiance: pixels.clone().map(|i| [i as f32 * 0.37, 1.0e-5 * i as f32, 1000.5 - i as f32]).collect(),
            transmittance: Some(pixels.clone().map(|i| i as f32 / 15.0).collect()),
            display: pixels.map(|i| [i as f32 / 255.0, 1.0 - i as f32 / 255.0, i as f32 / 14.0]).collect(),
        }
    }

    fn npy(path: &Path) -> (Vec<u64>, Vec<f32>) {
        let bytes = std::fs::read(path).unwrap();
        let file = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(file.order(), npyz::Order::C);
        (file.shape().to_vec(), file.into_vec().unwrap())
    }

    #[test]
    fn radiance_and_transmittance_come_back_bit_for_bit() {
        let (directory, picture) = (tempfile::tempdir().unwrap(), picture());
        let flat: Vec<f32> = picture.radiance.iter().flatten().copied().collect();

        let path = directory.path().join("a.npy");
        picture.write(&path, PngDepth::Eight).unwrap();
        assert_eq!(npy(&path), (vec![3, 5, 3], flat.clone()));

        let path = directory.path().join("a.exr");
        picture.write(&path, PngDepth::Eight).unwrap();
        let back = image::open(&path).unwrap();
        assert_eq!((back.width(), back.height(), back.to_rgb32f().into_raw()), (5, 3, flat));

        let path = transmittance_path(&path);
        assert_eq!(path.file_name().unwrap(), "a.transmittance.npy");
        picture.write_transmittance(&path).unwrap();
        assert_eq!(npy(&path), (vec![3, 5], picture.transmittance.clone().unwrap()));
    }

    #[test]
    fn png_holds_the_display_values() {
        let (directory, picture) = (tempfile::tempdir().unwrap(), picture());
        let path = directory.path().join("a.png");
        picture.write(&path, PngDepth::Sixteen).unwrap();
        let back = image::open(&path).unwrap();
        assert_eq!(back.color(), image::ColorType::Rgb16);
        let exact: Vec<u16> = picture.display.iter().flatten().map(|v| (v * 65_535.0).round() as u16).collect();
        assert_eq!(back.into_rgb16().into_raw(), exact);

        picture.write(&path, PngDepth::Eight).unwrap();
        let back = image::open(&path).unwrap().into_rgb8();
        for (pixel, colour) in back.pixels().zip(&picture.display) {
            // The first two channels are whole steps of 1/255, which the dither leaves alone.
            assert_eq!([pixel[0], pixel[1]], [(colour[0] * 255.0).round() as u8, (colour[1] * 255.0).round() as u8]);
            assert!((f32::from(pixel[2]) - colour[2] * 255.0).abs() <= 1.0);
        }
    }

    #[test]
    fn the_dither_keeps_the_mean() {
        let level = 100.3 / 255.0;
        let pixels = 128 * 128;
        let flat = Picture {
            width: 128,
            height: 128,
            radiance: vec![[0.0; 3]; pixels],
            transmittance: None,
            display: vec![[level; 3]; pixels],
        };
        let mean = flat.codes_8().iter().map(|&c| f64::from(c)).sum::<f64>() / (pixels * 3) as f64;
        assert!((mean - 100.3).abs() < 0.01, "mean {mean}"); // the noise is that even over 128² pixels
    }

    #[test]
    fn values_that_are_not_finite_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        let mut bad = picture();
        bad.radiance[7][1] = f32::NAN;
        bad.radiance[9][1] = f32::INFINITY;
        let message = bad.write(&path, PngDepth::Eight).unwrap_err().to_string();
        assert!(message.ends_with("radiance is not finite in 2 pixels, first at column 2, row 1"), "{message}");
        let mut bad = picture();
        bad.transmittance = Some(vec![f32::NAN; 15]);
        let message = bad.write_transmittance(&path).unwrap_err().to_string();
        assert!(message.contains("transmittance is not finite in 15 pixels"), "{message}");
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    #[test]
    fn formats_and_names_follow_the_extension() {
        assert_eq!(Format::of(Path::new("a.PNG")).unwrap(), Format::Png);
        let message = Format::of(Path::new("a.jpg")).unwrap_err().to_string();
        assert_eq!(message, "a.jpg: names no picture format: expected a name that ends in .png, .exr or .npy");
        assert_eq!(numbered(Path::new("d/sky.png"), 7), Path::new("d/sky.0007.png"));
        assert_eq!(numbered(Path::new("d/sky.png"), 12_345), Path::new("d/sky.12345.png"));
    }
}
