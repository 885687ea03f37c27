//! The device's own acceleration structure over the boxes of an instance.
//!
//! ```text
//! boxes (6 floats each, Morton order) ──► bottom level, compacted ──► top level with that one member, placed by the identity
//! ```
//! Each instance has a top level of its own, in its index space: our own arithmetic moves a ray there exactly before hardware traces it.
//! Boxes are in Morton order because some builders do not sort (Mesa's on the CPU): shuffled boxes traced 18 to 26 times slower there.

use std::sync::Arc;

use ash::{khr, vk};

use super::DeviceError;
use super::buffer::Buffer;
use super::gpu::{Gpu, Inner};

/// Bounds of a box in hardware's format: lowest corner, highest corner.
pub type HardwareBox = [f32; 6];

const BOX_BYTES: usize = size_of::<HardwareBox>();

/// The two levels of a hardware hierarchy over one instance.
pub struct Acceleration {
    // The top level refers to the bottom level, so it is dropped first.
    top: AccelerationStructure,
    bottom: AccelerationStructure,
    address: u64,
}

/// One acceleration structure with its memory.
struct AccelerationStructure {
    handle: vk::AccelerationStructureKHR,
    buffer: Buffer,
    gpu: Arc<Inner>,
}

impl Acceleration {
    /// The address through which shaders trace it.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.top.buffer.bytes() + self.bottom.buffer.bytes()
    }
}

impl std::fmt::Debug for Acceleration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Acceleration").field("bytes", &self.bytes()).finish()
    }
}

impl Drop for AccelerationStructure {
    fn drop(&mut self) {
        if let (true, Some(calls)) = (self.gpu.may_destroy(), &self.gpu.acceleration) {
            // SAFETY: no launch is in flight, and the memory is freed after this.
            unsafe { calls.destroy_acceleration_structure(self.handle, None) };
        }
    }
}

impl Gpu {
    /// Builds a hierarchy over `count` boxes, of which `box_at(i)` gives box i, for the instance of this number in the scene.
    ///
    /// # Errors
    /// When there are more boxes than the device supports, when memory is short, or when the device is lost.
    pub fn acceleration(
        &self,
        instance: u32,
        count: u32,
        box_at: impl Fn(u32) -> HardwareBox,
    ) -> Result<Acceleration, DeviceError> {
        let Some(calls) = &self.inner.acceleration else {
            return Err(DeviceError::Unsupported {
                backend: self.backend(),
                why: "the device was opened without acceleration structures".into(),
            });
        };
        let limit = self.inner.limits.box_count;
        if u64::from(count) > limit {
            return Err(DeviceError::Limit {
                what: "boxes of an instance in a hardware hierarchy",
                needed: u64::from(count),
                limit,
            });
        }

        // The boxes lie on the device until the build has ended.
        let input = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR;
        let boxes =
            self.buffer_for("boxes to build a hierarchy of", u64::from(count) * BOX_BYTES as u64, input)?;
        let step = (Self::FILL_BYTES / BOX_BYTES) as u32;
        let mut first = 0;
        while first < count {
            let end = count.min(first.saturating_add(step));
            let offset = u64::from(first) * BOX_BYTES as u64;
            self.fill(&boxes, offset, (end - first) as usize * BOX_BYTES, |bytes| {
                for (slot, i) in bytes.chunks_exact_mut(BOX_BYTES).zip(first..end) {
                    slot.copy_from_slice(bytemuck::bytes_of(&box_at(i)));
                }
            })?;
            first = end;
        }

        // The bottom level, then a compacted copy of it.
        let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: boxes.address() })
            .stride(BOX_BYTES as u64);
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::AABBS)
            .flags(vk::GeometryFlagsKHR::OPAQUE)
            .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs });
        let compaction = vk::BuildAccelerationStructureFlagsKHR::ALLOW_COMPACTION;
        let bottom =
            self.level(calls, vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, compaction, geometry, count)?;
        drop(boxes);
        let bottom = self.compacted(calls, bottom)?;

        // The top level. The record of its one member has 64 bytes; the specification gives the layout.
        let info =
            vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(bottom.handle);
        // SAFETY: the structure is built and alive.
        let reference = unsafe { calls.get_acceleration_structure_device_address(&info) };
        let mut record = [0u8; 64];
        let identity: [f32; 12] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.];
        record[..48].copy_from_slice(bytemuck::bytes_of(&identity));
        record[48..52].copy_from_slice(&(instance & 0xFF_FFFF | 0xFF << 24).to_le_bytes());
        record[56..].copy_from_slice(&reference.to_le_bytes());
        let member = self.buffer_for("a member of a hierarchy", 64, input)?;
        self.upload(&member, 0, &record)?;
        let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: member.address() });
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances });
        let flags = vk::BuildAccelerationStructureFlagsKHR::empty();
        let top = self.level(calls, vk::AccelerationStructureTypeKHR::TOP_LEVEL, flags, geometry, 1)?;
        let info =
            vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(top.handle);
        // SAFETY: as above.
        let address = unsafe { calls.get_acceleration_structure_device_address(&info) };
        Ok(Acceleration { top, bottom, address })
    }

    /// Builds one level over one geometry.
    fn level(
        &self,
        calls: &khr::acceleration_structure::Device,
        kind: vk::AccelerationStructureTypeKHR,
        flags: vk::BuildAccelerationStructureFlagsKHR,
        geometry: vk::AccelerationStructureGeometryKHR<'_>,
        count: u32,
    ) -> Result<AccelerationStructure, DeviceError> {
        let geometries = [geometry];
        let mut build = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(kind)
            .flags(flags | vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(&geometries);
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let by_device = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: one geometry, one count.
        unsafe { calls.get_acceleration_structure_build_sizes(by_device, &build, &[count], &mut sizes) };
        let level = self.empty_level(calls, kind, sizes.acceleration_structure_size)?;
        let alignment = self.inner.limits.scratch_alignment;
        let scratch = self.buffer("the build of a hierarchy", sizes.build_scratch_size + alignment)?;
        build = build.dst_acceleration_structure(level.handle).scratch_data(vk::DeviceOrHostAddressKHR {
            device_address: scratch.address().next_multiple_of(alignment),
        });
        let range = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count)];
        self.submit("the build of a hierarchy", |_, commands| {
            // SAFETY: geometry, scratch and target have the sizes that the device asked for and live until the launch has ended.
            unsafe { calls.cmd_build_acceleration_structures(commands, &[build], &[&range]) };
        })?;
        Ok(level)
    }

    fn empty_level(
        &self,
        calls: &khr::acceleration_structure::Device,
        kind: vk::AccelerationStructureTypeKHR,
        bytes: u64,
    ) -> Result<AccelerationStructure, DeviceError> {
        let usage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR;
        let buffer = self.buffer_for("a hierarchy", bytes, usage)?;
        let create =
            vk::AccelerationStructureCreateInfoKHR::default().ty(kind).buffer(buffer.handle()).size(bytes);
        // SAFETY: the buffer is large enough and lives as long as the level.
        let handle = unsafe { calls.create_acceleration_structure(&create, None) }
            .map_err(DeviceError::of("vkCreateAccelerationStructureKHR"))?;
        Ok(AccelerationStructure { handle, buffer, gpu: Arc::clone(&self.inner) })
    }

    /// A compacted copy of the structure, or the structure itself where compaction saves nothing.
    fn compacted(
        &self,
        calls: &khr::acceleration_structure::Device,
        level: AccelerationStructure,
    ) -> Result<AccelerationStructure, DeviceError> {
        let kind = vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
        let create = vk::QueryPoolCreateInfo::default().query_type(kind).query_count(1);
        // SAFETY: destroyed below, before which no launch is in flight.
        let pool = unsafe { self.inner.calls.create_query_pool(&create, None) }
            .map_err(DeviceError::of("vkCreateQueryPool"))?;
        let asked = self.submit("the size of a hierarchy", |inner, commands| {
            // SAFETY: pool and structure live until the launch has ended; the structure was built with that flag.
            unsafe {
                inner.calls.cmd_reset_query_pool(commands, pool, 0, 1);
                calls.cmd_write_acceleration_structures_properties(commands, &[level.handle], kind, pool, 0);
            }
        });
        let mut size = [0u64];
        let told = asked.and_then(|_| {
            let wait = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
            // SAFETY: the query was written by a launch that has ended.
            unsafe { self.inner.calls.get_query_pool_results(pool, 0, &mut size, wait) }
                .map_err(DeviceError::of("vkGetQueryPoolResults"))
        });
        if self.inner.may_destroy() {
            // SAFETY: the launch has ended.
            unsafe { self.inner.calls.destroy_query_pool(pool, None) };
        }
        told?;
        if size[0] == 0 || size[0] >= level.buffer.bytes() {
            return Ok(level);
        }
        let smaller = self.empty_level(calls, vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, size[0])?;
        let copy = vk::CopyAccelerationStructureInfoKHR::default()
            .src(level.handle)
            .dst(smaller.handle)
            .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
        self.submit("the compaction of a hierarchy", |_, commands| {
            // SAFETY: both live until the launch has ended; the target has the size that the device asked for.
            unsafe { calls.cmd_copy_acceleration_structure(commands, &copy) };
        })?;
        Ok(smaller)
    }
}
