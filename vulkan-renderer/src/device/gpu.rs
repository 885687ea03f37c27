//! A device that was opened for one backend, and its queue. All work goes through [`Gpu::submit`].

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ash::{khr, vk};

use super::buffer::Staging;
use super::faults::{Faults, InjectedFault};
use super::float_modes::FloatModes;
use super::pipeline_cache::PipelineCache;
use super::survey::compute_family;
use super::unfinished::{Compiling, mark_hang};
use super::{Backend, Candidate, DeviceError, DeviceKind, Instance};

/// A launch that takes longer than this counts as a lost device. It is hundreds of times what a slice may take and many times the build time
/// of the largest hierarchy, and still a bearable wait.
const SILENCE: Duration = Duration::from_secs(30);

/// The same for a software driver (one that computes on the CPU). Such a driver compiles during the first launch of a pipeline, which takes
/// minutes where doubles are emulated with integers and the machine is busy, and it blocks no screen.
const SOFTWARE_SILENCE: Duration = Duration::from_secs(3600);

/// An open device. Clones refer to the same device.
#[derive(Clone)]
pub struct Gpu {
    pub(super) inner: Arc<Inner>,
}

/// Limits of a device.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    pub(super) allocation_bytes: u64,
    /// Most allocations at one time.
    pub(super) allocations: u64,
    pub(super) groups: [u32; 3],
    pub(super) box_count: u64,
    pub(super) scratch_alignment: u64,
    pub(super) handle_bytes: u64,
    pub(super) handle_alignment: u64,
    pub(super) table_alignment: u64,
    pub(super) ray_count: u64,
}

pub(super) struct Inner {
    pub(super) calls: ash::Device,
    pub(super) acceleration: Option<khr::acceleration_structure::Device>,
    pub(super) ray_pipeline: Option<khr::ray_tracing_pipeline::Device>,
    /// Present where pipelines keep what the compiler counts.
    pub(super) executables: Option<khr::pipeline_executable_properties::Device>,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    pub(super) limits: Limits,
    pub(super) faults: Faults,
    pub(super) cache: PipelineCache,
    /// Bytes of device memory that are allocated.
    pub(super) allocated: AtomicU64,
    /// Bytes that were copied to the host.
    pub(super) downloaded: AtomicU64,
    /// Number of live buffers, each with an allocation of its own.
    pub(super) buffers: AtomicU64,
    /// Floating-point modes that shaders can be given on this device.
    pub(super) float_modes: FloatModes,
    queue: vk::Queue,
    queue_family: u32,
    pub(super) worker: Mutex<Worker>,
    lost: AtomicBool,
    /// True once a launch never ended. Nothing that the launch may use can be destroyed then.
    hung: AtomicBool,
    candidate: Candidate,
    backend: Backend,
    pub(super) instance: Instance,
}

/// Objects with which launches are made, one launch at a time.
pub(super) struct Worker {
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    /// Allocated by the first copy.
    pub(super) staging: Option<Staging>,
}

impl Gpu {
    /// Opens a device for a backend.
    ///
    /// # Errors
    /// [`DeviceError::Unsupported`] says what the device lacks.
    pub fn open(
        instance: &Instance,
        candidate: &Candidate,
        backend: Backend,
        cache_folder: Option<&std::path::Path>,
    ) -> Result<Self, DeviceError> {
        Self::open_as(instance, candidate, backend, cache_folder, false)
    }

    /// Opens a device for a backend, to learn what its driver's compiler counts ([`super::Executable`]). No compiled pipelines are kept or
    /// taken from disk, and nothing can be launched.
    ///
    /// # Errors
    /// [`DeviceError::Unsupported`] says what the device lacks.
    pub fn open_for_statistics(
        instance: &Instance,
        candidate: &Candidate,
        backend: Backend,
    ) -> Result<Self, DeviceError> {
        if !candidate.statistics {
            let lacks = khr::pipeline_executable_properties::NAME.to_string_lossy();
            return Err(DeviceError::Unsupported {
                backend,
                why: format!(
                    "{} lacks {lacks}: its driver tells no figures of compiled shaders",
                    candidate.name
                ),
            });
        }
        Self::open_as(instance, candidate, backend, None, true)
    }

    fn open_as(
        instance: &Instance,
        candidate: &Candidate,
        backend: Backend,
        cache_folder: Option<&std::path::Path>,
        statistics: bool,
    ) -> Result<Self, DeviceError> {
        if !candidate.can(backend) {
            let lacks = candidate.missing(backend).join(", ");
            return Err(DeviceError::Unsupported {
                backend,
                why: format!("{} lacks {lacks}", candidate.name),
            });
        }
        let physical = candidate.physical;
        // SAFETY: the candidate's device is one of this instance's, here and below.
        let queues = unsafe { instance.calls().get_physical_device_queue_family_properties(physical) };
        let Some(queue_family) = compute_family(&queues) else {
            return Err(DeviceError::Unsupported {
                backend,
                why: format!("{} cannot compute", candidate.name),
            });
        };

        let mut extensions = Vec::new();
        if candidate.portability_subset {
            extensions.push(khr::portability_subset::NAME.as_ptr());
        }
        if candidate.memory_budget {
            extensions.push(ash::ext::memory_budget::NAME.as_ptr());
        }
        let features =
            vk::PhysicalDeviceFeatures::default().shader_int64(true).shader_float64(candidate.native_f64);
        let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default()
            .buffer_device_address(true)
            .scalar_block_layout(true);
        let mut acceleration =
            vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut pipeline =
            vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
        let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
        let mut info = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        let priorities = [1.0];
        let wanted = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(queue_family)
            .queue_priorities(&priorities)];
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&wanted)
            .enabled_features(&features)
            .push_next(&mut vulkan12);
        if backend.uses_hardware_hierarchy() {
            extensions.extend(
                [khr::acceleration_structure::NAME, khr::deferred_host_operations::NAME].map(|n| n.as_ptr()),
            );
            create = create.push_next(&mut acceleration);
        }
        match backend {
            Backend::RayPipeline => {
                extensions.push(khr::ray_tracing_pipeline::NAME.as_ptr());
                create = create.push_next(&mut pipeline);
            }
            Backend::RayQuery => {
                extensions.push(khr::ray_query::NAME.as_ptr());
                create = create.push_next(&mut query);
            }
            Backend::Compute => {}
        }
        if statistics {
            extensions.push(khr::pipeline_executable_properties::NAME.as_ptr());
            create = create.push_next(&mut info);
        }
        let create = create.enabled_extension_names(&extensions);
        // SAFETY: every extension and feature was found by the survey; the chain lives until the call returns.
        let calls = unsafe { instance.calls().create_device(physical, &create, None) }
            .map_err(DeviceError::of("vkCreateDevice"))?;

        let functions = instance.calls();
        let inner = Inner {
            acceleration: backend
                .uses_hardware_hierarchy()
                .then(|| khr::acceleration_structure::Device::new(functions, &calls)),
            ray_pipeline: (backend == Backend::RayPipeline)
                .then(|| khr::ray_tracing_pipeline::Device::new(functions, &calls)),
            executables: statistics
                .then(|| khr::pipeline_executable_properties::Device::new(functions, &calls)),
            // SAFETY: as above.
            memory: unsafe { functions.get_physical_device_memory_properties(physical) },
            limits: limits(functions, physical, backend),
            faults: Faults::default(),
            cache: PipelineCache::none(),
            allocated: AtomicU64::new(0),
            downloaded: AtomicU64::new(0),
            buffers: AtomicU64::new(0),
            float_modes: FloatModes::of(functions, physical),
            // SAFETY: one queue of that family was asked for.
            queue: unsafe { calls.get_device_queue(queue_family, 0) },
            queue_family,
            worker: Mutex::new(Worker::none()),
            lost: AtomicBool::new(false),
            hung: AtomicBool::new(false),
            candidate: candidate.clone(),
            backend,
            instance: instance.clone(),
            calls,
        };
        // From here on, dropping `inner` cleans up after a failure.
        let mut inner = inner;
        if !statistics {
            // A driver that compiles for a device that is not there may have no fences.
            inner.start_worker()?;
        }
        // SAFETY: as above.
        let properties = unsafe { instance.calls().get_physical_device_properties(physical) };
        inner.cache = PipelineCache::open(&inner.calls, &properties, cache_folder)?;
        Ok(Self { inner: Arc::new(inner) })
    }

    /// The device that was opened.
    pub fn candidate(&self) -> &Candidate {
        &self.inner.candidate
    }

    /// The backend that it was opened for.
    pub fn backend(&self) -> Backend {
        self.inner.backend
    }

    /// Most bytes of one buffer.
    pub fn most_buffer_bytes(&self) -> u64 {
        self.inner.limits.allocation_bytes
    }

    /// The Vulkan instance.
    pub fn instance(&self) -> &Instance {
        &self.inner.instance
    }

    /// Whether the device was lost; it cannot be used any more then.
    pub fn is_lost(&self) -> bool {
        self.inner.lost.load(Ordering::Relaxed)
    }

    /// Whether it was lost because a launch did not end. The next would not end either.
    pub fn is_hung(&self) -> bool {
        self.inner.hung.load(Ordering::Relaxed)
    }

    /// Bytes of device memory that are allocated.
    pub fn allocated_bytes(&self) -> u64 {
        self.inner.allocated.load(Ordering::Relaxed)
    }

    /// Bytes that were copied to the host since the device was opened.
    pub fn downloaded_bytes(&self) -> u64 {
        self.inner.downloaded.load(Ordering::Relaxed)
    }

    /// From the `nth` such call from now on, 1 being the next, `times` calls fail. For tests of how failures are handled.
    #[doc(hidden)]
    pub fn inject(&self, fault: InjectedFault, nth: u32, times: u32) {
        self.inner.faults.inject(fault, nth, times);
    }

    /// Writes the driver's compiled pipelines to the cache folder, if there is one. Failure to write is ignored.
    pub fn save_pipelines(&self) {
        self.inner.cache.save(&self.inner.calls);
    }

    /// Runs `compile`, which has the driver compile shaders. A file in the cache folder marks that, for the case that the process does not
    /// live to its end ([`super::Unfinished`]).
    pub(crate) fn compiling<T>(
        &self,
        compile: impl FnOnce() -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        let (pipelines, backend) = (self.inner.cache.file.as_deref(), self.inner.backend);
        let mark = Compiling::begin(pipelines, backend);
        let made = compile()?;
        mark.succeed(pipelines, backend);
        Ok(made)
    }

    /// Records commands, runs them and waits for their end. Returns how long that took. The results of all earlier work are visible to the
    /// commands, and what they write is visible to the host and to all later work.
    ///
    /// # Errors
    /// [`DeviceError::Lost`], also when the launch has not ended after [`SILENCE`].
    pub(super) fn submit(
        &self,
        during: &'static str,
        record: impl FnOnce(&Inner, vk::CommandBuffer),
    ) -> Result<Duration, DeviceError> {
        let worker = self.inner.worker();
        self.submit_with(&worker, during, record)
    }

    /// As [`Gpu::submit`], for a caller that holds the worker's lock already.
    pub(super) fn submit_with(
        &self,
        worker: &Worker,
        during: &'static str,
        record: impl FnOnce(&Inner, vk::CommandBuffer),
    ) -> Result<Duration, DeviceError> {
        let inner = &*self.inner;
        if self.is_lost() {
            return Err(DeviceError::Lost(during));
        }
        if inner.executables.is_some() {
            let why = format!("the device was opened for statistics alone: no {during}");
            return Err(DeviceError::Unsupported { backend: inner.backend, why });
        }
        let lost = |result: vk::Result| match result {
            vk::Result::ERROR_DEVICE_LOST => {
                inner.lost.store(true, Ordering::Relaxed);
                DeviceError::Lost(during)
            }
            other => DeviceError::of(during)(other),
        };
        let calls = &inner.calls;
        let (commands, fences) = (worker.commands, [worker.fence]);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the worker is locked, and its last commands have ended (we waited), so they may be recorded anew; what `record`
        // writes into them uses objects that its caller keeps alive until this function returns.
        unsafe {
            calls.reset_command_pool(worker.pool, vk::CommandPoolResetFlags::empty()).map_err(lost)?;
            calls.begin_command_buffer(commands, &begin).map_err(lost)?;
            inner.barrier(commands, vk::PipelineStageFlags::ALL_COMMANDS);
            record(inner, commands);
            inner.barrier(commands, vk::PipelineStageFlags::ALL_COMMANDS | vk::PipelineStageFlags::HOST);
            calls.end_command_buffer(commands).map_err(lost)?;
        }
        let start = Instant::now();
        let buffers = [commands];
        let submit = [vk::SubmitInfo::default().command_buffers(&buffers)];
        // SAFETY: the fence is not in use: it was reset after the last wait.
        unsafe { calls.queue_submit(inner.queue, &submit, fences[0]) }.map_err(lost)?;
        let software = inner.candidate.kind == DeviceKind::Software;
        let silence = if software { SOFTWARE_SILENCE } else { SILENCE };
        // SAFETY: the fence was just submitted.
        let waited = unsafe { calls.wait_for_fences(&fences, true, silence.as_nanos() as u64) };
        let waited = inner.faults.instead(InjectedFault::Hang, waited);
        // However the wait failed, the launch may still be running. Only a lost device guarantees that it has ended.
        if waited.is_err_and(|e| e != vk::Result::ERROR_DEVICE_LOST) {
            inner.hung.store(true, Ordering::Relaxed);
            mark_hang(inner.cache.file.as_deref(), inner.backend);
            inner.lost.store(true, Ordering::Relaxed);
            return Err(DeviceError::Lost(during));
        }
        inner.faults.instead(InjectedFault::Submission, waited).map_err(lost)?;
        let taken = start.elapsed();
        // SAFETY: the wait has succeeded, so the fence is not in use.
        unsafe { calls.reset_fences(&fences) }.map_err(lost)?;
        Ok(taken)
    }
}

impl Inner {
    /// Locks the worker.
    pub(super) fn worker(&self) -> std::sync::MutexGuard<'_, Worker> {
        // A panic while it was locked leaves no running commands behind: every launch is waited for before anything else.
        self.worker.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn start_worker(&mut self) -> Result<(), DeviceError> {
        let worker = self.worker.get_mut().unwrap_or_else(PoisonError::into_inner);
        let calls = &self.calls;
        let pool = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(self.queue_family);
        // SAFETY: the device is live; what is made lies in the worker, which the device's drop destroys.
        unsafe {
            worker.pool =
                calls.create_command_pool(&pool, None).map_err(DeviceError::of("vkCreateCommandPool"))?;
            let one =
                vk::CommandBufferAllocateInfo::default().command_pool(worker.pool).command_buffer_count(1);
            let buffers =
                calls.allocate_command_buffers(&one).map_err(DeviceError::of("vkAllocateCommandBuffers"))?;
            worker.commands = buffers.first().copied().unwrap_or_default();
            worker.fence = calls
                .create_fence(&vk::FenceCreateInfo::default(), None)
                .map_err(DeviceError::of("vkCreateFence"))?;
        }
        Ok(())
    }

    /// A barrier: all earlier work is complete and visible to all later work.
    ///
    /// # Safety
    /// * `commands` are being recorded on this device.
    pub(super) unsafe fn barrier(&self, commands: vk::CommandBuffer, then: vk::PipelineStageFlags) {
        let mut reads = vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE;
        if then.contains(vk::PipelineStageFlags::HOST) {
            reads |= vk::AccessFlags::HOST_READ;
        }
        let all = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(reads)];
        // SAFETY: as the caller promises.
        unsafe {
            self.calls.cmd_pipeline_barrier(
                commands,
                vk::PipelineStageFlags::ALL_COMMANDS,
                then,
                vk::DependencyFlags::empty(),
                &all,
                &[],
                &[],
            );
        }
    }

    /// Whether objects that launches used may be destroyed.
    pub(super) fn may_destroy(&self) -> bool {
        !self.hung.load(Ordering::Relaxed)
    }

    /// Free bytes of a heap, as the driver reports them.
    pub(super) fn free_bytes(&self, heap: u32) -> Option<u64> {
        if !self.candidate.memory_budget {
            return None;
        }
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut properties = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
        // SAFETY: the device is of this instance and has the extension.
        unsafe {
            self.instance
                .calls()
                .get_physical_device_memory_properties2(self.candidate.physical, &mut properties);
        }
        let (all, used) = (budget.heap_budget.get(heap as usize)?, budget.heap_usage.get(heap as usize)?);
        Some(all.saturating_sub(*used))
    }
}

impl Worker {
    fn none() -> Self {
        Self {
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            staging: None,
        }
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        if !self.may_destroy() {
            return;
        }
        let worker = self.worker.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(staging) = worker.staging.take() {
            staging.destroy(&self.calls);
        }
        // SAFETY: every buffer and pipeline holds the device alive, so all are gone; no launch is in flight (each was waited
        // for). Handles that were never made are null, which these calls ignore.
        unsafe {
            self.cache.destroy(&self.calls);
            self.calls.destroy_fence(worker.fence, None);
            self.calls.destroy_command_pool(worker.pool, None);
            self.calls.destroy_device(None);
        }
    }
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu")
            .field("device", &self.inner.candidate.name)
            .field("backend", &self.backend())
            .finish()
    }
}

fn limits(calls: &ash::Instance, physical: vk::PhysicalDevice, backend: Backend) -> Limits {
    let mut allocation = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut acceleration = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut pipeline = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut allocation);
    if backend.uses_hardware_hierarchy() {
        properties = properties.push_next(&mut acceleration);
    }
    if backend == Backend::RayPipeline {
        properties = properties.push_next(&mut pipeline);
    }
    // SAFETY: the chain holds structures of version 1.1 and of extensions that the device has.
    unsafe { calls.get_physical_device_properties2(physical, &mut properties) };
    let core = properties.properties.limits;
    Limits {
        allocation_bytes: allocation.max_memory_allocation_size,
        allocations: u64::from(core.max_memory_allocation_count),
        groups: core.max_compute_work_group_count,
        box_count: acceleration.max_primitive_count,
        scratch_alignment: u64::from(acceleration.min_acceleration_structure_scratch_offset_alignment.max(1)),
        handle_bytes: u64::from(pipeline.shader_group_handle_size),
        handle_alignment: u64::from(pipeline.shader_group_handle_alignment.max(1)),
        table_alignment: u64::from(pipeline.shader_group_base_alignment.max(1)),
        ray_count: u64::from(pipeline.max_ray_dispatch_invocation_count),
    }
}
