//! Welkin inside a program that has a Vulkan device, a queue, command buffers and images of its own.
//!
//! The host draws first (here: it clears), lends Welkin its picture and its opaque distances in the layouts that they
//! happen to be in, and has Welkin record a cloudy sky into the host's command buffer. Then it copies the picture away and
//! writes it as a PNG.
//!
//! `cargo run --release --example embed -- sky.png`

use ash::vk;
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use welkin::Params;
use welkin::frame::{FrameInputs, FrameOutput, Lent, Output, OutputKind};
use welkin::gpu::{Access, Capabilities, DeviceFeatures, Feature, Frames, Gpu, Image, RawDevice, RecorderState};
use welkin::lut::{Detail, TableParams, Tables};
use welkin::output::{Picture, PngDepth};
use welkin::params::Preset;
use welkin::renderer::{Renderer, TableImages};

const SIZE: [u32; 2] = [640, 360];
/// As a swapchain has it.
const FORMAT: vk::Format = vk::Format::B8G8R8A8_UNORM;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or("sky.png".into());

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
    // SAFETY: the instance is alive.
    let memory = unsafe { instance.get_physical_device_memory_properties(physical_device) };
    let host = Host::new(&device, queue, queue_family, &memory)?;

    // The loan.
    let raw = RawDevice {
        instance: instance.clone(),
        physical_device,
        device: device.clone(),
        queue_family,
        features: DeviceFeatures::WANTED, // what `create_device` enabled
        interlock,
        attachment_access: false,
        local_read: false,
        debug_utils: false,
        allocator: None,      // or an engine's own, behind `welkin::gpu::Allocator`
        pipeline_cache: None, // or an engine's own
        factory: None,        // or an engine's own: see examples/pipeline_state.rs
        keep_alive: None,
    };
    // SAFETY: the handles belong together, the features are those of `create_device`, and `render` drops all that it made.
    let gpu = unsafe { Gpu::from_raw(raw)? };
    let bgra = render(&gpu, queue, &host)?;
    drop((host, gpu));

    let display: Vec<_> = bgra.iter().map(|&[b, g, r, _]| [r, g, b].map(|v| f32::from(v) / 255.0)).collect();
    let radiance = vec![[0.0; 3]; display.len()]; // Not of interest here: a PNG holds the toned picture.
    let picture = Picture { width: SIZE[0], height: SIZE[1], radiance, transmittance: None, display };
    picture.write(Path::new(&path), PngDepth::Eight)?;
    println!("wrote {path}");
    // SAFETY: everything made on the device is gone.
    unsafe {
        device.destroy_device(None);
        instance.destroy_instance(None);
    }
    Ok(())
}

/// A device with what Welkin must have, and interlock if there is.
fn create_device(
    instance: &ash::Instance,
    physical_device: vk::PhysicalDevice,
    queue_family: u32,
    interlock: bool,
) -> Result<ash::Device, vk::Result> {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
    let (mut core, mut v12, mut v13) = Default::default(); // An engine's own features are set here too.
    DeviceFeatures::WANTED.enable(&mut core, &mut v12, &mut v13);
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

/// Renders a frame into the host's picture; its texels.
fn render(gpu: &Arc<Gpu>, queue: vk::Queue, host: &Host<'_>) -> Result<Vec<[u8; 4]>, Box<dyn Error>> {
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

    // Once per size and format. Everything is compiled here.
    let mut renderer = Renderer::new(gpu, &params, SIZE, 1)?;
    let output = Output::new(gpu, OutputKind::Picture, FORMAT)?;
    println!("blending: {} ({})", renderer.choice().used, renderer.choice().reason);
    let mut state = RecorderState::new(gpu, 1)?;
    // SAFETY: the host's images outlive the wrappers.
    let (picture, distance) = unsafe {
        let borrow = |name, (image, view): (vk::Image, vk::ImageView), format| {
            Image::borrow(gpu, name, image, view, SIZE, format)
        };
        (
            borrow("the host's picture", host.picture, FORMAT),
            borrow("the host's distances", host.distance, vk::Format::R32_SFLOAT),
        )
    };

    let mut inputs = FrameInputs::new(&params.camera, images);
    // The host has just cleared both images, and wants the picture for a copy and the distances for its own shaders.
    let cleared = (Access::TransferWrite, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
    let to_copy = (Access::TransferRead, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    let to_read = (Access::GraphicsRead, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
    inputs.opaque_distance = Some(Lent { image: &distance, entry: cleared, exit: to_read });
    let target = Lent { image: &picture, entry: cleared, exit: to_copy };

    loop {
        host.submit(|cmd| {
            host.draw(cmd);
            // SAFETY: `cmd` records and is submitted at once; the last frame has ended.
            let mut recorder = unsafe { state.begin(cmd, 0) };
            renderer.record_frame(&mut recorder, &inputs, Some(&FrameOutput { output: &output, target }))?;
            host.copy(cmd); // No barrier: the exit access stands for it.
            Ok(())
        })?;
        // Lists that were too small have been counted and grow between frames. An engine shows the frame all the same.
        if !renderer.finish(gpu, 0)? {
            return Ok(host.texels());
        }
        state.forget();
    }
}

/// The host's command buffer, images and memory.
struct Host<'a> {
    device: &'a ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    picture: (vk::Image, vk::ImageView),
    distance: (vk::Image, vk::ImageView),
    buffer: vk::Buffer,
    memory: Vec<vk::DeviceMemory>,
}

const BYTES: u64 = SIZE[0] as u64 * SIZE[1] as u64 * 4;
const RANGE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

impl<'a> Host<'a> {
    fn new(
        device: &'a ash::Device,
        queue: vk::Queue,
        queue_family: u32,
        types: &vk::PhysicalDeviceMemoryProperties,
    ) -> Result<Self, Box<dyn Error>> {
        let mut memory = Vec::new();
        let mut allocate = |needs: vk::MemoryRequirements, wanted| -> Result<vk::DeviceMemory, Box<dyn Error>> {
            let fits = |i: &u32| {
                needs.memory_type_bits >> i & 1 == 1 && types.memory_types[*i as usize].property_flags.contains(wanted)
            };
            let index = (0..types.memory_type_count).find(fits).ok_or("no such memory")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
            // SAFETY: the device is alive.
            memory.push(unsafe { device.allocate_memory(&info, None)? });
            Ok(memory[memory.len() - 1])
        };
        let mut image = |format, usage| -> Result<(vk::Image, vk::ImageView), Box<dyn Error>> {
            let info = vk::ImageCreateInfo::default()
                .image_type(vk::ImageType::TYPE_2D)
                .format(format)
                .extent(vk::Extent3D { width: SIZE[0], height: SIZE[1], depth: 1 })
                .mip_levels(1)
                .array_layers(1)
                .samples(vk::SampleCountFlags::TYPE_1)
                .usage(usage | vk::ImageUsageFlags::TRANSFER_DST);
            // SAFETY: the device is alive, and the memory fits.
            unsafe {
                let image = device.create_image(&info, None)?;
                let needs = device.get_image_memory_requirements(image);
                device.bind_image_memory(image, allocate(needs, vk::MemoryPropertyFlags::DEVICE_LOCAL)?, 0)?;
                let info = vk::ImageViewCreateInfo::default()
                    .image(image)
                    .view_type(vk::ImageViewType::TYPE_2D)
                    .format(format)
                    .subresource_range(RANGE);
                Ok((image, device.create_image_view(&info, None)?))
            }
        };
        let picture = image(FORMAT, vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC)?;
        let distance = image(vk::Format::R32_SFLOAT, vk::ImageUsageFlags::SAMPLED)?;
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device is alive, and the memory fits.
        unsafe {
            let pool = device.create_command_pool(&info, None)?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let commands = device.allocate_command_buffers(&info)?[0];
            let info = vk::BufferCreateInfo::default().size(BYTES).usage(vk::BufferUsageFlags::TRANSFER_DST);
            let buffer = device.create_buffer(&info, None)?;
            let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            device.bind_buffer_memory(buffer, allocate(device.get_buffer_memory_requirements(buffer), wanted)?, 0)?;
            Ok(Self { device, queue, pool, commands, picture, distance, buffer, memory })
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

    /// What the host draws: an empty world, in which nothing is opaque. Magenta would show wherever Welkin leaves a pixel out.
    fn draw(&self, cmd: vk::CommandBuffer) {
        for (image, float32) in [(self.picture.0, [1.0, 0.0, 1.0, 1.0]), (self.distance.0, [1e30; 4])] {
            let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            let barrier = vk::ImageMemoryBarrier::default()
                .dst_access_mask(vk::AccessFlags::TRANSFER_WRITE)
                .new_layout(layout)
                .image(image)
                .subresource_range(RANGE);
            let (top, transfer) = (vk::PipelineStageFlags::TOP_OF_PIPE, vk::PipelineStageFlags::TRANSFER);
            let none = vk::DependencyFlags::empty();
            let colour = vk::ClearColorValue { float32 };
            // SAFETY: `cmd` records outside a render pass; the image is alive.
            unsafe {
                self.device.cmd_pipeline_barrier(cmd, top, transfer, none, &[], &[], &[barrier]);
                self.device.cmd_clear_color_image(cmd, image, layout, &colour, &[RANGE]);
            }
        }
    }

    /// Copies the picture, in TRANSFER_SRC_OPTIMAL, into the buffer.
    fn copy(&self, cmd: vk::CommandBuffer) {
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
            self.device.cmd_copy_image_to_buffer(cmd, self.picture.0, layout, self.buffer, &[region]);
            let none = vk::DependencyFlags::empty();
            self.device.cmd_pipeline_barrier(cmd, copy, host, none, &[seen_by_host], &[], &[]);
        }
    }

    fn texels(&self) -> Vec<[u8; 4]> {
        let memory = self.memory[self.memory.len() - 1];
        // SAFETY: the memory is mapped for its whole size, and the device is done with it.
        unsafe {
            let mapped = self.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty());
            let bytes = mapped.map_or(&[][..], |at| std::slice::from_raw_parts(at.cast::<u8>(), BYTES as usize));
            let texels = bytes.chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]]).collect();
            self.device.unmap_memory(memory);
            texels
        }
    }
}

impl Drop for Host<'_> {
    fn drop(&mut self) {
        // SAFETY: the queue is idle after `submit`.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            for (image, view) in [self.picture, self.distance] {
                self.device.destroy_image_view(view, None);
                self.device.destroy_image(image, None);
            }
            self.device.destroy_buffer(self.buffer, None);
            for memory in &self.memory {
                self.device.free_memory(*memory, None);
            }
        }
    }
}
