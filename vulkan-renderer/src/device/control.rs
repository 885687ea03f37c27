//! Negative controls: the validation layer is present, and it detects the errors that it is used for. Without these, tests that expect no
//! messages would prove nothing.

use ash::vk;

use super::{Backend, Buffer, Gpu, Instance, InstanceOptions, survey};

fn gpu() -> Gpu {
    let options = InstanceOptions { validation: true, ..InstanceOptions::default() };
    let instance = Instance::new(&options).expect("Vulkan with its validation layer");
    let devices = survey(&instance).expect("a list of devices");
    Gpu::open(&instance, &devices[0], Backend::Compute, None).expect("a device")
}

/// Copies one half of a buffer onto the other, twice.
fn copy_twice(
    gpu: &Gpu,
    buffer: &Buffer,
    between: impl Fn(&super::gpu::Inner, vk::CommandBuffer),
) -> Vec<String> {
    let region = [vk::BufferCopy::default().dst_offset(512).size(512)];
    gpu.submit("two copies", |inner, commands| {
        // SAFETY: the buffer lives until the launch has ended and is 1024 bytes long.
        unsafe { inner.calls.cmd_copy_buffer(commands, buffer.handle(), buffer.handle(), &region) };
        between(inner, commands);
        // SAFETY: as before.
        unsafe { inner.calls.cmd_copy_buffer(commands, buffer.handle(), buffer.handle(), &region) };
    })
    .expect("run");
    gpu.instance().messages().take()
}

#[test]
fn writes_that_overlap_are_noticed() {
    let gpu = gpu();
    let buffer = gpu.buffer("a test's buffer", 1024).expect("memory");
    let said = copy_twice(&gpu, &buffer, |_, _| ());
    assert!(
        said.iter().any(|m| m.contains("WRITE-AFTER-WRITE") || m.contains("WRITE_AFTER_WRITE")),
        "{said:?}"
    );
    // The barrier that every launch has makes the message go away.
    let barrier = |inner: &super::gpu::Inner, commands| {
        // SAFETY: the commands are being recorded.
        unsafe { inner.barrier(commands, vk::PipelineStageFlags::ALL_COMMANDS) };
    };
    assert_eq!(copy_twice(&gpu, &buffer, barrier), Vec::<String>::new());
}

#[test]
fn wrong_arguments_are_noticed() {
    let gpu = gpu();
    let buffer = gpu.buffer("a test's buffer", 1024).expect("memory");
    let beyond = [vk::BufferCopy::default().dst_offset(4096).size(16)];
    let inner = &gpu.inner;
    // These commands are recorded and never run.
    let worker = inner.worker();
    let pool = vk::CommandPoolCreateInfo::default();
    // SAFETY: the copy beyond the buffer's end is refused by the layer when it is recorded and is never submitted; the pool is
    // used here alone.
    unsafe {
        let pool = inner.calls.create_command_pool(&pool, None).expect("a pool");
        let one = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = inner.calls.allocate_command_buffers(&one).expect("commands")[0];
        inner.calls.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()).expect("begun");
        inner.calls.cmd_copy_buffer(commands, buffer.handle(), buffer.handle(), &beyond);
        inner.calls.destroy_command_pool(pool, None);
    }
    drop(worker);
    let said = gpu.instance().messages().take();
    assert!(said.iter().any(|m| m.contains("vkCmdCopyBuffer")), "{said:?}");
}
