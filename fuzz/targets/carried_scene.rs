//! Fuzzes what `--again` does with a picture (`fuzz/src/carried_scene.rs`).
#![no_main]

use pumice_fuzz::{carried_scene, scratch, seeds};

libfuzzer_sys::fuzz_target!(init: seeds::give(|| carried_scene::seeds(seeds::SCENE)), |input: &[u8]| {
    carried_scene::outcome(&scratch::path(".png"), input);
});
