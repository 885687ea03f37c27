//! The sections of a `.pumice` file, unpacked, in a table that is right: what `file::nodes` and `file::check` are for.
#![no_main]

use pumice_fuzz::{sections, seeds, volume};

fn make() -> Vec<Vec<u8>> {
    seeds::pumice_files().iter().map(|file| sections::from_file(file)).collect()
}

libfuzzer_sys::fuzz_target!(init: seeds::give(make), |input: &[u8]| {
    volume::open_and_use(sections::to_file(input));
});
