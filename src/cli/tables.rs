//! The tables of a scene's medium on the device.

use std::ops::ControlFlow;
use std::time::Instant;

use welkin::Result;
use welkin::gpu::{Buffer, BufferKind, Frames};
use welkin::lut::axes::{OpticalDepthShape, ScatteringShape};
use welkin::lut::{OpticalDepthTable, ScatteringTable};
use welkin::output::TableStats;
use welkin::params::{Clouds, Phase, Style};
use welkin::reference::monte_carlo::Medium;
use welkin::reference::phase::PhaseFunction;
use welkin::renderer::TableImages;

use super::progress::Progress;

/// Both tables, filled.
pub struct Tables {
    optical_depth: OpticalDepthTable,
    scattering: ScatteringTable,
    fill: f32,
    stats: TableStats,
}

impl Tables {
    /// Makes the tables of `clouds`.
    pub fn make(frames: &mut Frames, clouds: &Clouds) -> Result<Self> {
        let started = Instant::now();
        let gpu = frames.gpu().clone();
        let optical_depth = OpticalDepthTable::new(&gpu, OpticalDepthShape::FULL)?;
        let scattering = ScatteringTable::new(&gpu, ScatteringShape::COARSE)?;
        frames.run(|rec| optical_depth.record(rec, clouds.style, clouds.seed))?;
        let medium = Medium {
            phase: match clouds.phase {
                Phase::CornetteShanks => PhaseFunction::CornetteShanks,
                Phase::HenyeyGreenstein => PhaseFunction::HenyeyGreenstein,
            },
            g_sun: clouds.g_single.into(),
            g: clouds.g_multiple.into(),
            albedo: clouds.albedo.into(),
        };
        let orders = (clouds.orders > 0).then_some(clouds.orders);
        let mut progress = Progress::start("scattering tables", 1000);
        scattering.build(frames, &medium, orders, 0.4, &mut |fraction| {
            progress.set((fraction * 1000.0) as u64);
            ControlFlow::Continue(())
        })?;
        drop(progress);
        let fill = if clouds.style == Style::Homogeneous { 1.0 } else { mean_density(frames, &optical_depth)? };
        let seconds = started.elapsed().as_secs_f64();
        let stats = TableStats { from: "built".into(), size: "reduced".into(), seconds };
        Ok(Self { optical_depth, scattering, fill, stats })
    }

    pub fn images(&self) -> TableImages<'_> {
        TableImages { optical_depth: self.optical_depth.image(), scattering: self.scattering.image(), fill: self.fill }
    }

    pub fn stats(&self) -> &TableStats {
        &self.stats
    }
}

/// Mean density along the chords through the particle's centre, over all directions.
fn mean_density(frames: &mut Frames, table: &OpticalDepthTable) -> Result<f32> {
    let [width, height, depth] = table.image().extent();
    let shape = table.shape();
    let bytes = u64::from(width) * u64::from(height) * u64::from(depth) * 4;
    let readback = Buffer::new(frames.gpu(), "optical depth", bytes, BufferKind::Readback)?;
    frames.run(|rec| {
        rec.copy_image_to_buffer(table.image(), &readback);
        rec.make_visible_to_host(&readback);
        Ok(())
    })?;
    // Direction zenith 0 is the first `theta` rows of the first slice: every azimuth of the direction is the same ray.
    let texels: Vec<[half::f16; 2]> = readback.read(0, (shape.theta * width) as usize);
    let (mut sum, mut weights) = (0.0, 0.0);
    for (row, texels) in texels.chunks_exact(width as usize).enumerate() {
        let weight = shape.theta_s(row as u32).sin();
        sum += weight * texels.iter().map(|texel| texel[0].to_f64()).sum::<f64>() / f64::from(width);
        weights += weight;
    }
    Ok((sum / weights) as f32)
}
