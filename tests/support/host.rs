//! A host with an instance, a device, command buffers, images and memory of its own, as an engine has them. Nothing here
//! comes from `welkin::gpu::standalone` but the collecting of validation messages.

use ash::vk;
use std::ffi::CStr;
use welkin::gpu::standalone::Messages;
use welkin::gpu::{DeviceFeatures, RawDevice};

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

pub struct Host {
    pub device: ash::Device,
    pub instance: ash::Instance,
    pub physical_device: vk::PhysicalDevice,
    pub family: u32,
    pub features: DeviceFeatures,
    pub interlock: bool,
    queue: vk::Queue,
    pool: vk::CommandPool,
    fence: vk::Fence,
    debug: ash::ext::debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    messages: Messages,
    _entry: ash::Entry,
}

impl Host {
    /// A device with exactly `features`, and with interlock if it is wanted and there is any.
    pub fn new(features: DeviceFeatures, interlock: bool) -> Self {
        // SAFETY: the ordinary calls of a Vulkan program, in order; every pointer in a description is alive.
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let messages = Messages::default();
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let extensions = [ash::ext::debug_utils::NAME.as_ptr(), ash::ext::validation_features::NAME.as_ptr()];
            let layers = [VALIDATION.as_ptr()];
            let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
            let mut validation = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
            let on = vk::TRUE.to_ne_bytes();
            let mut setting = vk::LayerSettingEXT::default()
                .layer_name(VALIDATION)
                .setting_name(c"syncval_shader_accesses_heuristic")
                .ty(vk::LayerSettingTypeEXT::BOOL32)
                .values(&on);
            setting.value_count = 1;
            let settings = [setting];
            let mut settings = vk::LayerSettingsCreateInfoEXT::default().settings(&settings);
            let mut info = vk::InstanceCreateInfo::default()
                .application_info(&application)
                .enabled_extension_names(&extensions)
                .enabled_layer_names(&layers)
                .push_next(&mut validation);
            let of_layer = entry.enumerate_instance_extension_properties(Some(VALIDATION)).unwrap();
            if of_layer.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::layer_settings::NAME)) {
                info = info.push_next(&mut settings);
            }
            let instance = entry.create_instance(&info, None).expect("an instance with validation");
            let debug = ash::ext::debug_utils::Instance::new(&entry, &instance);
            let messenger = debug.create_debug_utils_messenger(&messages.messenger(), None).unwrap();
            let physical_device = instance.enumerate_physical_devices().unwrap()[0];
            let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
            let families = instance.get_physical_device_queue_family_properties(physical_device);
            let family = families.iter().position(|f| f.queue_flags.contains(wanted)).unwrap() as u32;
            let extensions = instance.enumerate_device_extension_properties(physical_device).unwrap();
            let interlock = interlock
                && extensions
                    .iter()
                    .any(|e| e.extension_name_as_c_str() == Ok(ash::ext::fragment_shader_interlock::NAME));

            let (mut core, mut v12, mut v13) = Default::default();
            features.enable(&mut core, &mut v12, &mut v13);
            let mut ordered =
                vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default().fragment_shader_pixel_interlock(true);
            let mut chain =
                vk::PhysicalDeviceFeatures2::default().features(core).push_next(&mut v12).push_next(&mut v13);
            let mut names = Vec::new();
            if interlock {
                names.push(ash::ext::fragment_shader_interlock::NAME.as_ptr());
                chain = chain.push_next(&mut ordered);
            }
            let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&names)
                .push_next(&mut chain);
            let device = instance.create_device(physical_device, &info, None).unwrap();
            let queue = device.get_device_queue(family, 0);
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&info, None).unwrap();
            let fence = device.create_fence(&vk::FenceCreateInfo::default(), None).unwrap();
            Self {
                device,
                instance,
                physical_device,
                family,
                features,
                interlock,
                queue,
                pool,
                fence,
                debug,
                messenger,
                messages,
                _entry: entry,
            }
        }
    }

    /// What Welkin is handed.
    pub fn raw(&self) -> RawDevice {
        RawDevice {
            instance: self.instance.clone(),
            physical_device: self.physical_device,
            device: self.device.clone(),
            queue_family: self.family,
            features: self.features,
            interlock: self.interlock,
            attachment_access: false,
            local_read: false,
            debug_utils: true,
            allocator: None,
            pipeline_cache: None,
            factory: None,
            keep_alive: None,
        }
    }

    /// Records a command buffer of the host's, submits it and waits for it.
    pub fn submit(&self, record: impl FnOnce(vk::CommandBuffer)) {
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is new, and freed when the fence says that the device is done with it.
        unsafe {
            let buffers = self.device.allocate_command_buffers(&info).unwrap();
            self.device.begin_command_buffer(buffers[0], &begin).unwrap();
            record(buffers[0]);
            self.device.end_command_buffer(buffers[0]).unwrap();
            let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(buffers[0])];
            let submit = vk::SubmitInfo2::default().command_buffer_infos(&commands);
            self.device.queue_submit2(self.queue, &[submit], self.fence).unwrap();
            self.device.wait_for_fences(&[self.fence], true, u64::MAX).unwrap();
            self.device.reset_fences(&[self.fence]).unwrap();
            self.device.free_command_buffers(self.pool, &buffers);
        }
    }

    /// A barrier of the host's: everything before, everything after, and a change of layout.
    pub fn barrier(&self, cmd: vk::CommandBuffer, image: &HostImage, old: vk::ImageLayout, new: vk::ImageLayout) {
        let all =
            (vk::PipelineStageFlags2::ALL_COMMANDS, vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE);
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(all.0)
            .src_access_mask(all.1)
            .dst_stage_mask(all.0)
            .dst_access_mask(all.1)
            .old_layout(old)
            .new_layout(new)
            .image(image.handle)
            .subresource_range(RANGE)];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the command buffer is recording, and the image is alive.
        unsafe { self.device.cmd_pipeline_barrier2(cmd, &info) };
    }

    pub fn memory_type(&self, bits: u32, wanted: vk::MemoryPropertyFlags) -> u32 {
        // SAFETY: the handle came from this instance.
        let memory = unsafe { self.instance.get_physical_device_memory_properties(self.physical_device) };
        let fits = |i: &u32| bits & (1 << i) != 0 && memory.memory_types[*i as usize].property_flags.contains(wanted);
        (0..memory.memory_type_count).find(fits).unwrap()
    }

    /// Destroys everything and gives what validation has said from first to last.
    pub fn finish(self) -> Vec<String> {
        // SAFETY: tests drop everything made with the device before.
        unsafe {
            self.device.destroy_fence(self.fence, None);
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.debug.destroy_debug_utils_messenger(self.messenger, None);
            self.instance.destroy_instance(None);
        }
        self.messages.all()
    }
}

pub const RANGE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

/// An image of the host's in memory of the host's, and a buffer to read it back.
pub struct HostImage {
    device: ash::Device,
    pub handle: vk::Image,
    pub view: vk::ImageView,
    pub extent: [u32; 2],
    pub format: vk::Format,
    texel_bytes: u64,
    memory: [vk::DeviceMemory; 2],
    buffer: vk::Buffer,
}

impl HostImage {
    pub fn new(host: &Host, format: vk::Format, texel_bytes: u64, extent: [u32; 2]) -> Self {
        let device = host.device.clone();
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::TRANSFER_SRC
            | vk::ImageUsageFlags::TRANSFER_DST;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: extent[0], height: extent[1], depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage);
        let size = texel_bytes * u64::from(extent[0] * extent[1]);
        let buffer_info = vk::BufferCreateInfo::default()
            .size(size)
            .usage(vk::BufferUsageFlags::TRANSFER_DST | vk::BufferUsageFlags::TRANSFER_SRC);
        // SAFETY: as in `Host::new`.
        unsafe {
            let handle = device.create_image(&info, None).unwrap();
            let allocate = |needs: vk::MemoryRequirements, properties| {
                let info = vk::MemoryAllocateInfo::default()
                    .allocation_size(needs.size)
                    .memory_type_index(host.memory_type(needs.memory_type_bits, properties));
                device.allocate_memory(&info, None).unwrap()
            };
            let image_memory =
                allocate(device.get_image_memory_requirements(handle), vk::MemoryPropertyFlags::DEVICE_LOCAL);
            device.bind_image_memory(handle, image_memory, 0).unwrap();
            let buffer = device.create_buffer(&buffer_info, None).unwrap();
            let coherent = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let buffer_memory = allocate(device.get_buffer_memory_requirements(buffer), coherent);
            device.bind_buffer_memory(buffer, buffer_memory, 0).unwrap();
            let info = vk::ImageViewCreateInfo::default()
                .image(handle)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(format)
                .subresource_range(RANGE);
            let view = device.create_image_view(&info, None).unwrap();
            let memory = [image_memory, buffer_memory];
            Self { device, handle, view, extent, format, texel_bytes, memory, buffer }
        }
    }

    fn region(&self) -> vk::BufferImageCopy {
        let [width, height] = self.extent;
        let layers =
            vk::ImageSubresourceLayers { aspect_mask: RANGE.aspect_mask, layer_count: 1, ..Default::default() };
        vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D { width, height, depth: 1 })
    }

    /// Copies `image`, of this size and texel, to the buffer; no barrier before it.
    pub fn copy_from(&self, cmd: vk::CommandBuffer, image: vk::Image, layout: vk::ImageLayout) {
        // SAFETY: the command buffer is recording; image and buffer are alive.
        unsafe { self.device.cmd_copy_image_to_buffer(cmd, image, layout, self.buffer, &[self.region()]) };
    }

    /// Copies the image itself to the buffer; no barrier before it.
    pub fn copy(&self, cmd: vk::CommandBuffer, layout: vk::ImageLayout) {
        self.copy_from(cmd, self.handle, layout);
    }

    /// Fills the image, in layout `TRANSFER_DST_OPTIMAL`, with what `write` put in the buffer.
    pub fn fill(&self, cmd: vk::CommandBuffer) {
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        // SAFETY: as above.
        unsafe { self.device.cmd_copy_buffer_to_image(cmd, self.buffer, self.handle, layout, &[self.region()]) };
    }

    fn mapped<T>(&self, use_bytes: impl FnOnce(&mut [u8]) -> T) -> T {
        let size = self.texel_bytes * u64::from(self.extent[0] * self.extent[1]);
        // SAFETY: the memory is host-visible, coherent, of this size, and not in use by the device.
        unsafe {
            let memory = self.device.map_memory(self.memory[1], 0, size, vk::MemoryMapFlags::empty()).unwrap();
            let result = use_bytes(std::slice::from_raw_parts_mut(memory.cast(), size as usize));
            self.device.unmap_memory(self.memory[1]);
            result
        }
    }

    pub fn write<T: bytemuck::Pod>(&self, texels: &[T]) {
        self.mapped(|bytes| bytes.copy_from_slice(bytemuck::cast_slice(texels)));
    }

    pub fn read<T: bytemuck::Pod>(&self) -> Vec<T> {
        self.mapped(|bytes| bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }
}

impl Drop for HostImage {
    fn drop(&mut self) {
        // SAFETY: `Host::submit` waits for the device.
        unsafe {
            self.device.destroy_image_view(self.view, None);
            self.device.destroy_image(self.handle, None);
            self.device.destroy_buffer(self.buffer, None);
            for memory in self.memory {
                self.device.free_memory(memory, None);
            }
        }
    }
}
