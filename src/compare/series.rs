//! One mode's pictures, frame by frame, against the reference's.

use std::sync::Arc;

use serde::Serialize;

use super::metrics::{Difference, Errors, Metrics, Popping, Reference};
use crate::Result;
use crate::output::Picture;

/// Collects the metrics of a sequence.
#[derive(Debug)]
pub struct Series {
    name: String,
    errors: Errors,
    popping: Popping,
    frames: Vec<FrameMetrics>,
    last: Option<(Arc<Picture>, Arc<Reference>)>,
}

/// The metrics of one frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameMetrics {
    /// Its number.
    pub frame: u32,
    /// Against the reference of the same frame.
    #[serde(flatten)]
    pub metrics: Metrics,
    /// Change since the frame before that the motion does not explain; none in the first frame, and where the reference
    /// did not change.
    pub popping: Option<f64>,
}

/// The metrics of a whole sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Over all pixels of all frames.
    #[serde(flatten)]
    pub metrics: Metrics,
    /// Mean over the pairs of consecutive frames whose reference changed; none without such pairs.
    pub popping: Option<f64>,
    /// How many pairs there were.
    pub popping_pairs: u32,
    /// Pairs whose reference did not change, which `popping` leaves out.
    pub still_pairs: u32,
    /// Root mean square change of the picture over those; none without such pairs.
    pub still_change: Option<f64>,
}

impl Series {
    /// Nothing yet; `name` is what an error calls the pictures.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self { name: name.into(), errors: Errors::default(), popping: Popping::default(), frames: vec![], last: None }
    }

    /// Takes in the picture of a frame and the reference of the same frame. Frames come in order.
    ///
    /// # Errors
    /// [`Error::InvalidParam`](crate::Error::InvalidParam) when the sizes differ or a pixel is not finite.
    pub fn add(&mut self, frame: u32, picture: &Arc<Picture>, reference: &Arc<Reference>) -> Result<Difference> {
        let difference = Difference::of(&self.name, picture, reference)?;
        self.errors.add(&difference.errors);
        let popping = match self.last.replace((picture.clone(), reference.clone())) {
            Some((i, r)) => self.popping.add(&self.name, (&i, &r), (picture, reference))?,
            None => None,
        };
        self.frames.push(FrameMetrics { frame, metrics: difference.errors.metrics(), popping });
        Ok(difference)
    }

    /// Each frame so far.
    #[must_use]
    pub fn frames(&self) -> &[FrameMetrics] {
        &self.frames
    }

    /// All frames so far.
    #[must_use]
    pub fn summary(&self) -> Summary {
        Summary {
            metrics: self.errors.metrics(),
            popping: self.popping.mean(),
            popping_pairs: self.popping.pairs(),
            still_pairs: self.popping.still_pairs(),
            still_change: self.popping.still_change(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform(value: f32) -> Picture {
        let radiance = vec![[value; 3]; 12];
        Picture { width: 4, height: 3, display: radiance.clone(), radiance, transmittance: None }
    }

    #[test]
    fn frames_and_their_sum_are_kept() {
        let mut series = Series::new("a");
        for (frame, picture, reference) in [(3, 0.25, 0.25), (4, 1.0, 0.5), (5, 0.5, 0.5)] {
            series.add(frame, &Arc::new(uniform(picture)), &Arc::new(uniform(reference).into())).unwrap();
        }
        let frames: Vec<_> = series.frames().iter().map(|f| (f.frame, f.metrics.rmse, f.popping)).collect();
        assert_eq!(frames, [(3, 0.0, None), (4, 0.5, Some(2.0)), (5, 0.0, None)]);
        let summary = series.summary();
        assert_eq!((summary.popping, summary.popping_pairs, summary.still_pairs), (Some(2.0), 1, 1));
        assert_eq!((summary.still_change, summary.metrics.max_abs), (Some(0.5), 0.5));
    }
}
