//! A device to try the checks on, and what it is able to.

use crate::Result;
use crate::gpu::standalone::{DeviceSetup, Options, Standalone, validation_available};
use crate::gpu::{Capabilities, Feature, Frames, Gpu, Recorder};
use ash::vk;
use std::ffi::CStr;
use std::sync::{Arc, Mutex, PoisonError};

/// How much of the matrix is tried in each check.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Effort {
    /// Everything: all sizes, 1000 repetitions.
    #[default]
    Full,
    /// Small sizes and few repetitions, for a test-suite.
    Quick,
}

/// What a test breaks on purpose, so that a check is seen to fail.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sabotage {
    /// One expected value is another.
    Expected,
    /// Ordering is not asked for: no interlock in the SPIR-V, no flags of attachment access.
    Unordered,
    /// The same, and nobody looks at SPIR-V and flags: only hardware that runs fragments side by side shows it.
    UnorderedUnseen,
    /// What is drawn in order comes in reverse.
    Reversed,
    /// The merge is a commutative one, which every order satisfies.
    Commutative,
    /// One fragment is lost.
    Lost,
}

impl Sabotage {}

/// What to open.
#[derive(Clone, Debug, Default)]
pub struct LabOptions {
    /// Part of the device's name or its index; none takes the best.
    pub device: Option<String>,
    /// How much is tried.
    pub effort: Effort,
    /// What is broken on purpose.
    pub sabotage: Option<Sabotage>,
}

/// A device, with everything enabled that checks can use, and with validation where the layer is installed.
pub struct Lab {
    device: Standalone,
    abilities: Abilities,
    options: LabOptions,
}

impl Lab {
    /// Opens a device.
    ///
    /// # Errors
    /// As [`Standalone::new`].
    pub fn open(options: LabOptions) -> Result<Self> {
        let probed = Arc::new(Mutex::new(Abilities::default()));
        let slot = probed.clone();
        let setup = move |instance: &ash::Instance, device, setup: &mut DeviceSetup| {
            let abilities = Abilities::probe(instance, device);
            abilities.enable(setup);
            *slot.lock().unwrap_or_else(PoisonError::into_inner) = abilities;
        };
        let device = Standalone::new(Options {
            device: options.device.clone(),
            validation: validation_available(),
            frames_in_flight: 1,
            setup: Some(Box::new(setup)),
            ..Options::default()
        })?;
        let mut abilities = probed.lock().unwrap_or_else(PoisonError::into_inner).clone();
        abilities.renderer(device.gpu().capabilities());
        Ok(Self { device, abilities, options })
    }

    /// The same device, opened anew after it has failed.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn reopen(self) -> Result<Self> {
        let options = self.options.clone();
        drop(self);
        Self::open(options)
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        self.device.gpu()
    }

    /// The queue: one frame in flight.
    pub fn frames(&mut self) -> &mut Frames {
        self.device.frames()
    }

    /// Records, submits and waits. Resources may be replaced afterwards.
    pub(crate) fn submit<T>(&mut self, record: impl FnOnce(&mut Recorder<'_>) -> Result<T>) -> Result<T> {
        let frames = self.device.frames();
        let value = frames.run(record)?;
        frames.state().forget();
        Ok(value)
    }

    /// What the device is able to.
    pub fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    /// Whether sizes and repetitions are to be small.
    pub fn quick(&self) -> bool {
        self.options.effort == Effort::Quick
    }

    /// What is broken on purpose.
    pub fn sabotage(&self) -> Option<Sabotage> {
        self.options.sabotage
    }

    /// Whether validation is on.
    pub fn validated(&self) -> bool {
        self.device.messages().is_some()
    }

    /// What validation has said so far.
    pub fn messages(&self) -> Vec<String> {
        self.device.messages().map(|messages| messages.all()).unwrap_or_default()
    }
}

/// Something that a check needs and not every device has.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Need {
    /// Pixel interlock.
    PixelInterlock,
    /// Sample interlock.
    SampleInterlock,
    /// A shader invocation for each sample.
    SampleShading,
    /// So many samples per pixel in a pass without attachments.
    Samples(u32),
    /// So many samples per pixel in colour attachments that are read back as input attachments.
    ColourSamples(u32),
    /// Sample locations as the specification draws them.
    StandardSampleLocations,
    /// Rasterization-order attachment access for colour.
    AttachmentAccess,
    /// Dynamic rendering local read.
    LocalRead,
    /// Storage buffers with 16-bit floats, and arithmetic on them.
    Half,
    /// Timestamps on the queue.
    Timestamps,
}

/// What of [`Need`] a device has.
#[derive(Clone, Debug, Default)]
pub struct Abilities {
    sample_interlock: Option<String>,
    sample_shading: Option<String>,
    half: Option<String>,
    pixel_interlock: Option<String>,
    attachment_access: Option<String>,
    local_read: Option<String>,
    timestamps: Option<String>,
    sample_counts: vk::SampleCountFlags,
    colour_sample_counts: vk::SampleCountFlags,
    standard_locations: bool,
}

impl Abilities {
    fn probe(instance: &ash::Instance, device: vk::PhysicalDevice) -> Self {
        // SAFETY: the handle came from this instance, here and below.
        let extensions = unsafe { instance.enumerate_device_extension_properties(device) }.unwrap_or_default();
        let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str().is_ok_and(|n| n == name));
        let interlock = has(ash::ext::fragment_shader_interlock::NAME);
        let mut interlock_features = vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default();
        let mut v11 = vk::PhysicalDeviceVulkan11Features::default();
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v11).push_next(&mut v12);
        if interlock {
            features = features.push_next(&mut interlock_features);
        }
        // SAFETY: only structs that the version or an extension of the device knows are chained.
        unsafe { instance.get_physical_device_features2(device, &mut features) };
        let core = features.features;
        // SAFETY: as above.
        let limits = unsafe { instance.get_physical_device_properties(device) }.limits;
        let extension = |present: bool, name: &str| (!present).then(|| format!("the driver has no {name}"));
        let feature = |value: vk::Bool32, name: &str| (value == vk::FALSE).then(|| format!("{name} is false"));
        Self {
            sample_interlock: extension(interlock, "VK_EXT_fragment_shader_interlock").or_else(|| {
                feature(interlock_features.fragment_shader_sample_interlock, "fragmentShaderSampleInterlock")
            }),
            sample_shading: feature(core.sample_rate_shading, "sampleRateShading"),
            half: feature(v11.storage_buffer16_bit_access, "storageBuffer16BitAccess")
                .or_else(|| feature(v12.shader_float16, "shaderFloat16")),
            sample_counts: limits.framebuffer_no_attachments_sample_counts,
            colour_sample_counts: limits.framebuffer_color_sample_counts,
            standard_locations: limits.standard_sample_locations != vk::FALSE,
            ..Self::default()
        }
    }

    /// Enables what the device has.
    fn enable(&self, setup: &mut DeviceSetup) {
        if self.sample_interlock.is_none() {
            setup.interlock.fragment_shader_sample_interlock = vk::TRUE;
            add(&mut setup.extensions, ash::ext::fragment_shader_interlock::NAME);
        }
        if self.sample_shading.is_none() {
            setup.core.sample_rate_shading = vk::TRUE;
        }
        if self.half.is_none() {
            setup.vulkan11.storage_buffer16_bit_access = vk::TRUE;
            setup.vulkan12.shader_float16 = vk::TRUE;
        }
    }

    /// Takes over what the renderer has found out itself.
    fn renderer(&mut self, capabilities: &Capabilities) {
        let reason = |feature| capabilities.supports(feature).err().map(str::to_owned);
        self.pixel_interlock = reason(Feature::FragmentShaderInterlock);
        self.attachment_access = reason(Feature::RasterizationOrderAttachmentAccess);
        self.local_read = reason(Feature::DynamicRenderingLocalRead);
        self.timestamps = reason(Feature::Timestamps);
    }

    /// Why `need` is not met; none if it is.
    #[must_use]
    pub fn lacks(&self, need: Need) -> Option<String> {
        let samples = |counts: vk::SampleCountFlags, n: u32, limit: &str| {
            (counts.as_raw() & n == 0).then(|| format!("{limit} has no {n}"))
        };
        match need {
            Need::PixelInterlock => self.pixel_interlock.clone(),
            Need::SampleInterlock => self.sample_interlock.clone(),
            Need::SampleShading => self.sample_shading.clone(),
            Need::Samples(n) => samples(self.sample_counts, n, "framebufferNoAttachmentsSampleCounts"),
            Need::ColourSamples(n) => samples(self.colour_sample_counts, n, "framebufferColorSampleCounts"),
            Need::StandardSampleLocations => {
                (!self.standard_locations).then(|| "standardSampleLocations is false".to_owned())
            }
            Need::AttachmentAccess => self.attachment_access.clone(),
            Need::LocalRead => self.local_read.clone(),
            Need::Half => self.half.clone(),
            Need::Timestamps => self.timestamps.clone(),
        }
    }
}

/// Adds an extension that is not there yet.
fn add(extensions: &mut Vec<&'static CStr>, name: &'static CStr) {
    if !extensions.contains(&name) {
        extensions.push(name);
    }
}
