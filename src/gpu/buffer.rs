//! Storage buffers.

use super::Gpu;
use super::id::next_id;
use super::memory::{Allocation, MemoryLocation};
use super::retire::Garbage;
use crate::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::sync::Arc;

/// Where a buffer lives and who may touch it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BufferKind {
    /// Device memory: storage, indirect arguments, copies.
    Device,
    /// Mapped, written by the host.
    Upload,
    /// Mapped, read by the host.
    Readback,
}

/// A buffer with a name, freed when dropped, as soon as the frames in flight have ended.
pub struct Buffer {
    gpu: Arc<Gpu>,
    pub(crate) id: u64,
    name: String,
    handle: vk::Buffer,
    size: u64,
    kind: BufferKind,
    allocation: Option<Allocation>,
}

impl Buffer {
    /// A buffer of `size` bytes (at least 4; storage blocks may not be empty).
    pub fn new(gpu: &Arc<Gpu>, name: &str, size: u64, kind: BufferKind) -> Result<Self> {
        let size = size.max(4).next_multiple_of(4);
        let limit = u64::from(gpu.capabilities().max_storage_buffer_range);
        if size > limit {
            return Err(Error::Unsupported {
                needed: format!("a storage buffer of {size} bytes for {name} (the limit is {limit})"),
                by: gpu.capabilities().device_name.clone(),
            });
        }
        let info = vk::BufferCreateInfo::default().size(size).usage(
            vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::INDIRECT_BUFFER
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::TRANSFER_DST,
        );
        // SAFETY: the device is alive as long as `gpu`, and the description is complete.
        let handle = unsafe { gpu.device().create_buffer(&info, None) }
            .map_err(|result| gpu.sized_error("vkCreateBuffer", name, Some(size), result))?;
        let mut buffer =
            Self { gpu: gpu.clone(), id: next_id(), name: name.to_owned(), handle, size, kind, allocation: None };
        // SAFETY: the buffer was created above on this device.
        let requirements = unsafe { gpu.device().get_buffer_memory_requirements(handle) };
        let location = match kind {
            BufferKind::Device => MemoryLocation::Device,
            BufferKind::Upload => MemoryLocation::Upload,
            BufferKind::Readback => MemoryLocation::Readback,
        };
        let allocation = gpu.memory().allocate(name, requirements, location, true)?;
        // SAFETY: the memory satisfies the requirements of this buffer, which is not bound yet.
        let bound = unsafe { gpu.device().bind_buffer_memory(handle, allocation.memory, allocation.offset) };
        buffer.allocation = Some(allocation);
        bound.map_err(|result| gpu.sized_error("vkBindBufferMemory", name, Some(size), result))?;
        gpu.set_name(handle, name);
        Ok(buffer)
    }

    /// A device buffer for `count` elements of `T`.
    pub fn array<T>(gpu: &Arc<Gpu>, name: &str, count: usize) -> Result<Self> {
        Self::new(gpu, name, (count.max(1) * size_of::<T>()) as u64, BufferKind::Device)
    }

    /// A mapped buffer that holds `data`.
    pub fn upload<T: Pod>(gpu: &Arc<Gpu>, name: &str, data: &[T]) -> Result<Self> {
        let buffer = Self::new(gpu, name, size_of_val(data) as u64, BufferKind::Upload)?;
        buffer.write(0, data);
        Ok(buffer)
    }

    /// Copies `data` to byte `offset` of a mapped buffer that the device is not reading.
    pub fn write<T: Pod>(&self, offset: u64, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let mapped = self.mapped(offset, bytes.len());
        // SAFETY: `mapped` checked that the range lies inside the allocation, and host and device take turns.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), mapped, bytes.len()) };
    }

    /// Copies `count` elements from byte `offset` of a mapped buffer that the device has finished writing.
    pub fn read<T: Pod>(&self, offset: u64, count: usize) -> Vec<T> {
        let mut data = vec![T::zeroed(); count];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut data);
        let mapped = self.mapped(offset, bytes.len());
        // SAFETY: as in `write`.
        unsafe { std::ptr::copy_nonoverlapping(mapped, bytes.as_mut_ptr(), bytes.len()) };
        data
    }

    fn mapped(&self, offset: u64, length: usize) -> *mut u8 {
        assert!(offset + length as u64 <= self.size, "{}: access past the end of the buffer", self.name);
        let base = self.allocation.as_ref().and_then(|allocation| allocation.mapped);
        let Some(base) = base else { panic!("{} is not mapped: only upload and readback buffers are", self.name) };
        // SAFETY: the range was checked against the size of the allocation.
        unsafe { base.as_ptr().add(offset as usize) }
    }

    /// The Vulkan handle.
    pub fn handle(&self) -> vk::Buffer {
        self.handle
    }

    /// Size [bytes].
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Name, as debuggers show it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where it lives.
    pub fn kind(&self) -> BufferKind {
        self.kind
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.gpu.retire(Garbage::Buffer(self.handle, self.allocation.take()));
    }
}
