//! Device features and limits that Welkin must have: one table for probing a device, for creating one, and for checking
//! what an engine says it enabled.

use super::{BindingKind, Program};
use ash::vk;

macro_rules! features {
    (
        $core:ident, $vulkan12:ident, $vulkan13:ident;
        $($from:ident . $field:ident = $name:literal),* $(,)?
    ) => {
        /// The features that Welkin must have, each named as Vulkan names it. An engine states here what it enabled on the
        /// device that it lends: [`DeviceFeatures::from_vulkan`] takes the structs that the device was created with.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct DeviceFeatures {
            $(#[doc = concat!("`", $name, "`")] pub $field: bool,)*
        }

        /// Device features that Welkin must have, by their Vulkan names, on a device of Vulkan 1.3.
        pub const FEATURES_WANTED: &[&str] = &[$($name),*];

        impl DeviceFeatures {
            /// Everything that is needed.
            pub const WANTED: Self = Self { $($field: true),* };

            /// What these structs have enabled.
            #[must_use]
            pub fn from_vulkan(
                $core: &vk::PhysicalDeviceFeatures,
                $vulkan12: &vk::PhysicalDeviceVulkan12Features<'_>,
                $vulkan13: &vk::PhysicalDeviceVulkan13Features<'_>,
            ) -> Self {
                Self { $($field: $from.$field != vk::FALSE),* }
            }

            /// Enables what is set here, and leaves everything else as it is.
            pub fn enable(
                &self,
                $core: &mut vk::PhysicalDeviceFeatures,
                $vulkan12: &mut vk::PhysicalDeviceVulkan12Features<'_>,
                $vulkan13: &mut vk::PhysicalDeviceVulkan13Features<'_>,
            ) {
                $($from.$field |= vk::Bool32::from(self.$field);)*
            }

            /// What is needed and not set, by its Vulkan name.
            #[must_use]
            pub fn missing(&self) -> Vec<&'static str> {
                let mut missing = Vec::new();
                $(if !self.$field {
                    missing.push($name);
                })*
                missing
            }
        }
    };
}

features! {
    core, vulkan12, vulkan13;
    vulkan13.synchronization2 = "synchronization2",
    vulkan13.dynamic_rendering = "dynamicRendering",
    vulkan13.shader_demote_to_helper_invocation = "shaderDemoteToHelperInvocation",
    vulkan12.timeline_semaphore = "timelineSemaphore",
    core.fragment_stores_and_atomics = "fragmentStoresAndAtomics",
    core.independent_blend = "independentBlend",
    core.shader_storage_image_extended_formats = "shaderStorageImageExtendedFormats",
    core.shader_storage_image_write_without_format = "shaderStorageImageWriteWithoutFormat",
}

/// A limit of the device, and how much of it Welkin needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitWanted {
    /// Name in `VkPhysicalDeviceLimits`.
    pub name: &'static str,
    /// The least value that will do.
    pub least: u32,
}

/// The limits that the shaders need, as reflected from them. Every set layout shows its bindings to all stages of its
/// program, so a program's bindings count against the limits per stage.
#[must_use]
pub fn limits_wanted() -> [LimitWanted; 6] {
    let most = |count: &dyn Fn(&Program) -> usize| {
        crate::shaders::PROGRAMS.iter().map(|program| count(program)).max().unwrap_or(0) as u32
    };
    let of_kind =
        |kind: BindingKind| most(&|program| program.bindings.iter().filter(|binding| binding.kind == kind).count());
    let invocations = most(&|program| program.group_size.iter().product::<u32>() as usize);
    [
        LimitWanted { name: "maxPerStageDescriptorStorageBuffers", least: of_kind(BindingKind::StorageBuffer) },
        LimitWanted { name: "maxPerStageDescriptorStorageImages", least: of_kind(BindingKind::StorageImage) },
        LimitWanted { name: "maxPerStageDescriptorSampledImages", least: of_kind(BindingKind::SampledImage) },
        LimitWanted { name: "maxPerStageResources", least: most(&|program| program.bindings.len()) },
        LimitWanted { name: "maxPushConstantsSize", least: most(&|program| program.push_constant_size as usize) },
        LimitWanted { name: "maxComputeWorkGroupInvocations", least: invocations },
    ]
}

/// What of [`limits_wanted`] a device falls short of, in words.
pub(super) fn limits_missing(limits: &vk::PhysicalDeviceLimits) -> Vec<String> {
    let has = |name: &str| match name {
        "maxPerStageDescriptorStorageBuffers" => limits.max_per_stage_descriptor_storage_buffers,
        "maxPerStageDescriptorStorageImages" => limits.max_per_stage_descriptor_storage_images,
        "maxPerStageDescriptorSampledImages" => limits.max_per_stage_descriptor_sampled_images,
        "maxPerStageResources" => limits.max_per_stage_resources,
        "maxPushConstantsSize" => limits.max_push_constants_size,
        _ => limits.max_compute_work_group_invocations,
    };
    let short = limits_wanted().into_iter().filter(|limit| has(limit.name) < limit.least);
    short.map(|limit| format!("{} >= {} (the device has {})", limit.name, limit.least, has(limit.name))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn enabled_features_are_read_back_and_none_is_forgotten() {
        let (mut core, mut v12, mut v13) = Default::default();
        assert_eq!(DeviceFeatures::from_vulkan(&core, &v12, &v13).missing(), FEATURES_WANTED);
        DeviceFeatures::WANTED.enable(&mut core, &mut v12, &mut v13);
        assert_eq!(DeviceFeatures::from_vulkan(&core, &v12, &v13), DeviceFeatures::WANTED);
        assert!(DeviceFeatures::WANTED.missing().is_empty());
        core.independent_blend = vk::FALSE;
        assert_eq!(DeviceFeatures::from_vulkan(&core, &v12, &v13).missing(), ["independentBlend"]);
    }

    #[test]
    fn a_device_with_the_least_limits_lacks_nothing_and_one_below_is_told_which() {
        let mut limits = vk::PhysicalDeviceLimits::default();
        assert_eq!(limits_missing(&limits).len(), limits_wanted().len());
        let [buffers, images, sampled, resources, push, invocations] = limits_wanted().map(|limit| limit.least);
        limits.max_per_stage_descriptor_storage_buffers = buffers;
        limits.max_per_stage_descriptor_storage_images = images;
        limits.max_per_stage_descriptor_sampled_images = sampled;
        limits.max_per_stage_resources = resources;
        limits.max_push_constants_size = push;
        limits.max_compute_work_group_invocations = invocations;
        assert_eq!(limits_missing(&limits), Vec::<String>::new());
        limits.max_push_constants_size -= 1;
        let told = format!("maxPushConstantsSize >= {push} (the device has {})", push - 1);
        assert_eq!(limits_missing(&limits), [told]);
    }
}
