//! Records passes into a command buffer. Every use of a resource goes through here, so the barriers between uses follow
//! from what the shaders declare; the order of passes is the order of calls.

use super::access::{Barrier, ResourceState};
use super::feedback::{FeedbackPath, Framebuffers};
use super::image::COLOR;
use super::pipeline::{Pipeline, PipelineKind, check_bindings};
use super::timing::Timer;
use super::{
    Access, BindingKind, BindingSet, Buffer, ComputePipeline, Gpu, GraphicsPipeline, GraphicsState, Image, PassTime,
    Program, Resource, ShaderStage,
};
use crate::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::collections::{HashMap, HashSet};
use std::ffi::CString;
use std::sync::Arc;

/// What has to be remembered between frames: the last access of each resource, descriptor sets, timers.
pub struct RecorderState {
    gpu: Arc<Gpu>,
    resources: HashMap<u64, ResourceState>,
    initialised: HashSet<u64>,
    sets: HashMap<SetKey, vk::DescriptorSet>,
    pools: Vec<vk::DescriptorPool>,
    framebuffers: Framebuffers,
    timers: Vec<Timer>,
    log: Option<Vec<String>>,
}

/// Program, then identity and sampler of each resource.
type SetKey = (usize, Vec<(u64, u8)>);

const SETS_PER_POOL: u32 = 64;

impl RecorderState {
    /// State for `slots` frames in flight. A host keeps one for all renderers that record into its command buffers: two
    /// states know nothing of each other's accesses.
    pub fn new(gpu: &Arc<Gpu>, slots: usize) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            resources: HashMap::new(),
            initialised: HashSet::new(),
            sets: HashMap::new(),
            pools: Vec::new(),
            framebuffers: Framebuffers::default(),
            timers: (0..slots).map(|_| Timer::new(gpu)).collect::<Result<_>>()?,
            log: None,
        })
    }

    /// Starts recording frame slot `slot` into `cmd`, which may already hold commands of the host's; the host goes on with
    /// it when the [`Recorder`] is gone. State that the recording changes: bound pipelines and descriptor sets of both bind
    /// points, push constants, viewport and scissor.
    ///
    /// # Safety
    /// - `cmd` is a primary command buffer in the recording state, outside a render pass, with no query active, and is
    ///   submitted, once, to a queue of the device's family before what this state records later.
    /// - The last frame of this slot has ended on the device.
    /// - Buffers, images and pipelines that are recorded stay alive until the frame has ended on the device.
    ///
    /// # Panics
    /// If there is no such slot.
    pub unsafe fn begin(&mut self, cmd: vk::CommandBuffer, slot: usize) -> Recorder<'_> {
        self.timers[slot].reset(cmd);
        Recorder { state: self, cmd, slot, pass: "" }
    }

    /// Time of each pass of the last frame in `slot`, which must have ended; empty without timestamps.
    pub fn times(&self, slot: usize) -> Vec<PassTime> {
        self.timers[slot].read()
    }

    /// The last pass that the device had begun in `slot`: where to look when the device was lost.
    pub fn last_pass(&self, slot: usize) -> &'static str {
        self.timers[slot].last_pass()
    }

    /// Forgets descriptor sets and states, after resources have been replaced or lent images have gone. The device must
    /// be done with every frame recorded so far.
    pub fn forget(&mut self) {
        self.sets.clear();
        self.resources.clear();
        self.framebuffers.clear(&self.gpu);
        for pool in self.pools.drain(..) {
            // SAFETY: the device is idle, so no set of the pool is in use.
            unsafe { self.gpu.device().destroy_descriptor_pool(pool, None) };
        }
    }

    /// From now on keeps a line of text for each command and each barrier, for tests and for people.
    pub fn start_log(&mut self) {
        self.log = Some(Vec::new());
    }

    /// What [`start_log`](Self::start_log) has collected.
    pub fn take_log(&mut self) -> Vec<String> {
        self.log.take().unwrap_or_default()
    }

    fn descriptor_set(&mut self, pipeline: &Pipeline, resources: &[Resource<'_>]) -> Result<vk::DescriptorSet> {
        let program = pipeline.desc.program;
        let key: SetKey = (
            std::ptr::from_ref(program).addr(),
            resources
                .iter()
                .map(|resource| match resource {
                    Resource::Buffer(buffer) => (buffer.id, 0),
                    Resource::Image(image) => (image.id, 0),
                    Resource::Sampled(sampled) => (sampled.image.id, 1 + sampled.sampler as u8),
                })
                .collect(),
        );
        if let Some(set) = self.sets.get(&key) {
            return Ok(*set);
        }
        let set = self.allocate_set(pipeline)?;
        write_set(&self.gpu, set, program, resources);
        self.sets.insert(key, set);
        Ok(set)
    }

    fn allocate_set(&mut self, pipeline: &Pipeline) -> Result<vk::DescriptorSet> {
        let layouts = [pipeline.set_layout];
        if let Some(pool) = self.pools.last() {
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(*pool).set_layouts(&layouts);
            // SAFETY: pool and layout belong to this device.
            if let Ok(sets) = unsafe { self.gpu.device().allocate_descriptor_sets(&info) } {
                return Ok(sets[0]);
            }
        }
        let size = |ty, count| vk::DescriptorPoolSize { ty, descriptor_count: count * SETS_PER_POOL };
        let sizes = [
            size(vk::DescriptorType::STORAGE_BUFFER, 10),
            size(vk::DescriptorType::STORAGE_IMAGE, 4),
            size(vk::DescriptorType::COMBINED_IMAGE_SAMPLER, 6),
            size(vk::DescriptorType::INPUT_ATTACHMENT, 4),
        ];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(SETS_PER_POOL).pool_sizes(&sizes);
        // SAFETY: the device is alive as long as `gpu`.
        let pool = unsafe { self.gpu.device().create_descriptor_pool(&info, None) }
            .map_err(|result| self.gpu.error("vkCreateDescriptorPool", "descriptor sets", result))?;
        self.pools.push(pool);
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: as above.
        unsafe { self.gpu.device().allocate_descriptor_sets(&info) }
            .map(|sets| sets[0])
            .map_err(|result| self.gpu.error("vkAllocateDescriptorSets", pipeline.desc.program.name, result))
    }
}

impl Drop for RecorderState {
    fn drop(&mut self) {
        self.forget();
    }
}

fn write_set(gpu: &Gpu, set: vk::DescriptorSet, program: &Program, resources: &[Resource<'_>]) {
    enum Info {
        Buffer([vk::DescriptorBufferInfo; 1]),
        Image([vk::DescriptorImageInfo; 1]),
    }
    let image = |image: &Image, sampler| {
        Info::Image([vk::DescriptorImageInfo {
            sampler,
            image_view: image.view(),
            image_layout: vk::ImageLayout::GENERAL,
        }])
    };
    let infos: Vec<Info> = resources
        .iter()
        .map(|resource| match resource {
            Resource::Buffer(buffer) => {
                Info::Buffer([vk::DescriptorBufferInfo { buffer: buffer.handle(), offset: 0, range: vk::WHOLE_SIZE }])
            }
            Resource::Image(i) => image(i, vk::Sampler::null()),
            Resource::Sampled(s) => image(s.image, gpu.sampler(s.sampler)),
        })
        .collect();
    let writes: Vec<_> = program
        .bindings
        .iter()
        .zip(&infos)
        .map(|(binding, info)| {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding.binding)
                .descriptor_type(binding.kind.descriptor_type());
            match info {
                Info::Buffer(info) => write.buffer_info(info),
                Info::Image(info) => write.image_info(info),
            }
        })
        .collect();
    // SAFETY: the set is new, so no command uses it; resources outlive the commands that do (see `Buffer`, `Image`).
    unsafe { gpu.device().update_descriptor_sets(&writes, &[]) };
}

/// A colour attachment of a draw.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// The image.
    pub image: &'a Image,
    /// Value that it is cleared to first; none keeps what is there.
    pub clear: Option<[f32; 4]>,
}

/// How many vertices and instances to draw.
#[derive(Clone, Copy)]
pub enum Draw<'a> {
    /// Known to the host.
    Direct {
        /// Vertices of each instance.
        vertices: u32,
        /// Instances.
        instances: u32,
    },
    /// A `VkDrawIndirectCommand` in a buffer.
    Indirect {
        /// The buffer.
        args: &'a Buffer,
        /// Where in it the command lies [bytes].
        offset: u64,
    },
}

/// One draw of several that share their targets.
#[derive(Clone, Copy)]
pub struct DrawCall<'a> {
    /// What draws.
    pub pipeline: &'a GraphicsPipeline,
    /// What it reads and writes through descriptors.
    pub bindings: &'a dyn BindingSet,
    /// Its push constants.
    pub push: &'a [u8],
    /// How much.
    pub draw: Draw<'a>,
}

/// What a render pass has beside its colour attachments.
#[derive(Clone, Copy, Default)]
pub struct PassState<'a> {
    /// Depth attachment and the value that it is cleared to; its contents are gone afterwards.
    pub depth: Option<(&'a Image, f32)>,
    /// Whether each call may read as input attachments what those before it have written: a barrier between them. Pipelines
    /// with ordered feedback do without.
    pub separated: bool,
    /// First row to draw and the first not to; none draws all.
    pub rows: Option<(u32, u32)>,
}

/// An open command buffer.
pub struct Recorder<'s> {
    state: &'s mut RecorderState,
    cmd: vk::CommandBuffer,
    slot: usize,
    pass: &'static str,
}

impl Recorder<'_> {
    /// The device that is recorded for.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.state.gpu
    }

    /// The command buffer, for commands of the host's own.
    pub fn command_buffer(&self) -> vk::CommandBuffer {
        self.cmd
    }

    /// The frame slot being recorded.
    pub fn slot(&self) -> usize {
        self.slot
    }

    /// Opens a labelled, timed pass around `record`.
    pub fn pass<T>(&mut self, name: &'static str, record: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let outer = std::mem::replace(&mut self.pass, name);
        self.log(|| format!("pass {name}"));
        self.label(name);
        let index = self.state.timers[self.slot].begin(self.cmd, name);
        let result = record(self);
        self.state.timers[self.slot].end(self.cmd, index);
        if let Some(debug) = self.state.gpu.debug() {
            // SAFETY: closes the label that was opened above.
            unsafe { debug.cmd_end_debug_utils_label(self.cmd) };
        }
        self.pass = outer;
        result
    }

    fn label(&self, name: &str) {
        if let (Some(debug), Ok(name)) = (self.state.gpu.debug(), CString::new(name)) {
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: the command buffer is recording.
            unsafe { debug.cmd_begin_debug_utils_label(self.cmd, &label) };
        }
    }

    /// Runs at least `threads` invocations of `pipeline`, rounded up to whole groups.
    pub fn dispatch<P: Pod>(
        &mut self,
        pipeline: &ComputePipeline,
        bindings: &dyn BindingSet,
        push: &P,
        threads: [u32; 3],
    ) -> Result<()> {
        let group = pipeline.0.desc.program.group_size;
        self.bind(&pipeline.0, bindings, push, vk::PipelineBindPoint::COMPUTE, &[])?;
        let [x, y, z] = [0, 1, 2].map(|i| threads[i].div_ceil(group[i]));
        // SAFETY: pipeline and descriptors are bound, barriers recorded.
        unsafe { self.state.gpu.device().cmd_dispatch(self.cmd, x, y, z) };
        Ok(())
    }

    /// Runs as many groups of `pipeline` as the `VkDispatchIndirectCommand` at `offset` of `args` says.
    pub fn dispatch_indirect<P: Pod>(
        &mut self,
        pipeline: &ComputePipeline,
        bindings: &dyn BindingSet,
        push: &P,
        args: &Buffer,
        offset: u64,
    ) -> Result<()> {
        self.bind(&pipeline.0, bindings, push, vk::PipelineBindPoint::COMPUTE, &[(args.id, Access::IndirectRead)])?;
        // SAFETY: as above; the argument buffer holds a command at `offset`.
        unsafe { self.state.gpu.device().cmd_dispatch_indirect(self.cmd, args.handle(), offset) };
        Ok(())
    }

    /// Draws into `targets` (none is allowed), over the whole of `extent`.
    pub fn draw<P: Pod>(
        &mut self,
        pipeline: &GraphicsPipeline,
        bindings: &dyn BindingSet,
        push: &P,
        extent: [u32; 2],
        targets: &[Target<'_>],
        draw: Draw<'_>,
    ) -> Result<()> {
        self.draw_all(extent, targets, &[DrawCall { pipeline, bindings, push: bytemuck::bytes_of(push), draw }])
    }

    /// Records `calls`, in order, into the same targets: one render pass, with no barrier between them. What one writes
    /// through descriptors, another may touch only under interlock.
    ///
    /// # Panics
    /// If pipelines are described for other attachments than `targets` or for different ways to read them, or if an input
    /// attachment is bound to another image than the target of its index.
    pub fn draw_all(&mut self, extent: [u32; 2], targets: &[Target<'_>], calls: &[DrawCall<'_>]) -> Result<()> {
        self.draw_pass(extent, targets, PassState::default(), calls)
    }

    /// As [`draw_all`](Self::draw_all), in a pass with more `state`.
    ///
    /// # Panics
    /// As [`draw_all`](Self::draw_all).
    pub fn draw_pass(
        &mut self,
        extent: [u32; 2],
        targets: &[Target<'_>],
        pass: PassState<'_>,
        calls: &[DrawCall<'_>],
    ) -> Result<()> {
        let Some(first) = calls.first() else { return Ok(()) };
        let state = graphics_state(first.pipeline);
        let mut uses: Vec<(u64, Access)> = Vec::new();
        let mut sets = Vec::with_capacity(calls.len());
        for call in calls {
            check_targets(call.pipeline, targets);
            assert_eq!(state.feedback, graphics_state(call.pipeline).feedback, "pipelines of one pass read alike");
            check_bindings(&call.pipeline.0, call.bindings);
            let resources = call.bindings.resources();
            check_inputs(call.pipeline, &resources, targets);
            self.descriptor_uses(&call.pipeline.0, &resources, &mut uses);
            if let Draw::Indirect { args, .. } = call.draw {
                uses.push((args.id, Access::IndirectRead));
            }
            sets.push(self.state.descriptor_set(&call.pipeline.0, &resources)?);
        }
        let access = if state.feedback.is_some() { Access::AttachmentFeedback } else { Access::ColorAttachment };
        for target in targets {
            self.initialise(target.image);
            uses.push((target.image.id, access));
        }
        if let Some((image, _)) = pass.depth {
            self.initialise(image);
            uses.push((image.id, Access::DepthAttachment));
        }
        let mut seen = HashSet::new();
        uses.retain(|one| seen.insert(*one));
        self.transition(first.pipeline.0.desc.program.name, &uses);
        let [width, height] = extent;
        let (first_row, end_row) = pass.rows.unwrap_or((0, height));
        let area = vk::Rect2D {
            offset: vk::Offset2D { x: 0, y: first_row as i32 },
            extent: vk::Extent2D { width, height: end_row - first_row },
        };
        let in_render_pass = state.feedback.is_some_and(|feedback| feedback.path == FeedbackPath::Subpass);
        if in_render_pass {
            self.state.framebuffers.begin(&self.state.gpu, self.cmd, state, targets, area)?;
        } else {
            self.begin_rendering(targets, pass.depth, area);
        }
        let viewport =
            vk::Viewport { x: 0.0, y: 0.0, width: width as f32, height: height as f32, min_depth: 0.0, max_depth: 1.0 };
        for (index, (call, set)) in calls.iter().zip(sets).enumerate() {
            if pass.separated && index > 0 {
                self.separate();
            }
            self.bind_set(&call.pipeline.0, set, call.push, vk::PipelineBindPoint::GRAPHICS);
            let device = self.state.gpu.device();
            // SAFETY: pipeline and descriptors are bound, barriers recorded, attachments in GENERAL layout.
            unsafe {
                device.cmd_set_viewport(self.cmd, 0, &[viewport]);
                device.cmd_set_scissor(self.cmd, 0, &[area]);
                match call.draw {
                    Draw::Direct { vertices, instances } => device.cmd_draw(self.cmd, vertices, instances, 0, 0),
                    Draw::Indirect { args, offset } => device.cmd_draw_indirect(self.cmd, args.handle(), offset, 1, 16),
                }
            }
        }
        let device = self.state.gpu.device();
        // SAFETY: closes what was opened above.
        unsafe {
            if in_render_pass {
                device.cmd_end_render_pass(self.cmd);
            } else {
                device.cmd_end_rendering(self.cmd);
            }
        }
        Ok(())
    }

    /// Inside a pass: what has been written to colour attachments can be read as input attachments of the same pixels.
    fn separate(&mut self) {
        let memory = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
            .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::FRAGMENT_SHADER)
            .dst_access_mask(vk::AccessFlags2::INPUT_ATTACHMENT_READ)];
        let dependency =
            vk::DependencyInfo::default().dependency_flags(vk::DependencyFlags::BY_REGION).memory_barriers(&memory);
        // SAFETY: inside a pass whose pipelines read their attachments, which has this dependency on itself.
        unsafe { self.state.gpu.device().cmd_pipeline_barrier2(self.cmd, &dependency) };
        self.log(|| "  barrier within the pass".to_owned());
    }

    fn begin_rendering(&mut self, targets: &[Target<'_>], depth: Option<(&Image, f32)>, area: vk::Rect2D) {
        let attachments: Vec<_> = targets
            .iter()
            .map(|target| {
                let attachment = vk::RenderingAttachmentInfo::default()
                    .image_view(target.image.view())
                    .image_layout(vk::ImageLayout::GENERAL)
                    .store_op(vk::AttachmentStoreOp::STORE);
                match target.clear {
                    None => attachment.load_op(vk::AttachmentLoadOp::LOAD),
                    Some(float32) => attachment
                        .load_op(vk::AttachmentLoadOp::CLEAR)
                        .clear_value(vk::ClearValue { color: vk::ClearColorValue { float32 } }),
                }
            })
            .collect();
        let depth = depth.map(|(image, depth)| {
            vk::RenderingAttachmentInfo::default()
                .image_view(image.view())
                .image_layout(vk::ImageLayout::GENERAL)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .clear_value(vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth, stencil: 0 } })
        });
        let mut rendering =
            vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&attachments);
        if let Some(depth) = &depth {
            rendering = rendering.depth_attachment(depth);
        }
        // SAFETY: the command buffer is recording, outside a render pass; attachments are in GENERAL layout.
        unsafe { self.state.gpu.device().cmd_begin_rendering(self.cmd, &rendering) };
    }

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

    /// Makes what Welkin has written to an image of its own visible to the host's next commands of kind `access`, in this
    /// or a later command buffer of the queue. The image stays in `GENERAL` layout; later passes wait for that access.
    pub fn share(&mut self, image: &Image, access: Access) {
        self.initialise(image);
        self.transition("share", &[(image.id, access)]);
    }

    /// Takes over a lent image that was last used as `access` in `layout`; its contents are kept unless the layout is
    /// `UNDEFINED`. Every lent image is acquired before a pass uses it and released afterwards, in every frame anew.
    pub fn acquire(&mut self, image: &Image, access: Access, layout: vk::ImageLayout) {
        let (src_stage, src_access) = access.masks();
        self.layout(image, (src_stage, src_access), ALL, layout, vk::ImageLayout::GENERAL);
        self.state.initialised.insert(image.id);
        self.state.resources.insert(image.id, ResourceState::default());
    }

    /// Gives a lent image back, ready for `access` in `layout`.
    pub fn release(&mut self, image: &Image, access: Access, layout: vk::ImageLayout) {
        self.layout(image, ALL, access.masks(), vk::ImageLayout::GENERAL, layout);
        self.state.initialised.remove(&image.id);
        self.state.resources.remove(&image.id);
    }

    fn bind<P: Pod>(
        &mut self,
        pipeline: &Pipeline,
        bindings: &dyn BindingSet,
        push: &P,
        point: vk::PipelineBindPoint,
        extra: &[(u64, Access)],
    ) -> Result<()> {
        check_bindings(pipeline, bindings);
        let resources = bindings.resources();
        let mut uses = extra.to_vec();
        self.descriptor_uses(pipeline, &resources, &mut uses);
        let set = self.state.descriptor_set(pipeline, &resources)?;
        self.transition(pipeline.desc.program.name, &uses);
        self.bind_set(pipeline, set, bytemuck::bytes_of(push), point);
        Ok(())
    }

    /// Adds what `pipeline` does to `resources` through descriptors. Input attachments are uses of the targets.
    fn descriptor_uses(&mut self, pipeline: &Pipeline, resources: &[Resource<'_>], uses: &mut Vec<(u64, Access)>) {
        let program = pipeline.desc.program;
        let compute = program.stages[0].kind == ShaderStage::Compute;
        let descriptors = program.bindings.iter().zip(resources);
        for (binding, resource) in descriptors.filter(|(binding, _)| binding.kind != BindingKind::InputAttachment) {
            let access = match (compute, binding.readable, binding.writable) {
                (true, true, true) => Access::ComputeReadWrite,
                (true, false, true) => Access::ComputeWrite,
                (true, _, false) => Access::ComputeRead,
                (false, true, true) => Access::FragmentReadWrite,
                (false, false, true) => Access::FragmentWrite,
                (false, _, false) => Access::GraphicsRead,
            };
            let id = match resource {
                Resource::Buffer(buffer) => buffer.id,
                Resource::Image(image) | Resource::Sampled(super::Sampled { image, .. }) => {
                    self.initialise(image);
                    image.id
                }
            };
            uses.push((id, access));
        }
    }

    fn bind_set(&mut self, pipeline: &Pipeline, set: vk::DescriptorSet, push: &[u8], point: vk::PipelineBindPoint) {
        let program = pipeline.desc.program;
        let size = program.push_constant_size as usize;
        assert!(push.len() >= size, "{}: {} bytes of push constants, expected {size}", program.name, push.len());
        let device = self.state.gpu.device();
        // SAFETY: pipeline, layout and set belong together; the set's resources outlive the commands.
        unsafe {
            device.cmd_bind_pipeline(self.cmd, point, pipeline.handle);
            device.cmd_bind_descriptor_sets(self.cmd, point, pipeline.layout, 0, &[set], &[]);
            if size > 0 {
                device.cmd_push_constants(self.cmd, pipeline.layout, pipeline.stages, 0, &push[..size]);
            }
        }
    }

    /// Records the one barrier that must come before a command with these uses.
    fn transition(&mut self, command: &str, uses: &[(u64, Access)]) {
        let mut barrier = Barrier::default();
        // One resource may be used in two ways by one command; a write must see all earlier reads, so reads go first.
        for writes in [false, true] {
            for (id, access) in uses.iter().filter(|(_, access)| access.writes() == writes) {
                self.state.resources.entry(*id).or_default().apply(*access, &mut barrier);
            }
        }
        if !barrier.is_empty() {
            self.log(|| format!("  barrier {:?} -> {:?}", barrier.src, barrier.dst));
            let memory = [vk::MemoryBarrier2::default()
                .src_stage_mask(barrier.src.0)
                .src_access_mask(barrier.src.1)
                .dst_stage_mask(barrier.dst.0)
                .dst_access_mask(barrier.dst.1)];
            let dependency = vk::DependencyInfo::default().memory_barriers(&memory);
            // SAFETY: the command buffer is recording, outside a render pass.
            unsafe { self.state.gpu.device().cmd_pipeline_barrier2(self.cmd, &dependency) };
        }
        self.log(|| format!("  {command}"));
    }

    /// Brings a new image to GENERAL layout, once in its life. A lent one comes by `acquire`.
    fn initialise(&mut self, image: &Image) {
        if self.state.initialised.insert(image.id) {
            assert!(image.owned, "{} is lent: acquire it before a pass uses it", image.name());
            let none = Access::None.masks();
            self.layout(image, none, ALL, vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL);
        }
    }

    fn layout(
        &mut self,
        image: &Image,
        src: (vk::PipelineStageFlags2, vk::AccessFlags2),
        dst: (vk::PipelineStageFlags2, vk::AccessFlags2),
        old: vk::ImageLayout,
        new: vk::ImageLayout,
    ) {
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(src.0)
            .src_access_mask(src.1)
            .dst_stage_mask(dst.0)
            .dst_access_mask(dst.1)
            .old_layout(old)
            .new_layout(new)
            .image(image.handle())
            .subresource_range(image.range())];
        let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the command buffer is recording, outside a render pass; the image is alive.
        unsafe { self.state.gpu.device().cmd_pipeline_barrier2(self.cmd, &dependency) };
    }

    fn log(&mut self, line: impl FnOnce() -> String) {
        if let Some(log) = &mut self.state.log {
            log.push(line());
        }
    }

    /// The error of a lost device, naming the last pass reached.
    pub fn device_lost(&self) -> Error {
        Error::DeviceLost { last_pass: self.state.last_pass(self.slot).to_owned() }
    }
}

fn graphics_state(pipeline: &GraphicsPipeline) -> &GraphicsState {
    match &pipeline.desc().kind {
        PipelineKind::Graphics(state) => state,
        PipelineKind::Compute => panic!("{}: described as compute, drawn as graphics", pipeline.desc().program.name),
    }
}

/// Misuse of the interface: an input attachment that is not the target of its index.
fn check_inputs(pipeline: &GraphicsPipeline, resources: &[Resource<'_>], targets: &[Target<'_>]) {
    for (binding, resource) in pipeline.desc().program.bindings.iter().zip(resources) {
        if let (Some(index), Resource::Image(image)) = (binding.attachment, resource) {
            assert!(
                targets.get(index as usize).is_some_and(|target| target.image.id == image.id),
                "{}: input attachment {} is bound to {}, which is not target {index}",
                pipeline.desc().program.name,
                binding.name,
                image.name()
            );
        }
    }
}

/// Misuse of the interface, or of a [`PipelineFactory`](super::PipelineFactory): attachments of other formats than images.
fn check_targets(pipeline: &GraphicsPipeline, targets: &[Target<'_>]) {
    let state = graphics_state(pipeline);
    let (described, given): (Vec<_>, Vec<_>) =
        (state.attachments.iter().map(|a| a.format).collect(), targets.iter().map(|t| t.image.format()).collect());
    assert!(
        described == given,
        "pipeline {} is described for attachments {described:?} but drawn into {given:?}",
        pipeline.desc().program.name
    );
}

/// Every stage, every access: for the rare layout changes, which happen once in an image's life or at the border to a host.
const ALL: (vk::PipelineStageFlags2, vk::AccessFlags2) = (
    vk::PipelineStageFlags2::ALL_COMMANDS,
    vk::AccessFlags2::from_raw(vk::AccessFlags2::MEMORY_READ.as_raw() | vk::AccessFlags2::MEMORY_WRITE.as_raw()),
);

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
