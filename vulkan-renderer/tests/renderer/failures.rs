//! Memory that runs out and devices that are lost, at every point where they can.

use std::time::Duration;

use pumice_core::Job;
use pumice_picture::Image;
use pumice_scene::Adaptive;
use pumice_transport::{LoadedScene, RenderError, Renderer as _};
use pumice_vulkan::device::{Backend, Fault};

use super::Validated;
use super::edits::{balls, scene_of_balls};

const SPP: u32 = 4;

/// Shows the scene and draws it, `faults` being due; the picture and what was told, or the error.
fn draw(renderer: &mut Validated, faults: &[(Fault, u32)]) -> Result<(Image, Vec<String>), RenderError> {
    for &(fault, nth) in faults {
        renderer.gpu().inject(fault, nth, 1);
    }
    renderer.set_scene(&LoadedScene::new(scene_of_balls(), vec![balls()], vec![])?)?;
    while renderer.advance(Duration::ZERO, SPP, &Job::new())?.spp < SPP {}
    let picture = renderer.picture()?;
    Ok((picture.color, renderer.notices()))
}

/// The `nth` such call fails, for each nth that there is: the picture is the same, and it is told what happened.
fn overcome_everywhere(backend: Backend, fault: Fault, step: usize) -> usize {
    let mut renderer = Validated::open(backend);
    let (expected, notices) = draw(&mut renderer, &[]).unwrap();
    assert_eq!(notices, Vec::<String>::new());
    let mut failures = 0;
    for nth in (1..).step_by(step) {
        renderer.forget_scene();
        let (image, notices) = draw(&mut renderer, &[(fault, nth)]).unwrap();
        assert_eq!(image, expected, "{fault:?} {nth}");
        let [notice] = &notices[..] else {
            assert!(notices.is_empty(), "{notices:?}");
            // The fault was not met any more: all were.
            renderer.gpu().inject(fault, 0, 0);
            return failures;
        };
        let named = match fault {
            Fault::Allocation => "out of GPU memory: ",
            Fault::Submission => "the GPU was lost during ",
        };
        assert!(notice.starts_with(named) && !notice.contains('\n'), "{notice}");
        failures += 1;
    }
    failures
}

#[test]
fn memory_that_is_short_once_is_overcome() {
    for backend in Backend::ALL {
        let failures = overcome_everywhere(backend, Fault::Allocation, 1);
        assert!(failures >= 12, "{backend}: {failures}");
    }
}

/// Opening a device anew compiles anew, which takes seconds: some of the points are enough, some of them with hierarchies of the
/// device's own.
#[test]
fn a_device_that_is_lost_once_is_overcome() {
    for (backend, step) in [(Backend::RayPipeline, 17), (Backend::Compute, 9)] {
        let failures = overcome_everywhere(backend, Fault::Submission, step);
        assert!(failures >= 2, "{backend}: {failures}");
    }
}

/// Samples that the host has seen survive the device.
#[test]
fn samples_survive_a_lost_device() {
    let mut renderer = Validated::open(Backend::Compute);
    let (expected, _) = draw(&mut renderer, &[]).unwrap();
    renderer.set_scene(&LoadedScene::new(scene_of_balls(), vec![balls()], vec![]).unwrap()).unwrap();
    while renderer.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
    renderer.gpu().inject(Fault::Submission, 1, 1);
    let job = Job::new();
    while renderer.advance(Duration::ZERO, SPP, &job).unwrap().spp < SPP {}
    assert_eq!(renderer.color().unwrap(), expected);
    assert_eq!(renderer.notices().len(), 1);
    let film = scene_of_balls().film;
    let samples = job.progress().0 / u64::from(film.width * film.height);
    assert_eq!(samples, u64::from(SPP) - 2, "no sample was computed twice");
}

/// So does which pixels rest.
#[test]
fn pixels_rest_on_after_a_lost_device() {
    let mut renderer = Validated::open(Backend::Compute);
    let mut scene = scene_of_balls();
    scene.settings.adaptive = Some(Adaptive { threshold: 0.2, min_spp: 4 });
    let mut drawn = |fault: bool| {
        renderer.set_scene(&LoadedScene::new(scene.clone(), vec![balls()], vec![]).unwrap()).unwrap();
        while renderer.advance(Duration::ZERO, 5, &Job::new()).unwrap().spp < 5 {}
        if fault {
            renderer.gpu().inject(Fault::Submission, 1, 1);
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

/// Twice in a row is given up, in one line that names backend and device; afterwards the renderer can be used again.
#[test]
fn what_fails_twice_is_given_up() {
    let mut renderer = Validated::open(Backend::Compute);
    let (expected, _) = draw(&mut renderer, &[]).unwrap();
    renderer.forget_scene();
    renderer.gpu().inject(Fault::Allocation, 2, 2);
    let error =
        renderer.set_scene(&LoadedScene::new(scene_of_balls(), vec![balls()], vec![]).unwrap()).unwrap_err();
    let RenderError::Device(text) = &error else { panic!("{error}") };
    assert!(text.starts_with("vulkan-compute on ") && text.contains("out of GPU memory"), "{text}");
    assert!(!text.contains('\n'));
    assert!(matches!(renderer.advance(Duration::ZERO, 1, &Job::new()), Err(RenderError::Scene(_))));
    assert_eq!(draw(&mut renderer, &[]).unwrap().0, expected);
}
