//! What a picture has gathered so far, and its file.

use bytemuck::{Pod, Zeroable};

use crate::shared::assert_layout;
use crate::{Error, Result};

/// Means over a pixel's samples and sums of squared deviations (`glsl/pathtrace/path.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PixelSums {
    /// Mean radiance that the clouds add [W m⁻² sr⁻¹].
    pub radiance: [f32; 3],
    /// Mean transmittance of the clouds.
    pub transmittance: f32,
    /// What compensated summation carries.
    pub radiance_carry: [f32; 3],
    /// The same.
    pub transmittance_carry: f32,
    /// Sum of squared deviations of radiance.
    pub radiance_m2: [f32; 3],
    /// The same of transmittance.
    pub transmittance_m2: f32,
    /// Sum of products of both deviations.
    pub co_moment: [f32; 3],
    /// Mean of opacity × distance of the first event [m].
    pub distance: f32,
}
assert_layout!(PixelSums, pixel_sums, {
    radiance: RADIANCE, transmittance: TRANSMITTANCE, radiance_carry: RADIANCE_CARRY,
    transmittance_carry: TRANSMITTANCE_CARRY, radiance_m2: RADIANCE_M2, transmittance_m2: TRANSMITTANCE_M2,
    co_moment: CO_MOMENT, distance: DISTANCE,
});

const MAGIC: &[u8; 16] = b"welkin paths 1\r\n";
const HEADER: usize = MAGIC.len() + 32 + 32 + 4;

/// All that is needed to go on: random numbers are functions of pixel, sample and seed.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Of everything that the picture depends on; see [`PathTracer::state`](super::PathTracer::state).
    pub fingerprint: [u8; 32],
    /// Samples of each pixel.
    pub samples: u32,
    /// One a pixel, row 0 at the top.
    pub pixels: Vec<PixelSums>,
}

impl State {
    /// As a file holds it: a header with the fingerprint and a checksum, then the pixels, little-endian.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let payload: &[u8] = bytemuck::cast_slice(&self.pixels);
        let mut bytes = Vec::with_capacity(HEADER + payload.len());
        bytes.extend_from_slice(MAGIC);
        bytes.extend_from_slice(&self.fingerprint);
        bytes.extend_from_slice(blake3::hash(payload).as_bytes());
        bytes.extend_from_slice(&self.samples.to_le_bytes());
        bytes.extend_from_slice(payload);
        bytes
    }

    /// Reads what [`Self::to_bytes`] made.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] for anything else.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let bad = |found: &str| {
            let value = format!("{} bytes", bytes.len());
            Error::invalid("state", value, format!("a state of welkin reference ({found})"))
        };
        if bytes.len() < HEADER || &bytes[..MAGIC.len()] != MAGIC {
            return Err(bad("it is not one of this version"));
        }
        let (header, payload) = bytes.split_at(HEADER);
        if payload.len() % size_of::<PixelSums>() != 0 || blake3::hash(payload).as_bytes()[..] != header[48..80] {
            return Err(bad("its checksum does not match its data"));
        }
        let mut fingerprint = [0; 32];
        fingerprint.copy_from_slice(&header[16..48]);
        let samples = u32::from_le_bytes(header[80..84].try_into().unwrap_or_default());
        let pixels = payload.chunks_exact(size_of::<PixelSums>()).map(bytemuck::pod_read_unaligned).collect();
        Ok(Self { fingerprint, samples, pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_comes_back_from_its_bytes_and_damage_is_noticed() {
        let pixel = |i: usize| PixelSums { radiance: [i as f32, 0.5, 2.0], distance: 7.0, ..PixelSums::default() };
        let state = State { fingerprint: [9; 32], samples: 3, pixels: (0..5).map(pixel).collect() };
        let bytes = state.to_bytes();
        assert_eq!(State::from_bytes(&bytes).unwrap(), state);
        let mut damaged = bytes.clone();
        damaged[HEADER + 3] ^= 1;
        for (bytes, word) in
            [(&damaged[..], "checksum"), (&bytes[..50], "not one"), (&bytes[..HEADER + 70], "checksum")]
        {
            let message = State::from_bytes(bytes).unwrap_err().to_string();
            assert!(message.starts_with("state = ") && message.contains(word), "{message}");
        }
    }
}
