//! The thin layer between the passes and Vulkan: borrowed handles, resources with a name and a lifetime, pipelines
//! described as data, and a recorder that derives every barrier from what the shaders declare.
//!
//! Nothing here owns a device except [`standalone`], which the command line, the tests and the examples use. An engine
//! hands over its own through [`Gpu::from_raw`].

mod access;
mod advice;
mod buffer;
mod capabilities;
mod device;
mod features;
mod feedback;
mod frames;
mod id;
mod image;
mod memory;
mod pipeline;
mod program;
mod recorder;
mod retire;
mod sampler;
pub mod standalone;
mod timing;

pub use access::Access;
pub use buffer::{Buffer, BufferKind};
pub use capabilities::{Capabilities, Feature};
pub use device::{Gpu, RawDevice};
pub use features::{DeviceFeatures, FEATURES_WANTED, LimitWanted, limits_wanted};
pub use feedback::{Feedback, FeedbackPath, create_render_pass};
pub use frames::Frames;
pub use image::{Image, ImageDesc, Sampled};
pub use memory::{Allocation, Allocator, MemoryLocation, MemoryUse};
pub use pipeline::{
    Attachment, BlendState, ComputePipeline, DefaultFactory, DepthState, GraphicsPipeline, GraphicsState, PipelineDesc,
    PipelineFactory, PipelineKind,
};
pub use program::{
    Binding, BindingKind, BindingSet, MethodBindings, Program, Resource, ShaderStage, SpecConstant, Stage,
};
pub use recorder::{Draw, DrawCall, Once, PassState, Recorder, RecorderState, Target};
pub use sampler::Sampler;
pub use timing::PassTime;
