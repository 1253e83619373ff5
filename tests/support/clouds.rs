//! A small grid of clouds on the device, for the oracle tests of the stages that make and light particles.

use bytemuck::Pod;
use welkin::compact::Compact;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, Recorder};
use welkin::grid::{CounterReadback, Counters, Grid, GridDesign, GridParams, ParticleSet};
use welkin::lighting::tables::Occlusion;
use welkin::params::{Animation, Clouds, Coverage, Quality};
use welkin::shared::FrameParams;
use welkin::tiling::{Slab, Tiling, TilingParams};

/// Earth's radius [m].
pub const PLANET: f64 = 6.36e6;

/// A device with validation; every test ends with [`silent`].
pub fn open() -> Standalone {
    Standalone::new(Options { validation: true, ..Options::default() }).expect("a device with validation")
}

/// Asserts that validation had nothing to say.
pub fn silent(device: &Standalone) {
    assert_eq!(device.messages().expect("opened with validation").all(), Vec::<String>::new());
}

/// Edge of the voxels in which light diffuses [m]: smaller than particles, so that it counts.
pub const VOXEL: f32 = 50.0;

/// Scene and sizes of a test: small rings, everything else as by default.
pub struct Setup {
    pub clouds: Clouds,
    pub quality: Quality,
    pub camera: [f64; 3],
    pub origin: [f64; 3],
    pub to_sun: [f64; 3],
    pub animation: Animation,
}

impl Default for Setup {
    fn default() -> Self {
        let clouds = Clouds { coverage: Coverage::Uniform(0.5), particle_cutoff: 4.0e4, ..Clouds::default() };
        let quality = Quality { cells: 56, rings: 4, layers: 4, ..Quality::default() };
        let (elevation, azimuth) = (35.0f64.to_radians(), 150.0f64.to_radians());
        let to_sun = [elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos()];
        // Far from the world's origin, where f32 positions would have steps of 8 mm.
        let (camera, origin) = ([103_210.4, 500.0, -71_003.7], [103_000.0, 0.0, -71_000.0]);
        Self { clouds, quality, camera, origin, to_sun, animation: Animation::default() }
    }
}

impl Setup {
    pub fn design(&self) -> GridDesign {
        GridDesign::new(&self.clouds, &self.quality, PLANET).leaning(&self.animation)
    }

    pub fn grid_params(&self) -> GridParams {
        self.design().frame_at(self.camera, self.origin, &self.animation.clouds())
    }

    pub fn tiling_params(&self) -> TilingParams {
        let design = self.design();
        let half_widths = design.level_half_widths();
        let slab = Slab {
            centre: [0, 1, 2].map(|i| self.camera[i] - self.origin[i]),
            base: f64::from(self.clouds.altitude),
            thickness: f64::from(self.clouds.thickness),
            half_widths: &half_widths,
            greatest_extent: design.greatest_extent(),
            planet_radius: PLANET,
        };
        TilingParams::new(self.to_sun, &slab, self.clouds.sigma_t * 0.5)
    }

    /// A view along +x, a little upwards.
    pub fn frame(&self) -> FrameParams {
        let (sin, cos) = 0.2f32.sin_cos();
        let mut frame: FrameParams = bytemuck::Zeroable::zeroed();
        frame.camera = [0, 1, 2].map(|i| (self.camera[i] - self.origin[i]) as f32);
        frame.tan_half_fov_y = 0.577_350_3;
        frame.aspect = 16.0 / 9.0;
        (frame.right, frame.up, frame.forward) = ([0.0, 0.0, 1.0], [-sin, cos, 0.0], [cos, sin, 0.0]);
        frame
    }
}

/// The stages, on one device.
pub struct Stages {
    pub grid: Grid,
    pub set: ParticleSet,
    pub compact: Compact,
    pub tiling: Tiling,
    pub lighting: Occlusion,
    pub counters: CounterReadback,
}

impl Stages {
    pub fn new(device: &Standalone, setup: &Setup) -> Self {
        Self::with_capacity(device, setup, setup.design().particle_estimate())
    }

    pub fn with_capacity(device: &Standalone, setup: &Setup, particles: u32) -> Self {
        let (gpu, slots) = (device.gpu(), 2);
        let set = ParticleSet::new(gpu, particles).unwrap();
        Self {
            grid: Grid::new(gpu, &setup.design(), &setup.clouds.coverage, slots).unwrap(),
            compact: Compact::new(gpu, set.capacity()).unwrap(),
            tiling: Tiling::new(gpu, setup.quality.rings, set.capacity(), 1 << 22, slots).unwrap(),
            lighting: Occlusion::new(gpu, set.capacity()).unwrap(),
            counters: CounterReadback::new(gpu, slots).unwrap(),
            set,
        }
    }

    /// Runs all stages once and gives the counters.
    pub fn run(&self, device: &mut Standalone, setup: &Setup) -> Counters {
        let frame = setup.frame();
        let planes = welkin::compact::frustum_planes(&frame);
        let slot = device
            .frames()
            .run(|rec: &mut Recorder<'_>| {
                rec.pass("grid", |rec| self.grid.record(rec, &setup.grid_params(), &self.set))?;
                rec.pass("compact", |rec| self.compact.record(rec, &self.set, &planes, frame.camera))?;
                rec.pass("tiling", |rec| self.tiling.record(rec, &setup.tiling_params(), &self.set))?;
                rec.pass("lighting", |rec| {
                    self.lighting.record(rec, &self.tiling, &self.set, Some(&self.grid), &setup.clouds, VOXEL)
                })?;
                self.counters.record(rec, &self.set);
                Ok(rec.slot())
            })
            .unwrap();
        self.counters.read(slot)
    }
}

/// The first `count` elements of a device buffer.
pub fn read<T: Pod>(device: &mut Standalone, buffer: &Buffer, count: u32) -> Vec<T> {
    let bytes = u64::from(count) * size_of::<T>() as u64;
    let readback = Buffer::new(device.gpu(), "test readback", bytes, BufferKind::Readback).unwrap();
    device
        .frames()
        .run(|rec| {
            rec.copy_buffer(buffer, &readback, bytes);
            rec.make_visible_to_host(&readback);
            Ok(())
        })
        .unwrap();
    readback.read(0, count as usize)
}
