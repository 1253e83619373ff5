//! Unbiased path tracing of exactly what the renderer draws: the truth that every lighting and every compositing mode is
//! measured against. Method, sources and limits: `docs/reference.md`.
//!
//! ```no_run
//! use std::ops::ControlFlow;
//! use welkin::gpu::standalone::{Options, Standalone};
//! use welkin::pathtrace::{PathOptions, PathTracer};
//!
//! # fn main() -> welkin::Result<()> {
//! let params = welkin::Params::default();
//! let mut device = Standalone::new(Options::default())?;
//! let mut tracer = PathTracer::new(device.frames(), &params, [320, 180], &PathOptions::default())?;
//! tracer.run(device.frames(), 64, &mut |_| ControlFlow::Continue(()))?; // until every pixel has 64 samples
//! let picture = tracer.develop(device.frames())?;
//! println!("{} of relative noise, first pixel {:?}", tracer.noise(), picture.radiance[0]);
//! # Ok(())
//! # }
//! ```
//!
//! The same parameters and seed give the same bits on the same driver, however the samples are split into passes and
//! dispatches; [`PathTracer::state`] and [`PathTracer::restore`] stop and go on without a difference.

mod cells;
mod picture;
mod state;
mod tracer;

pub use cells::{CellCounts, CellGrid, CellParams};
pub use picture::Truth;
pub use state::{PixelSums, State};
pub use tracer::{Environment, Estimator, PathOptions, PathTracer, Progress, SunShape, Work};
