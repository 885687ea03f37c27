//! Fuzzes the reader of scene files. An accepted scene must be the same after writing it as JSON and reading it again.
#![no_main]

use pumice_fuzz::seeds;
use pumice_scene::Scene;

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::scenes), |input: &[u8]| {
    let Ok(text) = std::str::from_utf8(input) else { return };
    match Scene::from_json(text) {
        Ok(scene) => {
            let text = scene.to_json().expect("an accepted scene can be written as JSON");
            let again = Scene::from_json(&text).expect("a written scene can be read");
            assert_eq!(again, scene);
        }
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains('\n'), "expected an error of one line, got: {text}");
        }
    }
});
