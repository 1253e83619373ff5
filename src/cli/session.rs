//! A device and a renderer on it: the one place where the command line meets the renderer.

use std::collections::BTreeMap;
use std::time::Instant;

use welkin::blend::supports;
use welkin::gpu::standalone::Standalone;
use welkin::gpu::{Buffer, BufferKind, Frames, Image, ImageDesc};
use welkin::output::{BlendStats, CapacityStats, DeviceStats, ParticleStats, PassStats, Picture, TableStats};
use welkin::params::{Blend, Params, Precision};
use welkin::renderer::{ListUse, Renderer, TableImages};
use welkin::sky::Sky;
use welkin::{Error, Result};

use super::args::{PictureArgs, SceneArgs, Size};
use super::progress::note;
use super::tables::TableSet;
use super::{places, validation};

/// The device in use.
pub struct Device(Standalone);

impl Device {
    /// Opens the device that the flags name. With `validate`, validation is on where its layer is installed.
    pub fn open(args: &SceneArgs, validate: bool) -> Result<Self> {
        validation::open(args.device.as_deref(), validate).map(Self)
    }

    pub fn frames(&mut self) -> &mut Frames {
        self.0.frames()
    }

    pub fn stats(&self) -> DeviceStats {
        let capabilities = self.0.gpu().capabilities();
        DeviceStats {
            name: capabilities.device_name.clone(),
            driver: capabilities.driver.clone(),
            api: capabilities.api.clone(),
        }
    }

    /// Whether the device can composite by `mode`, or a sentence why not.
    pub fn supports(&self, mode: Blend) -> Result<(), String> {
        supports(mode, self.0.gpu().capabilities())
    }

    /// Messages of the validation layer so far; none without the layer. Each is also written to standard error.
    pub fn validation_messages(&self) -> Option<u64> {
        let messages = self.0.messages()?.all();
        messages.iter().for_each(|message| note(&format!("validation: {message}")));
        Some(messages.len() as u64)
    }
}

/// A frame and what is known about it.
pub struct Frame {
    pub picture: Picture,
    pub times: Times,
    pub particles: ParticleStats,
    pub capacity: BTreeMap<String, CapacityStats>,
}

/// Times of a frame.
pub struct Times {
    pub passes: Vec<PassStats>,
    /// Of all passes [ms]; none on a device without timestamps.
    pub gpu_ms: Option<f64>,
    pub wall_ms: f64,
}

/// How often a frame is recorded again because a list was too small. Lists grow to twice what was wanted of them, but a
/// list that was cut short may hide what the next one needs: one turn per list, and one to spare.
const MAX_TURNS: usize = 8;

/// A renderer for one scene.
pub struct Session {
    renderer: Renderer,
    tables: Option<TableSet>,
    /// Stands in for tables that nothing reads.
    unused: Image,
    scene: Buffer,
    picture: Buffer,
    size: Size,
    precision: Precision,
}

impl Session {
    pub fn open(device: &mut Device, params: &Params, args: &PictureArgs) -> Result<Self> {
        let size = args.size;
        let frames = device.0.frames();
        let gpu = frames.gpu().clone();
        let renderer = Renderer::new(&gpu, params, [size.width, size.height], frames.slots())?;
        let tables = if Sky::needs_tables(params) {
            let cache = places::cache(args.scene.cache.as_deref())?;
            Some(TableSet::obtain(frames, params, args.tables, &cache, args.scene.device.as_deref())?)
        } else {
            None
        };
        let unused = ImageDesc {
            name: "unused table",
            extent: [1, 1, 2],
            format: ash::vk::Format::R16G16_SFLOAT,
            usage: ash::vk::ImageUsageFlags::SAMPLED,
        };
        let pixels = u64::from(size.width) * u64::from(size.height);
        let precision = params.quality.precision;
        Ok(Self {
            renderer,
            tables,
            unused: Image::new(&gpu, &unused)?,
            scene: Buffer::new(&gpu, "scene readback", pixels * scene_texel_bytes(precision), BufferKind::Readback)?,
            picture: Buffer::new(&gpu, "picture readback", pixels * 8, BufferKind::Readback)?,
            size,
            precision,
        })
    }

    pub fn blend(&self) -> BlendStats {
        let choice = self.renderer.choice();
        BlendStats {
            requested: choice.requested.to_string(),
            used: choice.used.to_string(),
            reason: choice.reason.clone(),
        }
    }

    pub fn tables(&self) -> Option<TableStats> {
        self.tables.as_ref().map(|set| set.stats().clone())
    }

    /// Renders a frame and reads it back.
    pub fn frame(&mut self, device: &mut Device, params: &Params) -> Result<Frame> {
        let (slot, times) = self.run(device, params, true)?;
        let counters = self.renderer.counters(slot);
        let capacity = self.renderer.lists(slot).into_iter().map(|list| {
            (list.name.to_owned(), CapacityStats { needed: list.needed.into(), capacity: list.capacity.into() })
        });
        Ok(Frame {
            picture: self.read_picture(),
            times,
            particles: ParticleStats {
                cells: counters.cells.into(),
                valid_cells: counters.valid_cells.into(),
                generated: counters.generated.into(),
                visible: counters.visible.into(),
            },
            capacity: capacity.collect(),
        })
    }

    /// Renders a frame for its times alone.
    pub fn time_frame(&mut self, device: &mut Device, params: &Params) -> Result<Times> {
        Ok(self.run(device, params, false)?.1)
    }

    pub fn memory_bytes(&self, device: &Device) -> u64 {
        device.0.gpu().memory_use().bytes
    }

    /// Renders a frame, again where a list was too small; its slot and times.
    fn run(&mut self, device: &mut Device, params: &Params, read: bool) -> Result<(usize, Times)> {
        let started = Instant::now();
        self.renderer.set_time(params.animation.time)?;
        self.renderer.set_sun(params.sun.position)?;
        let frames = device.0.frames();
        let gpu = frames.gpu().clone();
        if let Some(set) = &mut self.tables {
            set.improve(frames)?;
        }
        let unused = TableImages { optical_depth: &self.unused, scattering: &self.unused, fill: 1.0 };
        let tables = self.tables.as_ref().map(TableSet::tables).map_or(unused, |tables| TableImages {
            optical_depth: tables.optical_depth.image(),
            scattering: tables.scattering.image(),
            fill: tables.fill(),
        });
        let mut last = 0;
        for _ in 0..MAX_TURNS {
            let (slot, ()) = frames.submit(|rec| {
                self.renderer.record(rec, &params.camera, tables)?;
                if read {
                    let film = self.renderer.film();
                    for (image, buffer) in [(&film.scene, &self.scene), (&film.picture, &self.picture)] {
                        rec.copy_image_to_buffer(image, buffer);
                        rec.make_visible_to_host(buffer);
                    }
                }
                Ok(())
            })?;
            frames.wait()?;
            if !self.renderer.finish(&gpu, slot)? {
                let times = frames.state().times(slot).into_iter();
                let passes: Vec<_> =
                    times.map(|pass| PassStats { name: pass.name.into(), gpu_ms: to_ns(pass.gpu_ms) }).collect();
                let gpu_ms = (!passes.is_empty()).then(|| to_ns(passes.iter().map(|pass| pass.gpu_ms).sum()));
                let wall_ms = to_ns(started.elapsed().as_secs_f64() * 1000.0);
                return Ok((slot, Times { passes, gpu_ms, wall_ms }));
            }
            frames.state().forget();
            last = slot;
        }
        Err(too_small(&self.renderer.lists(last)))
    }

    /// The picture in the readback buffers.
    fn read_picture(&self) -> Picture {
        let pixels = self.size.width as usize * self.size.height as usize;
        let scene: Vec<[f32; 4]> = match self.precision {
            Precision::F32 => self.scene.read(0, pixels),
            Precision::F16 => {
                let texels: Vec<[half::f16; 4]> = self.scene.read(0, pixels);
                texels.into_iter().map(|texel| texel.map(half::f16::to_f32)).collect()
            }
        };
        let display: Vec<[u16; 4]> = self.picture.read(0, pixels);
        Picture {
            width: self.size.width,
            height: self.size.height,
            radiance: scene.iter().map(|&[r, g, b, _]| [r, g, b]).collect(),
            transmittance: Some(scene.iter().map(|&[.., t]| t).collect()),
            display: display.into_iter().map(|[r, g, b, _]| [r, g, b].map(|v| f32::from(v) / 65_535.0)).collect(),
        }
    }
}

/// Milliseconds without the digits beyond a nanosecond, which no clock has.
fn to_ns(milliseconds: f64) -> f64 {
    (milliseconds * 1.0e6).round() / 1.0e6
}

fn scene_texel_bytes(precision: Precision) -> u64 {
    match precision {
        Precision::F16 => 8,
        Precision::F32 => 16,
    }
}

/// The error for lists that never grew enough.
fn too_small(lists: &[ListUse]) -> Error {
    let fill = |list: &ListUse| f64::from(list.needed) / f64::from(list.capacity.max(1));
    let worst = lists.iter().max_by(|a, b| fill(a).total_cmp(&fill(b)));
    let (list, needed, capacity) = worst.map_or(("particles", 0, 0), |l| (l.name, l.needed, l.capacity));
    Error::Capacity { list, needed: needed.into(), capacity: capacity.into() }
}
