//! The device that everything runs on: borrowed handles and what belongs to them.

use super::memory::{Accounting, Allocator, DefaultAllocator, MemoryUse};
use super::pipeline::{DefaultFactory, PipelineFactory};
use super::retire::Retirement;
use super::{Capabilities, DeviceFeatures, Feature, Sampler};
use crate::{Error, Result};
use ash::vk::{self, Handle};
use std::any::Any;
use std::ffi::CString;
use std::sync::{Arc, Mutex};

/// What an engine hands over to [`Gpu::from_raw`].
pub struct RawDevice {
    /// The instance that the device belongs to.
    pub instance: ash::Instance,
    /// The physical device behind it.
    pub physical_device: vk::PhysicalDevice,
    /// The device, created with at least [`DeviceFeatures::WANTED`].
    pub device: ash::Device,
    /// Family of the queue that will execute what is recorded; graphics and compute.
    pub queue_family: u32,
    /// What was enabled when the device was created. Vulkan cannot be asked, so this is where a forgotten feature is found.
    pub features: DeviceFeatures,
    /// Whether `fragmentShaderPixelInterlock` was enabled, on a device made with `VK_EXT_fragment_shader_interlock`.
    pub interlock: bool,
    /// Whether `rasterizationOrderColorAttachmentAccess` was enabled, with its extension.
    pub attachment_access: bool,
    /// Whether `dynamicRenderingLocalRead` was enabled, with `VK_KHR_dynamic_rendering_local_read`.
    pub local_read: bool,
    /// Whether `VK_EXT_debug_utils` was enabled on the instance: objects and passes then get names.
    pub debug_utils: bool,
    /// Source of device memory; none takes `gpu-allocator`. It is dropped with the last user of the device, when every
    /// piece has been given back.
    pub allocator: Option<Box<dyn Allocator>>,
    /// Pipeline cache to use, which stays the host's; none makes an own one.
    pub pipeline_cache: Option<vk::PipelineCache>,
    /// Who builds the pipelines; none builds them as described.
    pub factory: Option<Box<dyn PipelineFactory>>,
    /// Dropped after everything else: whatever must outlive the device's use.
    pub keep_alive: Option<Box<dyn Any + Send + Sync>>,
}

/// The device, its capabilities, memory and pipelines' factory. Shared by everything that lives on the device.
pub struct Gpu {
    instance: ash::Instance,
    device: ash::Device,
    capabilities: Capabilities,
    memory: Option<Accounting>,
    factory: Box<dyn PipelineFactory>,
    pipeline_cache: vk::PipelineCache,
    owns_cache: bool,
    samplers: Vec<vk::Sampler>,
    debug: Option<ash::ext::debug_utils::Device>,
    described: Mutex<Vec<String>>,
    pub(super) retirement: Retirement,
    keep_alive: Option<Box<dyn Any + Send + Sync>>,
}

impl Gpu {
    /// Takes over a device that somebody else owns.
    ///
    /// # Errors
    /// [`Error::Unsupported`] naming everything that is missing, if the device lacks a feature or limit
    /// ([`FEATURES_WANTED`](super::FEATURES_WANTED), [`limits_wanted`](super::limits_wanted)), if one was not enabled, or
    /// if the queue family cannot do graphics and compute. Optional features that were not enabled are no error: the blend
    /// mode `auto` goes without them and says so.
    ///
    /// # Safety
    /// - The handles belong together, and stay valid until the last clone of the returned `Arc` and everything made with
    ///   it are gone (`keep_alive` may hold their owner).
    /// - The device was created with what `features`, `interlock`, `attachment_access`, `local_read` and `debug_utils`
    ///   say.
    /// - Recorded commands are submitted to a queue of `queue_family`.
    /// - A lent `pipeline_cache` was not made with `EXTERNALLY_SYNCHRONIZED`, or nobody else uses it while Welkin builds
    ///   pipelines.
    pub unsafe fn from_raw(raw: RawDevice) -> Result<Arc<Self>> {
        let mut capabilities = Capabilities::probe(&raw.instance, raw.physical_device, Some(raw.queue_family));
        if !capabilities.missing.is_empty() {
            return Err(Error::Unsupported { needed: capabilities.missing.join(", "), by: capabilities.device_name });
        }
        let disabled = raw.features.missing();
        if !disabled.is_empty() {
            return Err(Error::Unsupported {
                needed: disabled.join(", "),
                by: format!("{} as it was created: the host did not enable it", capabilities.device_name),
            });
        }
        if !raw.interlock {
            capabilities.withhold(Feature::FragmentShaderInterlock);
        }
        if !raw.attachment_access {
            capabilities.withhold(Feature::RasterizationOrderAttachmentAccess);
        }
        if !raw.local_read {
            capabilities.withhold(Feature::DynamicRenderingLocalRead);
        }
        let allocator = match raw.allocator {
            Some(allocator) => allocator,
            None => Box::new(DefaultAllocator::new(&raw.instance, &raw.device, raw.physical_device)?),
        };
        let debug = raw.debug_utils.then(|| ash::ext::debug_utils::Device::new(&raw.instance, &raw.device));
        let mut gpu = Self {
            instance: raw.instance,
            device: raw.device,
            capabilities,
            memory: Some(Accounting::new(allocator)),
            factory: raw.factory.unwrap_or_else(|| Box::new(DefaultFactory)),
            pipeline_cache: raw.pipeline_cache.unwrap_or_default(),
            owns_cache: false,
            samplers: Vec::new(),
            debug,
            described: Mutex::new(Vec::new()),
            retirement: Retirement::default(),
            keep_alive: raw.keep_alive,
        };
        if raw.pipeline_cache.is_none() {
            let info = vk::PipelineCacheCreateInfo::default();
            // SAFETY: the caller vouches for the device.
            gpu.pipeline_cache = unsafe { gpu.device.create_pipeline_cache(&info, None) }
                .map_err(|result| gpu.error("vkCreatePipelineCache", "the pipeline cache", result))?;
            gpu.owns_cache = true;
        }
        for sampler in Sampler::ALL {
            // SAFETY: the caller vouches for the device.
            let handle = unsafe { gpu.device.create_sampler(&sampler.info(), None) }
                .map_err(|result| gpu.error("vkCreateSampler", &format!("{sampler:?}"), result))?;
            gpu.samplers.push(handle);
            gpu.set_name(handle, &format!("{sampler:?}"));
        }
        Ok(Arc::new(gpu))
    }

    /// What the device can do.
    pub fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    /// Memory that is alive now.
    pub fn memory_use(&self) -> MemoryUse {
        self.memory().in_use()
    }

    /// Every pipeline built so far, described in text.
    pub fn described_pipelines(&self) -> Vec<String> {
        self.described.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    /// The instance, for an engine's own calls.
    pub fn instance(&self) -> &ash::Instance {
        &self.instance
    }

    /// The device, for an engine's own calls.
    pub fn device(&self) -> &ash::Device {
        &self.device
    }

    /// The pipeline cache in use, for example to save it.
    pub fn pipeline_cache(&self) -> vk::PipelineCache {
        self.pipeline_cache
    }

    pub(crate) fn factory(&self) -> &dyn PipelineFactory {
        &*self.factory
    }

    pub(crate) fn note_pipeline(&self, description: String) {
        self.described.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(description);
    }

    pub(crate) fn memory(&self) -> &Accounting {
        match &self.memory {
            Some(memory) => memory,
            None => unreachable!("memory is only taken in drop"),
        }
    }

    pub(crate) fn sampler(&self, sampler: Sampler) -> vk::Sampler {
        self.samplers[sampler as usize]
    }

    pub(crate) fn debug(&self) -> Option<&ash::ext::debug_utils::Device> {
        self.debug.as_ref()
    }

    pub(crate) fn set_name<H: Handle>(&self, handle: H, name: &str) {
        if let (Some(debug), Ok(name)) = (&self.debug, CString::new(name)) {
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
            // SAFETY: the handle is alive: its owner is naming it. A name that cannot be set is only a missing name.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }

    /// The error for `result` of Vulkan function `call`, made for `what`.
    pub(crate) fn error(&self, call: &'static str, what: &str, result: vk::Result) -> Error {
        self.sized_error(call, what, None, result)
    }

    /// The same for a call that asks for so many `bytes`.
    pub(crate) fn sized_error(&self, call: &'static str, what: &str, bytes: Option<u64>, result: vk::Result) -> Error {
        match result {
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                Error::OutOfMemory { what: format!("{what} ({call})"), bytes }
            }
            vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost { last_pass: what.to_owned() },
            result => Error::Vulkan { call, pass: what.to_owned(), result },
        }
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        self.end_all_frames();
        for sampler in &self.samplers {
            // SAFETY: made by this device; every user held an `Arc` of `self` and is gone.
            unsafe { self.device.destroy_sampler(*sampler, None) };
        }
        if self.owns_cache {
            // SAFETY: as above.
            unsafe { self.device.destroy_pipeline_cache(self.pipeline_cache, None) };
        }
        self.memory = None; // Gives the memory back while the device is still there.
        self.keep_alive = None;
    }
}
