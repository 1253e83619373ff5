//! Welkin inside a host: its device, its command buffers, its images in whatever layout, its allocator, its pipelines.

#[path = "support/host.rs"]
mod host;

use ash::vk;
use host::{Host, HostImage};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use welkin::frame::{FrameInputs, FrameOutput, Lent, Output, OutputKind};
use welkin::gpu::{
    Access, Allocation, Allocator, BlendState, DefaultFactory, DeviceFeatures, Gpu, Image, MemoryLocation,
    PipelineDesc, PipelineFactory, PipelineKind, RawDevice, RecorderState,
};
use welkin::params::{
    Aim, Blend, Camera, Clouds, Lighting, Params, ParticleDesc, Precision, SkyModel, Source, Style, SunPosition,
};
use welkin::renderer::Renderer;
use welkin::{Error, Result};

const SIZE: [u32; 2] = [48, 32];
const PIXELS: usize = (SIZE[0] * SIZE[1]) as usize;
const TO_COPY: (Access, vk::ImageLayout) = (Access::TransferRead, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
const DROPPED: (Access, vk::ImageLayout) = (Access::None, vk::ImageLayout::UNDEFINED);

/// Two overlapping coloured clouds before a black background, at full resolution.
fn params() -> Params {
    let ball = |x: f64, z: f64, colour| ParticleDesc {
        centre: [x, 500.0, z],
        radii: [300.0, 200.0, 300.0],
        density: 0.05,
        colour,
        ..ParticleDesc::default()
    };
    let mut params = Params {
        camera: Camera { aim: Aim::Angles { yaw: 0.0, pitch: 0.0 }, ..Camera::default() },
        clouds: Clouds {
            source: Source::Particles(vec![
                ball(-100.0, -1500.0, [1.0, 0.4, 0.1]),
                ball(150.0, -1700.0, [0.1, 0.5, 1.0]),
            ]),
            lighting: Lighting::Flat,
            style: Style::Homogeneous,
            ..Clouds::default()
        },
        ..Params::default()
    };
    params.sky.model = SkyModel::None;
    (params.quality.downscale, params.quality.precision) = (1, Precision::F32);
    params
}

fn gpu(raw: RawDevice) -> Arc<Gpu> {
    // SAFETY: the handles belong together, and tests drop everything before `Host::finish`.
    unsafe { Gpu::from_raw(raw) }.unwrap()
}

fn wrap(gpu: &Arc<Gpu>, name: &str, image: &HostImage) -> Image {
    // SAFETY: the wrapper is dropped before the image.
    unsafe { Image::borrow(gpu, name, image.handle, image.view, image.extent, image.format) }
}

/// A renderer in a host.
struct Embedded<'h> {
    renderer: Renderer,
    state: RecorderState,
    gpu: Arc<Gpu>,
    params: Params,
    host: &'h Host,
}

impl<'h> Embedded<'h> {
    fn new(host: &'h Host, gpu: Arc<Gpu>, params: Params) -> Self {
        let renderer = Renderer::new(&gpu, &params, SIZE, 1).unwrap();
        let mut embedded = Self { renderer, state: RecorderState::new(&gpu, 1).unwrap(), gpu, params, host };
        embedded.settle();
        embedded
    }

    /// Frames for the lists' sizes, as a host has them at load time. `submit` waits, so the device is idle.
    fn settle(&mut self) {
        for _ in 0..8 {
            self.record(None, None, |_| (), |_, _| ());
            if !self.renderer.wants_more(0) {
                return;
            }
            assert!(self.renderer.finish(&self.gpu, 0).unwrap());
            self.state.forget();
        }
        panic!("the lists keep growing");
    }

    /// A frame for which all lists are large enough.
    fn frame(
        &mut self,
        opaque_distance: Option<Lent<'_>>,
        output: Option<&FrameOutput<'_>>,
        before: impl FnOnce(vk::CommandBuffer),
        after: impl FnOnce(vk::CommandBuffer, &Renderer),
    ) {
        self.record(opaque_distance, output, before, after);
        assert!(!self.renderer.wants_more(0));
    }

    /// Records a frame into a command buffer of the host's, between `before` and `after`.
    fn record(
        &mut self,
        opaque_distance: Option<Lent<'_>>,
        output: Option<&FrameOutput<'_>>,
        before: impl FnOnce(vk::CommandBuffer),
        after: impl FnOnce(vk::CommandBuffer, &Renderer),
    ) {
        let inputs = FrameInputs { camera: &self.params.camera, tables: None, opaque_distance };
        self.host.submit(|cmd| {
            before(cmd);
            // SAFETY: `cmd` records, and the last frame has ended: `submit` waits.
            let mut rec = unsafe { self.state.begin(cmd, 0) };
            self.renderer.record_frame(&mut rec, &inputs, output).unwrap();
            rec.share(&self.renderer.film().picture, Access::TransferRead);
            after(cmd, &self.renderer);
        });
    }

    /// A frame into `image`, which comes in layout `entry` after that access; then it is read back.
    fn frame_into<T: bytemuck::Pod>(
        &mut self,
        output: &Output,
        image: &HostImage,
        entry: (Access, vk::ImageLayout),
        before: impl FnOnce(vk::CommandBuffer),
    ) -> Vec<T> {
        let lent = wrap(&self.gpu, "the host's picture", image);
        let target = Lent { image: &lent, entry, exit: TO_COPY };
        // No barrier of the host's before its copy: the exit access stands for it.
        self.frame(None, Some(&FrameOutput { output, target }), before, |cmd, _| image.copy(cmd, TO_COPY.1));
        image.read()
    }
}

#[test]
fn any_entry_layout_gives_the_same_picture() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    {
        let format = vk::Format::R16G16B16A16_UNORM; // That of the renderer's own picture: equal to the bit.
        let (image, own) = (HostImage::new(&host, format, 8, SIZE), HostImage::new(&host, format, 8, SIZE));
        let mut embedded = Embedded::new(&host, gpu(host.raw()), params());
        let output = Output::new(&embedded.gpu, OutputKind::Picture, format).unwrap();
        embedded.frame(
            None,
            None,
            |_| (),
            |cmd, renderer| {
                own.copy_from(cmd, renderer.film().picture.handle(), vk::ImageLayout::GENERAL);
            },
        );
        let expected: Vec<u16> = own.read();
        assert!(expected.iter().any(|value| (10_000..60_000).contains(value)), "no cloud in sight");
        use vk::ImageLayout as L;
        let entries = [
            DROPPED,
            (Access::TransferWrite, L::TRANSFER_DST_OPTIMAL),
            (Access::TransferRead, L::TRANSFER_SRC_OPTIMAL),
            (Access::GraphicsRead, L::SHADER_READ_ONLY_OPTIMAL),
            (Access::ColorAttachment, L::COLOR_ATTACHMENT_OPTIMAL),
            (Access::ComputeRead, L::GENERAL),
        ];
        for entry in entries {
            let picture: Vec<u16> = embedded.frame_into(&output, &image, entry, |cmd| match entry.1 {
                L::UNDEFINED => {}
                L::TRANSFER_DST_OPTIMAL => {
                    // A write of the host's just before the frame: only the named access orders it.
                    host.barrier(cmd, &image, L::UNDEFINED, L::TRANSFER_DST_OPTIMAL);
                    image.fill(cmd);
                }
                layout => host.barrier(cmd, &image, L::UNDEFINED, layout),
            });
            assert!(picture == expected, "another picture from entry {entry:?}");
        }
    }
    assert_eq!(host.finish(), Vec::<String>::new());
}

#[test]
#[should_panic(expected = "the host's picture is lent: acquire it before a pass uses it")]
fn a_lent_image_that_was_not_acquired_is_refused() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    let image = HostImage::new(&host, vk::Format::R8G8B8A8_UNORM, 4, SIZE);
    let gpu = gpu(host.raw());
    let (lent, mut state) = (wrap(&gpu, "the host's picture", &image), RecorderState::new(&gpu, 1).unwrap());
    // SAFETY: `cmd` records, and nothing was recorded before.
    host.submit(|cmd| unsafe { state.begin(cmd, 0) }.clear_image(&lent, [0.0; 4]));
}

#[test]
fn the_sun_moves_between_frames() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    {
        let image = HostImage::new(&host, vk::Format::R32G32B32A32_SFLOAT, 16, SIZE);
        let mut early = params();
        early.sky.model = SkyModel::Atmosphere;
        let mut late = early.clone();
        late.sun.position = SunPosition::Angles { elevation: 4.0, azimuth: 280.0 };
        let mut moving = Embedded::new(&host, gpu(host.raw()), early);
        let output = Output::new(&moving.gpu, OutputKind::Radiance, image.format).unwrap();
        let before: Vec<[f32; 4]> = moving.frame_into(&output, &image, DROPPED, |_| ());
        moving.renderer.set_sun(late.sun.position).unwrap();
        moving.settle(); // Shadows are longer, and so are the light's lists.
        let after: Vec<[f32; 4]> = moving.frame_into(&output, &image, DROPPED, |_| ());
        let mut fresh = Embedded::new(&host, moving.gpu.clone(), late);
        let expected: Vec<[f32; 4]> = fresh.frame_into(&output, &image, DROPPED, |_| ());
        assert!(before != after && after == expected, "the sky is not that of the new sun");
        let wrong = SunPosition::Angles { elevation: 91.0, azimuth: 0.0 };
        assert!(matches!(moving.renderer.set_sun(wrong), Err(Error::InvalidParam { .. })));
    }
    assert_eq!(host.finish(), Vec::<String>::new());
}

#[test]
fn a_host_that_names_a_wrong_entry_access_is_found_out() {
    // The canary of this file: silence elsewhere would mean nothing if validation did not see the lent images.
    let host = Host::new(DeviceFeatures::WANTED, true);
    {
        let image = HostImage::new(&host, vk::Format::R8G8B8A8_UNORM, 4, SIZE);
        let mut embedded = Embedded::new(&host, gpu(host.raw()), params());
        let output = Output::new(&embedded.gpu, OutputKind::Picture, image.format).unwrap();
        let dst = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        embedded.frame_into::<u8>(&output, &image, (Access::None, dst), |cmd| {
            host.barrier(cmd, &image, vk::ImageLayout::UNDEFINED, dst);
            image.fill(cmd); // A write, but the entry says that nothing has touched the image.
        });
    }
    let messages = host.finish();
    assert!(
        messages.iter().any(|m| m.contains("WRITE_AFTER_WRITE") || m.contains("WRITE-AFTER-WRITE")),
        "{messages:?}"
    );
}

#[test]
fn formats_that_encode_get_the_same_picture_as_those_that_do_not() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    {
        let mut embedded = Embedded::new(&host, gpu(host.raw()), params());
        let mut render = |format| {
            let image = HostImage::new(&host, format, 4, SIZE);
            let output = Output::new(&embedded.gpu, OutputKind::Picture, format).unwrap();
            embedded.frame_into::<[u8; 4]>(&output, &image, DROPPED, |_| ())
        };
        let plain = render(vk::Format::R8G8B8A8_UNORM);
        // Swizzled is equal to the bit. Decoding and encoding again takes one code at most: the driver's encoding is an
        // approximation that Vulkan allows to be off by 0.6 codes, and each result is rounded.
        let swizzled = render(vk::Format::B8G8R8A8_UNORM);
        let encoded = render(vk::Format::R8G8B8A8_SRGB);
        for ((p, s), e) in plain.iter().zip(&swizzled).zip(&encoded) {
            assert_eq!([p[0], p[1], p[2]], [s[2], s[1], s[0]]);
            assert!((0..3).all(|i| p[i].abs_diff(e[i]) <= 1), "{p:?} {e:?}");
        }
        assert!(plain.iter().any(|p| p[0] > 100), "no cloud in sight");
    }
    assert_eq!(host.finish(), Vec::<String>::new());
}

#[test]
fn over_lays_the_clouds_over_what_the_host_has_drawn() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    {
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = HostImage::new(&host, format, 16, SIZE);
        let mut embedded = Embedded::new(&host, gpu(host.raw()), params());
        let radiance = Output::new(&embedded.gpu, OutputKind::Radiance, format).unwrap();
        let clouds: Vec<[f32; 4]> = embedded.frame_into(&radiance, &image, DROPPED, |_| ());
        let drawn: Vec<[f32; 4]> = (0..PIXELS).map(|i| [i as f32 / 100.0, 2.0, (i % 48) as f32, 1.0]).collect();
        image.write(&drawn);
        let over = Output::new(&embedded.gpu, OutputKind::Over, format).unwrap();
        let dst = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let result: Vec<[f32; 4]> = embedded.frame_into(&over, &image, (Access::TransferWrite, dst), |cmd| {
            host.barrier(cmd, &image, vk::ImageLayout::UNDEFINED, dst);
            image.fill(cmd);
        });
        for ((c, d), r) in clouds.iter().zip(&drawn).zip(&result) {
            for i in 0..3 {
                let expected = f64::from(c[i]) + f64::from(c[3]) * f64::from(d[i]);
                // One multiplication and one addition in f32.
                assert!((f64::from(r[i]) - expected).abs() <= 2.4e-7 * expected.abs() + 1e-30, "{c:?} {d:?} {r:?}");
            }
        }
        assert!(clouds.iter().any(|c| c[3] < 0.1) && clouds.iter().any(|c| c[3] == 1.0), "no cloud, or nothing else");
    }
    assert_eq!(host.finish(), Vec::<String>::new());
}

#[test]
#[should_panic(expected = "UNDEFINED drops them")]
fn over_refuses_contents_that_the_entry_drops() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let image = HostImage::new(&host, format, 16, SIZE);
    let mut embedded = Embedded::new(&host, gpu(host.raw()), params());
    let over = Output::new(&embedded.gpu, OutputKind::Over, format).unwrap();
    embedded.frame_into::<[f32; 4]>(&over, &image, DROPPED, |_| ());
}

/// A wall of the host's covers the left half of the picture, nearer than the clouds.
fn a_wall_hides(model: SkyModel) {
    let host = Host::new(DeviceFeatures::WANTED, true);
    {
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = HostImage::new(&host, format, 16, SIZE);
        let distance = HostImage::new(&host, vk::Format::R32_SFLOAT, 4, SIZE);
        let mut params = params();
        params.sky.model = model;
        let mut embedded = Embedded::new(&host, gpu(host.raw()), params);
        let output = Output::new(&embedded.gpu, OutputKind::Radiance, format).unwrap();
        let open: Vec<[f32; 4]> = embedded.frame_into(&output, &image, DROPPED, |_| ());

        let at = |i: usize| if i % (SIZE[0] as usize) < SIZE[0] as usize / 2 { 100.0 } else { 1e30 };
        distance.write(&(0..PIXELS).map(at).collect::<Vec<f32>>());
        let (dst, read) = (vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
        let (opaque, lent) =
            (wrap(&embedded.gpu, "the host's distances", &distance), wrap(&embedded.gpu, "the host's picture", &image));
        embedded.frame(
            Some(Lent { image: &opaque, entry: (Access::TransferWrite, dst), exit: (Access::GraphicsRead, read) }),
            Some(&FrameOutput { output: &output, target: Lent { image: &lent, entry: DROPPED, exit: TO_COPY } }),
            |cmd| {
                host.barrier(cmd, &distance, vk::ImageLayout::UNDEFINED, dst);
                distance.fill(cmd);
            },
            |cmd, _| image.copy(cmd, TO_COPY.1),
        );
        let walled: Vec<[f32; 4]> = image.read();
        let hidden: Vec<usize> = (0..PIXELS).filter(|i| at(*i) < 1e30).collect();
        assert!(hidden.iter().any(|i| open[*i][3] < 0.1), "no cloud behind the wall");
        for i in 0..PIXELS {
            let expected = if at(i) < 1e30 { [0.0, 0.0, 0.0, 1.0] } else { open[i] };
            assert_eq!(walled[i], expected, "pixel {i}");
        }
    }
    assert_eq!(host.finish(), Vec::<String>::new());
}

#[test]
fn the_hosts_opaque_scene_hides_clouds_behind_it() {
    a_wall_hides(SkyModel::None);
}

#[test]
fn the_hosts_opaque_scene_hides_sky_and_ground_behind_it() {
    a_wall_hides(SkyModel::Atmosphere);
}

/// Writes down what it sees, lets only red through to the host's image, and builds one pipeline by itself.
#[derive(Clone, Default)]
struct Recording(Arc<Mutex<Vec<String>>>, Arc<AtomicU64>);

impl PipelineFactory for Recording {
    fn describe(&self, mut desc: PipelineDesc) -> PipelineDesc {
        self.0.lock().unwrap().push(desc.program.name.to_owned());
        if let (PipelineKind::Graphics(state), "film/present.frag") = (&mut desc.kind, desc.program.name) {
            let red = vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::R);
            state.attachments[0].format = vk::Format::R16G16B16A16_SFLOAT;
            state.attachments[0].blend = BlendState::Custom(red);
        }
        desc
    }

    fn build(&self, gpu: &Gpu, desc: &PipelineDesc, layout: vk::PipelineLayout) -> Result<vk::Pipeline> {
        if desc.program.name != "film/composite.comp" {
            return DefaultFactory.build(gpu, desc, layout);
        }
        self.1.fetch_add(1, Ordering::Relaxed);
        let bytes = desc.program.stages[0].spirv;
        let words: Vec<u32> = bytes.chunks_exact(4).map(|w| u32::from_le_bytes(w.try_into().unwrap())).collect();
        // SAFETY: the words are a module that the build compiled, for this layout.
        unsafe {
            let info = vk::ShaderModuleCreateInfo::default().code(&words);
            let module = gpu.device().create_shader_module(&info, None).unwrap();
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::DISABLE_OPTIMIZATION)
                .stage(stage)
                .layout(layout);
            let pipelines = gpu.device().create_compute_pipelines(vk::PipelineCache::null(), &[info], None).unwrap();
            gpu.device().destroy_shader_module(module, None);
            Ok(pipelines[0])
        }
    }
}

#[test]
fn a_factory_sees_every_pipeline_and_can_change_or_build_it() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    {
        let factory = Recording::default();
        let raw = RawDevice { factory: Some(Box::new(factory.clone())), ..host.raw() };
        let mut embedded = Embedded::new(&host, gpu(raw), params());
        let output = Output::new(&embedded.gpu, OutputKind::Picture, vk::Format::R8G8B8A8_UNORM).unwrap();
        assert_eq!(output.format(), vk::Format::R16G16B16A16_SFLOAT);

        let seen = factory.0.lock().unwrap().clone();
        let described = embedded.gpu.described_pipelines();
        assert_eq!(seen.len(), described.len());
        assert!(seen.iter().zip(&described).all(|(name, text)| text.starts_with(name.as_str())));
        // An explicit list of particles takes the place of the grid, and flat lighting has no passes.
        for name in ["compact/", "tiling/", "blend/", "atmosphere/", "film/"] {
            assert!(seen.iter().any(|s| s.starts_with(name)), "{name} is missing in {seen:?}");
        }
        assert_eq!(factory.1.load(Ordering::Relaxed), 1);

        let image = HostImage::new(&host, output.format(), 8, SIZE);
        let dst = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        image.write(&vec![[0u16; 4]; PIXELS]);
        let picture: Vec<[u16; 4]> = embedded.frame_into(&output, &image, (Access::TransferWrite, dst), |cmd| {
            host.barrier(cmd, &image, vk::ImageLayout::UNDEFINED, dst);
            image.fill(cmd);
        });
        assert!(picture.iter().any(|p| p[0] > 0), "no cloud in sight");
        assert!(picture.iter().all(|p| p[1..] == [0; 3]), "the factory's blend state was not used");
    }
    assert_eq!(host.finish(), Vec::<String>::new());
}

/// One `vkAllocateMemory` for each resource, counted.
struct Counting {
    device: ash::Device,
    memory: vk::PhysicalDeviceMemoryProperties,
    counts: Arc<[AtomicU64; 2]>,
}

impl Allocator for Counting {
    fn allocate(
        &self,
        _: &str,
        needs: vk::MemoryRequirements,
        location: MemoryLocation,
        _: bool,
    ) -> Result<Allocation> {
        use vk::MemoryPropertyFlags as P;
        let wanted =
            if location == MemoryLocation::Device { P::DEVICE_LOCAL } else { P::HOST_VISIBLE | P::HOST_COHERENT };
        let types = &self.memory.memory_types[..self.memory.memory_type_count as usize];
        let fits = |(i, ty): &(usize, &vk::MemoryType)| {
            needs.memory_type_bits & (1 << i) != 0 && ty.property_flags.contains(wanted)
        };
        let index = types.iter().enumerate().find(fits).unwrap().0 as u32;
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
        self.counts[0].fetch_add(1, Ordering::Relaxed);
        // SAFETY: the device is alive as long as Welkin is; the memory is not yet in use.
        unsafe {
            let memory = self.device.allocate_memory(&info, None).unwrap();
            let map = || self.device.map_memory(memory, 0, needs.size, vk::MemoryMapFlags::empty()).unwrap();
            let mapped = (location != MemoryLocation::Device).then(map);
            let mapped = mapped.map(|address| std::ptr::NonNull::new(address.cast()).unwrap());
            Ok(Allocation { memory, offset: 0, size: needs.size, mapped, token: Box::new(()) })
        }
    }

    fn free(&self, allocation: Allocation) {
        self.counts[1].fetch_add(1, Ordering::Relaxed);
        // SAFETY: the resource is gone. Freeing unmaps.
        unsafe { self.device.free_memory(allocation.memory, None) };
    }
}

#[test]
fn memory_comes_from_the_hosts_allocator_and_goes_back_to_it() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    let counts: Arc<[AtomicU64; 2]> = Arc::default();
    {
        // SAFETY: the handles are the host's.
        let memory = unsafe { host.instance.get_physical_device_memory_properties(host.physical_device) };
        let allocator = Counting { device: host.device.clone(), memory, counts: counts.clone() };
        let raw = RawDevice { allocator: Some(Box::new(allocator)), ..host.raw() };
        let mut embedded = Embedded::new(&host, gpu(raw), params());
        embedded.frame(None, None, |_| (), |_, _| ());
        let [taken, freed] = [0, 1].map(|i| counts[i].load(Ordering::Relaxed));
        assert_eq!(taken - freed, embedded.gpu.memory_use().allocations);
        assert!(taken - freed > 20, "{taken} pieces taken: the renderer has more resources than that");
    }
    assert_eq!(counts[0].load(Ordering::Relaxed), counts[1].load(Ordering::Relaxed));
    assert_eq!(host.finish(), Vec::<String>::new());
}

#[test]
fn a_lent_pipeline_cache_is_used_and_stays_the_hosts() {
    let host = Host::new(DeviceFeatures::WANTED, true);
    // SAFETY: the device is the host's.
    let cache = unsafe { host.device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None) }.unwrap();
    {
        let gpu = gpu(RawDevice { pipeline_cache: Some(cache), ..host.raw() });
        assert_eq!(gpu.pipeline_cache(), cache);
        Embedded::new(&host, gpu, params()).frame(None, None, |_| (), |_, _| ());
    }
    // SAFETY: Welkin is gone. Had it destroyed the cache, validation would say so here.
    unsafe { host.device.destroy_pipeline_cache(cache, None) };
    assert_eq!(host.finish(), Vec::<String>::new());
}

/// The error of a device that cannot be used.
fn refusal(raw: RawDevice) -> String {
    // SAFETY: the handles belong together.
    match unsafe { Gpu::from_raw(raw) } {
        Err(error @ Error::Unsupported { .. }) => error.to_string(),
        Err(other) => panic!("another error: {other}"),
        Ok(_) => panic!("the device was taken"),
    }
}

#[test]
fn a_device_without_a_needed_feature_is_refused_by_name() {
    let features = DeviceFeatures { dynamic_rendering: false, independent_blend: false, ..DeviceFeatures::WANTED };
    let host = Host::new(features, false);
    let text = refusal(host.raw());
    assert!(text.starts_with("dynamicRendering, independentBlend is not supported by "), "{text}");
    assert!(text.ends_with("as it was created: the host did not enable it"), "{text}");
    let text = refusal(RawDevice { queue_family: 77, features: DeviceFeatures::WANTED, ..host.raw() });
    assert!(text.starts_with("graphics and compute on queue family 77"), "{text}");
    assert_eq!(host.finish(), Vec::<String>::new());
}

#[test]
fn without_interlock_auto_takes_alpha_and_says_why_and_interlock_is_an_error() {
    let host = Host::new(DeviceFeatures::WANTED, false);
    {
        let mut params = params();
        params.quality.blend = Blend::Auto;
        let mut embedded = Embedded::new(&host, gpu(host.raw()), params.clone());
        let choice = embedded.renderer.choice().clone();
        assert_eq!(choice.used, Blend::Alpha);
        let reasons =
            ["the host did not enable it on the device", "the driver has no VK_EXT_fragment_shader_interlock"];
        assert!(
            reasons.iter().any(|reason| choice.reason.starts_with(&format!("no interlock: {reason}; no attachment: "))),
            "{}",
            choice.reason
        );
        embedded.frame(None, None, |_| (), |_, _| ());

        params.quality.blend = Blend::Interlock(1);
        let error = Renderer::new(&embedded.gpu, &params, SIZE, 1).err().expect("interlock is not to be had");
        assert!(matches!(error, Error::Unsupported { .. }));
        assert!(reasons.iter().any(|reason| error.to_string().contains(reason)), "{error}");
    }
    assert_eq!(host.finish(), Vec::<String>::new());
}
