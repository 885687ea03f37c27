//! Fuzzes the decompressed sections of a `.pumice` file in a valid table, which `file::nodes` and `file::check` must validate.
#![no_main]

use pumice_fuzz::{sections, seeds, volume};

fn make() -> Vec<Vec<u8>> {
    seeds::pumice_files().iter().map(|file| sections::from_file(file)).collect()
}

libfuzzer_sys::fuzz_target!(init: seeds::give(make), |input: &[u8]| {
    volume::open_and_use(sections::to_file(input));
});
