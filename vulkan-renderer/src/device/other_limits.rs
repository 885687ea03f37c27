//! Tests with the limits of other devices, on the device at hand: larger alignments, and room for fewer buffers. A layout for a stricter
//! device also works on a laxer one, so only the numbers need changing. The validation layer checks each test.

#[path = "../../tests/gpu/tiny.rs"]
#[allow(dead_code, reason = "not every test uses all of it")]
mod tiny;

use std::sync::Arc;

use super::gpu::Limits;
use super::{Backend, DeviceError, Gpu, Instance, InstanceOptions, RayShaders, survey};
use crate::layout::Launch;

/// Opens a device and changes its limits.
fn device(backend: Backend, change: impl FnOnce(&mut Limits)) -> Gpu {
    let options = InstanceOptions { validation: true, ..InstanceOptions::default() };
    let instance = Instance::new(&options).expect("Vulkan with its validation layer");
    let devices = survey(&instance).expect("a list of devices");
    let candidate = devices.iter().find(|c| c.can(backend)).expect("a device for each backend");
    let mut gpu = Gpu::open(&instance, candidate, backend, None).expect("a device");
    change(&mut Arc::get_mut(&mut gpu.inner).expect("nobody else has it yet").limits);
    gpu
}

fn silent(gpu: &Gpu) {
    assert_eq!(gpu.instance().messages().take(), Vec::<String>::new());
}

/// The scratch memory of builds begins at the required alignment. 4096 is sixteen times what cards require.
#[test]
fn hierarchies_are_built_at_any_alignment() {
    for alignment in [1, 128, 4096] {
        let gpu = device(Backend::RayQuery, |l| l.scratch_alignment = alignment);
        let built = gpu.acceleration(3, 500, |i| [i as f32, 0., 0., i as f32 + 1., 1., 1.]).expect("built");
        assert!(built.address() != 0);
        drop(built);
        assert_eq!(gpu.allocated_bytes(), 0);
        silent(&gpu);
    }
}

/// Entries and regions of the shader binding table are spaced by the required alignments, and the device finds the ray generation shader
/// there.
#[test]
fn tables_of_shaders_are_laid_out_at_any_alignment() {
    let [generation, miss, intersection] = tiny::rays();
    let shaders = RayShaders { generation: &generation, miss: &miss, intersection: &intersection };
    for (handle, table) in [(32, 64), (64, 64), (64, 4096)] {
        let gpu = device(Backend::RayPipeline, |l| (l.handle_alignment, l.table_alignment) = (handle, table));
        let pipeline = gpu.ray_pipeline(&shaders, &[]).expect("a pipeline");
        gpu.trace("a test", &pipeline, &Launch::default(), [8, 1]).expect("run");
        silent(&gpu);
    }
}

/// One buffer too many is refused with an error that has numbers, before the driver is called. Freeing one makes room again.
#[test]
fn buffers_are_counted() {
    let gpu = device(Backend::Compute, |l| l.allocations = 4);
    let mut held: Vec<_> =
        (0..3).map(|_| gpu.buffer_of("a test's buffer", &[1; 64]).expect("room")).collect();
    let refused = gpu.buffer("a test's buffer", 64);
    assert!(
        matches!(refused, Err(DeviceError::Limit { what: "buffers at one time", needed: 5, limit: 4 })),
        "{refused:?}"
    );
    held.pop();
    gpu.buffer_of("a test's buffer", &[2; 64]).expect("room again");
    silent(&gpu);
}
