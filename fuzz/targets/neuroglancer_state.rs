//! Fuzzes the reader of Neuroglancer's states, JSON or links. What is accepted becomes a scene of a small volume, the same after writing it as
//! JSON and reading it again, or is refused by one line.
#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use pumice_core::{CompressionLevel, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_formats::OpenOptions;
use pumice_fuzz::{scratch, seeds};
use pumice_scene::Scene;
use pumice_session::Residence;
use pumice_session::neuroglancer::{State, open_state};

static VOLUME: LazyLock<PathBuf> = LazyLock::new(|| {
    let path = scratch::path(".pumice");
    let labels = LabelBuffer::U8(vec![1, 2, 3, 4, 5, 6, 7, 0]);
    let volume = compress_labels(VolumeInfo::new([2; 3], LabelType::U8), labels).unwrap();
    volume.save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    path
});

fn in_one_line(text: &str) {
    assert!(!text.contains('\n'), "expected an error of one line, got: {text}");
}

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::neuroglancer_states), |input: &[u8]| {
    let Ok(text) = std::str::from_utf8(input) else { return };
    let state = match State::parse(text) {
        Ok(state) => state,
        Err(error) => return in_one_line(&error),
    };
    let here = Path::new("/nowhere");
    let layers = match state.sources(here) {
        Ok(layers) => layers,
        Err(error) => return in_one_line(&error.to_string()),
    };
    let copies: Vec<(String, PathBuf)> = layers.into_iter().map(|(name, _)| (name, VOLUME.clone())).collect();
    let reading = OpenOptions::default();
    match open_state(&state, &copies, (here, [4, 3]), (&reading, Residence::Copied), &Job::new()) {
        // (Numbers may be beyond what a scene takes.)
        Ok(opened) => match opened.scene.to_json().and_then(|json| Scene::from_json(&json)) {
            Ok(scene) => assert_eq!(scene, opened.scene),
            Err(error) => in_one_line(&error.to_string()),
        },
        Err(error) => in_one_line(&error.to_string()),
    }
});
