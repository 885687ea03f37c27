//! Hand-written shaders that do nothing. They are for tests of the code around shaders: compiling a real one for a device that computes on
//! the CPU takes longer than such a test.

const MAIN: [u32; 2] = [u32::from_le_bytes(*b"main"), 0];

/// The instructions that all of them have, from the header on: `void main() {}`. Instructions and numbers: the SPIR-V specification 1.5.
fn module(needs: &[u32], model: u32, mode: &[u32]) -> Vec<u32> {
    let header = [0x0723_0203, 0x0001_0500, 0, 5, 0];
    let memory_model = [3 << 16 | 14, 0, 1];
    let entry = [5 << 16 | 15, model, 1];
    let types = [2 << 16 | 19, 2, 3 << 16 | 33, 3, 2];
    let function = [5 << 16 | 54, 2, 1, 0, 3, 2 << 16 | 248, 4, 1 << 16 | 253, 1 << 16 | 56];
    [&header[..], needs, &memory_model, &entry, &MAIN, mode, &types, &function].concat()
}

/// A compute shader with a workgroup size of one.
pub(crate) fn compute() -> Vec<u32> {
    module(&[2 << 16 | 17, 1], 5, &[6 << 16 | 16, 1, 17, 1, 1, 1])
}

/// Ray generation, miss and intersection shader.
pub(crate) fn rays() -> [Vec<u32>; 3] {
    let mut needs = vec![2 << 16 | 17, 4479, 6 << 16 | 10];
    let name = b"SPV_KHR_ray_tracing\0";
    needs.extend(name.chunks(4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]])));
    [5313, 5317, 5314].map(|model| module(&needs, model, &[]))
}
