//! Determines which device can run which backend, and what it lacks. Each extension and each feature bit is tested on its own, because
//! there are devices with any subset of them (data-centre GPUs have ray tracing pipelines and no ray queries).

use ash::{khr, vk};

use super::instance::{Instance, VERSION, spelled};
use super::{Backend, DeviceError};

/// The kind of a device, the preferred first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DeviceKind {
    /// A graphics card.
    Discrete,
    /// A GPU on the processor's chip.
    Integrated,
    /// A share of a GPU, in a virtual machine.
    Virtual,
    /// None of the others.
    Other,
    /// A driver that computes on the CPU.
    Software,
}

/// A device and what it can do.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The device's own name.
    pub name: String,
    /// The device's kind.
    pub kind: DeviceKind,
    /// Vulkan's version and the driver's name and version.
    pub driver: String,
    /// What it lacks for each of [`Backend::ALL`]; an empty list where it lacks nothing.
    missing: [Vec<String>; 3],
    /// Whether it supports f64 natively.
    pub native_f64: bool,
    /// Whether its driver tells what its compiler counts (`VK_KHR_pipeline_executable_properties`).
    pub statistics: bool,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) memory_budget: bool,
    pub(super) portability_subset: bool,
}

impl Candidate {
    /// What it lacks for a backend, as text; empty where it lacks nothing.
    pub fn missing(&self, backend: Backend) -> &[String] {
        let place = match backend {
            Backend::RayPipeline => 0,
            Backend::RayQuery => 1,
            Backend::Compute => 2,
        };
        &self.missing[place]
    }

    /// Whether it can run a backend.
    pub fn can(&self, backend: Backend) -> bool {
        self.missing(backend).is_empty()
    }
}

/// All devices, graphics cards first; devices of one kind in the driver's order.
///
/// # Errors
/// When the devices cannot be listed.
pub fn survey(instance: &Instance) -> Result<Vec<Candidate>, DeviceError> {
    // SAFETY: a plain query of a live instance.
    let devices = unsafe { instance.calls().enumerate_physical_devices() }
        .map_err(DeviceError::of("vkEnumeratePhysicalDevices"))?;
    let mut candidates: Vec<_> = devices.into_iter().map(|d| probe(instance.calls(), d)).collect();
    candidates.sort_by_key(|c| c.kind);
    Ok(candidates)
}

fn probe(calls: &ash::Instance, physical: vk::PhysicalDevice) -> Candidate {
    // SAFETY: `physical` is a device of this instance, here and below.
    let basic = unsafe { calls.get_physical_device_properties(physical) };
    let name =
        basic.device_name_as_c_str().map_or_else(|_| String::new(), |n| n.to_string_lossy().into_owned());
    let kind = match basic.device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
        vk::PhysicalDeviceType::CPU => DeviceKind::Software,
        _ => DeviceKind::Other,
    };
    let version = basic.api_version;
    let useless = |name: &str, missing: String| Candidate {
        name: name.to_owned(),
        kind,
        driver: format!("Vulkan {}", spelled(version)),
        missing: [(); 3].map(|()| vec![missing.clone()]),
        native_f64: false,
        statistics: false,
        physical,
        memory_budget: false,
        portability_subset: false,
    };
    if version < VERSION {
        // On such a version its features cannot be queried.
        return useless(&name, format!("Vulkan 1.2 (it has {})", spelled(version)));
    }

    // SAFETY: as above.
    let extensions = match unsafe { calls.enumerate_device_extension_properties(physical) } {
        Ok(extensions) => extensions,
        // A broken driver must not hide the other devices.
        Err(e) => {
            return useless(
                &name,
                format!("a list of its extensions (vkEnumerateDeviceExtensionProperties: {e})"),
            );
        }
    };
    let has = |name: &std::ffi::CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    let has_acceleration = has(khr::acceleration_structure::NAME) && has(khr::deferred_host_operations::NAME);

    let mut vulkan12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut acceleration = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut pipeline = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut vulkan12);
    // A structure must not be queried where the device does not have its extension.
    if has_acceleration {
        features = features.push_next(&mut acceleration);
    }
    if has(khr::ray_tracing_pipeline::NAME) {
        features = features.push_next(&mut pipeline);
    }
    if has(khr::ray_query::NAME) {
        features = features.push_next(&mut query);
    }
    if has(khr::pipeline_executable_properties::NAME) {
        features = features.push_next(&mut executables);
    }
    // SAFETY: the chain holds structures of version 1.2 and of extensions that the device has.
    unsafe { calls.get_physical_device_features2(physical, &mut features) };
    let core = features.features;
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    // SAFETY: as above.
    unsafe { calls.get_physical_device_properties2(physical, &mut properties) };
    // SAFETY: as above.
    let queues = unsafe { calls.get_physical_device_queue_family_properties(physical) };

    let bits = Bits {
        compute_queue: compute_family(&queues).is_some(),
        int64: core.shader_int64 != 0,
        buffer_address: vulkan12.buffer_device_address != 0,
        scalar_layout: vulkan12.scalar_block_layout != 0,
        acceleration: acceleration.acceleration_structure != 0,
        ray_pipeline: pipeline.ray_tracing_pipeline != 0,
        ray_query: query.ray_query != 0,
    };
    let driver_text = |text: Result<&std::ffi::CStr, _>| {
        text.map_or_else(
            |_: std::ffi::FromBytesUntilNulError| String::new(),
            |t| t.to_string_lossy().into_owned(),
        )
    };
    Candidate {
        name,
        kind,
        driver: format!(
            "Vulkan {}, {} {}",
            spelled(version),
            driver_text(driver.driver_name_as_c_str()),
            driver_text(driver.driver_info_as_c_str())
        ),
        missing: missing(&has, &bits),
        native_f64: core.shader_float64 != 0,
        statistics: executables.pipeline_executable_info != 0,
        physical,
        memory_budget: has(ash::ext::memory_budget::NAME),
        portability_subset: has(khr::portability_subset::NAME),
    }
}

/// What a device reports beside its extensions.
#[derive(Clone, Copy, Debug)]
struct Bits {
    compute_queue: bool,
    int64: bool,
    buffer_address: bool,
    scalar_layout: bool,
    acceleration: bool,
    ray_pipeline: bool,
    ray_query: bool,
}

/// What a device with these extensions and features lacks for each of [`Backend::ALL`].
fn missing(has: &dyn Fn(&std::ffi::CStr) -> bool, bits: &Bits) -> [Vec<String>; 3] {
    let lacking = |needs: &[(bool, &str)]| -> Vec<String> {
        needs.iter().filter(|n| !n.0).map(|n| n.1.to_string()).collect()
    };
    let basics = [
        (bits.compute_queue, "a queue that computes"),
        (bits.int64, "shaderInt64"),
        (bits.buffer_address, "bufferDeviceAddress"),
        (bits.scalar_layout, "scalarBlockLayout"),
    ];
    let hierarchy = [
        (has(khr::acceleration_structure::NAME), "VK_KHR_acceleration_structure"),
        (has(khr::deferred_host_operations::NAME), "VK_KHR_deferred_host_operations"),
        (bits.acceleration, "accelerationStructure"),
    ];
    let by_pipeline = [
        (has(khr::ray_tracing_pipeline::NAME), "VK_KHR_ray_tracing_pipeline"),
        (bits.ray_pipeline, "rayTracingPipeline"),
    ];
    let by_query = [(has(khr::ray_query::NAME), "VK_KHR_ray_query"), (bits.ray_query, "rayQuery")];
    [
        lacking(&[&basics[..], &hierarchy, &by_pipeline].concat()),
        lacking(&[&basics[..], &hierarchy, &by_query].concat()),
        lacking(&basics),
    ]
}

/// The queue family to use: one without graphics where there is one, so that drawing of the screen is not disturbed.
pub(super) fn compute_family(queues: &[vk::QueueFamilyProperties]) -> Option<u32> {
    let computes = |q: &vk::QueueFamilyProperties| q.queue_flags.contains(vk::QueueFlags::COMPUTE);
    let alone = queues.iter().position(|q| computes(q) && !q.queue_flags.contains(vk::QueueFlags::GRAPHICS));
    alone.or_else(|| queues.iter().position(computes)).map(|i| i as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Bits = Bits {
        compute_queue: true,
        int64: true,
        buffer_address: true,
        scalar_layout: true,
        acceleration: true,
        ray_pipeline: true,
        ray_query: true,
    };

    /// What a device with `bits` lacks when it does not have the named extensions.
    fn without(extensions: &[&str], bits: Bits) -> [String; 3] {
        let has = |name: &std::ffi::CStr| !extensions.contains(&name.to_str().unwrap());
        missing(&has, &bits).map(|m| m.join(", "))
    }

    /// Each extension and each bit is required by exactly the backends that need it.
    #[test]
    fn every_need_is_asked_for_by_itself() {
        assert_eq!(without(&[], ALL), ["", "", ""]);
        for (extension, backends) in [
            ("VK_KHR_acceleration_structure", [true, true, false]),
            ("VK_KHR_deferred_host_operations", [true, true, false]),
            ("VK_KHR_ray_tracing_pipeline", [true, false, false]),
            ("VK_KHR_ray_query", [false, true, false]),
        ] {
            assert_eq!(without(&[extension], ALL), backends.map(|b| if b { extension } else { "" }));
        }
        for (bits, name, backends) in [
            (Bits { compute_queue: false, ..ALL }, "a queue that computes", [true; 3]),
            (Bits { int64: false, ..ALL }, "shaderInt64", [true; 3]),
            (Bits { buffer_address: false, ..ALL }, "bufferDeviceAddress", [true; 3]),
            (Bits { scalar_layout: false, ..ALL }, "scalarBlockLayout", [true; 3]),
            (Bits { acceleration: false, ..ALL }, "accelerationStructure", [true, true, false]),
            (Bits { ray_pipeline: false, ..ALL }, "rayTracingPipeline", [true, false, false]),
            (Bits { ray_query: false, ..ALL }, "rayQuery", [false, true, false]),
        ] {
            assert_eq!(without(&[], bits), backends.map(|b| if b { name } else { "" }));
        }
    }

    /// Data-centre GPUs have ray tracing pipelines and no ray queries, neither the extension nor its bit.
    #[test]
    fn a_data_centres_processor_has_what_it_has() {
        let bits = Bits { ray_query: false, ..ALL };
        assert_eq!(without(&["VK_KHR_ray_query"], bits), ["", "VK_KHR_ray_query, rayQuery", ""]);
    }

    #[test]
    fn a_queue_that_only_computes_is_preferred() {
        let queue = |flags| vk::QueueFamilyProperties { queue_flags: flags, ..Default::default() };
        let (graphics, compute) = (vk::QueueFlags::GRAPHICS, vk::QueueFlags::COMPUTE);
        let transfer = queue(vk::QueueFlags::TRANSFER);
        assert_eq!(compute_family(&[queue(graphics | compute), transfer, queue(compute)]), Some(2));
        assert_eq!(compute_family(&[transfer, queue(graphics | compute)]), Some(1));
        assert_eq!(compute_family(&[transfer, queue(graphics)]), None);
    }
}
