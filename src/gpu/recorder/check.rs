//! Misuse of the interface, found before Vulkan would see it.

use super::Target;
use crate::gpu::pipeline::Pipeline;
use crate::gpu::{BindingSet, GraphicsPipeline, GraphicsState, PipelineKind, Resource};

/// Misuse of the interface: bindings of another program.
pub(super) fn check_bindings(pipeline: &Pipeline, bindings: &dyn BindingSet) {
    assert!(
        std::ptr::eq(pipeline.desc.program, bindings.program()),
        "pipeline {} was given the bindings of {}",
        pipeline.desc.program.name,
        bindings.program().name
    );
}

pub(super) fn graphics_state(pipeline: &GraphicsPipeline) -> &GraphicsState {
    match &pipeline.desc().kind {
        PipelineKind::Graphics(state) => state,
        PipelineKind::Compute => panic!("{}: described as compute, drawn as graphics", pipeline.desc().program.name),
    }
}

/// Misuse of the interface: an input attachment that is not the target of its index.
pub(super) fn check_inputs(pipeline: &GraphicsPipeline, resources: &[Resource<'_>], targets: &[Target<'_>]) {
    for (binding, resource) in pipeline.desc().program.bindings.iter().zip(resources) {
        if let (Some(index), Resource::Image(image)) = (binding.attachment, resource) {
            assert!(
                targets.get(index as usize).is_some_and(|target| target.image.id == image.id),
                "{}: input attachment {} is bound to {}, which is not target {index}",
                pipeline.desc().program.name,
                binding.name,
                image.name()
            );
        }
    }
}

/// Misuse of the interface, or of a [`PipelineFactory`](crate::gpu::PipelineFactory): attachments of other formats than images.
pub(super) fn check_targets(pipeline: &GraphicsPipeline, targets: &[Target<'_>]) {
    let state = graphics_state(pipeline);
    let (described, given): (Vec<_>, Vec<_>) =
        (state.attachments.iter().map(|a| a.format).collect(), targets.iter().map(|t| t.image.format()).collect());
    assert!(
        described == given,
        "pipeline {} is described for attachments {described:?} but drawn into {given:?}",
        pipeline.desc().program.name
    );
}
