//! From sums to a picture: the renderer's own air, background and film over the traced clouds, and the variance of it all.

use super::state::PixelSums;
use super::tracer::PathTracer;
use crate::Result;
use crate::blend::NO_CLOUD;
use crate::gpu::{Buffer, BufferKind, Frames};

/// A traced picture; row by row, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Columns and rows.
    pub extent: [u32; 2],
    /// Samples of each pixel.
    pub samples: u32,
    /// Linear scene radiance, air and background included [W m⁻² sr⁻¹ nm⁻¹].
    pub radiance: Vec<[f32; 3]>,
    /// Variance of [`Self::radiance`], which is a mean over the samples: its noise squared. Zero below two samples.
    pub variance: Vec<[f32; 3]>,
    /// Toned and sRGB-encoded, 0 to 1.
    pub display: Vec<[f32; 3]>,
    /// Transmittance of the clouds.
    pub transmittance: Vec<f32>,
    /// What the clouds themselves add, without the air in front: as the cloud targets hold it.
    pub cloud: Vec<[f32; 3]>,
    /// Variance of [`Self::cloud`].
    pub cloud_variance: Vec<[f32; 3]>,
    /// Mean distance of the first event of those rays that have one [m]; 1e30 where none has.
    pub distance: Vec<f32>,
}

impl PathTracer {
    /// Relative standard error of the clouds' radiance: root of the summed variances of all pixels' means over the root of
    /// their summed squares. Infinite below two samples.
    #[must_use]
    pub fn noise(&self) -> f64 {
        noise(&self.pixels, self.samples)
    }

    /// The picture so far, through the renderer's own air, background and film.
    ///
    /// # Errors
    /// What Vulkan says.
    pub fn develop(&mut self, frames: &mut Frames) -> Result<Truth> {
        develop(self, frames)
    }
}

fn over_samples(m2: f32, samples: u32) -> f32 {
    if samples < 2 { 0.0 } else { m2.max(0.0) / (samples as f32 * (samples - 1) as f32) }
}

fn noise(pixels: &[PixelSums], samples: u32) -> f64 {
    if samples < 2 {
        return f64::INFINITY;
    }
    let (mut variance, mut square) = (0.0, 0.0);
    for pixel in pixels {
        for (m2, mean) in pixel.radiance_m2.iter().zip(pixel.radiance) {
            variance += f64::from(over_samples(*m2, samples));
            square += f64::from(mean) * f64::from(mean);
        }
    }
    if variance > 0.0 { (variance / square).sqrt() } else { 0.0 }
}

/// The pictures that the film is asked for. It is linear in radiance and transmittance, so with the air and the background
/// of each pixel known from three of them, variances follow.
const PROBES: [[f32; 4]; 3] = [[0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

fn develop(tracer: &mut PathTracer, frames: &mut Frames) -> Result<Truth> {
    let gpu = &frames.gpu().clone();
    let pixels = &tracer.pixels;
    let count = pixels.len();
    let cloud: Vec<[f32; 4]> = pixels
        .iter()
        .map(|p| [p.radiance[0], p.radiance[1], p.radiance[2], p.transmittance.clamp(0.0, 1.0)])
        .map(|p| if tracer.samples == 0 { [0.0, 0.0, 0.0, 1.0] } else { p })
        .collect();
    let distance: Vec<f32> =
        pixels.iter().map(|p| if p.distance > 0.0 { p.distance / (1.0 - p.transmittance) } else { NO_CLOUD }).collect();
    let bytes = 16 * count as u64;
    let readback = |name, bytes| Buffer::new(gpu, name, bytes, BufferKind::Readback);
    let mut scenes = Vec::new();
    let display = readback("display readback", 8 * count as u64)?;
    let nearest = Buffer::upload(gpu, "distance upload", &distance)?;
    let texels = Buffer::new(gpu, "cloud upload", bytes, BufferKind::Upload)?;
    let scene = readback("scene readback", bytes)?;
    for probe in [None, Some(PROBES[0]), Some(PROBES[1]), Some(PROBES[2])] {
        texels.write(0, probe.map_or_else(|| cloud.clone(), |probe| vec![probe; count]).as_slice());
        frames.run(|rec| {
            // The frame's parameters belong to a slot, so each run records its scene.
            tracer.renderer.record_scene(rec, &tracer.params.camera, tracer.fill)?;
            let targets = tracer.renderer.targets();
            rec.copy_buffer_to_image(&texels, &targets.cloud);
            rec.copy_buffer_to_image(&nearest, &targets.nearest);
            tracer.renderer.view().record_film(rec, tracer.renderer.sky())?;
            let film = tracer.renderer.film();
            rec.copy_image_to_buffer(&film.scene, &scene);
            rec.make_visible_to_host(&scene);
            if probe.is_none() {
                rec.copy_image_to_buffer(&film.picture, &display);
                rec.make_visible_to_host(&display);
            }
            Ok(())
        })?;
        scenes.push(scene.read::<[f32; 4]>(0, count));
    }
    let samples = tracer.samples;
    let variance = |i: usize| {
        let p = &pixels[i];
        std::array::from_fn(|c| {
            let (veil, white, behind) = (scenes[1][i][c], scenes[2][i][c], scenes[3][i][c]);
            let (a, b) = (white - veil, behind - veil);
            let m2 = a * a * p.radiance_m2[c] + 2.0 * a * b * p.co_moment[c] + b * b * p.transmittance_m2;
            over_samples(m2, samples)
        })
    };
    Ok(Truth {
        extent: tracer.extent,
        samples,
        radiance: scenes[0].iter().map(|&[r, g, b, _]| [r, g, b]).collect(),
        variance: (0..count).map(variance).collect(),
        display: display
            .read::<[u16; 4]>(0, count)
            .iter()
            .map(|&[r, g, b, _]| [r, g, b].map(|v| f32::from(v) / 65_535.0))
            .collect(),
        transmittance: cloud.iter().map(|texel| texel[3]).collect(),
        cloud: cloud.iter().map(|&[r, g, b, _]| [r, g, b]).collect(),
        cloud_variance: pixels.iter().map(|p| p.radiance_m2.map(|m2| over_samples(m2, samples))).collect(),
        distance,
    })
}
