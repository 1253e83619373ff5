//! Memory comes through a small trait, so that an engine can bring its own allocator.

use crate::{Error, Result};
use ash::vk;
use std::any::Any;
use std::ptr::NonNull;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Who touches the memory.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MemoryLocation {
    /// Only the device.
    Device,
    /// Written by the host, read by the device; mapped.
    Upload,
    /// Written by the device, read by the host; mapped.
    Readback,
}

/// A piece of device memory.
pub struct Allocation {
    /// The memory object.
    pub memory: vk::DeviceMemory,
    /// Where in it the piece begins [bytes].
    pub offset: u64,
    /// Length [bytes].
    pub size: u64,
    /// Host address of the piece, if mapped. The memory must be host-coherent.
    pub mapped: Option<NonNull<u8>>,
    /// Whatever the allocator needs to free the piece.
    pub token: Box<dyn Any + Send + Sync>,
}

// SAFETY: `mapped` is an address that stays valid until `free`; the owner synchronises access to what it points at.
unsafe impl Send for Allocation {}
// SAFETY: as above; a shared `Allocation` gives out no reference to the memory.
unsafe impl Sync for Allocation {}

/// Source of device memory. Mapped memory must be host-coherent.
pub trait Allocator: Send + Sync {
    /// Memory for a resource called `name`; `linear` is true for buffers.
    fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation>;
    /// Takes a piece back.
    fn free(&self, allocation: Allocation);
}

/// How much memory a [`Gpu`](super::Gpu) holds at the moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct MemoryUse {
    /// Number of live allocations.
    pub allocations: u64,
    /// Their total size [bytes].
    pub bytes: u64,
}

/// Counts what is alive on its way to and from the allocator.
pub(crate) struct Accounting {
    allocator: Box<dyn Allocator>,
    allocations: AtomicU64,
    bytes: AtomicU64,
}

impl Accounting {
    pub(crate) fn new(allocator: Box<dyn Allocator>) -> Self {
        Self { allocator, allocations: AtomicU64::new(0), bytes: AtomicU64::new(0) }
    }

    pub(crate) fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        let allocation = self.allocator.allocate(name, requirements, location, linear)?;
        self.allocations.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(allocation.size, Ordering::Relaxed);
        Ok(allocation)
    }

    pub(crate) fn free(&self, allocation: Allocation) {
        self.allocations.fetch_sub(1, Ordering::Relaxed);
        self.bytes.fetch_sub(allocation.size, Ordering::Relaxed);
        self.allocator.free(allocation);
    }

    pub(crate) fn in_use(&self) -> MemoryUse {
        MemoryUse { allocations: self.allocations.load(Ordering::Relaxed), bytes: self.bytes.load(Ordering::Relaxed) }
    }
}

/// The default: `gpu-allocator`.
pub(crate) struct DefaultAllocator(Mutex<gpu_allocator::vulkan::Allocator>);

impl DefaultAllocator {
    pub(crate) fn new(
        instance: &ash::Instance,
        device: &ash::Device,
        physical_device: vk::PhysicalDevice,
    ) -> Result<Self> {
        let mut debug_settings = gpu_allocator::AllocatorDebugSettings::default();
        debug_settings.log_leaks_on_shutdown = false; // `Accounting` counts; a library does not log.
        let desc = gpu_allocator::vulkan::AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device,
            debug_settings,
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        };
        gpu_allocator::vulkan::Allocator::new(&desc)
            .map(|allocator| Self(Mutex::new(allocator)))
            .map_err(|error| Error::OutOfMemory { what: format!("the allocator ({error})"), bytes: None })
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, gpu_allocator::vulkan::Allocator> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Allocator for DefaultAllocator {
    fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        use gpu_allocator::MemoryLocation as Location;
        let desc = gpu_allocator::vulkan::AllocationCreateDesc {
            name,
            requirements,
            location: match location {
                MemoryLocation::Device => Location::GpuOnly,
                MemoryLocation::Upload => Location::CpuToGpu,
                MemoryLocation::Readback => Location::GpuToCpu,
            },
            linear,
            allocation_scheme: gpu_allocator::vulkan::AllocationScheme::GpuAllocatorManaged,
        };
        let allocation = self.lock().allocate(&desc).map_err(|error| Error::OutOfMemory {
            what: format!("{name} ({error})"),
            bytes: Some(requirements.size),
        })?;
        // SAFETY: the memory is freed only through `free`, which takes the piece back by value.
        let memory = unsafe { allocation.memory() };
        Ok(Allocation {
            memory,
            offset: allocation.offset(),
            size: allocation.size(),
            mapped: allocation.mapped_ptr().map(NonNull::cast),
            token: Box::new(allocation),
        })
    }

    fn free(&self, allocation: Allocation) {
        if let Ok(piece) = allocation.token.downcast::<gpu_allocator::vulkan::Allocation>() {
            // Freeing fails only for a foreign piece; there is nothing to give back then.
            let _ = self.lock().free(*piece);
        }
    }
}
