//! A device for tests, with the validation layer. Any message of the layer fails the test that is running.
//!
//! A test without a device fails, because it must not pass by doing nothing. `cargo xtask test` provides a driver that computes on the CPU
//! where the machine has no GPU.
#![allow(dead_code, reason = "not every test uses all of it")]

pub(crate) mod scene;
pub(crate) mod tiny;
/// (The shaders of each backend take a minute or more to compile for a CPU.)
#[path = "../../../tests/tests/turns/mod.rs"]
pub(crate) mod turns;
pub(crate) mod validated;

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use bytemuck::{Pod, Zeroable};
use pumice_vulkan::device::{self, Backend, DeviceError, Instance, InstanceOptions};
use pumice_vulkan::layout::Launch;
use pumice_vulkan::program::{Code, Program};

pub(crate) use pumice_vulkan::device::ComputePipeline as Pipeline;
pub(crate) use turns::of_today;

/// A device of which the validation layer checks every call.
pub(crate) struct Gpu {
    inner: device::Gpu,
    pub(crate) has_f64: bool,
    pub(crate) name: String,
    /// Pipelines of `probe.comp`, by function and by whether doubles are native.
    probes: RefCell<HashMap<(u32, bool), Pipeline>>,
}

/// Memory on the device.
pub(crate) struct Buffer {
    pub(crate) inner: device::Buffer,
    pub(crate) address: u64,
    gpu: device::Gpu,
}

impl Buffer {
    pub(crate) fn write<T: Pod>(&mut self, values: &[T]) {
        self.gpu.upload(&self.inner, 0, bytemuck::cast_slice(values)).expect("written");
    }

    pub(crate) fn read<T: Pod + Zeroable>(&self, count: usize) -> Vec<T> {
        let mut values = vec![T::zeroed(); count];
        self.gpu.download(&self.inner, 0, bytemuck::cast_slice_mut(&mut values)).expect("read");
        values
    }
}

/// Starts Vulkan with the validation layer.
pub(crate) fn validated() -> Instance {
    Instance::new(&InstanceOptions { validation: true, ..InstanceOptions::default() })
        .expect("Vulkan with its validation layer")
}

impl Gpu {
    /// The preferred device for compute shaders.
    pub(crate) fn new() -> Self {
        Self::of(Backend::Compute)
    }

    /// The preferred device for a backend.
    pub(crate) fn of(backend: Backend) -> Self {
        let instance = validated();
        let all = device::survey(&instance).expect("a list of devices");
        let found = all.iter().find(|c| c.can(backend));
        let candidate = found.unwrap_or_else(|| panic!("no device for {backend} among {all:?}"));
        let inner = device::Gpu::open(&instance, candidate, backend, None).expect("a device");
        Self {
            inner,
            has_f64: candidate.native_f64,
            name: candidate.name.clone(),
            probes: RefCell::default(),
        }
    }

    /// The device itself.
    pub(crate) fn device(&self) -> &device::Gpu {
        &self.inner
    }

    /// Allocates zeroed memory.
    pub(crate) fn buffer(&self, bytes: usize) -> Buffer {
        let inner = self.inner.buffer("a test's buffer", bytes as u64).expect("memory");
        self.inner.clear(&inner).expect("cleared");
        Buffer { address: inner.address(), inner, gpu: self.inner.clone() }
    }

    /// Allocates memory with these values.
    pub(crate) fn buffer_of<T: Pod>(&self, values: &[T]) -> Buffer {
        let mut buffer = self.buffer(size_of_val(values));
        buffer.write(values);
        buffer
    }

    /// Creates a compute pipeline with these specialisation constants.
    pub(crate) fn pipeline(&self, words: &[u32], constants: &[u32]) -> Pipeline {
        self.inner.compute_pipeline(words, constants).expect("a pipeline")
    }

    /// Creates an entry point for the device's backend, compiled with everything that the tests' scenes may need.
    pub(crate) fn program(&self, entry: &str, native: bool, group: [u32; 2]) -> Program {
        self.program_with(entry, native, group, &[])
    }

    /// As [`Gpu::program`], with specialisation constants.
    pub(crate) fn program_with(
        &self,
        entry: &str,
        native: bool,
        group: [u32; 2],
        constants: &[u32],
    ) -> Program {
        let backend = self.inner.backend();
        let main = match backend {
            Backend::RayPipeline => format!("{entry}.rgen"),
            Backend::RayQuery => format!("{entry}_query.comp"),
            Backend::Compute => format!("{entry}_bvh.comp"),
        };
        let main = spirv(&main, native);
        let others = ["nothing.rmiss", "box.rint"].map(|name| spirv(name, native));
        let [miss, intersection] = &others;
        let miss_and_box = (backend == Backend::RayPipeline).then_some([&miss[..], &intersection[..]]);
        let code = Code { main: &main, miss_and_box, group };
        Program::new(&self.inner, &code, constants).expect("a program")
    }

    /// Runs it once and waits for its end.
    pub(crate) fn run(&self, pipeline: &Pipeline, launch: &Launch, groups: [u32; 2]) {
        self.try_run(pipeline, launch, groups).expect("run");
    }

    /// As [`Gpu::run`], where it may fail.
    pub(crate) fn try_run(
        &self,
        pipeline: &Pipeline,
        launch: &Launch,
        groups: [u32; 2],
    ) -> Result<(), DeviceError> {
        self.inner.dispatch("a test", pipeline, launch, groups).map(|_| ())
    }

    /// Whether a large function is probed with native doubles: where the device has them, but on one day in eight and in full, because emulated
    /// ones take a minute to compile for a CPU. (That each operation computes the same has a test of its own.)
    pub(crate) fn native_today(&self) -> bool {
        self.has_f64 && of_today(&[true, true, true, false, true, true, true, true]) == [true]
    }

    /// Runs function `function` of `probe.comp` on rows of words, and returns rows of words.
    pub(crate) fn probe(
        &self,
        native: bool,
        function: u32,
        scene: u64,
        rows: &[Vec<u32>],
        out: usize,
    ) -> Vec<Vec<u32>> {
        let mut probes = self.probes.borrow_mut();
        let pipeline = probes
            .entry((function, native))
            .or_insert_with(|| self.pipeline(&spirv("probe.comp", native), &[function]));
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
        self.run(pipeline, &launch, [(rows.len() as u32).div_ceil(64), 1]);
        target.read::<u32>(rows.len() * out).chunks_exact(out).map(<[u32]>::to_vec).collect()
    }
}

impl Gpu {
    /// Fails if the validation layer reported anything.
    fn check(&self) {
        let said = self.inner.instance().messages().take();
        if !std::thread::panicking() {
            assert!(said.is_empty(), "the validation layer says:\n{}", said.join("\n"));
        }
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        self.check();
    }
}

/// The backends that are tested: all, or those that `PUMICE_TEST_BACKENDS` names (`vulkan-rt,vulkan-compute`) for a device that lacks one.
pub(crate) fn backends() -> Vec<Backend> {
    let Ok(named) = std::env::var("PUMICE_TEST_BACKENDS") else { return Backend::ALL.to_vec() };
    let of =
        |name| Backend::from_name(name).unwrap_or_else(|| panic!("PUMICE_TEST_BACKENDS: no backend {name}"));
    named.split(',').map(of).collect()
}

/// Those of [`backends`] that trace rays by hardware.
pub(crate) fn hardware_backends() -> Vec<Backend> {
    backends().into_iter().filter(|b| b.uses_hardware_hierarchy()).collect()
}

/// A resource that several tests use, one after the other, because compiling for a device that computes on the CPU takes longer than most
/// tests. Messages of the validation layer fail the test that returns the resource. A test that fails discards it.
pub(crate) struct Shared<T: 'static>(MutexGuard<'static, Option<T>>, fn(&T) -> Vec<&Gpu>);

impl<T> Shared<T> {
    /// Waits until no other test has it. The first caller creates it.
    pub(crate) fn take(
        place: &'static Mutex<Option<T>>,
        make: impl FnOnce() -> T,
        devices: fn(&T) -> Vec<&Gpu>,
    ) -> Self {
        let mut held = place.lock().unwrap_or_else(PoisonError::into_inner);
        if held.is_none() {
            *held = Some(make());
        }
        Self(held, devices)
    }
}

impl<T> std::ops::Deref for Shared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0.as_ref().expect("made when it was taken")
    }
}

impl<T> Drop for Shared<T> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            *self.0 = None;
            return;
        }
        for gpu in (self.1)(self) {
            gpu.check();
        }
    }
}

/// The words of a compiled shader.
pub(crate) fn spirv(name: &str, native: bool) -> Vec<u32> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv");
    // A shader without doubles has one form only.
    let with_doubles = folder.join(format!("{name}.f64.spv"));
    let path =
        if native && with_doubles.exists() { with_doubles } else { folder.join(format!("{name}.spv")) };
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect()
}
