//! Lighting `flat`: every particle shines with its own constant colour (`glsl/lighting/flat/source.glsl`), which it carries.

use std::sync::Arc;

use super::{Lent, Method, Scene};
use crate::Result;
use crate::gpu::{Gpu, Recorder, Resource};
use crate::grid::{Counters, ParticleSet};

pub(super) struct Flat;

impl Method for Flat {
    fn record(&mut self, _: &mut Recorder<'_>, _: &Scene<'_>) -> Result<()> {
        Ok(())
    }

    fn resources<'a>(&'a self, _: &Lent<'a>) -> Vec<(&'static str, Resource<'a>)> {
        Vec::new()
    }

    fn grow(&mut self, _: &Arc<Gpu>, _: &Counters, _: &ParticleSet) -> Result<bool> {
        Ok(false)
    }
}
