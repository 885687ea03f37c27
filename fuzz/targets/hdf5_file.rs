//! Fuzzes the reader of HDF5. The seeds are files that h5py has written.
#![no_main]

use pumice_fuzz::{files, scratch, seeds};

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::hdf5_files), |input: &[u8]| {
    let path = scratch::path(".h5");
    scratch::put(&path, input);
    files::read_all(&path, Default::default());
});
