//! Tests the device's interface: memory, launches, hierarchies, and what happens when they fail.
#![allow(clippy::unwrap_used, clippy::panic, clippy::expect_used, reason = "tests")]

mod gpu;

use gpu::{Gpu, tiny, validated};
use pumice_vulkan::device::{self, Backend, DeviceError, InjectedFault, Instance, InstanceOptions};
use pumice_vulkan::layout::Launch;
use pumice_vulkan::program::{Code, Program};

#[test]
fn a_machine_without_vulkan_says_so() {
    let loader = Some("/there/is/no/libvulkan.so.1".into());
    let Err(DeviceError::NoVulkan(what)) = Instance::new(&InstanceOptions { loader, ..Default::default() })
    else {
        panic!("Vulkan came from nowhere");
    };
    assert!(what.contains("/there/is/no/libvulkan.so.1") && !what.contains('\n'), "{what}");
}

/// A library that is not a Vulkan loader.
#[test]
fn a_library_that_is_no_loader_is_refused() {
    let loader = Some("libc.so.6".into());
    let refused = Instance::new(&InstanceOptions { loader, ..Default::default() });
    assert!(matches!(refused, Err(DeviceError::NoVulkan(_))), "{refused:?}");
}

#[test]
fn every_tested_backend_has_a_device_here() {
    let instance = validated();
    let all = device::survey(&instance).unwrap();
    for backend in gpu::backends() {
        assert!(all.iter().any(|c| c.can(backend)), "{backend}: {all:?}");
        assert_eq!(Backend::from_name(backend.name()), Some(backend));
    }
    assert!(all.windows(2).all(|w| w[0].kind <= w[1].kind));
    assert!(all.iter().all(|c| !c.name.is_empty() && c.driver.starts_with("Vulkan 1.")));
    assert_eq!(instance.messages().take(), Vec::<String>::new());
}

/// Longer than the staging memory, with lengths that are multiples of nothing.
#[test]
fn bytes_come_back_as_they_went() {
    let gpu = Gpu::new();
    let device = gpu.device();
    let length = (40 << 20) + 7;
    let bytes: Vec<u8> =
        (0..length as u64).map(|i| (i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8).collect();
    let before = device.allocated_bytes();
    let buffer = device.buffer_of("a test's buffer", &bytes).unwrap();
    assert!(device.allocated_bytes() >= before + length as u64);
    let mut back = vec![0; length];
    device.download(&buffer, 0, &mut back).unwrap();
    assert!(back == bytes);
    let mut part = vec![0; 1000];
    device.download(&buffer, 12_345, &mut part).unwrap();
    assert_eq!(part, bytes[12_345..13_345]);
    device.upload(&buffer, 3, &[1, 2, 3]).unwrap();
    device.download(&buffer, 0, &mut part[..8]).unwrap();
    assert_eq!(part[..8], [&bytes[..3], &[1, 2, 3], &bytes[6..8]].concat());
    drop(buffer);
    assert_eq!(device.allocated_bytes(), before);
}

#[test]
fn copies_beyond_the_end_are_refused() {
    let gpu = Gpu::new();
    let buffer = gpu.device().buffer("a test's buffer", 100).unwrap();
    for (offset, length) in [(0, 101), (100, 1), (u64::MAX, 1), (u64::MAX - 10, 100)] {
        let up = gpu.device().upload(&buffer, offset, &vec![0; length]);
        let down = gpu.device().download(&buffer, offset, &mut vec![0; length]);
        for result in [up, down] {
            assert!(
                matches!(result, Err(DeviceError::Limit { limit: 100, .. })),
                "{offset} {length}: {result:?}"
            );
        }
    }
}

#[test]
fn what_cannot_fit_is_refused_with_numbers() {
    let gpu = Gpu::new();
    let Err(e) = gpu.device().buffer("a film of another world", 1 << 50) else { panic!("2^50 bytes") };
    let (DeviceError::Limit { needed, .. } | DeviceError::OutOfMemory { needed, .. }) = e else {
        panic!("{e}")
    };
    assert_eq!(needed, 1 << 50);
    assert!(e.to_string().contains("a film of another world"));
    // The device still works.
    gpu.device().buffer_of("a test's buffer", &[1, 2, 3]).unwrap();
}

#[test]
fn a_full_device_is_told_and_goes_on() {
    let gpu = Gpu::new();
    gpu.device().buffer_of("a test's buffer", &[1]).unwrap();
    gpu.device().inject(InjectedFault::Allocation, 1, 1);
    let Err(e) = gpu.device().buffer("the film", 5000) else { panic!("it was allocated") };
    let DeviceError::OutOfMemory { what: "the film", needed, .. } = e else { panic!("{e}") };
    assert!(needed >= 5000);
    gpu.device().buffer("the film", 5000).unwrap();
}

#[test]
fn a_lost_device_stays_lost() {
    let gpu = Gpu::new();
    let device = gpu.device();
    let buffer = device.buffer_of("a test's buffer", &[1; 64]).unwrap();
    device.inject(InjectedFault::Submission, 1, 1);
    assert_eq!(device.upload(&buffer, 0, &[2]), Err(DeviceError::Lost("an upload")));
    assert!(device.is_lost());
    assert_eq!(device.download(&buffer, 0, &mut [0]), Err(DeviceError::Lost("a download")));
    assert_eq!(device.clear(&buffer), Err(DeviceError::Lost("a clear")));
    // Another instance can be opened beside it.
    Gpu::new().device().buffer_of("a test's buffer", &[1]).unwrap();
}

#[test]
fn launches_beyond_the_limits_are_refused() {
    let gpu = Gpu::new();
    let pipeline = gpu.pipeline(&tiny::compute(), &[]);
    let refused = gpu.try_run(&pipeline, &Launch::default(), [u32::MAX, 1]);
    assert!(matches!(refused, Err(DeviceError::Limit { needed: 0xFFFF_FFFF, .. })), "{refused:?}");
    let gpu = Gpu::of(Backend::RayPipeline);
    let [main, miss, intersection] = tiny::rays();
    let code = Code { main: &main, miss_and_box: Some([&miss, &intersection]), group: [1, 1] };
    let mut program = Program::new(gpu.device(), &code, &[]).unwrap();
    let refused = program.run("a test", &Launch::default(), [u32::MAX, u32::MAX]);
    assert!(
        matches!(refused, Err(DeviceError::Limit { .. } | DeviceError::OutOfMemory { .. })),
        "{refused:?}"
    );
}

#[test]
fn hierarchies_are_for_hardware_that_has_them() {
    let unit = |_| [0., 0., 0., 1., 1., 1.];
    let refused = Gpu::new().device().acceleration(0, 1, unit);
    assert!(
        matches!(refused, Err(DeviceError::Unsupported { backend: Backend::Compute, .. })),
        "{refused:?}"
    );
    let gpu = Gpu::of(gpu::hardware_backends()[0]);
    let before = gpu.device().allocated_bytes();
    let built = gpu.device().acceleration(7, 1000, |i| [i as f32, 0., 0., i as f32 + 1., 1., 1.]).unwrap();
    assert!(built.address() != 0 && built.bytes() > 0);
    // The memory that the build needed is free again.
    assert!(gpu.device().allocated_bytes() - before < 2 * built.bytes() + 4096);
    drop(built);
    assert_eq!(gpu.device().allocated_bytes(), before);
    let refused = gpu.device().acceleration(0, u32::MAX, unit);
    assert!(matches!(refused, Err(DeviceError::Limit { .. })), "{refused:?}");
}

/// Each step of a build may fail; no memory leaks.
#[test]
fn builds_that_fail_leave_nothing() {
    for backend in gpu::hardware_backends() {
        let gpu = Gpu::of(backend);
        let device = gpu.device();
        let build = || device.acceleration(0, 100, |i| [i as f32, 0., 0., i as f32 + 1., 1., 1.]);
        drop(build().unwrap());
        let before = device.allocated_bytes();
        let mut failed = 0;
        for nth in 1.. {
            device.inject(InjectedFault::Allocation, nth, 1);
            match build() {
                Err(DeviceError::OutOfMemory { .. }) => failed += 1,
                Err(e) => panic!("{e}"),
                Ok(_) => break,
            }
            assert_eq!(device.allocated_bytes(), before, "allocation {nth}");
        }
        assert!(failed >= 5, "boxes, two levels, their scratch: {failed}");
    }
}

#[test]
fn shaders_of_another_backend_are_refused() {
    let compute = tiny::compute();
    let code = Code { main: &compute, miss_and_box: None, group: [1, 1] };
    let gpu = Gpu::of(Backend::RayPipeline);
    let refused = Program::new(gpu.device(), &code, &[]);
    assert!(matches!(refused, Err(DeviceError::Unsupported { .. })), "{refused:?}");
}

/// Cached pipelines are loaded again, and a damaged file does no harm.
#[test]
fn pipelines_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let open = || {
        let instance = validated();
        let devices = device::survey(&instance).unwrap();
        let gpu = device::Gpu::open(&instance, &devices[0], Backend::Compute, Some(folder.path())).unwrap();
        gpu.compute_pipeline(&tiny::compute(), &[]).unwrap();
        gpu.save_pipelines();
        assert_eq!(instance.messages().take(), Vec::<String>::new());
    };
    let files =
        || -> Vec<_> { std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).collect() };
    open();
    let [file] = &files()[..] else { panic!("{:?}", files()) };
    let written = std::fs::read(file).unwrap();
    open();
    for damage in [&written[..written.len() / 2], b"", b"PUMVKPC1 and nothing that follows from it"] {
        std::fs::write(file, damage).unwrap();
        open();
        assert!(std::fs::read(file).unwrap().len() >= written.len().min(24));
    }
    assert_eq!(files().len(), 1);
    // A folder that cannot be created is no error either.
    let instance = validated();
    let devices = device::survey(&instance).unwrap();
    let nowhere = file.join("a file is no folder");
    let gpu = device::Gpu::open(&instance, &devices[0], Backend::Compute, Some(&nowhere)).unwrap();
    gpu.save_pipelines();
}
