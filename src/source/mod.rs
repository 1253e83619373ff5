//! Where particles come from: one module for each source. A new one touches its own module, [`Source`](crate::params::Source)
//! with its row in [`SOURCES`](crate::params::SOURCES), and `open`.

mod grid;
mod list;

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Gpu, Recorder};
use crate::grid::{Counters, Grid, ParticleSet};
use crate::lists::ListUse;
use crate::params::{Animation, Params, Source};
use crate::tiling::Slab;

/// Where a frame is: the point that its particles are made around, and the floating origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// The camera of the frame's only or main view [m].
    pub centre: [f64; 3],
    /// What positions on the device are relative to [m].
    pub origin: [f64; 3],
}

impl Place {
    /// The place around `centre`. The origin is near it, at sea level, on a lattice of 1024 m: positions relative to it are
    /// small and change rarely.
    pub(crate) fn around(centre: [f64; 3]) -> Self {
        let snap = |x: f64| (x / 1024.0).round() * 1024.0;
        Self { centre, origin: [snap(centre[0]), 0.0, snap(centre[2])] }
    }

    /// `point` relative to the origin.
    pub(crate) fn relative(&self, point: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| point[axis] - self.origin[axis])
    }
}

/// The body of air that the particles of a frame lie in.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layer {
    /// Its middle [m, floating origin].
    pub centre: [f64; 3],
    /// Least height of anything at the centre [m, floating origin].
    pub base: f64,
    /// Greatest height above `base` [m].
    pub thickness: f64,
    /// Half the edge of nested squares around the centre in which particles are alike in size [m], ascending.
    pub half_widths: Vec<f64>,
    /// No particle reaches farther from its centre [m].
    pub greatest_extent: f32,
    /// Of the planet that the layer follows [m]; infinite for a flat world.
    pub planet_radius: f64,
}

impl Layer {
    /// As the light tiles take it.
    pub(crate) fn slab(&self) -> Slab<'_> {
        Slab {
            centre: self.centre,
            base: self.base,
            thickness: self.thickness,
            half_widths: &self.half_widths,
            greatest_extent: self.greatest_extent,
            planet_radius: self.planet_radius,
        }
    }
}

/// How the particles of a source are spread, whatever the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Spread {
    /// Around the camera, many and small.
    Layer {
        /// They stand so far apart in the innermost ring [m].
        cell: f64,
        /// So many in a row.
        cells: u32,
        /// As far as this [m].
        cutoff: f64,
        /// In a layer so high [m].
        thickness: f64,
    },
    /// In one place, of any size.
    Heap {
        /// Width, height and depth [m].
        extent: [f64; 3],
        /// None reaches farther from its centre [m].
        greatest: f64,
    },
}

/// A source of particles.
pub(crate) trait ParticleSource {
    /// Particles to make room for at first.
    fn capacity(&self) -> u32;

    /// Nested squares of [`Layer::half_widths`].
    fn levels(&self) -> u32;

    /// The point around which to make particles for a camera at `camera` [m], where any may be chosen.
    fn middle(&self, camera: [f64; 3]) -> [f64; 3];

    /// How particles are spread.
    fn spread(&self) -> Spread;

    /// Altitude of the lowest clouds [m].
    fn base(&self) -> f32;

    /// The air that the particles lie in.
    fn layer(&self, place: &Place) -> Layer;

    /// Moves on to the time of `animation`.
    fn set_time(&mut self, animation: &Animation);

    /// Makes the particles of a frame.
    fn record(&mut self, rec: &mut Recorder<'_>, place: &Place, set: &ParticleSet) -> Result<()>;

    /// The grid whose cells the particles stand in, if there is one.
    fn cells(&self) -> Option<&Grid> {
        None
    }

    /// Makes room for what a frame with these counts wanted. True if there was too little.
    fn grow(&mut self, _: &Arc<Gpu>, _: &Counters) -> Result<bool> {
        Ok(false)
    }

    /// Its lists, and what a frame with these counts wanted of them.
    fn lists(&self, _: &Counters) -> Vec<ListUse> {
        Vec::new()
    }
}

/// The source that the parameters ask for, with `slots` frames in flight.
///
/// # Errors
/// [`Error::OutOfMemory`](crate::Error::OutOfMemory) and what else Vulkan says.
///
/// # Panics
/// If [`Params::validate`] does not let the source pass.
pub(crate) fn open(gpu: &Arc<Gpu>, params: &Params, slots: usize) -> Result<Box<dyn ParticleSource>> {
    match &params.clouds.source {
        Source::Grid => Ok(Box::new(grid::GridSource::new(gpu, params, slots)?)),
        Source::Particles(particles) => {
            Ok(Box::new(list::ListSource::new(gpu, particles, params.animation.time, slots)?))
        }
        Source::Voxels { .. } => panic!("validation has let a source of voxels pass"),
    }
}
