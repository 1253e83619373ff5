//! What the build reflects out of a shader, as static data.

use super::{Buffer, Image, Sampled};
use ash::vk;

/// A compute shader, or a vertex and a fragment shader, with everything needed to build and bind it.
#[derive(Debug)]
pub struct Program {
    /// Path of the entry file below `glsl/`; for a graphics program, of the fragment shader.
    pub name: &'static str,
    /// The lighting method that it was compiled for, a folder of `glsl/lighting`; empty where there is one program for all.
    pub lighting: &'static str,
    /// One compute stage, or vertex and fragment.
    pub stages: &'static [Stage],
    /// Descriptors of set 0, sorted by binding number.
    pub bindings: &'static [Binding],
    /// Size of the push constant block [bytes]; 0 without one.
    pub push_constant_size: u32,
    /// Work-group size (compute only).
    pub group_size: [u32; 3],
    /// Specialization constants, by name.
    pub spec_constants: &'static [SpecConstant],
    /// Whether the fragment stage uses `VK_EXT_fragment_shader_interlock`.
    pub interlock: bool,
}

/// One shader stage.
pub struct Stage {
    /// Which stage.
    pub kind: ShaderStage,
    /// The SPIR-V module, little-endian words.
    pub spirv: &'static [u8],
}

impl std::fmt::Debug for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} ({} bytes)", self.kind, self.spirv.len())
    }
}

/// The stages that Welkin uses.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ShaderStage {
    /// Compute.
    Compute,
    /// Vertex.
    Vertex,
    /// Fragment.
    Fragment,
}

impl ShaderStage {
    pub(crate) fn flags(self) -> vk::ShaderStageFlags {
        match self {
            Self::Compute => vk::ShaderStageFlags::COMPUTE,
            Self::Vertex => vk::ShaderStageFlags::VERTEX,
            Self::Fragment => vk::ShaderStageFlags::FRAGMENT,
        }
    }
}

/// One descriptor.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Name in the shader.
    pub name: &'static str,
    /// Number within set 0.
    pub binding: u32,
    /// Kind of descriptor.
    pub kind: BindingKind,
    /// Whether any stage may read it.
    pub readable: bool,
    /// Whether any stage may write it.
    pub writable: bool,
    /// The colour attachment that an input attachment reads: its `input_attachment_index`.
    pub attachment: Option<u32>,
}

/// The kinds of descriptor that Welkin uses.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BindingKind {
    /// `buffer` block.
    StorageBuffer,
    /// `image2D` and friends.
    StorageImage,
    /// `sampler2D` and friends.
    SampledImage,
    /// `subpassInput`.
    InputAttachment,
}

impl BindingKind {
    pub(crate) fn descriptor_type(self) -> vk::DescriptorType {
        match self {
            Self::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
            Self::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
            Self::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            Self::InputAttachment => vk::DescriptorType::INPUT_ATTACHMENT,
        }
    }
}

/// A specialization constant.
#[derive(Clone, Copy, Debug)]
pub struct SpecConstant {
    /// Name in the shader.
    pub name: &'static str,
    /// `constant_id`.
    pub id: u32,
}

/// A generated struct with one field for each binding of a program.
pub trait BindingSet {
    /// The program that these bindings are for.
    fn program(&self) -> &'static Program;
    /// The bound resources, in the order of [`Program::bindings`].
    fn resources(&self) -> Vec<Resource<'_>>;
}

/// Something bound to a descriptor.
#[derive(Clone, Copy)]
pub enum Resource<'a> {
    /// A whole storage buffer.
    Buffer(&'a Buffer),
    /// A storage image or input attachment.
    Image(&'a Image),
    /// An image read through a sampler.
    Sampled(Sampled<'a>),
}

/// What the source function of a lighting method reads (`glsl/lighting/METHOD/source.glsl`), by name: the part of a compositing
/// program's bindings that the program's mode knows nothing of.
#[derive(Clone, Copy)]
pub struct MethodBindings<'a> {
    /// Name of the method.
    pub method: &'static str,
    /// Its resources by the names that they have in the shader.
    pub resources: &'a [(&'static str, Resource<'a>)],
}

impl<'a> MethodBindings<'a> {
    /// The resource that the shader calls `name`.
    ///
    /// # Panics
    /// If the method did not give one.
    #[must_use]
    pub fn resource(&self, name: &str) -> Resource<'a> {
        match self.resources.iter().find(|(known, _)| *known == name) {
            Some((_, resource)) => *resource,
            None => panic!("the lighting method {} gives no {name}, which its source.glsl reads", self.method),
        }
    }
}
