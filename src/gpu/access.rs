//! The only file that names Vulkan stage and access flags.

use ash::vk;

/// How a pass touches a resource; each kind stands for one row of pipeline stage and memory access.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Access {
    /// Nothing has touched it, or its contents do not matter.
    None,
    /// Read by a compute shader.
    ComputeRead,
    /// Written by a compute shader.
    ComputeWrite,
    /// Read and written by a compute shader.
    ComputeReadWrite,
    /// Read by a vertex or fragment shader.
    GraphicsRead,
    /// Written by a fragment shader through a descriptor.
    FragmentWrite,
    /// Read and written by a fragment shader through a descriptor.
    FragmentReadWrite,
    /// Written, and perhaps blended, as a colour attachment.
    ColorAttachment,
    /// Written as a colour attachment by fragments that read it as an input attachment
    /// ([`Feedback`](super::Feedback)).
    AttachmentFeedback,
    /// Tested and written as the depth attachment.
    DepthAttachment,
    /// Read by an indirect command.
    IndirectRead,
    /// Source of a copy.
    TransferRead,
    /// Destination of a copy, fill or clear.
    TransferWrite,
    /// Read by the host after the submission has ended.
    HostRead,
    /// Written by the host before the submission.
    HostWrite,
}

impl Access {
    /// Every kind, for tables and tests.
    pub const ALL: [Self; 15] = [
        Self::None,
        Self::ComputeRead,
        Self::ComputeWrite,
        Self::ComputeReadWrite,
        Self::GraphicsRead,
        Self::FragmentWrite,
        Self::FragmentReadWrite,
        Self::ColorAttachment,
        Self::AttachmentFeedback,
        Self::DepthAttachment,
        Self::IndirectRead,
        Self::TransferRead,
        Self::TransferWrite,
        Self::HostRead,
        Self::HostWrite,
    ];

    /// Pipeline stages and memory accesses of this kind.
    pub fn masks(self) -> (vk::PipelineStageFlags2, vk::AccessFlags2) {
        use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
        let graphics = S::VERTEX_SHADER | S::FRAGMENT_SHADER;
        let read = A::SHADER_STORAGE_READ | A::SHADER_SAMPLED_READ;
        match self {
            Self::None => (S::NONE, A::NONE),
            Self::ComputeRead => (S::COMPUTE_SHADER, read),
            Self::ComputeWrite => (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE),
            Self::ComputeReadWrite => (S::COMPUTE_SHADER, A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE),
            Self::GraphicsRead => (graphics, read),
            Self::FragmentWrite => (S::FRAGMENT_SHADER, A::SHADER_STORAGE_WRITE),
            Self::FragmentReadWrite => (S::FRAGMENT_SHADER, A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE),
            Self::ColorAttachment => (S::COLOR_ATTACHMENT_OUTPUT, A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE),
            Self::AttachmentFeedback => (
                S::FRAGMENT_SHADER | S::COLOR_ATTACHMENT_OUTPUT,
                A::INPUT_ATTACHMENT_READ | A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE,
            ),
            Self::DepthAttachment => (
                S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS,
                A::DEPTH_STENCIL_ATTACHMENT_READ | A::DEPTH_STENCIL_ATTACHMENT_WRITE,
            ),
            Self::IndirectRead => (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ),
            Self::TransferRead => (S::ALL_TRANSFER, A::TRANSFER_READ),
            Self::TransferWrite => (S::ALL_TRANSFER, A::TRANSFER_WRITE),
            Self::HostRead => (S::HOST, A::HOST_READ),
            Self::HostWrite => (S::HOST, A::HOST_WRITE),
        }
    }

    /// Whether memory may change.
    pub fn writes(self) -> bool {
        matches!(
            self,
            Self::ComputeWrite
                | Self::ComputeReadWrite
                | Self::FragmentWrite
                | Self::FragmentReadWrite
                | Self::ColorAttachment
                | Self::DepthAttachment
                | Self::AttachmentFeedback
                | Self::TransferWrite
                | Self::HostWrite
        )
    }
}

/// What is known about one resource between passes.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct ResourceState {
    /// Stages and accesses of the last write.
    write: (vk::PipelineStageFlags2, vk::AccessFlags2),
    /// Stages that have read since.
    readers: vk::PipelineStageFlags2,
    /// Stages and accesses that the last write has been made visible to.
    visible: (vk::PipelineStageFlags2, vk::AccessFlags2),
}

impl ResourceState {
    /// Applies `access` and adds to `barrier` what must come before it.
    pub(crate) fn apply(&mut self, access: Access, barrier: &mut Barrier) {
        let (stages, accesses) = access.masks();
        if access.writes() {
            if !(self.write.0 | self.readers).is_empty() {
                barrier.add((self.write.0 | self.readers, self.write.1), (stages, accesses));
            }
            *self = Self { write: (stages, accesses & WRITES), ..Self::default() };
        } else {
            self.readers |= stages;
            let visible = self.visible.0.contains(stages) && self.visible.1.contains(accesses);
            if !self.write.0.is_empty() && !visible {
                // The pair of masks is a product: widen both together, so that it stays true of every combination.
                self.visible = (self.visible.0 | stages, self.visible.1 | accesses);
                barrier.add(self.write, self.visible);
            }
        }
    }
}

const WRITES: vk::AccessFlags2 = vk::AccessFlags2::from_raw(
    vk::AccessFlags2::SHADER_STORAGE_WRITE.as_raw()
        | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw()
        | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE.as_raw()
        | vk::AccessFlags2::TRANSFER_WRITE.as_raw()
        | vk::AccessFlags2::HOST_WRITE.as_raw(),
);

/// One memory barrier in the making: the union of what a pass needs before it starts.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Barrier {
    pub(crate) src: (vk::PipelineStageFlags2, vk::AccessFlags2),
    pub(crate) dst: (vk::PipelineStageFlags2, vk::AccessFlags2),
}

impl Barrier {
    fn add(
        &mut self,
        src: (vk::PipelineStageFlags2, vk::AccessFlags2),
        dst: (vk::PipelineStageFlags2, vk::AccessFlags2),
    ) {
        self.src = (self.src.0 | src.0, self.src.1 | src.1);
        self.dst = (self.dst.0 | dst.0, self.dst.1 | dst.1);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.src.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};

    fn barrier(accesses: &[Access]) -> Barrier {
        let mut state = ResourceState::default();
        let mut last = Barrier::default();
        for access in accesses {
            last = Barrier::default();
            state.apply(*access, &mut last);
        }
        last
    }

    #[test]
    fn a_read_after_a_compute_write_waits_for_it() {
        let b = barrier(&[Access::ComputeWrite, Access::IndirectRead]);
        assert_eq!(b.src, (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE));
        assert_eq!(b.dst, (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ));
    }

    #[test]
    fn a_second_read_of_the_same_kind_needs_nothing() {
        assert!(barrier(&[Access::ComputeWrite, Access::ComputeRead, Access::ComputeRead]).is_empty());
        assert!(barrier(&[Access::ComputeRead, Access::GraphicsRead]).is_empty());
    }

    #[test]
    fn a_read_from_another_stage_needs_its_own_barrier() {
        let b = barrier(&[Access::ComputeWrite, Access::ComputeRead, Access::GraphicsRead]);
        assert_eq!(b.src, (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE));
        assert!(b.dst.0.contains(S::FRAGMENT_SHADER));
    }

    #[test]
    fn a_write_after_reads_waits_for_every_reader() {
        let b = barrier(&[Access::HostWrite, Access::ComputeRead, Access::GraphicsRead, Access::TransferWrite]);
        assert!(b.src.0.contains(S::COMPUTE_SHADER | S::FRAGMENT_SHADER));
    }

    #[test]
    fn write_after_write_is_ordered_and_made_available() {
        let b = barrier(&[Access::TransferWrite, Access::ComputeReadWrite]);
        assert_eq!(b.src, (S::ALL_TRANSFER, A::TRANSFER_WRITE));
        assert!(b.dst.1.contains(A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE));
    }

    #[test]
    fn writing_kinds_are_those_with_a_write_mask() {
        for access in Access::ALL {
            assert_eq!(access.writes(), access.masks().1.intersects(WRITES), "{access:?}");
        }
    }
}
