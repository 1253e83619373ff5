//! Descriptor sets, made when first bound and kept.

use crate::Result;
use crate::gpu::pipeline::Pipeline;
use crate::gpu::{Gpu, Image, Program, Resource};
use ash::vk;
use std::collections::HashMap;

/// Program, then identity and sampler of each resource.
type SetKey = (usize, Vec<(u64, u8)>);

const SETS_PER_POOL: u32 = 64;

/// Every set in use and the pools that they come from.
#[derive(Default)]
pub(super) struct DescriptorSets {
    sets: HashMap<SetKey, vk::DescriptorSet>,
    pools: Vec<vk::DescriptorPool>,
}

impl DescriptorSets {
    /// The set of `pipeline`'s program with `resources`.
    pub(super) fn get(
        &mut self,
        gpu: &Gpu,
        pipeline: &Pipeline,
        resources: &[Resource<'_>],
    ) -> Result<vk::DescriptorSet> {
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
        let set = self.allocate(gpu, pipeline)?;
        write_set(gpu, set, program, resources);
        self.sets.insert(key, set);
        Ok(set)
    }

    fn allocate(&mut self, gpu: &Gpu, pipeline: &Pipeline) -> Result<vk::DescriptorSet> {
        let layouts = [pipeline.set_layout];
        if let Some(pool) = self.pools.last() {
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(*pool).set_layouts(&layouts);
            // SAFETY: pool and layout belong to this device.
            if let Ok(sets) = unsafe { gpu.device().allocate_descriptor_sets(&info) } {
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
        let pool = unsafe { gpu.device().create_descriptor_pool(&info, None) }
            .map_err(|result| gpu.error("vkCreateDescriptorPool", "descriptor sets", result))?;
        self.pools.push(pool);
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: as above.
        unsafe { gpu.device().allocate_descriptor_sets(&info) }
            .map(|sets| sets[0])
            .map_err(|result| gpu.error("vkAllocateDescriptorSets", pipeline.desc.program.name, result))
    }

    /// Destroys all of them; the device is done with them.
    pub(super) fn clear(&mut self, gpu: &Gpu) {
        self.sets.clear();
        for pool in self.pools.drain(..) {
            // SAFETY: the device is done with the pool's sets.
            unsafe { gpu.device().destroy_descriptor_pool(pool, None) };
        }
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
