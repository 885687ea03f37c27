//! The compiled shaders that the renderer launches. They are embedded in the library, so users need no shader compiler and no files.

use crate::device::{Backend, DeviceError, Gpu};
use crate::program::{Code, Program};

/// An entry point that can be launched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Entry {
    /// Adds samples to the film.
    Path,
    /// Finds the first surface through the centre of each pixel.
    First,
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

/// Creates the program of an entry on a device. It uses the variant with native doubles where the device has them.
pub(crate) fn program(gpu: &Gpu, entry: Entry, constants: &[u32]) -> Result<Program, DeviceError> {
    let (backend, native) = (gpu.backend(), gpu.candidate().native_f64);
    let main = words(main_of(entry, backend, native));
    if backend != Backend::RayPipeline {
        return Program::new(gpu, &Code { main: &main, miss_and_box: None, group: GROUP }, constants);
    }
    let miss = words(include_bytes!("../spirv/nothing.rmiss.spv"));
    let in_box = words(spirv!("box.rint", native));
    Program::new(gpu, &Code { main: &main, miss_and_box: Some([&miss, &in_box]), group: [1, 1] }, constants)
}
