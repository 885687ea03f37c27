//! Memory on the device, and copies into it and out of it.
//!
//! ```text
//! host bytes ──► staging (host-visible, 16 MiB, one for all) ──► Buffer (device memory, reached by its address)
//!            ◄──                                             ◄──
//! ```
//! Each buffer has a memory allocation of its own: there are about ten for each instance, and drivers allow at least 4096. A request beyond
//! the driver's limit is refused with an error here, because passing it to the driver would be invalid use of Vulkan.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::vk;

use super::DeviceError;
use super::faults::InjectedFault;
use super::gpu::{Gpu, Inner};

/// Size of the staging memory: large enough that the fixed cost of a launch does not matter, small compared with any volume.
const STAGING_BYTES: u64 = 16 << 20;

/// Allowed uses of every buffer, by shaders and copies.
const USAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw(),
);

/// Bytes for a part of a buffer, and the offset where they begin.
pub type Piece<'a> = (u64, &'a [u8]);

/// Memory on the device.
pub struct Buffer {
    raw: RawBuffer,
    address: u64,
    gpu: Arc<Inner>,
}

/// A buffer and its memory; the owner must destroy them.
pub(super) struct RawBuffer {
    pub(super) buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    /// Size as requested, in bytes.
    bytes: u64,
    /// Size of the allocation in bytes, alignment included.
    allocated: u64,
}

/// Host-visible memory through which uploads and downloads pass.
pub(super) struct Staging {
    raw: RawBuffer,
    pointer: *mut u8,
}

// SAFETY: the pointer is to mapped memory, which belongs to no thread; whoever uses it holds the worker's lock.
unsafe impl Send for Staging {}

impl Buffer {
    /// Device address of its first byte, a multiple of 16.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Its size as requested, in bytes.
    pub fn bytes(&self) -> u64 {
        self.raw.bytes
    }

    pub(super) fn handle(&self) -> vk::Buffer {
        self.raw.buffer
    }
}

impl std::fmt::Debug for Buffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Buffer").field("bytes", &self.bytes()).finish()
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if self.gpu.may_destroy() {
            self.gpu.allocated.fetch_sub(self.raw.allocated, Ordering::Relaxed);
            self.gpu.buffers.fetch_sub(1, Ordering::Relaxed);
            self.raw.destroy(&self.gpu.calls);
        }
    }
}

impl RawBuffer {
    /// Frees both. Nothing may use the buffer afterwards: the owner is being dropped.
    fn destroy(&self, calls: &ash::Device) {
        // SAFETY: no launch is in flight that could use them (each is waited for), and the owner forgets the handles.
        unsafe {
            calls.destroy_buffer(self.buffer, None);
            calls.free_memory(self.memory, None);
        }
    }
}

impl Staging {
    pub(super) fn destroy(self, calls: &ash::Device) {
        self.raw.destroy(calls);
    }
}

/// The kind of memory for a buffer.
#[derive(Clone, Copy, PartialEq, Eq)]
enum MemoryKind {
    Device,
    Host,
}

impl Inner {
    fn make_buffer(
        &self,
        what: &'static str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        place: MemoryKind,
    ) -> Result<RawBuffer, DeviceError> {
        let limit = self.limits.allocation_bytes;
        if bytes > limit {
            return Err(DeviceError::Limit { what, needed: bytes, limit });
        }
        // Counts this buffer and reserves one allocation for the staging memory, which `buffers` does not count.
        let (allocations, limit) = (self.buffers.load(Ordering::Relaxed) + 2, self.limits.allocations);
        if place == MemoryKind::Device && allocations > limit {
            return Err(DeviceError::Limit { what: "buffers at one time", needed: allocations, limit });
        }
        let create = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        // SAFETY: the device is live; the handle goes into a `RawBuffer` or is destroyed below.
        let buffer =
            unsafe { self.calls.create_buffer(&create, None) }.map_err(DeviceError::of("vkCreateBuffer"))?;
        // SAFETY: the buffer was just made.
        let needs = unsafe { self.calls.get_buffer_memory_requirements(buffer) };
        let memory = self.allocate(what, &needs, place).and_then(|memory| {
            // SAFETY: memory of at least the needed size and of a type that the buffer allows, bound once.
            let bound = unsafe { self.calls.bind_buffer_memory(buffer, memory, 0) };
            bound.map(|()| memory).map_err(|e| {
                // SAFETY: it was not bound.
                unsafe { self.calls.free_memory(memory, None) };
                DeviceError::of("vkBindBufferMemory")(e)
            })
        });
        match memory {
            Ok(memory) => Ok(RawBuffer { buffer, memory, bytes, allocated: needs.size }),
            Err(e) => {
                // SAFETY: nobody else has the handle.
                unsafe { self.calls.destroy_buffer(buffer, None) };
                Err(e)
            }
        }
    }

    fn allocate(
        &self,
        what: &'static str,
        needs: &vk::MemoryRequirements,
        place: MemoryKind,
    ) -> Result<vk::DeviceMemory, DeviceError> {
        use vk::MemoryPropertyFlags as Is;
        let host = Is::HOST_VISIBLE | Is::HOST_COHERENT;
        // In order of preference. The host reads cached memory fast.
        let wishes: &[Is] = match place {
            MemoryKind::Device => &[Is::DEVICE_LOCAL, Is::empty()],
            MemoryKind::Host => &[host | Is::HOST_CACHED, host],
        };
        let types = &self.memory.memory_types[..self.memory.memory_type_count as usize];
        let allowed = |i: usize| needs.memory_type_bits >> i & 1 != 0;
        let kind = wishes.iter().find_map(|&wish| {
            (0..types.len()).find(|&i| allowed(i) && types[i].property_flags.contains(wish))
        });
        let Some(kind) = kind else {
            return Err(DeviceError::Call {
                call: "choice of a memory type",
                result: vk::Result::ERROR_FEATURE_NOT_PRESENT,
            });
        };
        let free = self.free_bytes(types[kind].heap_index);
        let full = || DeviceError::OutOfMemory { what, needed: needs.size, free };
        // Some drivers allocate more than there is and then swap.
        if free.is_some_and(|free| needs.size > free) {
            return Err(full());
        }
        let mut flags = vk::MemoryAllocateFlagsInfo::default();
        if place == MemoryKind::Device {
            flags = flags.flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
        }
        let create = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(kind as u32)
            .push_next(&mut flags);
        // An injected fault replaces the call: memory that was allocated would have to be freed.
        let made = self.faults.instead(InjectedFault::Allocation, Ok(())).and_then(|()| {
            // SAFETY: the device is live and the type is one of its own.
            unsafe { self.calls.allocate_memory(&create, None) }
        });
        made.map_err(|e| match e {
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => full(),
            other => DeviceError::of("vkAllocateMemory")(other),
        })
    }

    fn staging<'a>(&self, staging: &'a mut Option<Staging>) -> Result<&'a Staging, DeviceError> {
        if staging.is_none() {
            let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
            let raw = self.make_buffer("the staging memory", STAGING_BYTES, usage, MemoryKind::Host)?;
            // SAFETY: the memory is host-visible and not mapped yet; it stays mapped until it is freed.
            let mapped =
                unsafe { self.calls.map_memory(raw.memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()) };
            match mapped {
                Ok(pointer) => *staging = Some(Staging { raw, pointer: pointer.cast() }),
                Err(e) => {
                    raw.destroy(&self.calls);
                    return Err(DeviceError::of("vkMapMemory")(e));
                }
            }
        }
        staging
            .as_ref()
            .ok_or(DeviceError::Call { call: "vkMapMemory", result: vk::Result::ERROR_MEMORY_MAP_FAILED })
    }
}

impl Gpu {
    /// Allocates memory on the device, with undefined contents. Error texts name `what`.
    ///
    /// # Errors
    /// [`DeviceError::OutOfMemory`], [`DeviceError::Limit`].
    pub fn buffer(&self, what: &'static str, bytes: u64) -> Result<Buffer, DeviceError> {
        self.buffer_for(what, bytes, vk::BufferUsageFlags::empty())
    }

    /// Allocates memory with a Vulkan usage beside the common ones.
    pub(super) fn buffer_for(
        &self,
        what: &'static str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, DeviceError> {
        // An empty array gets an address too.
        let raw = self.inner.make_buffer(what, bytes.max(16), USAGE | usage, MemoryKind::Device)?;
        self.inner.allocated.fetch_add(raw.allocated, Ordering::Relaxed);
        self.inner.buffers.fetch_add(1, Ordering::Relaxed);
        let info = vk::BufferDeviceAddressInfo::default().buffer(raw.buffer);
        // SAFETY: the buffer is bound to memory that was allocated for addresses.
        let address = unsafe { self.inner.calls.get_buffer_device_address(&info) };
        Ok(Buffer { raw, address, gpu: Arc::clone(&self.inner) })
    }

    /// Allocates memory on the device and fills it with these bytes.
    ///
    /// # Errors
    /// As [`Gpu::buffer`] and [`Gpu::upload`].
    pub fn buffer_of(&self, what: &'static str, bytes: &[u8]) -> Result<Buffer, DeviceError> {
        let buffer = self.buffer(what, bytes.len() as u64)?;
        self.upload(&buffer, 0, bytes)?;
        Ok(buffer)
    }

    /// Copies bytes into a buffer, from `offset` on.
    ///
    /// # Errors
    /// When they do not fit, and when the device is lost.
    pub fn upload(&self, buffer: &Buffer, offset: u64, bytes: &[u8]) -> Result<(), DeviceError> {
        within(buffer, offset, bytes.len() as u64)?;
        let mut at = offset;
        for piece in bytes.chunks(STAGING_BYTES as usize) {
            self.fill(buffer, at, piece.len(), |staging| staging.copy_from_slice(piece))?;
            at += piece.len() as u64;
        }
        Ok(())
    }

    /// Most bytes that [`Gpu::fill`] takes at once.
    pub(super) const FILL_BYTES: usize = STAGING_BYTES as usize;

    /// Has `write` produce the bytes of a part of a buffer, at most [`Gpu::FILL_BYTES`].
    pub(super) fn fill(
        &self,
        buffer: &Buffer,
        offset: u64,
        bytes: usize,
        write: impl FnOnce(&mut [u8]),
    ) -> Result<(), DeviceError> {
        within(buffer, offset, bytes as u64)?;
        let length = bytes.min(STAGING_BYTES as usize);
        self.fill_regions(
            buffer,
            &[vk::BufferCopy::default().dst_offset(offset).size(length as u64)],
            length,
            write,
        )
    }

    /// Copies several pieces into a buffer, each from its offset on, in as few launches as the staging memory allows.
    ///
    /// # Errors
    /// As [`Gpu::upload`].
    pub fn upload_pieces(&self, buffer: &Buffer, pieces: &[Piece<'_>]) -> Result<(), DeviceError> {
        let mut small = Vec::new();
        for &(offset, bytes) in pieces {
            within(buffer, offset, bytes.len() as u64)?;
            let whole = bytes.chunks(STAGING_BYTES as usize).scan(offset, |at, piece| {
                let here = *at;
                *at += piece.len() as u64;
                Some((here, piece))
            });
            small.extend(whole);
        }
        let mut rest = small.as_slice();
        while !rest.is_empty() {
            let mut length = 0;
            let fit = rest.iter().take_while(|(_, piece)| {
                length += piece.len() as u64;
                length <= STAGING_BYTES
            });
            let (now, later) = rest.split_at(fit.count());
            let (mut regions, mut at) = (Vec::with_capacity(now.len()), 0);
            for &(offset, piece) in now {
                let size = piece.len() as u64;
                regions.push(vk::BufferCopy::default().src_offset(at).dst_offset(offset).size(size));
                at += size;
            }
            self.fill_regions(buffer, &regions, at as usize, |staging| {
                let mut staging = staging;
                for (_, piece) in now {
                    let (here, after) = staging.split_at_mut(piece.len());
                    here.copy_from_slice(piece);
                    staging = after;
                }
            })?;
            rest = later;
        }
        Ok(())
    }

    /// Has `write` fill the first `length` bytes of the staging memory, which copies then take from there; all lie within it and within
    /// the buffer.
    fn fill_regions(
        &self,
        buffer: &Buffer,
        regions: &[vk::BufferCopy],
        length: usize,
        write: impl FnOnce(&mut [u8]),
    ) -> Result<(), DeviceError> {
        let length = length.min(STAGING_BYTES as usize);
        if length == 0 {
            return Ok(());
        }
        let mut worker = self.inner.worker();
        let (pointer, source) = {
            let staging = self.inner.staging(&mut worker.staging)?;
            (staging.pointer, staging.raw.buffer)
        };
        // SAFETY: the mapped memory is `STAGING_BYTES` long, of plain bytes, nobody else uses it while the worker is locked, and
        // no launch is in flight. It may be uninitialised memory to Rust, but not to the system, which maps it readable.
        write(unsafe { std::slice::from_raw_parts_mut(pointer, length) });
        self.submit_with(&worker, "an upload", |inner, commands| {
            // SAFETY: both buffers live until the launch has ended, and the regions lie within both.
            unsafe { inner.calls.cmd_copy_buffer(commands, source, buffer.handle(), regions) };
        })?;
        Ok(())
    }

    /// Copies bytes out of a buffer, from `offset` on.
    ///
    /// # Errors
    /// When the buffer ends before, and when the device is lost.
    pub fn download(&self, buffer: &Buffer, offset: u64, bytes: &mut [u8]) -> Result<(), DeviceError> {
        within(buffer, offset, bytes.len() as u64)?;
        let mut at = offset;
        for piece in bytes.chunks_mut(STAGING_BYTES as usize) {
            let mut worker = self.inner.worker();
            let (pointer, target) = {
                let staging = self.inner.staging(&mut worker.staging)?;
                (staging.pointer, staging.raw.buffer)
            };
            let region = [vk::BufferCopy::default().src_offset(at).size(piece.len() as u64)];
            self.submit_with(&worker, "a download", |inner, commands| {
                // SAFETY: as in `fill`.
                unsafe { inner.calls.cmd_copy_buffer(commands, buffer.handle(), target, &region) };
            })?;
            // SAFETY: the copy has ended and is visible to the host; the piece is no longer than the mapped memory.
            piece.copy_from_slice(unsafe { std::slice::from_raw_parts(pointer, piece.len()) });
            at += piece.len() as u64;
        }
        self.inner.downloaded.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(())
    }

    /// Sets all bytes of a buffer to 0.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn clear(&self, buffer: &Buffer) -> Result<(), DeviceError> {
        self.submit("a clear", |inner, commands| {
            // SAFETY: the buffer lives until the launch has ended.
            unsafe { inner.calls.cmd_fill_buffer(commands, buffer.handle(), 0, vk::WHOLE_SIZE, 0) };
        })?;
        Ok(())
    }
}

fn within(buffer: &Buffer, offset: u64, bytes: u64) -> Result<(), DeviceError> {
    match offset.checked_add(bytes) {
        Some(end) if end <= buffer.bytes() => Ok(()),
        _ => Err(DeviceError::Limit {
            what: "bytes of a buffer, at the end of a copy",
            needed: offset.saturating_add(bytes),
            limit: buffer.bytes(),
        }),
    }
}
