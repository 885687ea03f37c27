//! Fuzzes the readers of other programs' formats; the content decides which one reads.
#![no_main]

use pumice_fuzz::{files, scratch, seeds};

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::label_volumes), |input: &[u8]| {
    let path = scratch::path("");
    scratch::put(&path, input);
    if input.starts_with(b"\x93NUMPY") || input.starts_with(b"PK") {
        files::read_array_both_ways(&path);
    } else {
        files::read_all(&path, Default::default());
    }
});
