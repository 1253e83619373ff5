//! How finely and by which means a picture is made.

use std::fmt;
use std::str::FromStr;

use super::{axes, check};
use crate::{Error, Result};

/// Sizes and choices that trade time for a better picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Cells along each side of a ring of the particle grid, overlap included; a multiple of 8.
    pub cells: u32,
    /// Nested rings of the particle grid; each is twice as coarse as the one inside.
    pub rings: u32,
    /// Layers of particles in a cell.
    pub layers: u32,
    /// Particles are drawn at the picture's size divided by this: 1, 2 or 4. Default 2 (Yusov 5.4).
    pub downscale: u32,
    /// Precision of the render targets. Default [`Precision::F16`].
    pub precision: Precision,
    /// How overlapping particles are composited. Default [`Blend::Auto`].
    pub blend: Blend,
}

/// A named choice of grid size (Yusov, Table 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// 4 rings of 104² cells, 2 layers.
    Low,
    /// 4 rings of 136² cells, 4 layers.
    #[default]
    Medium,
    /// 4 rings of 184² cells, 6 layers.
    High,
}

/// Precision of the render targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats.
    F16,
    /// 32-bit floats, for comparisons.
    F32,
}

/// How overlapping particles are composited. As text: the mode's name, and for a window of K segments `:K`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// The best of `interlock`, `attachment` and `alpha` that the device has.
    Auto,
    /// The cheapest exact one that the device has.
    Exact,
    /// Volume-aware blending ordered by fragment shader interlock, a window of K segments per pixel (Yusov 5.5 is K = 1).
    Interlock(u32),
    /// The same merge through rasterization-order attachment access.
    Attachment(u32),
    /// Per-pixel linked lists, exact at resolve.
    List,
    /// Compute: screen tiles, sorted, integrated exactly.
    Tiled,
    /// Sorted alpha blending, back to front.
    Alpha,
    /// Dynamic impostors.
    Impostor,
}

impl Preset {
    /// The quality settings of this preset.
    #[must_use]
    pub fn quality(self) -> Quality {
        let (cells, layers) = match self {
            Self::Low => (104, 2),
            Self::Medium => (136, 4),
            Self::High => (184, 6),
        };
        Quality { cells, rings: 4, layers, downscale: 2, precision: Precision::F16, blend: Blend::Auto }
    }
}

/// The windows that [`Blend::Interlock`] and [`Blend::Attachment`] come in: numbers of segments.
pub const WINDOWS: [u32; 4] = [1, 2, 4, 8];

impl Default for Quality {
    fn default() -> Self {
        Preset::default().quality()
    }
}

impl Quality {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the field, the value and what is accepted.
    pub fn validate(&self) -> Result<()> {
        if !(24..=512).contains(&self.cells) || !self.cells.is_multiple_of(8) {
            return Err(Error::invalid("quality.cells", self.cells, "a multiple of 8 from 24 to 512"));
        }
        check::within("quality.rings", self.rings, 1..=8, "")?;
        check::within("quality.layers", self.layers, 1..=16, "")?;
        if ![1, 2, 4].contains(&self.downscale) {
            return Err(Error::invalid("quality.downscale", self.downscale, "1, 2 or 4"));
        }
        if let Blend::Interlock(k) | Blend::Attachment(k) = self.blend
            && !WINDOWS.contains(&k)
        {
            return Err(Error::invalid("quality.blend", self.blend, "a window of 1, 2, 4 or 8 segments"));
        }
        Ok(())
    }
}

impl fmt::Display for Blend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = axes::name_of(axes::BLENDS, |value| value.same_kind(self));
        match self {
            Self::Interlock(k) | Self::Attachment(k) if *k != 1 => write!(f, "{name}:{k}"),
            _ => f.write_str(name),
        }
    }
}

impl Blend {
    /// Whether both are the same mode, whatever their windows.
    #[must_use]
    pub fn same_kind(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }
}

impl FromStr for Blend {
    type Err = Error;

    /// Reads `MODE` or `MODE:K`.
    fn from_str(text: &str) -> Result<Self> {
        let (name, window) = match text.split_once(':') {
            Some((name, k)) => (name, Some(k)),
            None => (text, None),
        };
        let mode = axes::lookup(axes::BLENDS, "quality.blend", name)?;
        let Some(window) = window else { return Ok(mode) };
        let k = window
            .parse()
            .map_err(|_| Error::invalid("quality.blend", text, "a window :K of 1, 2, 4 or 8 segments"))?;
        match mode {
            Self::Interlock(_) => Ok(Self::Interlock(k)),
            Self::Attachment(_) => Ok(Self::Attachment(k)),
            _ => Err(Error::invalid("quality.blend", text, "a window :K only after interlock or attachment")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blend_modes_read_and_print_alike() {
        for text in ["auto", "exact", "interlock", "interlock:4", "attachment:2", "list", "tiled", "alpha", "impostor"]
        {
            assert_eq!(text.parse::<Blend>().unwrap().to_string(), text);
        }
        assert_eq!("interlock:1".parse::<Blend>().unwrap(), Blend::Interlock(1));
        for text in ["", "Alpha", "alpha:2", "interlock:", "interlock:x", "glass"] {
            let error = text.parse::<Blend>().unwrap_err().to_string();
            assert!(error.starts_with(&format!("quality.blend = {text}")), "{error}");
        }
    }

    #[test]
    fn presets_are_those_of_the_paper() {
        let sizes = [Preset::Low, Preset::Medium, Preset::High].map(|p| {
            let q = p.quality();
            (q.cells, q.rings, q.layers)
        });
        assert_eq!(sizes, [(104, 4, 2), (136, 4, 4), (184, 4, 6)]);
    }
}
