//! A device of our own, for the command line, the tests and the examples. An engine does not need this file.

use super::advice::advice;
use super::{Capabilities, DeviceFeatures, Feature, Frames, Gpu, PipelineFactory, RawDevice};
use crate::{Error, Result};
use ash::vk;
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex};

/// What to open.
#[derive(Default)]
pub struct Options {
    /// Part of the device's name (case does not matter) or its index in [`devices`]; none takes the best.
    pub device: Option<String>,
    /// Turns on core and synchronization validation; an error if the layer is not installed.
    pub validation: bool,
    /// Frames in flight; 0 means 2.
    pub frames_in_flight: usize,
    /// Who builds the pipelines; none builds them as described.
    pub factory: Option<Box<dyn PipelineFactory>>,
    /// Optional features to leave disabled, for example to test a fallback.
    pub without: Vec<Feature>,
    /// Adds extensions and features that the physical device has to those that the renderer uses.
    pub setup: Option<Box<SetupHook>>,
}

/// See [`Options::setup`].
pub type SetupHook = dyn FnOnce(&ash::Instance, vk::PhysicalDevice, &mut DeviceSetup);

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Messages of the validation layers.
#[derive(Clone, Default)]
pub struct Messages(Arc<Mutex<Vec<String>>>);

impl Messages {
    /// Describes a messenger that collects every validation warning and error here, for an instance of the host's own
    /// with `VK_EXT_debug_utils`. These messages must outlive the messenger.
    pub fn messenger(&self) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
        use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
        vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(Severity::ERROR | Severity::WARNING)
            .message_type(Type::VALIDATION)
            .pfn_user_callback(Some(collect))
            .user_data(Arc::as_ptr(&self.0).cast_mut().cast())
    }

    /// Everything said so far: warnings and errors.
    pub fn all(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    /// Number of messages so far.
    pub fn count(&self) -> usize {
        self.all().len()
    }
}

/// A device, a queue and frames in flight.
pub struct Standalone {
    // Declared first, dropped first: everything on the device goes before the device.
    frames: Frames,
    gpu: Arc<Gpu>,
    messages: Option<Messages>,
}

impl Standalone {
    /// Opens a device.
    ///
    /// # Errors
    /// [`Error::NoDriver`] if there is no Vulkan loader, driver or device, [`Error::Unsupported`] if there is no usable one, or
    /// no validation layer when asked for;
    /// [`Error::InvalidParam`] if no device has the name or index asked for.
    pub fn new(options: Options) -> Result<Self> {
        let instance = Arc::new(Instance::new(options.validation)?);
        let (physical_device, capabilities) = pick(&instance, options.device.as_deref())?;
        if !capabilities.missing.is_empty() {
            return Err(Error::Unsupported { needed: capabilities.missing.join(", "), by: capabilities.device_name });
        }
        let usable = |feature| !options.without.contains(&feature) && capabilities.supports(feature).is_ok();
        let interlock = usable(Feature::FragmentShaderInterlock);
        let attachment_access = usable(Feature::RasterizationOrderAttachmentAccess);
        let local_read = usable(Feature::DynamicRenderingLocalRead);
        let mut setup = DeviceSetup::new(interlock, attachment_access, local_read);
        if let Some(add) = options.setup {
            add(&instance.raw, physical_device, &mut setup);
        }
        let device = setup.create(&instance.raw, physical_device, capabilities.queue_family)?;
        let owner = Device { device: device.clone(), _instance: instance.clone() };
        let raw = RawDevice {
            instance: instance.raw.clone(),
            physical_device,
            device,
            queue_family: capabilities.queue_family,
            features: DeviceFeatures::WANTED,
            interlock,
            attachment_access,
            local_read,
            debug_utils: instance.debug.is_some(),
            allocator: None,
            pipeline_cache: None,
            factory: options.factory,
            keep_alive: Some(Box::new(owner)),
        };
        // SAFETY: the handles were created above with `DeviceFeatures::WANTED`; `keep_alive` owns them.
        let gpu = unsafe { Gpu::from_raw(raw) }?;
        // SAFETY: the family was created with one queue.
        let queue = unsafe { gpu.device().get_device_queue(capabilities.queue_family, 0) };
        let slots = if options.frames_in_flight == 0 { 2 } else { options.frames_in_flight };
        // SAFETY: the queue is ours alone.
        let frames = unsafe { Frames::new(&gpu, queue, slots) }?;
        Ok(Self { frames, gpu, messages: options.validation.then(|| instance.messages.clone()) })
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Frames in flight.
    pub fn frames(&mut self) -> &mut Frames {
        &mut self.frames
    }

    /// What validation has said; none without validation.
    pub fn messages(&self) -> Option<&Messages> {
        self.messages.as_ref()
    }
}

/// Every Vulkan device, usable or not.
pub fn devices() -> Result<Vec<Capabilities>> {
    let instance = Instance::new(false)?;
    Ok(instance.devices()?.into_iter().map(|(_, capabilities)| capabilities).collect())
}

/// Whether the Khronos validation layer is installed.
pub fn validation_available() -> bool {
    // SAFETY: loads the Vulkan loader, which runs its initialisers.
    let Ok(entry) = (unsafe { ash::Entry::load() }) else { return false };
    has_layer(&entry)
}

fn has_layer(entry: &ash::Entry) -> bool {
    // SAFETY: a global command without parameters.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
    layers.iter().any(|layer| layer.layer_name_as_c_str().is_ok_and(|name| name == VALIDATION_LAYER))
}

/// Whether the validation layer has `VK_EXT_layer_settings`.
fn takes_settings(entry: &ash::Entry) -> bool {
    // SAFETY: a global command; the layer's name is alive.
    let extensions =
        unsafe { entry.enumerate_instance_extension_properties(Some(VALIDATION_LAYER)) }.unwrap_or_default();
    extensions.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|name| name == ash::ext::layer_settings::NAME))
}

struct Instance {
    debug: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    raw: ash::Instance,
    messages: Messages,
    _entry: ash::Entry,
}

impl Instance {
    fn new(validation: bool) -> Result<Self> {
        // SAFETY: loads the Vulkan loader, which runs its initialisers.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| Error::NoDriver {
            missing: format!("this system has no Vulkan loader ({error})"),
            help: advice(),
        })?;
        if validation && !has_layer(&entry) {
            return Err(Error::Unsupported {
                needed: "validation: the layer VK_LAYER_KHRONOS_validation".to_owned(),
                by: "this system".to_owned(),
            });
        }
        // SAFETY: a global command.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        let has_debug = validation
            || extensions
                .iter()
                .any(|e| e.extension_name_as_c_str().is_ok_and(|name| name == ash::ext::debug_utils::NAME));
        let application = vk::ApplicationInfo::default()
            .application_name(c"welkin")
            .engine_name(c"welkin")
            .api_version(vk::API_VERSION_1_3);
        let mut names = Vec::new();
        let mut layers = Vec::new();
        if has_debug {
            names.push(ash::ext::debug_utils::NAME.as_ptr());
        }
        if validation {
            layers.push(VALIDATION_LAYER.as_ptr());
            names.push(ash::ext::validation_features::NAME.as_ptr());
        }
        // Old layers take the list of features, new ones the settings; an old one objects to settings that it does not know.
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let on = vk::TRUE.to_ne_bytes();
        let setting = |name| {
            let mut setting = vk::LayerSettingEXT::default()
                .layer_name(VALIDATION_LAYER)
                .setting_name(name)
                .ty(vk::LayerSettingTypeEXT::BOOL32)
                .values(&on);
            setting.value_count = 1;
            setting
        };
        // Without the heuristic, hazards through descriptors go unreported.
        let settings = [setting(c"validate_sync"), setting(c"syncval_shader_accesses_heuristic")];
        let mut layer_settings = vk::LayerSettingsCreateInfoEXT::default().settings(&settings);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_extension_names(&names)
            .enabled_layer_names(&layers);
        if validation {
            info = info.push_next(&mut features);
            if takes_settings(&entry) {
                info = info.push_next(&mut layer_settings);
            }
        }
        // SAFETY: every pointer in the description is alive.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
                Error::NoDriver { missing: "this system has a Vulkan loader, but no driver".to_owned(), help: advice() }
            }
            result => Error::Vulkan { call: "vkCreateInstance", pass: "the instance".to_owned(), result },
        })?;
        let mut instance = Self { debug: None, raw, messages: Messages::default(), _entry: entry };
        if has_debug {
            let utils = ash::ext::debug_utils::Instance::new(&instance._entry, &instance.raw);
            let mut messenger = vk::DebugUtilsMessengerEXT::null();
            if validation {
                let info = instance.messages.messenger();
                // SAFETY: the messages live as long as `instance`, which destroys the messenger before them.
                messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }.unwrap_or_default();
            }
            instance.debug = Some((utils, messenger));
        }
        Ok(instance)
    }

    fn devices(&self) -> Result<Vec<(vk::PhysicalDevice, Capabilities)>> {
        // SAFETY: the instance is alive.
        let devices = unsafe { self.raw.enumerate_physical_devices() }.map_err(|result| Error::Vulkan {
            call: "vkEnumeratePhysicalDevices",
            pass: "the instance".to_owned(),
            result,
        })?;
        Ok(devices.into_iter().map(|device| (device, Capabilities::probe(&self.raw, device, None))).collect())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some((utils, messenger)) = self.debug.take() {
            // SAFETY: made by this instance; a null handle is ignored.
            unsafe { utils.destroy_debug_utils_messenger(messenger, None) };
        }
        // SAFETY: the device went first: it holds an `Arc` of this.
        unsafe { self.raw.destroy_instance(None) };
    }
}

/// SAFETY: called by the validation layer with the pointers that the messenger was created with.
unsafe extern "system" fn collect(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is the mutex that the messenger was created with, alive as long as the messenger; `data` is valid
    // for the duration of the call.
    let (messages, data) = unsafe { (&*user.cast::<Mutex<Vec<String>>>(), &*data) };
    // SAFETY: the layer passes strings that are null or end in a zero byte.
    let text = unsafe { data.message_as_c_str() }.map(|text| text.to_string_lossy().into_owned()).unwrap_or_default();
    messages.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(text);
    vk::FALSE
}

/// Dropped last of all: destroys the device, then lets go of the instance.
struct Device {
    device: ash::Device,
    _instance: Arc<Instance>,
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: everything made by the device is gone: this is dropped by the last holder of the `Gpu`.
        unsafe {
            let _ = self.device.device_wait_idle();
            self.device.destroy_device(None);
        }
    }
}

/// Index of the device that `wanted` names, by part of its name or by its index; of the best without a wish.
///
/// # Errors
/// [`Error::NoDriver`] if there is no device at all, [`Error::InvalidParam`] if none is meant.
pub fn find(devices: &[Capabilities], wanted: Option<&str>) -> Result<usize> {
    let Some(wanted) = wanted else {
        let rank = |c: &Capabilities| {
            let kind = ["discrete", "integrated", "virtual", "cpu", "other"].iter().position(|k| *k == c.device_type);
            (!c.missing.is_empty(), kind, c.supports(Feature::FragmentShaderInterlock).is_err())
        };
        let best = devices.iter().enumerate().min_by_key(|(_, c)| rank(c));
        return best.map(|(index, _)| index).ok_or_else(|| Error::NoDriver {
            missing: "this system has a Vulkan driver, but no device for it".to_owned(),
            help: advice(),
        });
    };
    let index = wanted.parse::<usize>().ok();
    let found = devices.iter().enumerate().position(|(i, c)| match index {
        Some(index) => i == index,
        None => c.device_name.to_lowercase().contains(&wanted.to_lowercase()),
    });
    found.ok_or_else(|| {
        let list: Vec<String> = devices.iter().enumerate().map(|(i, c)| format!("{i}: {}", c.device_name)).collect();
        Error::invalid("--device", wanted, format!("part of the name, or the index, of one of [{}]", list.join("; ")))
    })
}

fn pick(instance: &Instance, wanted: Option<&str>) -> Result<(vk::PhysicalDevice, Capabilities)> {
    let (handles, capabilities): (Vec<_>, Vec<_>) = instance.devices()?.into_iter().unzip();
    let index = find(&capabilities, wanted)?;
    Ok((handles[index], capabilities[index].clone()))
}

/// What a device is created with: [`Options::setup`] may add to it what the device has.
#[derive(Default)]
pub struct DeviceSetup {
    /// Device extensions. The structs of extensions below count only where theirs is in this list.
    pub extensions: Vec<&'static CStr>,
    /// Features of Vulkan 1.0.
    pub core: vk::PhysicalDeviceFeatures,
    /// Features of Vulkan 1.1.
    pub vulkan11: vk::PhysicalDeviceVulkan11Features<'static>,
    /// Features of Vulkan 1.2.
    pub vulkan12: vk::PhysicalDeviceVulkan12Features<'static>,
    /// Features of Vulkan 1.3.
    pub vulkan13: vk::PhysicalDeviceVulkan13Features<'static>,
    /// `VK_EXT_fragment_shader_interlock`.
    pub interlock: vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT<'static>,
    /// `VK_EXT_rasterization_order_attachment_access`.
    pub attachment_access: vk::PhysicalDeviceRasterizationOrderAttachmentAccessFeaturesEXT<'static>,
    /// `VK_KHR_dynamic_rendering_local_read`.
    pub local_read: vk::PhysicalDeviceDynamicRenderingLocalReadFeaturesKHR<'static>,
}

impl DeviceSetup {
    /// What the renderer needs, and the optional features that were asked for.
    fn new(interlock: bool, attachment_access: bool, local_read: bool) -> Self {
        let mut setup = Self::default();
        DeviceFeatures::WANTED.enable(&mut setup.core, &mut setup.vulkan12, &mut setup.vulkan13);
        if interlock {
            setup.extensions.push(ash::ext::fragment_shader_interlock::NAME);
            setup.interlock.fragment_shader_pixel_interlock = vk::TRUE;
        }
        if attachment_access {
            setup.extensions.push(ash::ext::rasterization_order_attachment_access::NAME);
            setup.attachment_access.rasterization_order_color_attachment_access = vk::TRUE;
        }
        if local_read {
            setup.extensions.push(ash::khr::dynamic_rendering_local_read::NAME);
            setup.local_read.dynamic_rendering_local_read = vk::TRUE;
        }
        setup
    }

    fn create(
        mut self,
        instance: &ash::Instance,
        physical_device: vk::PhysicalDevice,
        family: u32,
    ) -> Result<ash::Device> {
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        self.extensions.sort_unstable();
        self.extensions.dedup();
        let has = |name: &CStr| self.extensions.contains(&name);
        let (interlock, attachment_access, local_read) = (
            has(ash::ext::fragment_shader_interlock::NAME),
            has(ash::ext::rasterization_order_attachment_access::NAME),
            has(ash::khr::dynamic_rendering_local_read::NAME),
        );
        let extensions: Vec<_> = self.extensions.iter().map(|name| name.as_ptr()).collect();
        let mut features = vk::PhysicalDeviceFeatures2::default()
            .features(self.core)
            .push_next(&mut self.vulkan11)
            .push_next(&mut self.vulkan12)
            .push_next(&mut self.vulkan13);
        if interlock {
            features = features.push_next(&mut self.interlock);
        }
        if attachment_access {
            features = features.push_next(&mut self.attachment_access);
        }
        if local_read {
            features = features.push_next(&mut self.local_read);
        }
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut features);
        // SAFETY: every pointer in the description is alive; features and extensions were probed.
        unsafe { instance.create_device(physical_device, &info, None) }.map_err(|result| Error::Vulkan {
            call: "vkCreateDevice",
            pass: "the device".to_owned(),
            result,
        })
    }
}
