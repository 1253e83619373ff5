//! Source `particles`: an explicit list, in one place of a flat world.

use std::sync::Arc;

use super::{Layer, ParticleSource, Place, Spread};
use crate::Result;
use crate::gpu::{Gpu, Recorder};
use crate::grid::{ParticleList, ParticleSet};
use crate::params::{Animation, ParticleDesc};

pub(super) struct ListSource {
    list: ParticleList,
    /// Least and greatest corner of all particles [m].
    bounds: [[f64; 3]; 2],
    greatest_extent: f32,
    /// Time for which the list was given [s].
    since: f64,
}

impl ListSource {
    pub(super) fn new(gpu: &Arc<Gpu>, particles: &[ParticleDesc], since: f64, slots: usize) -> Result<Self> {
        let list = ParticleList::new(gpu, particles, slots)?;
        let (bounds, greatest_extent) = (list.bounds(), list.greatest_extent());
        Ok(Self { list, bounds, greatest_extent, since })
    }
}

impl ParticleSource for ListSource {
    fn capacity(&self) -> u32 {
        self.list.count()
    }

    fn levels(&self) -> u32 {
        1
    }

    fn middle(&self, _: [f64; 3]) -> [f64; 3] {
        let [least, greatest] = self.bounds;
        std::array::from_fn(|axis| 0.5 * (least[axis] + greatest[axis]))
    }

    fn spread(&self) -> Spread {
        let [least, greatest] = self.bounds;
        Spread::Heap {
            extent: std::array::from_fn(|axis| greatest[axis] - least[axis]),
            greatest: f64::from(self.greatest_extent),
        }
    }

    fn base(&self) -> f32 {
        self.bounds[0][1] as f32
    }

    fn layer(&self, place: &Place) -> Layer {
        let [least, greatest] = self.bounds;
        Layer {
            centre: place.relative(self.middle(place.centre)),
            base: least[1] - place.origin[1],
            thickness: greatest[1] - least[1],
            half_widths: vec![(0.5 * (greatest[0] - least[0])).max(0.5 * (greatest[2] - least[2]))],
            greatest_extent: self.greatest_extent,
            planet_radius: f64::INFINITY,
        }
    }

    fn set_time(&mut self, animation: &Animation) {
        self.list.set_motion(animation.time - self.since, animation.mean_wind());
        self.bounds = self.list.bounds();
    }

    fn record(&mut self, rec: &mut Recorder<'_>, place: &Place, set: &ParticleSet) -> Result<()> {
        self.list.record(rec, place.origin, set)
    }
}
