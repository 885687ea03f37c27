//! A scene file. What is accepted must come back from its own JSON form the same.
#![no_main]

use pumice_fuzz::seeds;
use pumice_scene::Scene;

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::scenes), |input: &[u8]| {
    let Ok(text) = std::str::from_utf8(input) else { return };
    match Scene::from_json(text) {
        Ok(scene) => {
            let text = scene.to_json().expect("what was accepted has a JSON form");
            let again = Scene::from_json(&text).expect("what was written is accepted");
            assert_eq!(again, scene);
        }
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains('\n'), "more than a line: {text}");
        }
    }
});
