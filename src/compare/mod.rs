//! Pictures against their reference: metrics, heat maps, and a report to look at.
//!
//! `welkin ab` is made of these; they take any [`Picture`](crate::output::Picture). `docs/comparing.md` tells how to read
//! them.

mod flip;
mod heat;
mod metrics;
mod oracle;
mod report;
mod series;

pub use flip::{PIXELS_PER_DEGREE, flip};
pub use heat::{HeatMap, Scale, magma};
pub use metrics::{Difference, Errors, Metrics, Popping, REL_MSE_EPSILON, Reference};
pub use oracle::oracle;
pub use report::{Report, ReportSide};
pub use series::{FrameMetrics, Series, Summary};
