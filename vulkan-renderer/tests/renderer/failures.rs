//! Memory that runs out and devices that are lost, at every call where that can happen. `super::bare()` makes the renderer that is tested:
//! a device that is opened again compiles again, so it should compile as little as possible.

use std::time::Duration;

use pumice_core::Job;
use pumice_picture::Image;
use pumice_scene::Scene;
use pumice_transport::{LoadedScene, RenderError, Renderer as _};
use pumice_vulkan::device::InjectedFault;

use super::Validated;
use super::edits::{balls, scene_of_balls};

pub(super) const SPP: u32 = 4;

/// The balls on few pixels, since they are drawn once for each call that may fail.
pub(super) fn small_scene() -> Scene {
    let mut scene = scene_of_balls();
    (scene.film.width, scene.film.height) = (24, 10);
    scene
}

/// Shows the scene and renders it with injected `faults`. Returns the picture with the notices, or the error.
pub(super) fn draw(
    renderer: &mut Validated,
    faults: &[(InjectedFault, u32)],
) -> Result<(Image, Vec<String>), RenderError> {
    for &(fault, nth) in faults {
        renderer.gpu().inject(fault, nth, 1);
    }
    renderer.set_scene(&LoadedScene::new(small_scene(), vec![balls()], vec![]).unwrap())?;
    while renderer.advance(Duration::ZERO, SPP, &Job::new())?.spp < SPP {}
    let picture = renderer.picture()?;
    Ok((picture.color, renderer.notices()))
}

/// Makes the `nth` such call fail, for every n that occurs. The picture must be the same each time, and a notice must say what happened.
pub(super) fn overcome_everywhere(fault: InjectedFault, step: usize) -> usize {
    let mut renderer = super::bare();
    let (expected, notices) = draw(&mut renderer, &[]).unwrap();
    assert_eq!(notices, Vec::<String>::new());
    let mut failures = 0;
    for nth in (1..).step_by(step) {
        renderer.forget_scene();
        let (image, notices) = draw(&mut renderer, &[(fault, nth)]).unwrap();
        assert_eq!(image, expected, "{fault:?} {nth}");
        let [notice] = &notices[..] else {
            assert!(notices.is_empty(), "{notices:?}");
            // The fault was not reached any more, so all calls have been tested.
            renderer.gpu().inject(fault, 0, 0);
            return failures;
        };
        let named = match fault {
            InjectedFault::Allocation => "out of GPU memory: ",
            InjectedFault::Submission | InjectedFault::Hang => "the GPU was lost during ",
        };
        assert!(notice.starts_with(named) && !notice.contains('\n'), "{notice}");
        failures += 1;
    }
    failures
}

#[test]
fn memory_that_is_short_once_is_overcome() {
    let failures = overcome_everywhere(InjectedFault::Allocation, 1);
    assert!(failures >= 12, "{failures}");
}

#[test]
#[ignore = "full: each opening of the device compiles all shaders again, which takes seconds"]
fn a_device_that_is_lost_once_is_overcome_at_many_points() {
    let failures = overcome_everywhere(InjectedFault::Submission, 5);
    assert!(failures >= 4, "{failures}");
}
