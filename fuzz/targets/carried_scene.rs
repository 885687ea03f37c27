//! Fuzzes what `--again` does with a picture: reads the text that a PNG or EXR carries, inflates it, makes a scene of it, checks the scene
//! and whether there is memory for its film. An accepted scene must be the same after writing it as JSON and reading it again.
#![no_main]

use pumice_fuzz::{carriers, scratch, seeds};
use pumice_picture::{PassSums, film_memory, read_provenance};
use pumice_scene::Scene;

fn one_line(error: &impl std::fmt::Display) {
    let text = error.to_string();
    assert!(!text.contains('\n'), "expected an error of one line, got: {text}");
}

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::carried_scenes), |input: &[u8]| {
    let path = scratch::path(".png");
    if !carriers::put(&path, input) {
        return;
    }
    let scene = match read_provenance(&path) {
        Ok(None) => return,
        Ok(Some(made)) => made.scene,
        Err(error) => return one_line(&error),
    };
    if let Err(error) = scene.validate() {
        return one_line(&error);
    }
    let catches = scene.meshes.iter().any(|mesh| mesh.shadow_catcher);
    let kept = PassSums::of(&scene.film, catches);
    if let Err(error) = film_memory::check(&scene.film, kept, scene.settings.adaptive, 0) {
        one_line(&error);
    }
    let text = scene.to_json().expect("an accepted scene can be written as JSON");
    assert_eq!(Scene::from_json(&text).expect("a written scene can be read"), scene);
});
