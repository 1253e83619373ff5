//! Images. Every image that Welkin owns stays in `GENERAL` layout for its whole life; only images that an
//! engine lends have others (see [`Access`](super::Access)).

use super::id::next_id;
use super::memory::{Allocation, MemoryLocation};
use super::retire::Garbage;
use super::{Gpu, Sampler};
use crate::Result;
use ash::vk;
use std::sync::Arc;

/// What an image is.
#[derive(Clone, Copy, Debug)]
pub struct ImageDesc<'a> {
    /// Name, as debuggers show it.
    pub name: &'a str,
    /// Width, height and depth [texels]; a depth of 0 makes a 2D image, anything else a 3D image.
    pub extent: [u32; 3],
    /// Format of a texel.
    pub format: vk::Format,
    /// What it is used for. Transfers are always included.
    pub usage: vk::ImageUsageFlags,
}

/// An image with one view, freed when dropped, as soon as the frames in flight have ended.
pub struct Image {
    gpu: Arc<Gpu>,
    pub(crate) id: u64,
    name: String,
    handle: vk::Image,
    view: vk::ImageView,
    extent: [u32; 3],
    format: vk::Format,
    layers: u32,
    allocation: Option<Allocation>,
    pub(crate) owned: bool,
}

impl Image {
    /// A 2D or 3D image with one mip level and one layer.
    pub fn new(gpu: &Arc<Gpu>, desc: &ImageDesc<'_>) -> Result<Self> {
        let view = if desc.extent[2] > 0 { vk::ImageViewType::TYPE_3D } else { vk::ImageViewType::TYPE_2D };
        Self::create(gpu, desc, view, 1, vk::SampleCountFlags::TYPE_1)
    }

    /// An array of `layers` 2D images: `image2DArray` in a shader.
    pub fn layered(gpu: &Arc<Gpu>, desc: &ImageDesc<'_>, layers: u32) -> Result<Self> {
        Self::create(gpu, desc, vk::ImageViewType::TYPE_2D_ARRAY, layers, vk::SampleCountFlags::TYPE_1)
    }

    /// A 2D image with `samples` a pixel, to be drawn into and read in shaders: it cannot be copied to a buffer.
    pub fn multisampled(gpu: &Arc<Gpu>, desc: &ImageDesc<'_>, samples: vk::SampleCountFlags) -> Result<Self> {
        Self::create(gpu, desc, vk::ImageViewType::TYPE_2D, 1, samples)
    }

    fn create(
        gpu: &Arc<Gpu>,
        desc: &ImageDesc<'_>,
        view_type: vk::ImageViewType,
        layers: u32,
        samples: vk::SampleCountFlags,
    ) -> Result<Self> {
        let [width, height, depth] = desc.extent;
        let volume = view_type == vk::ImageViewType::TYPE_3D;
        let info = vk::ImageCreateInfo::default()
            .image_type(if volume { vk::ImageType::TYPE_3D } else { vk::ImageType::TYPE_2D })
            .format(desc.format)
            .extent(vk::Extent3D { width, height, depth: depth.max(1) })
            .mip_levels(1)
            .array_layers(layers)
            .samples(samples)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(desc.usage | vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST);
        // SAFETY: the device is alive as long as `gpu`, and the description is complete.
        let handle = unsafe { gpu.device().create_image(&info, None) }
            .map_err(|result| gpu.error("vkCreateImage", desc.name, result))?;
        let mut image = Self {
            gpu: gpu.clone(),
            id: next_id(),
            name: desc.name.to_owned(),
            handle,
            view: vk::ImageView::null(),
            extent: [width, height, depth.max(1)],
            format: desc.format,
            layers,
            allocation: None,
            owned: true,
        };
        // SAFETY: the image was created above on this device.
        let requirements = unsafe { gpu.device().get_image_memory_requirements(handle) };
        let allocation = gpu.memory().allocate(desc.name, requirements, MemoryLocation::Device, false)?;
        // SAFETY: the memory satisfies the requirements of this image, which is not bound yet.
        let bound = unsafe { gpu.device().bind_image_memory(handle, allocation.memory, allocation.offset) };
        image.allocation = Some(allocation);
        bound.map_err(|result| gpu.sized_error("vkBindImageMemory", desc.name, Some(requirements.size), result))?;
        let info = vk::ImageViewCreateInfo::default()
            .image(handle)
            .view_type(view_type)
            .format(desc.format)
            .subresource_range(image.range());
        // SAFETY: the image is bound to memory and the range is the whole image.
        image.view = unsafe { gpu.device().create_image_view(&info, None) }
            .map_err(|result| gpu.error("vkCreateImageView", desc.name, result))?;
        gpu.set_name(handle, desc.name);
        gpu.set_name(image.view, desc.name);
        Ok(image)
    }

    /// Wraps an image that the host lends; nothing is destroyed on drop. A host wraps each of its images once and keeps the
    /// wrapper as long as the image; [`RecorderState::forget`](super::RecorderState::forget) drops the descriptor sets
    /// of images that have gone.
    ///
    /// # Safety
    /// `handle` and `view` are of this extent and format, with one sample, level and layer of colour, and stay valid until
    /// the device has ended every frame in which the returned image is used.
    pub unsafe fn borrow(
        gpu: &Arc<Gpu>,
        name: &str,
        handle: vk::Image,
        view: vk::ImageView,
        extent: [u32; 2],
        format: vk::Format,
    ) -> Self {
        Self {
            gpu: gpu.clone(),
            id: next_id(),
            name: name.to_owned(),
            handle,
            view,
            extent: [extent[0], extent[1], 1],
            format,
            layers: 1,
            allocation: None,
            owned: false,
        }
    }

    /// The Vulkan handle.
    pub fn handle(&self) -> vk::Image {
        self.handle
    }

    /// A view of the whole image.
    pub fn view(&self) -> vk::ImageView {
        self.view
    }

    /// Width, height and depth [texels].
    pub fn extent(&self) -> [u32; 3] {
        self.extent
    }

    /// Format of a texel.
    pub fn format(&self) -> vk::Format {
        self.format
    }

    /// Array layers; 1 but for [`Self::layered`] images.
    pub fn layers(&self) -> u32 {
        self.layers
    }

    /// The whole image: its depth, if its format is one of depth alone, else its colour.
    pub(crate) fn range(&self) -> vk::ImageSubresourceRange {
        match self.format {
            vk::Format::D16_UNORM | vk::Format::X8_D24_UNORM_PACK32 | vk::Format::D32_SFLOAT => {
                vk::ImageSubresourceRange { aspect_mask: vk::ImageAspectFlags::DEPTH, ..COLOR }
            }
            _ => COLOR,
        }
    }

    /// Name, as debuggers show it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// This image as read through `sampler`.
    pub fn sampled(&self, sampler: Sampler) -> Sampled<'_> {
        Sampled { image: self, sampler }
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        if !self.owned {
            return;
        }
        self.gpu.retire(Garbage::Image(self.handle, self.view, self.allocation.take()));
    }
}

/// The whole of a colour image with one level.
pub(crate) const COLOR: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: vk::REMAINING_ARRAY_LAYERS,
};

/// An image and the sampler that reads it.
#[derive(Clone, Copy)]
pub struct Sampled<'a> {
    /// The image.
    pub image: &'a Image,
    /// How it is filtered and wrapped.
    pub sampler: Sampler,
}
