//! The grid's geometry for one frame, and its twin on the device (`glsl/grid/params.glsl`).

use bytemuck::{Pod, Zeroable};

use crate::density::{self, Wavelengths};
use crate::params::{Animation, CloudMotion, Clouds, Coverage, Quality, WIND_LAYERS};
use crate::reference::density::FieldFrequencies;
use crate::shared::assert_layout;

/// Rings that the device's struct holds.
pub const RING_CAPACITY: usize = crate::shared::constants::grid_params_glsl::RING_CAPACITY as usize;
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
    /// Layer step [m]; 1 / step; share of fine detail that cells of this size resolve; unused.
    pub ring_layer: [[f32; 4]; RING_CAPACITY],
    /// Field value above which a share i/64 of the world lies.
    pub threshold: [[f32; 4]; 17],
    /// How far columns lean at even heights from base to top, x and z, two to a vector [m].
    pub lean: [[f32; 4]; 4],
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
    /// Texels of the coverage image per position step, in 2⁻³², times the cosine of its rotation.
    pub frequency_map_along: i32,
    /// The same, times the sine.
    pub frequency_map_across: i32,
    /// Position step of the coverage image's centre, x.
    pub map_centre_x: i32,
    /// The same, z.
    pub map_centre_z: i32,
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
    /// Phase of the noises, 2⁻²⁴ lives: [`FieldFrequencies::phase`].
    pub phase: u32,
    /// The same of streaks and weather.
    pub weather_phase: u32,
    /// 1: columns grow and dissolve, and do so without a jump.
    pub evolving: u32,
    /// Heights that have a lean; 0: upright.
    pub lean_count: u32,
    /// Fills up to a multiple of 16 bytes.
    pub reserved: [u32; 3],
}

assert_layout!(GridParams, grid_params, {
    ring_first: RING_FIRST, ring_frame: RING_FRAME, ring_layer: RING_LAYER, threshold: THRESHOLD, lean: LEAN, camera: CAMERA,
    altitude: ALTITUDE, thickness: THICKNESS, inverse_cutoff_squared: INVERSE_CUTOFF_SQUARED,
    inverse_diameter: INVERSE_DIAMETER, coverage: COVERAGE, frequency_heap: FREQUENCY_HEAP,
    frequency_billow: FREQUENCY_BILLOW, frequency_turret: FREQUENCY_TURRET, frequency_streak: FREQUENCY_STREAK,
    frequency_region: FREQUENCY_REGION, frequency_map_along: FREQUENCY_MAP_ALONG,
    frequency_map_across: FREQUENCY_MAP_ACROSS, map_centre_x: MAP_CENTRE_X, map_centre_z: MAP_CENTRE_Z, map_width: MAP_WIDTH, map_height: MAP_HEIGHT, ring_count: RING_COUNT,
    ring_dim: RING_DIM, seed: SEED, particle_capacity: PARTICLE_CAPACITY, valid_cell_capacity: VALID_CELL_CAPACITY,
    density: DENSITY, phase: PHASE, weather_phase: WEATHER_PHASE, evolving: EVOLVING, lean_count: LEAN_COUNT,
    reserved: RESERVED_A,
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
            phase: self.phase,
            weather_phase: self.weather_phase,
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
    /// How far a column leans at most, per axis [m].
    greatest_lean: f64,
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
            // Turrets are 900 m apart and the outline's second octave 650 m: a few cells show them well, cells as large
            // as that would sample noise, and the far field would fall apart into dots.
            let resolved = (300.0 / (cell_edge * f64::from(1u32 << ring))).min(1.0) as f32;
            fixed.ring_first[ring] = [0, 0, here, STEPS_PER_CELL << ring];
            fixed.ring_layer[ring] = [layer_step, 1.0 / layer_step, resolved, 0.0];
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
                let texel = f64::from(map.extent) / f64::from(map.width);
                let frequency = f64::from(density::frequency(texel, step));
                let (sin, cos) = map.rotation.to_radians().sin_cos();
                fixed.frequency_map_along = (frequency * cos).round() as i32;
                fixed.frequency_map_across = (frequency * sin).round() as i32;
                [fixed.map_centre_x, fixed.map_centre_z] = map.offset.map(|metres| (metres / step).round() as i32);
                (fixed.map_width, fixed.map_height) = (map.width, map.height);
            }
        }
        fixed.ring_count = rings;
        fixed.ring_dim = quality.cells;
        fixed.seed = clouds.seed;
        fixed.density = 1.0;
        Self { fixed, cell_edge, greatest_lean: 0.0 }
    }

    /// The same with columns that lean in the shear of `animation`'s wind.
    #[must_use]
    pub fn leaning(mut self, animation: &Animation) -> Self {
        let lean = animation.lean();
        self.fixed.lean_count = lean.len().min(WIND_LAYERS) as u32;
        for (at, lean) in lean.iter().take(WIND_LAYERS).enumerate() {
            self.fixed.lean[at / 2][at % 2 * 2] = lean[0] as f32;
            self.fixed.lean[at / 2][at % 2 * 2 + 1] = lean[1] as f32;
            self.greatest_lean = self.greatest_lean.max(lean[0].abs()).max(lean[1].abs());
        }
        self
    }

    /// Edge of a cell of the innermost ring [m].
    #[must_use]
    pub fn cell_edge(&self) -> f64 {
        self.cell_edge
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
        per_ring.saturating_mul(layers as u32 + 2 * self.fixed.ring_count) // two puffs a cell
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
        (0..self.fixed.ring_count)
            .map(|ring| cells * self.cell_edge * f64::from(1u32 << ring) + self.greatest_lean)
            .collect()
    }

    /// No particle reaches farther from its centre than this [m].
    #[must_use]
    pub fn greatest_extent(&self) -> f32 {
        // shape.glsl: 1.2 cells across, × 1.62 size in the last ring, 2.12 in ring 0, × 1.12; upwards × 1.15 of 0.8 times that, or of 0.62 steps.
        let last = self.fixed.ring_count as usize - 1;
        let across = self.cell_edge as f32 * (1u32 << last) as f32 * (1.2 * if last == 0 { 2.12 } else { 1.62 } * 1.12);
        let tall = (0..=last).map(|ring| self.fixed.ring_layer[ring][0]).fold(0.0, f32::max) * (0.62 * 1.15);
        across.max(tall) * 1.01
    }

    /// The grid around `camera`, relative to `origin` (both absolute [m]). Capacities are filled in by [`Grid::record`].
    ///
    /// [`Grid::record`]: super::Grid::record
    #[must_use]
    pub fn frame(&self, camera: [f64; 3], origin: [f64; 3]) -> GridParams {
        self.frame_at(camera, origin, &CloudMotion::default())
    }

    /// The same for clouds that have come as far as `motion`. The wind carries the cells along, so that what drifts is what
    /// a camera sees that moves the other way: no cell is classified anew, and none can pop.
    #[must_use]
    pub fn frame_at(&self, camera: [f64; 3], origin: [f64; 3], motion: &CloudMotion) -> GridParams {
        let mut params = self.fixed;
        (params.phase, params.weather_phase) = (motion.phase(), motion.weather_phase());
        params.evolving = u32::from(motion.evolving);
        let [drift_x, drift_z] = motion.drift;
        let half = f64::from(params.ring_dim / 2);
        for ring in 0..params.ring_count as usize {
            let edge = self.cell_edge * f64::from(1u32 << ring);
            let first = [camera[0] - drift_x, camera[2] - drift_z].map(|axis| (axis / edge).floor() - half);
            params.ring_first[ring][0] = first[0] as i32;
            params.ring_first[ring][1] = first[1] as i32;
            let corner = [first[0] * edge - (origin[0] - drift_x), first[1] * edge - (origin[2] - drift_z)];
            params.ring_frame[ring] = [corner[0] as f32, corner[1] as f32, edge as f32, (1.0 / edge) as f32];
        }
        params.camera = [0, 1, 2].map(|axis| (camera[axis] - origin[axis]) as f32);
        params
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::grid::{cell_place, generate, ring_weight};
    use crate::shared::Particle;
    use std::collections::HashMap;

    fn design(quality: Quality) -> GridDesign {
        GridDesign::new(&Clouds::default(), &quality, 6.36e6)
    }

    #[test]
    fn the_medium_preset_has_the_authors_cells() {
        let params = design(Quality::default()).frame([0.0; 3], [0.0; 3]);
        assert!((params.ring_frame[0][2] - 183.8).abs() < 0.05);
        assert_eq!(params.cell_count(), 4 * 136 * 136);
        assert_eq!([0, 1, 2, 3].map(|ring| params.ring_first[ring][2]), [4, 2, 1, 1]);
    }

    #[test]
    fn a_thicker_layer_of_cloud_takes_more_layers_of_particles() {
        let clouds = Clouds { thickness: 2100.0, ..Clouds::default() };
        let params = GridDesign::new(&clouds, &Quality::default(), f64::INFINITY).frame([0.0; 3], [0.0; 3]);
        assert_eq!(params.ring_first[0][2], 12);
        assert!((params.ring_layer[0][0] - 175.0).abs() < 0.1);
    }

    #[test]
    fn the_rings_weights_add_up_to_one_everywhere() {
        let params = design(Quality::default()).frame([1234.5, 0.0, -987.6], [1024.0, 0.0, -1024.0]);
        for i in 0..2000 {
            // A spiral out to 85 km: the cut-off's own fade begins at 89.
            let (r, angle) = (f64::from(i) * 42.5, f64::from(i) * 2.4);
            let place =
                [params.camera[0] + (r * f64::cos(angle)) as f32, params.camera[2] + (r * f64::sin(angle)) as f32];
            let sum: f32 = (0..4).map(|ring| ring_weight(place, ring, &params)).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{place:?}: {sum}"); // f32 rounding
        }
    }

    #[test]
    fn every_cell_that_a_ring_still_shows_exists_wherever_the_camera_is_in_its_cell() {
        for offset in [0.0, 0.3, 0.999] {
            let design = design(Quality { cells: 24, rings: 3, ..Quality::default() });
            let edge = design.cell_edge;
            let params = design.frame([offset * edge, 0.0, -offset * edge], [0.0; 3]);
            // One cell beyond the border of every ring but the last, nothing may be left to show.
            for cell in 0..2 * 24 * 24 {
                let place = cell_place(cell, &params);
                let edge = params.ring_frame[place.ring as usize][2];
                let outwards = place.local.map(|i| {
                    if i == 0 {
                        -edge
                    } else if i == 23 {
                        edge
                    } else {
                        0.0
                    }
                });
                if outwards != [0.0; 2] {
                    let beyond = [place.centre[0] + outwards[0], place.centre[1] + outwards[1]];
                    assert!(ring_weight(beyond, place.ring, &params) < 1e-6, "{place:?}");
                }
            }
        }
    }

    /// Particles by identity, absolute.
    fn world(params: &GridParams, origin: [f64; 3]) -> HashMap<u32, (Particle, [f64; 3])> {
        let grid = generate(params, &[]);
        let absolute = |p: &Particle| [0, 1, 2].map(|i| f64::from(p.centre[i]) + origin[i]);
        // Ring 1 is left out: its columns sink a little as they become cores of ring 0's.
        let in_ring_1 = |packed: u32| (packed >> 5) / (params.ring_dim * params.ring_dim) == 1;
        let others = grid.particles.iter().zip(&grid.cell_and_layer).filter(|(_, packed)| !in_ring_1(**packed));
        others.map(|(p, _)| (p.id, (*p, absolute(p)))).collect()
    }

    #[test]
    fn particles_stay_where_they_are_when_the_camera_and_the_origin_move() {
        let clouds = Clouds { particle_cutoff: 2.0e4, ..Clouds::default() };
        // Flat: on a globe the horizon, and with it the layer's drop, goes with the camera.
        let design = GridDesign::new(&clouds, &Quality { cells: 40, ..Quality::default() }, f64::INFINITY);
        let before = world(&design.frame([100_000.0, 0.0, 50.0], [99_328.0, 0.0, 0.0]), [99_328.0, 0.0, 0.0]);
        let after =
            world(&design.frame([100_777.0, 0.0, -900.0], [100_352.0, 0.0, -1024.0]), [100_352.0, 0.0, -1024.0]);
        let mut same = 0;
        for (id, (particle, place)) in &before {
            let Some((other, other_place)) = after.get(id) else { continue };
            same += 1;
            // f32 positions of up to 2e4 m: steps of 2 mm, five operations.
            assert!((0..3).all(|i| (place[i] - other_place[i]).abs() < 0.01), "{place:?} {other_place:?}");
            assert_eq!(particle.rotation, other.rotation);
            assert_eq!(particle.density, other.density);
        }
        assert!(same > before.len() / 2, "{same} of {}", before.len());
    }

    #[test]
    fn clouds_stand_on_a_flat_base_and_narrow_upwards() {
        let params = design(Quality::default()).frame([0.0; 3], [0.0; 3]);
        let grid = generate(&params, &[]);
        let above = |p: &Particle| {
            let (x, z) = (p.centre[0] - params.camera[0], p.centre[2] - params.camera[2]);
            p.centre[1] - (params.altitude - (x * x + z * z) * params.inverse_diameter)
        };
        let (mut low, mut high) = ((0, 0.0f32), (0, 0.0f32));
        for (particle, packed) in grid.particles.iter().zip(&grid.cell_and_layer) {
            let shape = grid.shapes[(packed >> 5) as usize];
            let height = above(particle);
            assert!((-20.0..params.thickness * 1.3).contains(&height), "{height} m above the base");
            if packed & 31 == 0 {
                // Balls of the lowest layer dip below the base by a fifth of their half height and the jitter at most.
                let step = shape.height / shape.layers as f32;
                assert!((0.4 * step..step).contains(&height), "{height} {step}");
            }
            let widest = particle.semi_axes.iter().fold(0.0f32, |a, &b| a.max(b));
            if shape.body == 1.0 && shape.layers >= 3 && packed >> 5 < params.ring_dim * params.ring_dim {
                let of = if packed & 31 == 0 { &mut low } else { &mut high };
                if (packed & 31) + 1 == shape.layers || packed & 31 == 0 {
                    *of = (of.0 + 1, of.1 + widest);
                }
            }
        }
        assert!(low.0 > 1000 && high.0 > 1000);
        assert!(high.1 / high.0 as f32 <= 0.8 * low.1 / low.0 as f32);
        let extent = design(Quality::default()).greatest_extent();
        assert!(grid.particles.iter().all(|p| p.semi_axes.iter().all(|&axis| axis <= extent)));
    }
}
