//! What `--again` does with a picture: reads the text that a PNG or EXR carries, inflates it, makes a scene of it, checks the scene and
//! whether there is memory for its film. The fuzz target `carried_scene` and an ordinary test (`tests/tests/carried_scenes.rs`) run this.

use std::path::Path;

use pumice_picture::{Annotations, PassSums, Passes, Provenance, film_memory, read_provenance};
use pumice_scene::Scene;

use crate::carriers;

/// What becomes of an input.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It stands for no picture.
    NoPicture,
    /// The picture carries no scene.
    NoScene,
    /// The picture, its scene, or a scene of that size is refused, by this line.
    Refused(String),
    /// The scene is accepted.
    Accepted(Box<Scene>),
}

/// Reads the picture that an input stands for, by way of a file.
///
/// # Panics
/// Where an error is not one line, or an accepted scene is another after it was written as JSON and read again: findings.
pub fn outcome(path: &Path, input: &[u8]) -> Outcome {
    if !carriers::put(path, input) {
        return Outcome::NoPicture;
    }
    let scene = match read_provenance(path) {
        Ok(None) => return Outcome::NoScene,
        Ok(Some(made)) => made.scene,
        Err(error) => return refused(&error),
    };
    if let Err(error) = scene.validate() {
        return refused(&error);
    }
    let text = scene.to_json().expect("an accepted scene can be written as JSON");
    assert_eq!(Scene::from_json(&text).expect("a written scene can be read"), scene);
    let catches = scene.meshes.iter().any(|mesh| mesh.shadow_catcher);
    let kept = PassSums::of(&scene.film, catches);
    match film_memory::check(&scene.film, kept, scene.settings.adaptive, 0) {
        Err(error) => refused(&error),
        Ok(()) => Outcome::Accepted(Box::new(scene)),
    }
}

fn refused(error: &impl std::fmt::Display) -> Outcome {
    let text = error.to_string();
    assert!(!text.contains('\n'), "expected an error of one line, got: {text}");
    Outcome::Refused(text)
}

/// Inputs: how a picture carries the text, then the text. Besides Pumice's own: the largest film, and texts that are much longer inflated
/// than deflated.
///
/// # Panics
/// When `scene` is none.
pub fn seeds(scene: &str) -> Vec<Vec<u8>> {
    let provenance = Provenance {
        version: "0.1.0".into(),
        backend: "cpu".into(),
        scene: Scene::from_json(scene).unwrap(),
        volume_hashes: vec!["0123456789abcdef0123456789abcdef".into()],
        label_hashes: Vec::new(),
        mesh_hashes: Vec::new(),
        sky_hash: None,
        spp: 64,
        error_estimate: Some(0.01),
        denoised: None,
        annotations: Annotations { dpi: Some(300.0), ..Annotations::default() },
    };
    let mut huge = provenance.clone();
    (huge.scene.film.width, huge.scene.film.height, huge.scene.film.passes) = (65_536, 16_384, Passes::ALL);
    let texts = [&provenance, &huge].map(|p| serde_json::to_vec(p).unwrap());
    let long = [vec![b' '; 4000], texts[0].clone()].concat();
    let mut seeds = Vec::new();
    for text in [&texts[0], &texts[1], &long] {
        for carrier in 0..carriers::COUNT {
            seeds.push([&[carrier, 0][..], text].concat());
        }
    }
    // The second byte repeats the text's first byte, 2¹⁹ times a count.
    seeds.push([&[1, 200][..], b" ", texts[0].as_slice()].concat());
    seeds
}
