//! Fuzzes what is read from a server (`fuzz/src/server.rs`): redirects, lengths that lie, parts, coded content.
#![no_main]

use pumice_fuzz::{seeds, server};

libfuzzer_sys::fuzz_target!(init: seeds::give(server::seeds), |input: &[u8]| {
    server::outcome(input);
});
