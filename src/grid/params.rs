//! The grid's geometry for one frame, and its twin on the device (`glsl/grid/params.glsl`).

use bytemuck::{Pod, Zeroable};

use crate::density::{self, Wavelengths};
use crate::params::{Clouds, Coverage, Quality};
use crate::reference::density::FieldFrequencies;
use crate::shared::assert_layout;

/// Rings that the device's struct holds.
pub const RING_CAPACITY: usize = 8;
/// Layers of one column at most: the layer index of a particle has five bits.
pub const LAYER_CAPACITY: u32 = 24;
/// Thickness that a preset's layers fill [m] (the authors' scene); a thicker layer of cloud takes more of them.
pub const REFERENCE_THICKNESS: f32 = 700.0;
/// Cells over which two rings blend, on each side.
pub const OVERLAP: u32 = 4;

/// What the grid stages need of a frame (`glsl/grid/params.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GridParams {
    /// Absolute index (x, z) of each ring's first cell; layers at full thickness; position steps per cell edge.
    pub ring_first: [[i32; 4]; RING_CAPACITY],
    /// Corner (x, z) of that cell [m, floating origin]; cell edge [m]; 1 / edge.
    pub ring_frame: [[f32; 4]; RING_CAPACITY],
    /// Layer step [m]; 1 / step; unused.
    pub ring_layer: [[f32; 4]; RING_CAPACITY],
    /// Field value above which a share i/64 of the world lies.
    pub threshold: [[f32; 4]; 17],
    /// Camera [m, floating origin].
    pub camera: [f32; 3],
    /// Cloud base above sea level [m].
    pub altitude: f32,
    /// Highest column [m].
    pub thickness: f32,
    /// 1 / cut-off² [1/m²].
    pub inverse_cutoff_squared: f32,
    /// 1 / (2 · planet radius) [1/m]; 0 is a flat world.
    pub inverse_diameter: f32,
    /// Share of the area that is covered, 0 to 1.
    pub coverage: f32,
    /// Frequency of the heaps; see [`FieldFrequencies`].
    pub frequency_heap: i32,
    /// Frequency of the outline.
    pub frequency_billow: i32,
    /// Frequency of the turrets.
    pub frequency_turret: i32,
    /// Frequency of the streaks.
    pub frequency_streak: i32,
    /// Frequency of the weather.
    pub frequency_region: i32,
    /// Texels of the coverage image per position step, in 2⁻³².
    pub frequency_map: i32,
    /// Position step of the centre of the coverage image's first texel, x.
    pub map_first_x: i32,
    /// The same, z.
    pub map_first_z: i32,
    /// Columns of the coverage image; 0: none.
    pub map_width: u32,
    /// Rows of the coverage image.
    pub map_height: u32,
    /// Rings in use.
    pub ring_count: u32,
    /// Cells along a ring's edge.
    pub ring_dim: u32,
    /// Seed of the scene.
    pub seed: u32,
    /// Particles that the list holds.
    pub particle_capacity: u32,
    /// Cells that the list of valid ones holds.
    pub valid_cell_capacity: u32,
    /// Relative density of a full particle.
    pub density: f32,
}

assert_layout!(GridParams, grid_params, {
    ring_first: RING_FIRST, ring_frame: RING_FRAME, ring_layer: RING_LAYER, threshold: THRESHOLD, camera: CAMERA,
    altitude: ALTITUDE, thickness: THICKNESS, inverse_cutoff_squared: INVERSE_CUTOFF_SQUARED,
    inverse_diameter: INVERSE_DIAMETER, coverage: COVERAGE, frequency_heap: FREQUENCY_HEAP,
    frequency_billow: FREQUENCY_BILLOW, frequency_turret: FREQUENCY_TURRET, frequency_streak: FREQUENCY_STREAK,
    frequency_region: FREQUENCY_REGION, frequency_map: FREQUENCY_MAP, map_first_x: MAP_FIRST_X,
    map_first_z: MAP_FIRST_Z, map_width: MAP_WIDTH, map_height: MAP_HEIGHT, ring_count: RING_COUNT,
    ring_dim: RING_DIM, seed: SEED, particle_capacity: PARTICLE_CAPACITY, valid_cell_capacity: VALID_CELL_CAPACITY,
    density: DENSITY,
});

impl GridParams {
    /// The field's frequencies.
    #[must_use]
    pub fn frequencies(&self) -> FieldFrequencies {
        FieldFrequencies {
            heap: self.frequency_heap,
            billow: self.frequency_billow,
            turret: self.frequency_turret,
            streak: self.frequency_streak,
            region: self.frequency_region,
        }
    }

    /// Cells of all rings.
    #[must_use]
    pub fn cell_count(&self) -> u32 {
        self.ring_count * self.ring_dim * self.ring_dim
    }
}

/// Everything about the grid that does not change while the camera moves.
#[derive(Clone, Debug)]
pub struct GridDesign {
    fixed: GridParams,
    /// Edge of a ring-0 cell [m].
    cell_edge: f64,
}

/// Position steps per edge of a ring-0 cell: 1.4 m for the medium preset. Even, so that a cell's centre is a step.
const STEPS_PER_CELL: i32 = 128;

impl GridDesign {
    /// Derives the geometry from what the scene asks for. `planet_radius` [m] bends the layer down towards the horizon;
    /// infinity leaves it flat.
    #[must_use]
    pub fn new(clouds: &Clouds, quality: &Quality, planet_radius: f64) -> Self {
        let rings = quality.rings.clamp(1, RING_CAPACITY as u32);
        // The outermost ring, overlap included, reaches the cut-off: 183.8 m for 4 rings of 136 cells and 1e5 m.
        let cutoff = f64::from(clouds.particle_cutoff);
        let cell_edge = 2.0 * cutoff / (f64::from(quality.cells) * f64::from(1u32 << (rings - 1)));
        let step = cell_edge / f64::from(STEPS_PER_CELL);
        let f = Wavelengths::default().frequencies(step);
        let wanted = (quality.layers as f32 * clouds.thickness / REFERENCE_THICKNESS).round();
        let layers = (wanted as u32).clamp(1, LAYER_CAPACITY);

        let mut fixed = GridParams::zeroed();
        for ring in 0..rings as usize {
            // Cells double, so do their particles: half the layers fill the same height.
            let here = (f64::from(layers) / f64::from(1u32 << ring)).round().max(1.0) as i32;
            let layer_step = clouds.thickness / here as f32;
            fixed.ring_first[ring] = [0, 0, here, STEPS_PER_CELL << ring];
            fixed.ring_layer[ring] = [layer_step, 1.0 / layer_step, 0.0, 0.0];
        }
        fixed.threshold = bytemuck::cast(density::coverage_curve(f, step, clouds.seed));
        fixed.altitude = clouds.altitude;
        fixed.thickness = clouds.thickness;
        fixed.inverse_cutoff_squared = 1.0 / (clouds.particle_cutoff * clouds.particle_cutoff);
        fixed.inverse_diameter = (0.5 / planet_radius) as f32;
        (fixed.frequency_heap, fixed.frequency_billow, fixed.frequency_turret) = (f.heap, f.billow, f.turret);
        (fixed.frequency_streak, fixed.frequency_region) = (f.streak, f.region);
        match &clouds.coverage {
            Coverage::Uniform(coverage) => fixed.coverage = *coverage,
            Coverage::Map(map) => {
                // Centred on the world's origin; the first texel's centre lies half a texel inside the corner.
                let texel = f64::from(map.extent) / f64::from(map.width);
                let first = |count: u32| (0.5 - f64::from(count) / 2.0) * texel / step;
                fixed.frequency_map = density::frequency(texel, step);
                (fixed.map_first_x, fixed.map_first_z) = (first(map.width) as i32, first(map.height) as i32);
                (fixed.map_width, fixed.map_height) = (map.width, map.height);
            }
        }
        fixed.ring_count = rings;
        fixed.ring_dim = quality.cells;
        fixed.seed = clouds.seed;
        fixed.density = 1.0;
        Self { fixed, cell_edge }
    }

    /// Cells of all rings.
    #[must_use]
    pub fn cell_count(&self) -> u32 {
        self.fixed.cell_count()
    }

    /// Particles of a frame, if every cell were full.
    #[must_use]
    pub fn particle_bound(&self) -> u32 {
        let per_ring = self.fixed.ring_dim * self.fixed.ring_dim;
        let layers: i32 = (0..self.fixed.ring_count as usize).map(|ring| self.fixed.ring_first[ring][2]).sum();
        per_ring.saturating_mul(layers as u32)
    }

    /// Room for particles to begin with: columns are about half full, and outer rings have a hole. More is grown to.
    #[must_use]
    pub fn particle_estimate(&self) -> u32 {
        let covered = if self.fixed.map_width > 0 { 1.0 } else { self.fixed.coverage };
        (self.particle_bound() as f32 * (0.1 + 0.55 * covered)) as u32 + 1024
    }

    /// Room for valid cells to begin with.
    #[must_use]
    pub fn valid_cell_estimate(&self) -> u32 {
        self.cell_count()
    }

    /// Half the edge [m] of the square around the camera that each ring's particles lie in: what the light tiles of the
    /// ring's level have to cover.
    #[must_use]
    pub fn level_half_widths(&self) -> Vec<f64> {
        // Cells start up to one away from centred, and jitter moves a particle 0.4 cells.
        let cells = f64::from(self.fixed.ring_dim / 2) + 0.5;
        (0..self.fixed.ring_count).map(|ring| cells * self.cell_edge * f64::from(1u32 << ring)).collect()
    }

    /// No particle reaches farther from its centre than this [m].
    #[must_use]
    pub fn greatest_extent(&self) -> f32 {
        // shape.glsl: 0.74 cells across, × 1.2 size, × 1.12; or as tall as a layer: 0.5 / 0.9 × 1.25 steps.
        let last = self.fixed.ring_count as usize - 1;
        let across = self.cell_edge as f32 * (1u32 << last) as f32 * (0.74 * 1.2 * 1.12);
        let tall = (0..=last).map(|ring| self.fixed.ring_layer[ring][0]).fold(0.0, f32::max) * (0.5 / 0.9 * 1.25);
        across.max(tall) * 1.01
    }

    /// The grid around `camera`, relative to `origin` (both absolute [m]). Capacities are filled in by [`Grid::record`].
    ///
    /// [`Grid::record`]: super::Grid::record
    #[must_use]
    pub fn frame(&self, camera: [f64; 3], origin: [f64; 3]) -> GridParams {
        let mut params = self.fixed;
        let half = f64::from(params.ring_dim / 2);
        for ring in 0..params.ring_count as usize {
            let edge = self.cell_edge * f64::from(1u32 << ring);
            let first = [camera[0], camera[2]].map(|axis| (axis / edge).floor() - half);
            params.ring_first[ring][0] = first[0] as i32;
            params.ring_first[ring][1] = first[1] as i32;
            let corner = [first[0] * edge - origin[0], first[1] * edge - origin[2]];
            params.ring_frame[ring] = [corner[0] as f32, corner[1] as f32, edge as f32, (1.0 / edge) as f32];
        }
        params.camera = [0, 1, 2].map(|axis| (camera[axis] - origin[axis]) as f32);
        params
    }
}
