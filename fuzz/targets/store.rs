//! Fuzzes the readers of Zarr, OME-Zarr, N5 and Neuroglancer precomputed: the description of a store, and its first chunk or shard.
#![no_main]

use pumice_fuzz::{files, seeds, stores};

libfuzzer_sys::fuzz_target!(init: seeds::give(stores::seeds), |input: &[u8]| {
    if let Some(folder) = stores::put(input) {
        files::read_all(&folder, Default::default());
    }
});
