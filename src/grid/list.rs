//! An explicit list of particles in place of the grid: same buffers, same later stages.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{Buffer, BufferKind, Gpu, Recorder};
use crate::params::ParticleDesc;
use crate::shared::Particle;

use super::set::{Counters, ParticleSet};

/// Groups for `count` items, as `glsl/compact/groups.glsl` has them.
fn groups_for(count: u32, per_group: u32) -> [u32; 4] {
    let needed = count.div_ceil(per_group);
    let rows = needed.div_ceil(32_768);
    [if rows > 1 { 32_768 } else { needed }, rows.max(1), 1, 0]
}

/// How long particles have moved [s], and the wind x, z that has carried them [m/s].
type Motion = (f64, [f64; 2]);

/// Uploads an explicit list, relative to the floating origin of each frame.
pub struct ParticleList {
    particles: Vec<ParticleDesc>,
    moved: Motion,
    staging: Vec<Staging>,
    no_cells: Buffer,
}

/// What one frame slot uploads.
struct Staging {
    particles: Buffer,
    counters: Buffer,
    args: Buffer,
    /// Origin and motion that `particles` was written for.
    written: Option<([f64; 3], Motion)>,
}

impl ParticleList {
    /// A list for `slots` frames in flight.
    pub fn new(gpu: &Arc<Gpu>, particles: &[ParticleDesc], slots: usize) -> Result<Self> {
        let count = particles.len() as u32;
        let counters = Counters { generated: count, stored: count, ..Counters::default() };
        let args = [[0, 1, 1, 0], groups_for(count, 64)];
        let bytes = (particles.len().max(1) * size_of::<Particle>()) as u64;
        let staging = (0..slots)
            .map(|_| {
                Ok(Staging {
                    particles: Buffer::new(gpu, "particle upload", bytes, BufferKind::Upload)?,
                    counters: Buffer::upload(gpu, "counters upload", &[counters])?,
                    args: Buffer::upload(gpu, "args upload", &args)?,
                    written: None,
                })
            })
            .collect::<Result<_>>()?;
        let no_cells = Buffer::upload(gpu, "no cells", &vec![u32::MAX; particles.len().max(1)])?;
        Ok(Self { particles: particles.to_vec(), moved: (0.0, [0.0; 2]), staging, no_cells })
    }

    /// From now on particles are where they have come to in `seconds` by their velocities and the wind x, z [m/s].
    pub fn set_motion(&mut self, seconds: f64, wind: [f64; 2]) {
        self.moved = (seconds, wind);
    }

    fn centre(&self, particle: &ParticleDesc) -> [f64; 3] {
        particle.after(self.moved.0, self.moved.1)
    }

    /// Particles in the list: the capacity that its [`ParticleSet`] needs.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.particles.len() as u32
    }

    /// No particle reaches farther from its centre than this [m].
    #[must_use]
    pub fn greatest_extent(&self) -> f32 {
        self.particles.iter().flat_map(|particle| particle.radii).fold(0.0, f32::max) * 1.01
    }

    /// Least and greatest corner of all particles' bounding boxes [m].
    #[must_use]
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for particle in &self.particles {
            let reach = f64::from(particle.radii.iter().fold(0.0f32, |a, &b| a.max(b)));
            let [least, greatest] = &mut bounds;
            for ((least, greatest), centre) in least.iter_mut().zip(greatest).zip(self.centre(particle)) {
                *least = least.min(centre - reach);
                *greatest = greatest.max(centre + reach);
            }
        }
        if self.particles.is_empty() { [[0.0; 3]; 2] } else { bounds }
    }

    /// Particle `index` relative to `origin`.
    #[must_use]
    pub fn particle(&self, index: usize, origin: [f64; 3]) -> Particle {
        let p = &self.particles[index];
        let centre = self.centre(p);
        Particle {
            centre: std::array::from_fn(|axis| (centre[axis] - origin[axis]) as f32),
            density: p.density,
            rotation: p.rotation,
            semi_axes: p.radii,
            fade: 1.0,
            colour: p.colour,
            id: index as u32,
        }
    }

    /// Records the upload into `set`. Particles are rewritten only when they or the origin have moved.
    pub fn record(&mut self, rec: &mut Recorder<'_>, origin: [f64; 3], set: &ParticleSet) -> Result<()> {
        assert!(set.capacity() >= self.count(), "the particle set is smaller than the list");
        let slot = rec.slot();
        if self.staging[slot].written != Some((origin, self.moved)) {
            let relative: Vec<Particle> = (0..self.particles.len()).map(|i| self.particle(i, origin)).collect();
            self.staging[slot].particles.write(0, &relative);
            self.staging[slot].written = Some((origin, self.moved));
        }
        let staging = &self.staging[slot];
        rec.copy_buffer(&staging.counters, set.counters(), staging.counters.size());
        rec.copy_buffer(&staging.args, set.args(), staging.args.size());
        rec.copy_buffer(&staging.particles, set.particles(), staging.particles.size());
        rec.copy_buffer(&self.no_cells, set.cells(), self.no_cells.size());
        Ok(())
    }
}
