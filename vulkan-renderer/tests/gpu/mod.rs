//! A device for tests, in its shortest form: buffers with addresses that the host sees too, compute shaders, one launch at a time.
#![allow(unsafe_code, dead_code, reason = "the Vulkan interface; not every test uses all of it")]
#![allow(
    clippy::undocumented_unsafe_blocks,
    reason = "all handles are of this device, which outlives them, and no call overlaps another"
)]

pub(crate) mod scene;

use std::ffi::CStr;

use ash::vk;
use bytemuck::{Pod, Zeroable};
use pumice_vulkan::layout::Launch;

/// A device.
pub(crate) struct Gpu {
    _entry: ash::Entry,
    instance: ash::Instance,
    device: ash::Device,
    queue: vk::Queue,
    memory: vk::PhysicalDeviceMemoryProperties,
    pool: vk::CommandPool,
    pub(crate) has_f64: bool,
    pub(crate) name: String,
}

/// Memory that both sides see.
pub(crate) struct Buffer {
    buffer: vk::Buffer,
    pub(crate) address: u64,
    pointer: *mut u8,
    bytes: usize,
}

impl Buffer {
    pub(crate) fn write<T: Pod>(&mut self, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        assert!(bytes.len() <= self.bytes);
        unsafe { self.pointer.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
    }

    pub(crate) fn read<T: Pod + Zeroable>(&self, count: usize) -> Vec<T> {
        assert!(count * size_of::<T>() <= self.bytes);
        let mut values = vec![T::zeroed(); count];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        unsafe { self.pointer.copy_to_nonoverlapping(bytes.as_mut_ptr(), bytes.len()) };
        values
    }
}

impl Gpu {
    /// The first device that can run the shaders. A test without one fails: it must not pass by doing nothing.
    pub(crate) fn new() -> Self {
        unsafe {
            let entry = ash::Entry::load().expect("a Vulkan loader");
            let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let create = vk::InstanceCreateInfo::default().application_info(&app);
            let instance = entry.create_instance(&create, None).expect("an instance");
            let physical = instance.enumerate_physical_devices().expect("devices")[0];
            let properties = instance.get_physical_device_properties(physical);
            let features = instance.get_physical_device_features(physical);
            let family = instance
                .get_physical_device_queue_family_properties(physical)
                .iter()
                .position(|q| q.queue_flags.contains(vk::QueueFlags::COMPUTE))
                .expect("a compute queue") as u32;
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let has_f64 = features.shader_float64 != 0;
            let mut features2 = vk::PhysicalDeviceFeatures2::default()
                .features(vk::PhysicalDeviceFeatures::default().shader_int64(true).shader_float64(has_f64));
            let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default()
                .buffer_device_address(true)
                .scalar_block_layout(true);
            let create = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .push_next(&mut features2)
                .push_next(&mut vulkan12);
            let device = instance.create_device(physical, &create, None).expect("a device");
            let queue = device.get_device_queue(family, 0);
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&pool, None).expect("a command pool");
            let memory = instance.get_physical_device_memory_properties(physical);
            let name = CStr::from_ptr(properties.device_name.as_ptr()).to_string_lossy().into_owned();
            Self { _entry: entry, instance, device, queue, memory, pool, has_f64, name }
        }
    }

    /// Zeroed memory.
    pub(crate) fn buffer(&self, bytes: usize) -> Buffer {
        let bytes = bytes.max(16);
        unsafe {
            let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
            let create = vk::BufferCreateInfo::default().size(bytes as u64).usage(usage);
            let buffer = self.device.create_buffer(&create, None).expect("a buffer");
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let kind = (0..self.memory.memory_type_count)
                .find(|&i| {
                    needs.memory_type_bits >> i & 1 != 0
                        && self.memory.memory_types[i as usize].property_flags.contains(wanted)
                })
                .expect("memory that the host sees");
            let mut flags =
                vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
            let allocate = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(kind)
                .push_next(&mut flags);
            let memory = self.device.allocate_memory(&allocate, None).expect("memory");
            self.device.bind_buffer_memory(buffer, memory, 0).expect("bound");
            let pointer = self
                .device
                .map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())
                .expect("mapped")
                .cast::<u8>();
            pointer.write_bytes(0, bytes);
            let info = vk::BufferDeviceAddressInfo::default().buffer(buffer);
            Buffer { buffer, address: self.device.get_buffer_device_address(&info), pointer, bytes }
        }
    }

    /// Memory with these values.
    pub(crate) fn buffer_of<T: Pod>(&self, values: &[T]) -> Buffer {
        let mut buffer = self.buffer(size_of_val(values));
        buffer.write(values);
        buffer
    }

    /// A compute shader with its constants, made ready.
    pub(crate) fn pipeline(&self, words: &[u32], constants: &[u32]) -> Pipeline {
        unsafe {
            let module = vk::ShaderModuleCreateInfo::default().code(words);
            let module = self.device.create_shader_module(&module, None).expect("a module");
            let ranges = [vk::PushConstantRange::default()
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
                .size(size_of::<Launch>() as u32)];
            let layout = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges);
            let layout = self.device.create_pipeline_layout(&layout, None).expect("a layout");
            let entries: Vec<_> = (0..constants.len() as u32)
                .map(|i| vk::SpecializationMapEntry::default().constant_id(i).offset(4 * i).size(4))
                .collect();
            let specialization =
                vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(constants));
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main")
                .specialization_info(&specialization);
            let create = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
            let pipeline = self
                .device
                .create_compute_pipelines(vk::PipelineCache::null(), &[create], None)
                .expect("a pipeline")[0];
            Pipeline { layout, pipeline }
        }
    }

    /// Runs it once and waits.
    pub(crate) fn run(&self, pipeline: &Pipeline, launch: &Launch, groups: [u32; 2]) {
        unsafe {
            let allocate =
                vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            let commands = self.device.allocate_command_buffers(&allocate).expect("a command buffer")[0];
            self.device
                .begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())
                .expect("begun");
            self.device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline.pipeline);
            let constants = bytemuck::bytes_of(launch);
            let stages = vk::ShaderStageFlags::COMPUTE;
            self.device.cmd_push_constants(commands, pipeline.layout, stages, 0, constants);
            self.device.cmd_dispatch(commands, groups[0], groups[1], 1);
            self.device.end_command_buffer(commands).expect("ended");
            let buffers = [commands];
            let submit = vk::SubmitInfo::default().command_buffers(&buffers);
            self.device.queue_submit(self.queue, &[submit], vk::Fence::null()).expect("submitted");
            self.device.queue_wait_idle(self.queue).expect("done");
        }
    }

    /// Runs function `function` of `probe.comp` on rows of words; gives rows of words back.
    pub(crate) fn probe(
        &self,
        native: bool,
        function: u32,
        scene: u64,
        rows: &[Vec<u32>],
        out: usize,
    ) -> Vec<Vec<u32>> {
        let pipeline = self.pipeline(&spirv("probe.comp", native), &[function]);
        let width = rows[0].len();
        let mut words = Vec::with_capacity(rows.len() * width);
        for row in rows {
            assert_eq!(row.len(), width);
            words.extend_from_slice(row);
        }
        let source = self.buffer_of(&words);
        let target = self.buffer(rows.len() * out * 4);
        let launch = Launch {
            scene,
            input: source.address,
            output: target.address,
            count: rows.len() as u32,
            ..Launch::default()
        };
        self.run(&pipeline, &launch, [(rows.len() as u32).div_ceil(64), 1]);
        target.read::<u32>(rows.len() * out).chunks_exact(out).map(<[u32]>::to_vec).collect()
    }
}

/// A shader, ready to run.
pub(crate) struct Pipeline {
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
}

/// The words of a compiled shader.
pub(crate) fn spirv(name: &str, native: bool) -> Vec<u32> {
    let file = format!("{name}{}.spv", if native { ".f64" } else { "" });
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv").join(file);
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect()
}
