//! Pipelines, first described as data, then built: an engine can print, change, replace or cache each one.

use super::retire::Garbage;
use super::{BindingKind, Feedback, FeedbackPath, Gpu, Program, ShaderStage, create_render_pass};
use crate::Result;
use ash::vk;
use std::fmt;
use std::sync::Arc;

/// Everything that makes up one pipeline state object.
#[derive(Clone, Debug)]
pub struct PipelineDesc {
    /// Shaders, bindings and constants.
    pub program: &'static Program,
    /// Values of specialization constants by name, as 32-bit patterns (`f32::to_bits` for floats).
    pub specialization: Vec<(&'static str, u32)>,
    /// Compute, or graphics with its fixed-function state.
    pub kind: PipelineKind,
}

/// Compute or graphics.
#[derive(Clone, Debug)]
pub enum PipelineKind {
    /// A compute pipeline.
    Compute,
    /// A graphics pipeline.
    Graphics(GraphicsState),
}

/// Fixed-function state. Viewport and scissor are dynamic, there is no vertex input.
#[derive(Clone, Debug)]
pub struct GraphicsState {
    /// How vertices make primitives.
    pub topology: vk::PrimitiveTopology,
    /// Samples per pixel.
    pub samples: vk::SampleCountFlags,
    /// Colour attachments in order.
    pub attachments: Vec<Attachment>,
    /// Whether and how fragments read the attachments that they write.
    pub feedback: Option<Feedback>,
    /// Whether the fragment shader runs for each sample; needs `sampleRateShading`.
    pub sample_shading: bool,
    /// The depth test, and with it a depth attachment ([`PassState::depth`](super::PassState)); not with
    /// [`FeedbackPath::Subpass`].
    pub depth: Option<DepthState>,
}

/// A depth test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthState {
    /// Format of the attachment.
    pub format: vk::Format,
    /// What a fragment's depth must be to what is there.
    pub compare: vk::CompareOp,
    /// Whether fragments that pass leave theirs.
    pub write: bool,
}

impl Default for GraphicsState {
    fn default() -> Self {
        Self {
            topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
            samples: vk::SampleCountFlags::TYPE_1,
            attachments: Vec::new(),
            feedback: None,
            sample_shading: false,
            depth: None,
        }
    }
}

/// One colour attachment.
#[derive(Clone, Copy, Debug)]
pub struct Attachment {
    /// Its format.
    pub format: vk::Format,
    /// How fragments are combined with what is there.
    pub blend: BlendState,
}

/// How a fragment is combined with the attachment.
#[derive(Clone, Copy, Debug)]
pub enum BlendState {
    /// It replaces it.
    Replace,
    /// The smaller of the two, by component.
    Min,
    /// `source.rgb + source.a · destination`, and `source.a · destination.a`: in-scattered radiance in rgb over
    /// transmittance in a, drawn back to front.
    OverTransmittance,
    /// Anything else, spelled out.
    Custom(vk::PipelineColorBlendAttachmentState),
}

impl BlendState {
    fn state(self) -> vk::PipelineColorBlendAttachmentState {
        let all = vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA);
        match self {
            Self::Replace => all,
            Self::Min => all
                .blend_enable(true)
                .src_color_blend_factor(vk::BlendFactor::ONE)
                .dst_color_blend_factor(vk::BlendFactor::ONE)
                .color_blend_op(vk::BlendOp::MIN)
                .src_alpha_blend_factor(vk::BlendFactor::ONE)
                .dst_alpha_blend_factor(vk::BlendFactor::ONE)
                .alpha_blend_op(vk::BlendOp::MIN),
            Self::OverTransmittance => all
                .blend_enable(true)
                .src_color_blend_factor(vk::BlendFactor::ONE)
                .dst_color_blend_factor(vk::BlendFactor::SRC_ALPHA)
                .color_blend_op(vk::BlendOp::ADD)
                .src_alpha_blend_factor(vk::BlendFactor::ZERO)
                .dst_alpha_blend_factor(vk::BlendFactor::SRC_ALPHA)
                .alpha_blend_op(vk::BlendOp::ADD),
            Self::Custom(state) => state,
        }
    }
}

impl fmt::Display for PipelineDesc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.program.name)?;
        if !self.program.lighting.is_empty() {
            write!(f, " for {} lighting", self.program.lighting)?;
        }
        match &self.kind {
            PipelineKind::Compute => {
                let [x, y, z] = self.program.group_size;
                write!(f, ": compute, groups of {x}x{y}x{z}")?;
            }
            PipelineKind::Graphics(state) => {
                write!(f, ": graphics, {:?}, {:?}", state.topology, state.samples)?;
                if self.program.interlock {
                    write!(f, ", pixel interlock")?;
                }
                if let Some(Feedback { path, ordered }) = state.feedback {
                    let order = if ordered { "rasterization-order" } else { "unordered" };
                    write!(f, ", {order} attachment feedback by {path:?}")?;
                }
                if state.sample_shading {
                    write!(f, ", for each sample")?;
                }
                if let Some(DepthState { format, compare, write }) = state.depth {
                    write!(f, ", depth {format:?} {compare:?}{}", if write { ", written" } else { "" })?;
                }
                for attachment in &state.attachments {
                    write!(f, ", {:?} {:?}", attachment.format, attachment.blend)?;
                }
            }
        }
        for (name, value) in &self.specialization {
            write!(f, ", {name} = {value}")?;
        }
        for b in self.program.bindings {
            let access = match (b.readable, b.writable) {
                (true, true) => "read-write",
                (false, true) => "write",
                _ => "read",
            };
            write!(f, "\n  {:2} {} {:?} {access}", b.binding, b.name, b.kind)?;
        }
        if self.program.push_constant_size > 0 {
            write!(f, "\n  push constants: {} bytes", self.program.push_constant_size)?;
        }
        Ok(())
    }
}

/// Builds pipelines from their descriptions. The default methods build exactly what is described.
pub trait PipelineFactory: Send + Sync {
    /// Called with every description before it is built; an engine may change state, formats or constants here. The
    /// program stays: its bindings are what the renderer binds. (Other shader code with the same bindings is a matter of
    /// [`Self::build`].)
    fn describe(&self, desc: PipelineDesc) -> PipelineDesc {
        desc
    }

    /// Builds the pipeline; `layout` has the bindings of `desc.program` in set 0 and its push constants. An engine may
    /// compile elsewhere, look up what it has compiled before, or call [`DefaultFactory`]'s `build`. Viewport and scissor
    /// are dynamic state. Pipelines are for dynamic rendering, but those with [`FeedbackPath::Subpass`] for a pass of
    /// [`create_render_pass`]. The returned pipeline belongs to Welkin, which destroys it.
    fn build(&self, gpu: &Gpu, desc: &PipelineDesc, layout: vk::PipelineLayout) -> Result<vk::Pipeline> {
        build(gpu, desc, layout)
    }
}

/// Builds every pipeline as described.
pub struct DefaultFactory;

impl PipelineFactory for DefaultFactory {}

/// A pipeline with its layouts; destroyed when dropped, as soon as the frames in flight have ended.
pub(crate) struct Pipeline {
    gpu: Arc<Gpu>,
    pub(crate) desc: PipelineDesc,
    pub(crate) handle: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
    pub(crate) stages: vk::ShaderStageFlags,
}

impl Pipeline {
    fn new(gpu: &Arc<Gpu>, desc: PipelineDesc) -> Result<Self> {
        let desc = gpu.factory().describe(desc);
        gpu.note_pipeline(desc.to_string());
        let program = desc.program;
        let stages = program.stages.iter().fold(vk::ShaderStageFlags::empty(), |all, stage| all | stage.kind.flags());
        let bindings: Vec<_> = program
            .bindings
            .iter()
            .map(|b| {
                // Vulkan shows input attachments to fragment shaders alone.
                let input = b.kind == BindingKind::InputAttachment;
                vk::DescriptorSetLayoutBinding::default()
                    .binding(b.binding)
                    .descriptor_type(b.kind.descriptor_type())
                    .descriptor_count(1)
                    .stage_flags(if input { vk::ShaderStageFlags::FRAGMENT } else { stages })
            })
            .collect();
        let mut pipeline = Self {
            gpu: gpu.clone(),
            handle: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            stages,
            desc,
        };
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive as long as `gpu`; the description is complete.
        pipeline.set_layout = unsafe { gpu.device().create_descriptor_set_layout(&info, None) }
            .map_err(|result| gpu.error("vkCreateDescriptorSetLayout", program.name, result))?;
        let set_layouts = [pipeline.set_layout];
        let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: program.push_constant_size }];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts);
        if program.push_constant_size > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: as above.
        pipeline.layout = unsafe { gpu.device().create_pipeline_layout(&info, None) }
            .map_err(|result| gpu.error("vkCreatePipelineLayout", program.name, result))?;
        pipeline.handle = gpu.factory().build(gpu, &pipeline.desc, pipeline.layout)?;
        gpu.set_name(pipeline.handle, program.name);
        Ok(pipeline)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        self.gpu.retire(Garbage::Pipeline(self.handle, self.layout, self.set_layout));
    }
}

/// A compute pipeline.
pub struct ComputePipeline(pub(crate) Pipeline);

impl ComputePipeline {
    /// Builds `program` with specialization constants given by name.
    pub fn new(gpu: &Arc<Gpu>, program: &'static Program, specialization: &[(&'static str, u32)]) -> Result<Self> {
        let desc = PipelineDesc { program, specialization: specialization.to_vec(), kind: PipelineKind::Compute };
        Pipeline::new(gpu, desc).map(Self)
    }

    /// What was built, after the host's changes.
    pub fn desc(&self) -> &PipelineDesc {
        &self.0.desc
    }
}

/// A graphics pipeline.
pub struct GraphicsPipeline(pub(crate) Pipeline);

impl GraphicsPipeline {
    /// Builds `program` with fixed-function `state` and specialization constants given by name.
    pub fn new(
        gpu: &Arc<Gpu>,
        program: &'static Program,
        specialization: &[(&'static str, u32)],
        state: GraphicsState,
    ) -> Result<Self> {
        let desc =
            PipelineDesc { program, specialization: specialization.to_vec(), kind: PipelineKind::Graphics(state) };
        Pipeline::new(gpu, desc).map(Self)
    }

    /// What was built, after the host's changes.
    pub fn desc(&self) -> &PipelineDesc {
        &self.0.desc
    }
}

/// Builds the pipeline that `desc` describes.
fn build(gpu: &Gpu, desc: &PipelineDesc, layout: vk::PipelineLayout) -> Result<vk::Pipeline> {
    let device = gpu.device();
    let name = desc.program.name;
    let mut entries = Vec::new();
    let mut data = Vec::new();
    for (constant, value) in &desc.specialization {
        let Some(spec) = desc.program.spec_constants.iter().find(|spec| spec.name == *constant) else {
            panic!("{name} has no specialization constant {constant}");
        };
        entries.push(vk::SpecializationMapEntry { constant_id: spec.id, offset: data.len() as u32, size: 4 });
        data.extend_from_slice(&value.to_ne_bytes());
    }
    let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&data);

    let mut modules = Modules { device, handles: Vec::new() };
    for stage in desc.program.stages {
        let words: Vec<u32> =
            stage.spirv.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the words are a module that the build compiled.
        let module = unsafe { device.create_shader_module(&info, None) }
            .map_err(|result| gpu.error("vkCreateShaderModule", name, result))?;
        modules.handles.push(module);
    }
    let stages: Vec<_> = desc
        .program
        .stages
        .iter()
        .zip(&modules.handles)
        .map(|(stage, module)| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(stage.kind.flags())
                .module(*module)
                .name(c"main")
                .specialization_info(&specialization)
        })
        .collect();

    let (call, result) = match &desc.kind {
        PipelineKind::Compute => {
            debug_assert_eq!(desc.program.stages[0].kind, ShaderStage::Compute);
            let info = vk::ComputePipelineCreateInfo::default().stage(stages[0]).layout(layout);
            // SAFETY: every referenced object is alive.
            let built = unsafe { device.create_compute_pipelines(gpu.pipeline_cache(), &[info], None) };
            ("vkCreateComputePipelines", built)
        }
        PipelineKind::Graphics(state) => {
            let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
            let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(state.topology);
            let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
            let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
            let samples = vk::PipelineMultisampleStateCreateInfo::default()
                .rasterization_samples(state.samples)
                .sample_shading_enable(state.sample_shading)
                .min_sample_shading(1.0);
            let depth = state.depth.map(|depth| {
                vk::PipelineDepthStencilStateCreateInfo::default()
                    .depth_test_enable(true)
                    .depth_compare_op(depth.compare)
                    .depth_write_enable(depth.write)
            });
            let formats: Vec<_> = state.attachments.iter().map(|attachment| attachment.format).collect();
            let blends: Vec<_> = state.attachments.iter().map(|attachment| attachment.blend.state()).collect();
            let mut blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
            if let Some(feedback) = state.feedback {
                blend = blend.flags(feedback.blend_flags());
            }
            let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
            let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
            let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats);
            rendering.depth_attachment_format = state.depth.map_or(vk::Format::UNDEFINED, |depth| depth.format);
            let mut info = vk::GraphicsPipelineCreateInfo::default()
                .stages(&stages)
                .vertex_input_state(&vertex_input)
                .input_assembly_state(&assembly)
                .viewport_state(&viewport)
                .rasterization_state(&raster)
                .multisample_state(&samples)
                .color_blend_state(&blend)
                .dynamic_state(&dynamic)
                .layout(layout);
            if let Some(depth) = &depth {
                info = info.depth_stencil_state(depth);
            }
            let mut render_pass = vk::RenderPass::null();
            if let Some(Feedback { path: FeedbackPath::Subpass, .. }) = state.feedback {
                render_pass = create_render_pass(gpu, state, 0)?;
                info = info.render_pass(render_pass);
            } else {
                info = info.push_next(&mut rendering);
            }
            // SAFETY: every referenced object is alive.
            let built = unsafe { device.create_graphics_pipelines(gpu.pipeline_cache(), &[info], None) };
            // SAFETY: made above; a pipeline outlives the pass that it was built for, and drawing uses a compatible one.
            unsafe { device.destroy_render_pass(render_pass, None) };
            ("vkCreateGraphicsPipelines", built)
        }
    };
    match result {
        Ok(pipelines) => Ok(pipelines[0]),
        Err((_, result)) => Err(gpu.error(call, name, result)),
    }
}

/// Shader modules, destroyed once the pipeline is built or has failed.
struct Modules<'a> {
    device: &'a ash::Device,
    handles: Vec<vk::ShaderModule>,
}

impl Drop for Modules<'_> {
    fn drop(&mut self) {
        for handle in &self.handles {
            // SAFETY: made by this device, and no longer needed.
            unsafe { self.device.destroy_shader_module(*handle, None) };
        }
    }
}
