//! Welkin inside a program that has a Vulkan device and a frame loop of its own.
//!
//! The host creates instance, device, queue and command buffer; Welkin records a cloudy sky into that command buffer and
//! leaves the picture in an image, which the host copies away. Every pipeline passes through the host before it is built.
//!
//! `cargo run --release --example embed -- sky.ppm`

use ash::vk;
use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;
use welkin::Params;
use welkin::gpu::{
    Access, Capabilities, Feature, Frames, Gpu, Image, PipelineDesc, PipelineFactory, RawDevice, RecorderState,
};
use welkin::lut::{Detail, TableParams, Tables};
use welkin::params::Preset;
use welkin::renderer::{Renderer, TableImages};

const SIZE: [u32; 2] = [640, 360];

/// Sees every pipeline before it is built. Here it only prints; it may as well change states, formats and constants, or
/// build the pipeline by its own means.
struct Witness;

impl PipelineFactory for Witness {
    fn describe(&self, desc: PipelineDesc) -> PipelineDesc {
        println!("{desc}");
        desc
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or("sky.ppm".into());

    // What an engine has anyway.
    // SAFETY: loads the Vulkan loader.
    let entry = unsafe { ash::Entry::load()? };
    let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
    // SAFETY: every pointer in the description is alive; here and below.
    let instance = unsafe { entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&app), None)? };
    // SAFETY: the instance is alive.
    let (physical_device, capabilities) = unsafe { instance.enumerate_physical_devices()? }
        .into_iter()
        .map(|device| (device, Capabilities::probe(&instance, device, None)))
        .find(|(_, capabilities)| capabilities.missing.is_empty())
        .ok_or("no device does what Welkin needs")?;
    let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    // SAFETY: as above.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical_device) };
    let queue_family = families.iter().position(|f| f.queue_flags.contains(wanted)).ok_or("no queue")? as u32;
    let interlock = capabilities.supports(Feature::FragmentShaderInterlock).is_ok();
    println!("{}: interlock {interlock}", capabilities.device_name);
    let device = create_device(&instance, physical_device, queue_family, interlock)?;
    // SAFETY: the family was created with one queue.
    let queue = unsafe { device.get_device_queue(queue_family, 0) };

    // The loan.
    let raw = RawDevice {
        instance: instance.clone(),
        physical_device,
        device: device.clone(),
        queue_family,
        interlock,
        attachment_access: false,
        debug_utils: false,
        allocator: None,      // or an engine's own, behind `welkin::gpu::Allocator`
        pipeline_cache: None, // or an engine's own
        factory: Some(Box::new(Witness)),
        keep_alive: None,
    };
    // SAFETY: the handles belong together, the features are those of `create_device`, and `render` drops all that it made.
    let gpu = unsafe { Gpu::from_raw(raw)? };
    // SAFETY: the instance is alive.
    let memory = unsafe { instance.get_physical_device_memory_properties(physical_device) };
    let host = Host::new(&device, queue, queue_family, &memory)?;
    let pixels = render(&gpu, queue, &host)?;
    drop((host, gpu));

    let mut ppm = format!("P6\n{} {}\n255\n", SIZE[0], SIZE[1]).into_bytes();
    ppm.extend(pixels.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]].map(|v| (v >> 8) as u8)));
    std::fs::write(&path, ppm)?;
    println!("wrote {path}");
    // SAFETY: everything made on the device is gone.
    unsafe {
        device.destroy_device(None);
        instance.destroy_instance(None);
    }
    Ok(())
}

/// A device with what Welkin must have (`welkin::gpu::FEATURES_WANTED`), and interlock if there is.
fn create_device(
    instance: &ash::Instance,
    physical_device: vk::PhysicalDevice,
    queue_family: u32,
    interlock: bool,
) -> Result<ash::Device, vk::Result> {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
    let core = vk::PhysicalDeviceFeatures::default()
        .fragment_stores_and_atomics(true)
        .independent_blend(true)
        .shader_storage_image_extended_formats(true)
        .shader_storage_image_write_without_format(true);
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default()
        .synchronization2(true)
        .dynamic_rendering(true)
        .shader_demote_to_helper_invocation(true);
    let mut ordered =
        vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default().fragment_shader_pixel_interlock(true);
    let mut features = vk::PhysicalDeviceFeatures2::default().features(core).push_next(&mut v12).push_next(&mut v13);
    let mut extensions = Vec::new();
    if interlock {
        extensions.push(ash::ext::fragment_shader_interlock::NAME.as_ptr());
        features = features.push_next(&mut ordered);
    }
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut features);
    // SAFETY: every pointer in the description is alive.
    unsafe { instance.create_device(physical_device, &info, None) }
}

/// Renders a frame with the host's own command buffer; its pixels, four 16-bit values each.
fn render(gpu: &Arc<Gpu>, queue: vk::Queue, host: &Host<'_>) -> Result<Vec<u16>, Box<dyn Error>> {
    let mut params = Params::default();
    params.quality = Preset::Low.quality();

    // Once per medium: the tables, with the frame loop that Welkin brings for programs without one.
    // SAFETY: nobody else uses the queue.
    let mut frames = unsafe { Frames::new(gpu, queue, 1)? };
    let tables = TableParams::new(&params.clouds, Detail::Coarse);
    let tables = Tables::load_or_build(&mut frames, &tables, None, &mut |_| ControlFlow::Continue(()))?;
    let tables = tables.ok_or("only a break ends without tables")?;
    drop(frames);
    let images = TableImages {
        optical_depth: tables.optical_depth.image(),
        scattering: tables.scattering.image(),
        fill: tables.fill(),
    };

    let mut renderer = Renderer::new(gpu, &params, SIZE, 1)?;
    println!("blending: {} ({})", renderer.choice().used, renderer.choice().reason);
    let mut state = RecorderState::new(gpu, 1)?;
    loop {
        host.submit(|cmd| {
            // SAFETY: `cmd` records and is submitted at once; the last frame has ended.
            let mut recorder = unsafe { state.begin(cmd, 0) };
            renderer.record(&mut recorder, &params.camera, images)?;
            // The picture goes to the host, ready to be copied from.
            let picture = &renderer.film().picture;
            recorder.release(picture, Access::TransferRead, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
            host.copy(cmd, picture);
            recorder.acquire(picture, Access::TransferRead, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
            Ok(())
        })?;
        // Lists that were too small have been counted and grow between frames. An engine shows the frame all the same.
        if !renderer.finish(gpu, 0)? {
            return Ok(host.pixels());
        }
        state.forget();
    }
}

/// The host's command buffer, and memory of its own for the picture.
struct Host<'a> {
    device: &'a ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
}

const BYTES: u64 = SIZE[0] as u64 * SIZE[1] as u64 * 8;

impl<'a> Host<'a> {
    fn new(
        device: &'a ash::Device,
        queue: vk::Queue,
        queue_family: u32,
        types: &vk::PhysicalDeviceMemoryProperties,
    ) -> Result<Self, Box<dyn Error>> {
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device is alive; a memory type that the host sees suits every buffer.
        unsafe {
            let pool = device.create_command_pool(&info, None)?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let commands = device.allocate_command_buffers(&info)?[0];
            let info = vk::BufferCreateInfo::default().size(BYTES).usage(vk::BufferUsageFlags::TRANSFER_DST);
            let buffer = device.create_buffer(&info, None)?;
            let needs = device.get_buffer_memory_requirements(buffer);
            let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let index = (0..types.memory_type_count)
                .find(|&i| {
                    needs.memory_type_bits >> i & 1 == 1
                        && types.memory_types[i as usize].property_flags.contains(wanted)
                })
                .ok_or("no memory that the host sees")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
            let memory = device.allocate_memory(&info, None)?;
            device.bind_buffer_memory(buffer, memory, 0)?;
            Ok(Self { device, queue, pool, commands, buffer, memory })
        }
    }

    /// Records, submits and waits.
    fn submit(
        &self,
        record: impl FnOnce(vk::CommandBuffer) -> Result<(), welkin::Error>,
    ) -> Result<(), Box<dyn Error>> {
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let commands = [self.commands];
        // SAFETY: the last submission has ended; the queue is used by nobody else.
        unsafe {
            self.device.begin_command_buffer(self.commands, &begin)?;
            record(self.commands)?;
            self.device.end_command_buffer(self.commands)?;
            let submit = vk::SubmitInfo::default().command_buffers(&commands);
            self.device.queue_submit(self.queue, &[submit], vk::Fence::null())?;
            Ok(self.device.queue_wait_idle(self.queue)?)
        }
    }

    /// Copies a picture in TRANSFER_SRC_OPTIMAL into the buffer.
    fn copy(&self, cmd: vk::CommandBuffer, picture: &Image) {
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let extent = vk::Extent3D { width: SIZE[0], height: SIZE[1], depth: 1 };
        let region = vk::BufferImageCopy::default().image_subresource(layers).image_extent(extent);
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        let seen_by_host = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ);
        let (copy, host) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        // SAFETY: `cmd` records outside a render pass; image and buffer are alive.
        unsafe {
            self.device.cmd_copy_image_to_buffer(cmd, picture.handle(), layout, self.buffer, &[region]);
            let none = vk::DependencyFlags::empty();
            self.device.cmd_pipeline_barrier(cmd, copy, host, none, &[seen_by_host], &[], &[]);
        }
    }

    fn pixels(&self) -> Vec<u16> {
        // SAFETY: the memory is mapped for its whole size, and the device is done with it.
        unsafe {
            let mapped = self.device.map_memory(self.memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty());
            let bytes = mapped.map_or(&[][..], |at| std::slice::from_raw_parts(at.cast::<u8>(), BYTES as usize));
            let pixels = bytes.chunks_exact(2).map(|pair| u16::from_ne_bytes([pair[0], pair[1]])).collect();
            self.device.unmap_memory(self.memory);
            pixels
        }
    }
}

impl Drop for Host<'_> {
    fn drop(&mut self) {
        // SAFETY: the queue is idle after `submit`.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
        }
    }
}
