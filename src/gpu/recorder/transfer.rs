//! Copies, fills and clears.

use super::Recorder;
use crate::gpu::image::COLOR;
use crate::gpu::{Access, Buffer, Image};
use ash::vk;

impl Recorder<'_> {
    /// Fills `size` bytes from `offset` with a word.
    pub fn fill_buffer(&mut self, buffer: &Buffer, offset: u64, size: u64, word: u32) {
        self.transition("fill", &[(buffer.id, Access::TransferWrite)]);
        // SAFETY: the range lies inside the buffer (validation checks it), barriers are recorded.
        unsafe { self.state.gpu.device().cmd_fill_buffer(self.cmd, buffer.handle(), offset, size, word) };
    }

    /// Copies `size` bytes from the start of one buffer to the start of another.
    pub fn copy_buffer(&mut self, from: &Buffer, to: &Buffer, size: u64) {
        self.transition("copy", &[(from.id, Access::TransferRead), (to.id, Access::TransferWrite)]);
        let region = vk::BufferCopy { src_offset: 0, dst_offset: 0, size };
        // SAFETY: as above.
        unsafe { self.state.gpu.device().cmd_copy_buffer(self.cmd, from.handle(), to.handle(), &[region]) };
    }

    /// Copies a whole image to the start of a buffer, rows tightly packed.
    pub fn copy_image_to_buffer(&mut self, from: &Image, to: &Buffer) {
        self.initialise(from);
        self.transition("copy", &[(from.id, Access::TransferRead), (to.id, Access::TransferWrite)]);
        let device = self.state.gpu.device();
        // SAFETY: the image is in GENERAL layout; the buffer is large enough (validation checks it).
        unsafe {
            let (general, region) = (vk::ImageLayout::GENERAL, region(from));
            device.cmd_copy_image_to_buffer(self.cmd, from.handle(), general, to.handle(), &[region]);
        }
    }

    /// Copies the start of a buffer, rows tightly packed, to a whole image.
    pub fn copy_buffer_to_image(&mut self, from: &Buffer, to: &Image) {
        self.initialise(to);
        self.transition("copy", &[(from.id, Access::TransferRead), (to.id, Access::TransferWrite)]);
        let device = self.state.gpu.device();
        // SAFETY: as above.
        unsafe {
            let (general, region) = (vk::ImageLayout::GENERAL, region(to));
            device.cmd_copy_buffer_to_image(self.cmd, from.handle(), to.handle(), general, &[region]);
        }
    }

    /// Clears a whole colour image.
    pub fn clear_image(&mut self, image: &Image, float32: [f32; 4]) {
        self.initialise(image);
        self.transition("clear", &[(image.id, Access::TransferWrite)]);
        let value = vk::ClearColorValue { float32 };
        let device = self.state.gpu.device();
        // SAFETY: the image is in GENERAL layout.
        unsafe { device.cmd_clear_color_image(self.cmd, image.handle(), vk::ImageLayout::GENERAL, &value, &[COLOR]) };
    }

    /// Makes what the device has written to a readback buffer visible to the host once the submission has ended.
    pub fn make_visible_to_host(&mut self, buffer: &Buffer) {
        self.transition("host", &[(buffer.id, Access::HostRead)]);
    }
}

fn region(image: &Image) -> vk::BufferImageCopy {
    let [width, height, depth] = image.extent();
    vk::BufferImageCopy::default()
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: image.layers(),
        })
        .image_extent(vk::Extent3D { width, height, depth })
}
