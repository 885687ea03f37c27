//! Fuzzes whole `.pumice` files (header, table, filters and zstd), after correcting their checksums.
#![no_main]

use pumice_fuzz::{checksums, seeds, volume};

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::pumice_files), |input: &[u8]| {
    let mut file = input.to_vec();
    checksums::set(&mut file);
    volume::open_and_use(file);
});
