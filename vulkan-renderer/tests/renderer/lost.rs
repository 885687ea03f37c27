//! What is restored after the device was lost. The code is the same for all backends, so one is tested (each opening compiles again).

use std::time::Duration;

use pumice_core::Job;
use pumice_scene::Adaptive;
use pumice_transport::{LoadedScene, RenderError, Renderer as _};
use pumice_vulkan::device::InjectedFault;

use super::edits::{balls, scene_of_balls};
use super::failures::{SPP, draw, small_scene};

/// Samples that the host has read survive the loss of the device; others are drawn again.
#[test]
fn samples_survive_a_lost_device() {
    let mut renderer = super::bare();
    let (expected, _) = draw(&mut renderer, &[]).unwrap();
    for is_read in [true, false] {
        renderer.set_scene(&LoadedScene::new(small_scene(), vec![balls()], vec![]).unwrap()).unwrap();
        while renderer.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
        if is_read {
            renderer.picture().unwrap();
        }
        renderer.gpu().inject(InjectedFault::Submission, 1, 1);
        let job = Job::new();
        while renderer.advance(Duration::ZERO, SPP, &job).unwrap().spp < SPP {}
        assert_eq!(renderer.color().unwrap(), expected);
        assert_eq!(renderer.notices().len(), 1);
        let film = small_scene().film;
        let samples = job.progress().0 / u64::from(film.width * film.height);
        assert_eq!(samples, u64::from(SPP) - if is_read { 2 } else { 0 }, "samples drawn since");
    }
}

/// So does the knowledge which pixels rest.
#[test]
fn pixels_rest_on_after_a_lost_device() {
    let mut renderer = super::bare();
    let mut scene = scene_of_balls();
    scene.settings.adaptive = Some(Adaptive { threshold: 0.2, min_spp: 4 });
    let mut drawn = |fault: bool| {
        renderer.set_scene(&LoadedScene::new(scene.clone(), vec![balls()], vec![]).unwrap()).unwrap();
        while renderer.advance(Duration::ZERO, 5, &Job::new()).unwrap().spp < 5 {}
        if fault {
            renderer.gpu().inject(InjectedFault::Submission, 1, 1);
        }
        let mut progress = renderer.advance(Duration::ZERO, 9, &Job::new()).unwrap();
        while progress.spp < 9 {
            progress = renderer.advance(Duration::ZERO, 9, &Job::new()).unwrap();
        }
        (renderer.color().unwrap(), progress.mean_spp, renderer.notices().len())
    };
    let (expected, mean_spp, _) = drawn(false);
    assert!(mean_spp > 4.0 && mean_spp < 9.0, "some rest: {mean_spp}");
    let (color, again, notices) = drawn(true);
    assert!(color == expected, "other colours");
    assert_eq!((again, notices), (mean_spp, 1));
}

/// A second failure in a row is an error, in one line that names backend and device. Afterwards the renderer can be used again.
#[test]
fn what_fails_twice_is_given_up() {
    let mut renderer = super::bare();
    let (expected, _) = draw(&mut renderer, &[]).unwrap();
    renderer.forget_scene();
    renderer.gpu().inject(InjectedFault::Allocation, 2, 2);
    let error =
        renderer.set_scene(&LoadedScene::new(small_scene(), vec![balls()], vec![]).unwrap()).unwrap_err();
    let RenderError::Device(text) = &error else { panic!("{error}") };
    assert!(text.starts_with("vulkan-compute on ") && text.contains("out of GPU memory"), "{text}");
    assert!(!text.contains('\n'));
    assert!(matches!(renderer.advance(Duration::ZERO, 1, &Job::new()), Err(RenderError::Scene(_))));
    assert_eq!(draw(&mut renderer, &[]).unwrap().0, expected);
}

/// The device is lost while the scene is sent, and while it is rendered. The full set (`failures.rs`) tests every call where it can be
/// lost.
#[test]
fn a_device_that_is_lost_once_is_overcome() {
    let mut renderer = super::bare();
    let (expected, _) = draw(&mut renderer, &[]).unwrap();
    renderer.forget_scene();
    let (image, notices) = draw(&mut renderer, &[(InjectedFault::Submission, 3)]).unwrap();
    assert_eq!(image, expected);
    let [notice] = &notices[..] else { panic!("{notices:?}") };
    assert!(notice.starts_with("the GPU was lost during ") && !notice.contains('\n'), "{notice}");
}
