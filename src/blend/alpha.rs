//! Mode `alpha`: sorted alpha blending by fixed function (`glsl/blend/alpha.frag`). Runs on every device.

use super::{BlendInputs, CloudTargets, Compositor, Kind, NO_CLOUD, Setting, anywhere};
use crate::Result;
use crate::gpu::{Attachment, BlendState, Draw, GraphicsPipeline, GraphicsState, Recorder, Target};
use crate::shaders::blend_alpha_frag as shader;
use crate::targets::{NEAREST_FORMAT, cloud_format};

pub(super) const KIND: Kind = Kind { supports: anywhere, open: |setting, _| Ok(Box::new(Alpha::new(setting)?)) };

struct Alpha {
    pipeline: GraphicsPipeline,
}

impl Alpha {
    fn new(setting: &Setting<'_>) -> Result<Self> {
        let state = GraphicsState {
            attachments: vec![
                Attachment { format: cloud_format(setting.precision), blend: BlendState::OverTransmittance },
                Attachment { format: NEAREST_FORMAT, blend: BlendState::Min },
            ],
            ..GraphicsState::default()
        };
        let (program, constants) = (shader::program(setting.shading.lighting.name()), setting.shading.specialization());
        Ok(Self { pipeline: GraphicsPipeline::new(setting.gpu, program, &constants, state)? })
    }
}

impl Compositor for Alpha {
    fn record(
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
