//! Mode `alpha`: sorted alpha blending by fixed function (`glsl/blend/alpha.frag`). Runs on every device.

use super::{BlendInputs, CloudTargets, NEAREST_FORMAT, NO_CLOUD, Shading, cloud_format};
use crate::Result;
use crate::gpu::{Attachment, BlendState, Draw, Gpu, GraphicsPipeline, GraphicsState, Recorder, Target};
use crate::params::Precision;
use crate::shaders::blend_alpha_frag as shader;
use std::sync::Arc;

pub(super) struct Alpha {
    pipeline: GraphicsPipeline,
}

impl Alpha {
    pub(super) fn new(gpu: &Arc<Gpu>, shading: Shading, precision: Precision) -> Result<Self> {
        let state = GraphicsState {
            attachments: vec![
                Attachment { format: cloud_format(precision), blend: BlendState::OverTransmittance },
                Attachment { format: NEAREST_FORMAT, blend: BlendState::Min },
            ],
            ..GraphicsState::default()
        };
        let pipeline = GraphicsPipeline::new(gpu, &shader::PROGRAM, &shading.specialization(), state)?;
        Ok(Self { pipeline })
    }

    pub(super) fn record(
        &self,
        rec: &mut Recorder<'_>,
        inputs: &BlendInputs<'_>,
        targets: &CloudTargets,
        extent: [u32; 2],
    ) -> Result<()> {
        let bindings = scene_bindings!(shader, inputs, {});
        let draw = Draw::Indirect { args: inputs.draw_args, offset: inputs.draw_args_offset };
        let attachments = [
            Target { image: &targets.cloud, clear: Some([0.0, 0.0, 0.0, 1.0]) },
            Target { image: &targets.nearest, clear: Some([NO_CLOUD; 4]) },
        ];
        rec.pass("blend", |rec| rec.draw(&self.pipeline, &bindings, &(), extent, &attachments, draw))
    }
}
