//! Pictures that the device denoises, compared with the host's filter on the picture that the renderer gives. The code is the same for all
//! backends, so one is tested; `tests/denoise.rs` runs the shader on each.

use std::time::Duration;

use glam::{DAffine3, DVec3};
use pumice_core::Job;
use pumice_picture::denoise::denoised;
use pumice_picture::film::variance_known;
use pumice_picture::{Guides, Image};
use pumice_scene::{Adaptive, Scene};
use pumice_transport::{LoadedScene, Renderer as _};
use pumice_vulkan::device::InjectedFault;

use super::Validated;
use super::edits::{balls, scene_of_balls};
use super::resolve::cancelled_midway;

/// Two instances of the balls, one before the other.
fn loaded(scene: Scene) -> LoadedScene {
    let mut scene = scene;
    let mut second = scene.instances[0].clone();
    second.id = 2;
    second.world_from_index = DAffine3::from_translation(DVec3::new(20.0, 10.0, 30.0));
    scene.instances.push(second);
    LoadedScene::new(scene, vec![balls(), balls()], vec![]).unwrap()
}

fn advance(renderer: &mut Validated, spp: u32) {
    while renderer.advance(Duration::ZERO, spp, &Job::new()).unwrap().spp < spp {}
}

/// What the host makes of the renderer's picture.
fn by_host(renderer: &mut Validated) -> Image {
    let picture = renderer.picture().unwrap();
    let guides = Guides::of(&picture).unwrap().unwrap();
    let smooth = denoised(&picture.color, picture.variance.as_ref().map(variance_known), &guides).unwrap();
    assert!(smooth != picture.color, "the filter does something");
    smooth
}

/// Bits on Mesa's software Vulkan; elsewhere as `tests/denoise.rs` says.
fn compare(renderer: &Validated, expected: &Image, got: &Image, what: &str) {
    let far = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-5 * a[c].abs());
    let far = expected.pixels.iter().zip(&got.pixels).filter(|&p| far(p)).count();
    assert!(far <= expected.pixels.len() / 500, "{what}: {far}");
    if renderer.gpu().candidate().name.contains("llvmpipe") {
        assert!(expected == got, "{what}: other bits");
    }
}

/// With one sample and with more, while the same film grows; after an edit; and where pixels rest with fewer samples than others.
#[test]
fn the_device_denoises_what_the_host_would() {
    let mut renderer = super::bare();
    for (threshold, spps) in [(None, &[1, 4, 9][..]), (Some(0.2), &[5, 9, 13])] {
        let mut scene = scene_of_balls();
        scene.settings.adaptive = threshold.map(|threshold| Adaptive { threshold, min_spp: 4 });
        renderer.set_scene(&loaded(scene.clone())).unwrap();
        for &spp in spps {
            advance(&mut renderer, spp);
            let what = format!("{threshold:?}, {spp} samples");
            let got = renderer.denoised().unwrap().expect(&what);
            let raw = renderer.color().unwrap();
            let expected = by_host(&mut renderer);
            compare(&renderer, &expected, &got, &what);
            assert!(renderer.color().unwrap() == raw, "{what}: the film is as it was");
        }
        // Other first surfaces: the guides are made anew.
        scene.camera.world_from_camera.translation.x += 40.0;
        renderer.set_scene(&loaded(scene)).unwrap();
        advance(&mut renderer, 4);
        let got = renderer.denoised().unwrap().unwrap();
        let expected = by_host(&mut renderer);
        compare(&renderer, &expected, &got, "another camera");
    }
    assert!(renderer.notices().is_empty());
}

/// A pass that was cancelled leaves pixels with different numbers of samples: what is denoised is the picture that the renderer gives.
#[test]
fn a_cancelled_pass_is_denoised_as_far_as_it_has_come() {
    let mut renderer = super::bare();
    let mut scene = scene_of_balls();
    (scene.film.width, scene.film.height) = (320, 64);
    cancelled_midway(&mut renderer, &loaded(scene));
    let got = renderer.denoised().unwrap().unwrap();
    let expected = by_host(&mut renderer);
    compare(&renderer, &expected, &got, "cancelled");
}

/// A device that fails leaves it to the host and says so once; samples stay, and a device that was lost is opened again.
#[test]
fn a_device_that_cannot_says_so_once() {
    let faults = [
        (InjectedFault::Allocation, "out of GPU memory: the denoiser's"),
        (InjectedFault::Submission, "the GPU was lost during "),
    ];
    for (fault, beginning) in faults {
        let mut renderer = super::bare();
        renderer.set_scene(&loaded(scene_of_balls())).unwrap();
        advance(&mut renderer, 4);
        let color = renderer.color().unwrap();
        renderer.gpu().inject(fault, 2, 1);
        assert!(renderer.denoised().unwrap().is_none(), "{fault:?}");
        let [notice] = &renderer.notices()[..] else { panic!("{fault:?}: one notice") };
        assert!(notice.starts_with(beginning), "{notice}");
        assert!(
            notice.ends_with("; the processor denoises from now on") && !notice.contains('\n'),
            "{notice}"
        );
        assert!(renderer.denoised().unwrap().is_none(), "{fault:?}: not tried again");
        assert_eq!(renderer.color().unwrap(), color);
        by_host(&mut renderer);
        // What is lost with the device comes back, with a notice of its own.
        let lost = fault == InjectedFault::Submission;
        assert_eq!(renderer.notices().len(), usize::from(lost));
        advance(&mut renderer, 6);
    }
}

/// The memory for denoising is counted while there is some, and freed with the scene.
#[test]
fn memory_for_denoising_is_counted() {
    let mut renderer = super::bare();
    let scene = scene_of_balls();
    let pixels = u64::from(scene.film.width * scene.film.height);
    renderer.set_scene(&loaded(scene.clone())).unwrap();
    advance(&mut renderer, 1);
    let part = |renderer: &Validated| {
        renderer.bytes().into_iter().find(|(name, _)| *name == "denoiser").map(|(_, bytes)| bytes)
    };
    assert_eq!(part(&renderer), None);
    let before = renderer.gpu().allocated_bytes();
    renderer.denoised().unwrap().unwrap();
    let held = part(&renderer).unwrap();
    // 112 bytes a pixel, and a header.
    assert!(held >= 112 * pixels && held < 112 * pixels + 256, "{held}");
    assert!(renderer.gpu().allocated_bytes() >= before + held);
    renderer.set_scene(&loaded(scene)).unwrap();
    assert_eq!(part(&renderer), None);
    assert_eq!(renderer.gpu().allocated_bytes(), before);
}
