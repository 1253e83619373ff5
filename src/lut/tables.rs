//! Both tables of a medium and style: from the cache, or built and then cached.

use super::axes::{LEVELS, OpticalDepthShape, ScatteringShape};
use super::cache::{self, Cached};
use super::optical_depth::style_index;
use super::{LevelReport, OpticalDepthTable, ScatteringTable};
use crate::Result;
use crate::definitions::REFERENCE_SEED;
use crate::gpu::{Buffer, BufferKind, Frames, Image, Recorder};
use crate::params::{Clouds, Style};
use crate::reference::monte_carlo::Medium;
use crate::reference::optical_depth::mean_density;
use crate::shaders;
use glam::DVec3;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// Raised when the host's part of a computation changes, which the shaders' bytes do not tell.
const VERSION: u32 = 4;

/// How finely tables are resolved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Detail {
    /// Small tables for a first picture, made in a few seconds on a CPU.
    Coarse,
    /// The paper's sizes.
    #[default]
    Full,
}

/// Everything that the tables depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableParams {
    /// The scattering medium.
    pub medium: Medium,
    /// Stop after this many events (Yusov: 18); `None` sums until converged.
    pub orders: Option<u32>,
    /// Density inside a particle.
    pub style: Style,
    /// Resolution.
    pub detail: Detail,
}

impl TableParams {
    /// What a scene's clouds need.
    pub fn new(clouds: &Clouds, detail: Detail) -> Self {
        let medium = Medium {
            phase: clouds.phase.into(),
            g_sun: f64::from(clouds.g_single),
            g: f64::from(clouds.g_multiple),
            albedo: f64::from(clouds.albedo),
        };
        let orders = (clouds.orders > 0).then_some(clouds.orders);
        Self { medium, orders, style: clouds.style, detail }
    }

    fn shapes(&self) -> (OpticalDepthShape, ScatteringShape, f64) {
        match self.detail {
            Detail::Coarse => (OpticalDepthShape::COARSE, ScatteringShape::COARSE, 0.4),
            Detail::Full => (OpticalDepthShape::FULL, ScatteringShape::FULL, 1.0),
        }
    }

    /// Name of the scattering table's file in the cache.
    pub fn scattering_file(&self) -> String {
        let mut key = VERSION.to_le_bytes().to_vec();
        let Medium { phase, g_sun, g, albedo } = self.medium;
        key.push(phase as u8);
        for value in [g_sun, g, albedo, super::axes::R_MIN, super::axes::R_MAX, super::axes::MU_SCALE] {
            key.extend(value.to_le_bytes());
        }
        key.extend(self.orders.unwrap_or(0).to_le_bytes());
        key.push(self.detail as u8);
        let programs = [
            &shaders::lut_transport_emit_comp::PROGRAM,
            &shaders::lut_transport_sweep_comp::PROGRAM,
            &shaders::lut_transport_turn_comp::PROGRAM,
            &shaders::lut_transport_project_comp::PROGRAM,
            &shaders::lut_scattering_comp::PROGRAM,
            &shaders::lut_scattering_between_comp::PROGRAM,
        ];
        cache::file_name("scattering", &key, &programs.map(|program| program.stages[0].spirv))
    }

    /// Name of the optical depth table's file in the cache.
    pub fn optical_depth_file(&self) -> String {
        let mut key = VERSION.to_le_bytes().to_vec();
        key.extend(style_index(self.style).to_le_bytes());
        key.extend(REFERENCE_SEED.to_le_bytes());
        key.push(self.detail as u8);
        let programs = [&shaders::lut_profile_comp::PROGRAM, &shaders::lut_optical_depth_comp::PROGRAM];
        cache::file_name("optical-depth", &key, &programs.map(|program| program.stages[0].spirv))
    }
}

/// How far building has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Which table.
    pub stage: &'static str,
    /// Done of all tables, 0..=1.
    pub fraction: f32,
}

/// The tables that the renderer reads.
pub struct Tables {
    params: TableParams,
    /// Optical depth of the reference particle.
    pub optical_depth: OpticalDepthTable,
    /// Scattering of the homogeneous ball.
    pub scattering: ScatteringTable,
    reports: Vec<LevelReport>,
    fill: f32,
    built: bool,
    seconds: f64,
    warnings: Vec<String>,
}

/// Finished tables in the host's memory, on their way from one device to another.
#[derive(Clone, Debug)]
pub struct TableData {
    params: TableParams,
    optical_depth: Vec<u8>,
    scattering: Vec<u8>,
    reports: Vec<LevelReport>,
    fill: f32,
    built: bool,
    seconds: f64,
    warnings: Vec<String>,
}

impl Tables {
    /// Copies the tables to the host, for [`Self::upload`] to another device.
    pub fn download(&self, frames: &mut Frames) -> Result<TableData> {
        Ok(TableData {
            params: self.params,
            optical_depth: download(frames, self.optical_depth.image())?,
            scattering: download(frames, self.scattering.image())?,
            reports: self.reports.clone(),
            fill: self.fill,
            built: self.built,
            seconds: self.seconds,
            warnings: self.warnings.clone(),
        })
    }

    /// Tables that another device has made.
    pub fn upload(frames: &mut Frames, data: TableData) -> Result<Self> {
        let gpu = frames.gpu().clone();
        let (depth_shape, scattering_shape, _) = data.params.shapes();
        let TableData { params, optical_depth, scattering, reports, fill, built, seconds, warnings } = data;
        let (depth_bytes, scattering_bytes) = (optical_depth, scattering);
        let optical_depth = OpticalDepthTable::new(&gpu, depth_shape)?;
        let scattering = ScatteringTable::new(&gpu, scattering_shape)?;
        upload(frames, optical_depth.image(), &depth_bytes)?;
        upload(frames, scattering.image(), &scattering_bytes)?;
        Ok(Self { params, optical_depth, scattering, reports, fill, built, seconds, warnings })
    }

    /// Reads the tables from `cache`, or builds them and writes them there; without a cache directory they are built.
    ///
    /// A damaged or unwritable cache is no error: it leads to a warning, see [`Self::warnings`]. `progress` may stop the
    /// build by returning `Break`; the answer is then `None`, and the cache has gained nothing or one whole table.
    pub fn load_or_build(
        frames: &mut Frames,
        params: &TableParams,
        cache: Option<&Path>,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Option<Self>> {
        let started = Instant::now();
        let gpu = frames.gpu().clone();
        let (depth_shape, scattering_shape, detail) = params.shapes();
        let mut tables = Self {
            params: *params,
            optical_depth: OpticalDepthTable::new(&gpu, depth_shape)?,
            scattering: ScatteringTable::new(&gpu, scattering_shape)?,
            reports: Vec::new(),
            fill: central_fill(params.style),
            built: false,
            seconds: 0.0,
            warnings: Vec::new(),
        };

        let path = cache.map(|directory| directory.join(params.optical_depth_file()));
        match tables.look_up(path.as_deref(), image_bytes(tables.optical_depth.image())) {
            Some(bytes) => upload(frames, tables.optical_depth.image(), &bytes)?,
            None => {
                if progress(Progress { stage: "optical depth", fraction: 0.0 }).is_break() {
                    return Ok(None);
                }
                frames.run(|rec| tables.optical_depth.record(rec, params.style))?;
                let bytes = download(frames, tables.optical_depth.image())?;
                tables.keep(path.as_deref(), &bytes);
            }
        }

        let path = cache.map(|directory| directory.join(params.scattering_file()));
        let image = image_bytes(tables.scattering.image());
        let report = reports_bytes();
        match tables.look_up(path.as_deref(), image + report) {
            Some(bytes) => {
                upload(frames, tables.scattering.image(), &bytes[..image])?;
                tables.reports = bytes[image..].chunks_exact(LevelReport::BYTES).map(LevelReport::from_bytes).collect();
            }
            None => {
                let mut inner =
                    |fraction: f32| progress(Progress { stage: "scattering", fraction: 0.1 + 0.9 * fraction });
                let built = tables.scattering.build(frames, &params.medium, params.orders, detail, &mut inner)?;
                let Some(reports) = built else { return Ok(None) };
                tables.reports = reports;
                let mut bytes = download(frames, tables.scattering.image())?;
                bytes.extend(tables.reports.iter().flat_map(|report| report.to_bytes()));
                tables.keep(path.as_deref(), &bytes);
            }
        }
        tables.seconds = started.elapsed().as_secs_f64();
        Ok(Some(tables))
    }

    /// Whether both tables of `params` lie in the cache, so that [`Self::load_or_build`] need only read them. A damaged
    /// file counts as absent.
    pub fn cached(params: &TableParams, cache: &Path) -> bool {
        let (depth, scattering, _) = params.shapes();
        let bytes = |extent: [u32; 3]| extent.iter().product::<u32>() as usize * 4;
        let found = |file: String, length| matches!(cache::read(&cache.join(file), length), Cached::Found(_));
        found(params.optical_depth_file(), bytes(depth.image_extent()))
            && found(params.scattering_file(), bytes(scattering.image_extent()) + reports_bytes())
    }

    fn look_up(&mut self, path: Option<&Path>, length: usize) -> Option<Vec<u8>> {
        let path = path?;
        match cache::read(path, length) {
            Cached::Found(bytes) => Some(bytes),
            Cached::Absent => None,
            Cached::Damaged(reason) => {
                self.warnings.push(format!("{}: {reason}; the table is built anew", path.display()));
                None
            }
        }
    }

    fn keep(&mut self, path: Option<&Path>, bytes: &[u8]) {
        self.built = true;
        if let Some(path) = path
            && let Err(reason) = cache::write(path, bytes)
        {
            self.warnings.push(format!("{}: {reason}; the table is not kept", path.display()));
        }
    }

    /// Records the change to another style, which is complete when the commands have run.
    pub fn record_style(&mut self, rec: &mut Recorder<'_>, style: Style) -> Result<()> {
        self.optical_depth.record(rec, style)?;
        self.params.style = style;
        self.fill = central_fill(style);
        Ok(())
    }

    /// What they were made from.
    pub fn params(&self) -> &TableParams {
        &self.params
    }

    /// Mean of the density profile along chords through the centre of the particle, 0..=1.
    pub fn fill(&self) -> f32 {
        self.fill
    }

    /// Per solved level of optical radius: how the solution went.
    pub fn reports(&self) -> &[LevelReport] {
        &self.reports
    }

    /// Whether any table had to be built.
    pub fn built(&self) -> bool {
        self.built
    }

    /// Time that reading or building took [s].
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// What went wrong with the cache, each a sentence.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The scattering table as it lies in memory: `[mu + level · n_mu][psi][theta]`, rest of single and multiple.
    pub fn read_scattering(&self, frames: &mut Frames) -> Result<Vec<[f32; 2]>> {
        read_image(frames, self.scattering.image())
    }

    /// The optical depth table as it lies in memory: `[phi_v][theta_v · n + theta_s][phi_s]`, mean density, first matter.
    pub fn read_optical_depth(&self, frames: &mut Frames) -> Result<Vec<[f32; 2]>> {
        read_image(frames, self.optical_depth.image())
    }
}

/// Mean density along 64 chords through the centre, in directions spread evenly.
pub(crate) fn central_fill(style: Style) -> f32 {
    let n = 64;
    let sum: f64 = (0..n)
        .map(|i| {
            let z: f64 = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
            let (s, c) = (2.399_963_229_728_653 * f64::from(i)).sin_cos(); // golden angle
            let entry = DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z);
            mean_density(entry, -entry, style, REFERENCE_SEED, 64)
        })
        .sum();
    (sum / f64::from(n)) as f32
}

fn reports_bytes() -> usize {
    (0..LEVELS).filter(|&level| ScatteringShape::solved(level)).count() * LevelReport::BYTES
}

fn image_bytes(image: &Image) -> usize {
    image.extent().iter().product::<u32>() as usize * 4
}

fn upload(frames: &mut Frames, image: &Image, bytes: &[u8]) -> Result<()> {
    let buffer = Buffer::upload(frames.gpu(), "table upload", bytes)?;
    frames.run(|rec| {
        rec.pass("table upload", |rec| {
            rec.copy_buffer_to_image(&buffer, image);
            Ok(())
        })
    })
}

fn download(frames: &mut Frames, image: &Image) -> Result<Vec<u8>> {
    let length = image_bytes(image);
    let buffer = Buffer::new(frames.gpu(), "table readback", length as u64, BufferKind::Readback)?;
    frames.run(|rec| {
        rec.pass("table readback", |rec| {
            rec.copy_image_to_buffer(image, &buffer);
            rec.make_visible_to_host(&buffer);
            Ok(())
        })
    })?;
    Ok(buffer.read(0, length))
}

/// The texels of a table, x fastest, then y, then z.
pub fn read_image(frames: &mut Frames, image: &Image) -> Result<Vec<[f32; 2]>> {
    let bytes = download(frames, image)?;
    let half = |low: u8, high: u8| half::f16::from_le_bytes([low, high]).to_f32();
    Ok(bytes.chunks_exact(4).map(|t| [half(t[0], t[1]), half(t[2], t[3])]).collect())
}
