//! The particles of a scene, on the host.

use crate::gpu::{Buffer, BufferKind, Frames};
use crate::grid::{CounterReadback, ParticleSet};
use crate::params::Params;
use crate::shared::Particle;
use crate::source::{self, Place, Spread};
use crate::{Error, Result};
use glam::{DQuat, DVec3};

/// How often the grid is made again because a list was too small: each list once, and one to spare.
const TURNS: usize = 4;

/// Particles and the origin that their centres are relative to.
pub struct Gathered {
    /// The particles.
    pub particles: Vec<Particle>,
    /// Floating origin [m].
    pub origin: [f64; 3],
    /// Whether there are more, as far as the eye sees: those of a grid.
    pub endless: bool,
}

impl Gathered {
    /// The particles of the scene of `params`: those of an explicit list, or those of the grid around the camera.
    ///
    /// # Errors
    /// [`Error::InvalidParam`] for parameters out of range; errors of the device.
    pub fn new(frames: &mut Frames, params: &Params) -> Result<Self> {
        params.validate()?;
        let (gpu, slots) = (frames.gpu().clone(), frames.slots());
        let mut source = source::open(&gpu, params, slots)?;
        let place = Place::around(source.middle(params.camera.position));
        let endless = matches!(source.spread(), Spread::Layer { .. });
        let mut set = ParticleSet::new(&gpu, source.capacity())?;
        let counters = CounterReadback::new(&gpu, slots)?;
        let mut needed = 0;
        for _ in 0..TURNS {
            let (slot, ()) = frames.submit(|rec| {
                rec.pass("grid", |rec| source.record(rec, &place, &set))?;
                counters.record(rec, &set);
                Ok(())
            })?;
            frames.wait()?;
            let counts = counters.read(slot);
            let grew = set.grow(&gpu, &counts)? | source.grow(&gpu, &counts)?;
            frames.state().forget();
            if !grew {
                return Ok(Self { particles: read(frames, &set, counts.stored)?, origin: place.origin, endless });
            }
            needed = counts.generated;
        }
        Err(Error::Capacity { list: "particles", needed: needed.into(), capacity: set.capacity().into() })
    }

    /// Least and greatest corner of a box around all particles that `wanted` picks by centre [m]; none if it picks none.
    #[must_use]
    pub fn bounds(&self, wanted: impl Fn([f64; 3]) -> bool) -> Option<[[f64; 3]; 2]> {
        let origin = DVec3::from_array(self.origin);
        let boxes = self.particles.iter().filter(|p| p.density * p.fade > 0.0).filter_map(|particle| {
            let centre = DVec3::from_array(particle.centre.map(f64::from)) + origin;
            let rotation = DQuat::from_array(particle.rotation.map(f64::from)).normalize();
            let half = half_extent(rotation, DVec3::from_array(particle.semi_axes.map(f64::from)));
            wanted(centre.to_array()).then_some((centre - half, centre + half))
        });
        boxes
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .map(|(least, greatest)| [least.to_array(), greatest.to_array()])
    }
}

/// Half of the axis-aligned bounding box of a turned ellipsoid.
pub(super) fn half_extent(rotation: DQuat, semi_axes: DVec3) -> DVec3 {
    let axes = [DVec3::X * semi_axes.x, DVec3::Y * semi_axes.y, DVec3::Z * semi_axes.z].map(|axis| rotation * axis);
    axes.iter().map(|axis| axis * axis).sum::<DVec3>().map(f64::sqrt)
}

fn read(frames: &mut Frames, set: &ParticleSet, count: u32) -> Result<Vec<Particle>> {
    let gpu = frames.gpu().clone();
    let bytes = u64::from(count) * size_of::<Particle>() as u64;
    let readback = Buffer::new(&gpu, "particles readback", bytes, BufferKind::Readback)?;
    if count > 0 {
        frames.run(|rec| {
            rec.copy_buffer(set.particles(), &readback, bytes);
            rec.make_visible_to_host(&readback);
            Ok(())
        })?;
    }
    Ok(readback.read(0, count as usize))
}
