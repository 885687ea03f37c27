//! Fuzzes the reader of EXR pictures, and the reader of provenance from EXR or PNG.
#![no_main]

use pumice_fuzz::{scratch, seeds};
use pumice_picture::{PictureError, read_exr, read_provenance};

fn init() {
    // Replaces libFuzzer's panic hook, which would end the process, because the reader turns panics of the EXR library into errors. Other
    // panics, also in this target, are printed, and count as failures if they leave the reader.
    std::panic::set_hook(Box::new(|info| {
        if info.location().is_none_or(|at| !at.file().contains("/registry/")) {
            eprintln!("{info}");
        }
    }));
    seeds::give(seeds::pictures);
}

fn one_line(error: &PictureError) {
    let text = error.to_string();
    assert!(!text.contains('\n'), "expected an error of one line, got: {text}");
}

libfuzzer_sys::fuzz_target!(init: init(), |input: &[u8]| {
    let path = scratch::path(if input.starts_with(b"\x89PNG") { ".png" } else { ".exr" });
    scratch::put(&path, input);
    match read_exr(&path) {
        Ok(picture) => {
            let pixels = picture.color.width * picture.color.height;
            assert_eq!(picture.color.pixels.len(), pixels);
            assert!(picture.depth.is_none_or(|d| d.len() == pixels));
            assert!(picture.label.is_none_or(|l| l.len() == pixels));
        }
        Err(error) => one_line(&error),
    }
    if let Err(error) = read_provenance(&path) {
        one_line(&error);
    }
});
