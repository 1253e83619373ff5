//! Source `grid`: procedural clouds in nested rings of cells around the camera (Yusov 5.2).

use std::sync::Arc;

use super::{Layer, ParticleSource, Place, Spread};
use crate::Result;
use crate::definitions::PLANET_RADIUS;
use crate::gpu::{Gpu, Recorder};
use crate::grid::{Counters, Grid, GridDesign, ParticleSet};
use crate::lists::ListUse;
use crate::params::{Animation, CloudMotion, Params};

pub(super) struct GridSource {
    grid: Grid,
    design: GridDesign,
    spread: Spread,
    base: f64,
    thickness: f64,
    motion: CloudMotion,
}

impl GridSource {
    pub(super) fn new(gpu: &Arc<Gpu>, params: &Params, slots: usize) -> Result<Self> {
        let clouds = &params.clouds;
        let design = GridDesign::new(clouds, &params.quality, PLANET_RADIUS).leaning(&params.animation);
        let (base, thickness) = (f64::from(clouds.altitude), f64::from(clouds.thickness));
        Ok(Self {
            grid: Grid::new(gpu, &design, &clouds.coverage, slots)?,
            spread: Spread::Layer {
                cell: design.cell_edge(),
                cells: params.quality.cells,
                cutoff: f64::from(clouds.particle_cutoff),
                thickness,
            },
            design,
            base,
            thickness,
            motion: params.animation.clouds(),
        })
    }
}

impl ParticleSource for GridSource {
    fn capacity(&self) -> u32 {
        self.design.particle_estimate()
    }

    fn levels(&self) -> u32 {
        self.design.level_half_widths().len() as u32
    }

    fn middle(&self, camera: [f64; 3]) -> [f64; 3] {
        camera
    }

    fn spread(&self) -> Spread {
        self.spread
    }

    fn base(&self) -> f32 {
        self.base as f32
    }

    fn layer(&self, place: &Place) -> Layer {
        Layer {
            centre: place.relative(place.centre),
            base: self.base,
            thickness: self.thickness,
            half_widths: self.design.level_half_widths(),
            greatest_extent: self.design.greatest_extent(),
            planet_radius: PLANET_RADIUS,
        }
    }

    fn set_time(&mut self, animation: &Animation) {
        self.motion = animation.clouds();
    }

    fn record(&mut self, rec: &mut Recorder<'_>, place: &Place, set: &ParticleSet) -> Result<()> {
        self.grid.record(rec, &self.design.frame_at(place.centre, place.origin, &self.motion), set)
    }

    fn cells(&self) -> Option<&Grid> {
        Some(&self.grid)
    }

    fn grow(&mut self, gpu: &Arc<Gpu>, counters: &Counters) -> Result<bool> {
        self.grid.grow(gpu, counters)
    }

    fn lists(&self, counters: &Counters) -> Vec<ListUse> {
        let capacity = self.grid.valid_cell_capacity();
        vec![ListUse { name: "valid_cells", needed: counters.valid_cells, capacity }]
    }
}
