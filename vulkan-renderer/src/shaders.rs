//! The shaders that the renderer launches. They are embedded in the library, so users need no shader compiler and no files.

use std::time::Duration;

use crate::device::{Backend, Candidate, DeviceError, DeviceKind, Executable, Gpu, RayShaders};
use crate::pack::{CONSTANTS, FLOATS_FIRST, ShaderNeeds};
use crate::program::{Code, Program};

/// An entry point that can be launched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// Adds samples to the film.
    Path,
    /// Finds the first surface through the centre of each pixel.
    First,
}

impl Entry {
    /// Specialisation constants of the entry for a scene that needs `needs`, and for a device.
    pub(crate) fn constants(self, needs: ShaderNeeds, device: &Candidate) -> [u32; FLOATS_FIRST + 1] {
        let needs = match self {
            Self::Path => needs,
            Self::First => needs.of_surfaces(),
        };
        let mut constants = [0; FLOATS_FIRST + 1];
        constants[..CONSTANTS].copy_from_slice(&needs.constants());
        constants[FLOATS_FIRST] = u32::from(floats_first(device.kind, device.native_f64));
        constants
    }
}

/// Whether the walk through bricks compares floats before doubles: on cards, whose doubles are slow, and where doubles are emulated. (Cortex,
/// Mesa's driver that computes on a processor: 1.2 times the CPU seconds of a walk in its own doubles.)
fn floats_first(kind: DeviceKind, native_f64: bool) -> bool {
    kind != DeviceKind::Software || !native_f64
}

/// Workgroup size of both entries, across and down, where they are compute shaders.
const GROUP: [u32; 2] = [8, 8];

macro_rules! spirv {
    ($name:literal, $native:expr) => {
        if $native {
            &include_bytes!(concat!("../spirv/", $name, ".f64.spv"))[..]
        } else {
            &include_bytes!(concat!("../spirv/", $name, ".spv"))[..]
        }
    };
}

fn main_of(entry: Entry, backend: Backend, native: bool) -> &'static [u8] {
    match (entry, backend) {
        (Entry::Path, Backend::RayPipeline) => spirv!("path.rgen", native),
        (Entry::Path, Backend::RayQuery) => spirv!("path_query.comp", native),
        (Entry::Path, Backend::Compute) => spirv!("path_bvh.comp", native),
        (Entry::First, Backend::RayPipeline) => spirv!("first.rgen", native),
        (Entry::First, Backend::RayQuery) => spirv!("first_query.comp", native),
        (Entry::First, Backend::Compute) => spirv!("first_bvh.comp", native),
    }
}

/// Decodes SPIR-V words. SPIR-V allows either byte order; the embedded files are little-endian.
fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect()
}

/// SPIR-V of an entry for a device.
struct Modules {
    main: Vec<u32>,
    /// The miss shader and the intersection shader of a ray tracing pipeline.
    miss_and_box: Option<[Vec<u32>; 2]>,
}

impl Modules {
    /// Those of an entry, in the variant with native doubles where the device has them.
    fn of(gpu: &Gpu, entry: Entry) -> Self {
        let (backend, native) = (gpu.backend(), gpu.candidate().native_f64);
        let by_pipeline = backend == Backend::RayPipeline;
        Self {
            main: words(main_of(entry, backend, native)),
            miss_and_box: by_pipeline.then(|| {
                [words(include_bytes!("../spirv/nothing.rmiss.spv")), words(spirv!("box.rint", native))]
            }),
        }
    }
}

/// SPIR-V of the denoiser, in the variant with native doubles where the device has them.
pub(crate) fn denoise_words(gpu: &Gpu) -> Vec<u32> {
    words(spirv!("denoise.comp", gpu.candidate().native_f64))
}

/// SPIR-V of what resolves the film, in the variant with native doubles where the device has them.
pub(crate) fn resolve_words(gpu: &Gpu) -> Vec<u32> {
    words(spirv!("resolve.comp", gpu.candidate().native_f64))
}

/// Creates the program of an entry on a device.
pub(crate) fn program(gpu: &Gpu, entry: Entry, constants: &[u32]) -> Result<Program, DeviceError> {
    let Modules { main, miss_and_box } = Modules::of(gpu, entry);
    let others = miss_and_box.as_ref().map(|[miss, in_box]| [&miss[..], &in_box[..]]);
    let group = if others.is_some() { [1, 1] } else { GROUP };
    Program::new(gpu, &Code { main: &main, miss_and_box: others, group }, constants)
}

/// Compiles an entry and launches nothing. Returns the time that it took, and what the driver's compiler counted. The device must have been
/// opened by [`Gpu::open_for_statistics`].
///
/// # Errors
/// When the driver refuses it, or the device was not opened so.
pub fn executables(
    gpu: &Gpu,
    entry: Entry,
    needs: &ShaderNeeds,
) -> Result<(Duration, Vec<Executable>), DeviceError> {
    let Modules { main, miss_and_box } = Modules::of(gpu, entry);
    let constants = entry.constants(*needs, gpu.candidate());
    match &miss_and_box {
        None => gpu.compute_executables(&main, &constants),
        Some([miss, intersection]) => {
            gpu.ray_executables(&RayShaders { generation: &main, miss, intersection }, &constants)
        }
    }
}
