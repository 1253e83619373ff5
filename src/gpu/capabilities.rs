//! What a device can do, probed once, with a printable reason for everything that it cannot.

use super::DeviceFeatures;
use super::features::limits_missing;
use ash::vk;
use std::ffi::CStr;

/// Features that Welkin uses where they exist.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Feature {
    /// `VK_EXT_fragment_shader_interlock` with `fragmentShaderPixelInterlock`: ordered volume-aware blending.
    FragmentShaderInterlock,
    /// `VK_EXT_rasterization_order_attachment_access` for colour attachments.
    RasterizationOrderAttachmentAccess,
    /// `VK_KHR_dynamic_rendering_local_read`: attachments that a draw writes are read outside render pass objects too.
    DynamicRenderingLocalRead,
    /// Timestamp queries on the queue in use.
    Timestamps,
}

/// Everything Welkin asks a device about.
#[derive(Clone, Debug)]
pub struct Capabilities {
    /// Name of the device.
    pub device_name: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Vulkan version of the device, as `major.minor.patch`.
    pub api: String,
    /// Kind of device: `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub device_type: &'static str,
    /// Largest range of a storage buffer [bytes].
    pub max_storage_buffer_range: u32,
    /// Largest extent of a 2D image [texels].
    pub max_image_dimension_2d: u32,
    /// Largest extent of a 3D image [texels].
    pub max_image_dimension_3d: u32,
    /// Attachments that one draw can both write and read: the least of `maxColorAttachments`,
    /// `maxFragmentOutputAttachments` and `maxPerStageDescriptorInputAttachments`.
    pub max_feedback_attachments: u32,
    /// Length of a timestamp tick [ns].
    pub timestamp_period: f32,
    /// Bits of a timestamp that count, on the queue in use; 0: it has none.
    pub timestamp_valid_bits: u32,
    /// Bits of the weights of linear filtering, at least (`subTexelPrecisionBits`).
    pub sub_texel_bits: u32,
    /// What keeps Welkin from running on this device at all: empty on a device that will do.
    pub missing: Vec<String>,
    interlock: Result<(), String>,
    attachment_access: Result<(), String>,
    local_read: Result<(), String>,
    timestamps: Result<(), String>,
    pub(crate) queue_family: u32,
}

impl Capabilities {
    /// Asks `physical_device` for everything. `queue_family` is the family in use, or none to pick the first that can
    /// do graphics and compute.
    pub fn probe(instance: &ash::Instance, physical_device: vk::PhysicalDevice, queue_family: Option<u32>) -> Self {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        // SAFETY: the handle came from this instance.
        unsafe { instance.get_physical_device_properties2(physical_device, &mut properties) };
        let p = properties.properties;
        let version = p.api_version;
        let (major, minor) = (vk::api_version_major(version), vk::api_version_minor(version));
        let driver_text = format!("{} {}", text(&driver.driver_name), text(&driver.driver_info));

        // SAFETY: as above.
        let extensions = unsafe { instance.enumerate_device_extension_properties(physical_device) }.unwrap_or_default();
        let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|n| n == name));
        let has_interlock = has(ash::ext::fragment_shader_interlock::NAME);
        let has_attachment = has(ash::ext::rasterization_order_attachment_access::NAME);
        let has_local_read = has(ash::khr::dynamic_rendering_local_read::NAME);

        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut interlock = vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default();
        let mut attachment = vk::PhysicalDeviceRasterizationOrderAttachmentAccessFeaturesEXT::default();
        let mut local_read = vk::PhysicalDeviceDynamicRenderingLocalReadFeaturesKHR::default();
        let mut features = vk::PhysicalDeviceFeatures2::default();
        if (major, minor) >= (1, 3) {
            features = features.push_next(&mut v12).push_next(&mut v13);
        }
        if has_interlock {
            features = features.push_next(&mut interlock);
        }
        if has_attachment {
            features = features.push_next(&mut attachment);
        }
        if has_local_read {
            features = features.push_next(&mut local_read);
        }
        // SAFETY: as above; only structs that the device's version or extensions know are chained.
        unsafe { instance.get_physical_device_features2(physical_device, &mut features) };
        let core = features.features;

        // SAFETY: as above.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical_device) };
        let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let able = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(wanted);
        let family = match queue_family {
            Some(index) => families.get(index as usize).is_some_and(able).then_some(index),
            None => families.iter().position(able).map(|index| index as u32),
        };

        let mut missing = Vec::new();
        if (major, minor) < (1, 3) {
            missing.push(format!("Vulkan 1.3 (the device has {major}.{minor})"));
        }
        let features = DeviceFeatures::from_vulkan(&core, &v12, &v13);
        missing.extend(features.missing().into_iter().map(str::to_owned));
        missing.extend(limits_missing(&p.limits));
        if family.is_none() {
            missing.push(match queue_family {
                Some(index) => format!("graphics and compute on queue family {index}"),
                None => "a queue with graphics and compute".to_owned(),
            });
        }

        let queue_family = family.unwrap_or(0);
        let valid_bits = families.get(queue_family as usize).map_or(0, |f| f.timestamp_valid_bits);
        Self {
            device_name: p.device_name_as_c_str().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            driver: driver_text.trim().to_owned(),
            api: format!("{major}.{minor}.{}", vk::api_version_patch(version)),
            device_type: match p.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
                vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
                vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
                vk::PhysicalDeviceType::CPU => "cpu",
                _ => "other",
            },
            max_storage_buffer_range: p.limits.max_storage_buffer_range,
            max_image_dimension_2d: p.limits.max_image_dimension2_d,
            max_image_dimension_3d: p.limits.max_image_dimension3_d,
            max_feedback_attachments: p
                .limits
                .max_color_attachments
                .min(p.limits.max_fragment_output_attachments)
                .min(p.limits.max_per_stage_descriptor_input_attachments),
            timestamp_period: p.limits.timestamp_period,
            timestamp_valid_bits: valid_bits,
            sub_texel_bits: p.limits.sub_texel_precision_bits,
            missing,
            interlock: optional(
                "VK_EXT_fragment_shader_interlock",
                has_interlock,
                "fragmentShaderPixelInterlock",
                interlock.fragment_shader_pixel_interlock,
            ),
            attachment_access: optional(
                "VK_EXT_rasterization_order_attachment_access",
                has_attachment,
                "rasterizationOrderColorAttachmentAccess",
                attachment.rasterization_order_color_attachment_access,
            ),
            local_read: optional(
                "VK_KHR_dynamic_rendering_local_read",
                has_local_read,
                "dynamicRenderingLocalRead",
                local_read.dynamic_rendering_local_read,
            ),
            timestamps: if valid_bits > 0 {
                Ok(())
            } else {
                Err(format!("queue family {queue_family} has no timestamps (timestampValidBits = 0)"))
            },
            queue_family,
        }
    }

    /// Whether an optional feature can be used, or a sentence why not.
    pub fn supports(&self, feature: Feature) -> Result<(), &str> {
        let answer = match feature {
            Feature::FragmentShaderInterlock => &self.interlock,
            Feature::RasterizationOrderAttachmentAccess => &self.attachment_access,
            Feature::DynamicRenderingLocalRead => &self.local_read,
            Feature::Timestamps => &self.timestamps,
        };
        answer.as_ref().copied().map_err(String::as_str)
    }

    /// Marks a feature that the device has, but that the engine did not enable.
    pub(crate) fn withhold(&mut self, feature: Feature) {
        let slot = match feature {
            Feature::FragmentShaderInterlock => &mut self.interlock,
            Feature::RasterizationOrderAttachmentAccess => &mut self.attachment_access,
            Feature::DynamicRenderingLocalRead => &mut self.local_read,
            Feature::Timestamps => &mut self.timestamps,
        };
        if slot.is_ok() {
            *slot = Err("the host did not enable it on the device".to_owned());
        }
    }
}

fn optional(extension: &str, present: bool, feature: &str, value: vk::Bool32) -> Result<(), String> {
    if !present {
        Err(format!("the driver has no {extension}"))
    } else if value == vk::FALSE {
        Err(format!("{extension} is present, but {feature} is false"))
    } else {
        Ok(())
    }
}

fn text(chars: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = chars.iter().map(|c| *c as u8).take_while(|b| *b != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
