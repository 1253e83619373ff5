//! A comparison as one HTML file: pictures, heat maps and figures inside, nothing fetched from anywhere.

use std::path::Path;

use serde::Serialize;

use super::heat::{HeatMap, Scale, magma};
use super::metrics::Difference;
use super::series::{Series, Summary};
use crate::output::{Picture, write_atomic};
use crate::{Error, Result};

const PAGE: &str = include_str!("report.html");
/// Where the page takes its data, an assignment in JSON.
const SLOT: &str = "\"%DATA%\"";

/// A report in the making. `docs/comparing.md` tells how to read one.
#[derive(Serialize)]
pub struct Report {
    scene: String,
    device: String,
    size: [u32; 2],
    reference: String,
    colours: Vec<[u8; 3]>,
    scales: [ReportScale; 2],
    frames: Vec<Pictures>,
}

/// What a report says of a or b.
pub struct ReportSide<'a> {
    /// The mode, as it is shown.
    pub name: &'a str,
    /// Its metrics.
    pub series: &'a Series,
    /// Median time of a frame on the device [ms], where it is known.
    pub frame_gpu_ms: Option<f64>,
}

#[derive(Serialize)]
struct ReportScale {
    name: &'static str,
    ticks: Vec<(f64, String)>,
}

/// The pictures of a frame as data URIs: a, b and the reference, and per scale the heat maps of a and b.
#[derive(Serialize)]
struct Pictures {
    frame: u32,
    pictures: [String; 3],
    heat: [[String; 2]; 2],
}

#[derive(Serialize)]
struct Page<'a> {
    #[serde(flatten)]
    report: &'a Report,
    sides: [PageSide<'a>; 2],
}

#[derive(Serialize)]
struct PageSide<'a> {
    name: &'a str,
    summary: Summary,
    frames: &'a [super::series::FrameMetrics],
    frame_gpu_ms: Option<f64>,
}

const SCALES: [Scale; 2] = [Scale::Flip, Scale::Radiance];

impl Report {
    /// A report without frames yet. `reference` names what the reference was made by.
    #[must_use]
    pub fn new(scene: &str, device: &str, size: [u32; 2], reference: &str) -> Self {
        let scale = |scale: Scale, name| ReportScale { name, ticks: scale.ticks() };
        Self {
            scene: scene.into(),
            device: device.into(),
            size,
            reference: reference.into(),
            colours: (0..=255).map(magma).collect(),
            scales: [scale(SCALES[0], "ꟻLIP"), scale(SCALES[1], "radiance difference")],
            frames: Vec::new(),
        }
    }

    /// Takes in a frame: the pictures of a, of b and of the reference, and the differences of a and of b.
    ///
    /// # Errors
    /// [`Error::File`] when a picture cannot be encoded.
    pub fn add(&mut self, frame: u32, pictures: [&Picture; 3], differences: [&Difference; 2]) -> Result<()> {
        let [a, b, reference] = pictures.map(Picture::png);
        let heat = |scale: Scale, side: usize| {
            HeatMap::new(scale, differences[side], self.size[0]).grey_png().map(|bytes| data_uri(&bytes))
        };
        self.frames.push(Pictures {
            frame,
            pictures: [data_uri(&a?), data_uri(&b?), data_uri(&reference?)],
            heat: [[heat(SCALES[0], 0)?, heat(SCALES[0], 1)?], [heat(SCALES[1], 0)?, heat(SCALES[1], 1)?]],
        });
        Ok(())
    }

    /// Writes the page.
    ///
    /// # Errors
    /// [`Error::File`] when it cannot be written.
    pub fn write(&self, path: &Path, sides: [ReportSide<'_>; 2]) -> Result<()> {
        let sides = sides.map(|side| PageSide {
            name: side.name,
            summary: side.series.summary(),
            frames: side.series.frames(),
            frame_gpu_ms: side.frame_gpu_ms,
        });
        let data = serde_json::to_string(&Page { report: self, sides }).map_err(|error| Error::file(path, error))?;
        // Inside a script element only `</script` and `<!--` would mean anything.
        let data = data.replace('<', "\\u003c");
        let (before, after) =
            PAGE.split_once(SLOT).ok_or_else(|| Error::file(path, "the page has no place for data"))?;
        write_atomic(path, |file| [before, &data, after].iter().try_for_each(|part| file.write_all(part.as_bytes())))
    }
}

fn data_uri(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64(png))
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let bits = (0..3).fold(0u32, |bits, i| bits << 8 | u32::from(group.get(i).copied().unwrap_or(0)));
        for digit in 0..4 {
            let value = bits >> (18 - 6 * digit) & 63;
            text.push(if digit <= group.len() { char::from(DIGITS[value as usize]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_follows_the_vectors_of_rfc_4648() {
        let vectors = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, encoded) in vectors {
            assert_eq!(base64(plain.as_bytes()), encoded);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xfe]), "+//+");
    }

    #[test]
    fn the_page_fetches_nothing_and_has_one_place_for_data() {
        assert_eq!(PAGE.matches(SLOT).count(), 1);
        for outside in ["http://", "https://", "src=\"/", "@import", "url("] {
            assert!(!PAGE.contains(outside), "{outside}");
        }
    }
}
