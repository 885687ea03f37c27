//! What comes back from the device for each frame. The code is the same for all backends, so one is tested; `tests/resolve.rs` compares the
//! shader with the host's film on each.

use std::sync::Arc;
use std::time::Duration;

use pumice_core::Job;
use pumice_picture::Image;
use pumice_picture::film::{CLASSES, STRIDE, STRIP_ROWS};
use pumice_scene::{Film, Filter, Scene};
use pumice_transport::{LoadedScene, RenderError, Renderer as _};
use pumice_vulkan::device::InjectedFault;

use super::Validated;
use super::edits::{balls, scene_of_balls};

fn show(renderer: &mut Validated, scene: &Scene) {
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![balls()], vec![]).unwrap()).unwrap();
}

fn advance(renderer: &mut Validated, spp: u32) -> pumice_transport::Progress {
    loop {
        let progress = renderer.advance(Duration::ZERO, spp, &Job::new()).unwrap();
        if progress.spp >= spp {
            return progress;
        }
    }
}

/// Colours are 12 bytes a pixel; the estimate of the error is 8 for each strip once there are enough samples. Only a picture with its passes
/// reads the sums. Whoever is asked, device or host, answers with the same bits.
#[test]
fn a_frame_reads_what_it_shows() {
    let mut renderer = super::bare();
    let scene = scene_of_balls();
    let pixels = u64::from(scene.film.width * scene.film.height);
    let strips = u64::from(scene.film.width * scene.film.height.div_ceil(STRIP_ROWS as u32));
    // The first launch compiles on a driver that computes on the CPU, which counts as time of samples; the picture is read then.
    show(&mut renderer, &scene);
    advance(&mut renderer, 1);
    show(&mut renderer, &scene);
    for spp in [1, 2, 4, 5] {
        let before = renderer.gpu().downloaded_bytes();
        let progress = advance(&mut renderer, spp);
        let color = renderer.color().unwrap();
        assert_eq!(renderer.alpha().unwrap(), None);
        let read = renderer.gpu().downloaded_bytes() - before;
        assert_eq!(progress.error_estimate.is_finite(), spp >= CLASSES);
        let of_error = if spp >= CLASSES { 8 * strips } else { 0 };
        assert_eq!(read, 12 * pixels + of_error, "{spp}");

        let before = renderer.gpu().downloaded_bytes();
        let picture = renderer.picture().unwrap();
        let read = renderer.gpu().downloaded_bytes() - before;
        assert!(read >= pixels * 4 * STRIDE as u64, "{read}");
        // Now the host has all sums and answers.
        let before = renderer.gpu().downloaded_bytes();
        assert!(picture.color == color && renderer.color().unwrap() == color, "{spp}");
        assert_eq!(renderer.advance(Duration::ZERO, spp, &Job::new()).unwrap(), progress);
        assert_eq!(renderer.gpu().downloaded_bytes(), before, "{spp}: nothing more is read");
    }
}

/// Draws to 4 samples, then on towards 20 until about half of these have come, and cancels. Returns the picture before.
pub(super) fn cancelled_midway(renderer: &mut Validated, scene: &LoadedScene) -> Image {
    const MORE: u32 = 16;
    renderer.set_scene(scene).unwrap();
    advance(renderer, 4);
    let before = renderer.color().unwrap();
    let film = &scene.scene().film;
    let half = u64::from(film.width * film.height * MORE / 2);
    let job = Arc::new(Job::new());
    let midway = {
        let job = Arc::clone(&job);
        std::thread::spawn(move || {
            while job.progress().0 < half {
                std::thread::yield_now();
            }
            job.cancel();
        })
    };
    let cancelled = renderer.advance(Duration::from_secs(60), 4 + MORE, &job);
    midway.join().unwrap();
    assert!(matches!(cancelled, Err(RenderError::Cancelled)), "{cancelled:?}");
    before
}

/// A pass that was cancelled counts as far as it has come: each pixel is the mean of its own samples, and the pass goes on from there.
#[test]
fn a_cancelled_pass_is_shown_as_far_as_it_has_come() {
    let mut scene = scene_of_balls();
    scene.film = Film::new(320, 64, Filter::Box { width: 1.0 });
    let loaded = LoadedScene::new(scene, vec![balls()], vec![]).unwrap();
    let mut renderer = super::bare();
    let before = cancelled_midway(&mut renderer, &loaded);
    let progress = renderer.advance(Duration::ZERO, 0, &Job::new()).unwrap();
    assert!((4..20).contains(&progress.spp) && progress.error_estimate.is_finite(), "{progress:?}");
    let mixed = renderer.color().unwrap();
    assert!(mixed != before && renderer.picture().unwrap().color == mixed);
    advance(&mut renderer, 20);
    let after = renderer.color().unwrap();
    // Sums divided by the samples of other pixels would be off by a quarter at least.
    let mean = |image: &Image| image.pixels.iter().flatten().map(|&v| f64::from(v)).sum::<f64>();
    assert!((mean(&mixed) / mean(&after) - 1.0).abs() < 0.02, "{} {}", mean(&mixed), mean(&after));
    renderer.set_scene(&loaded).unwrap();
    advance(&mut renderer, 20);
    assert!(renderer.color().unwrap() == after, "as if nobody had cancelled");
}

/// A device that is lost while it resolves is opened again, and the samples that went with it are drawn again.
#[test]
fn a_frame_survives_a_lost_device() {
    let mut renderer = super::bare();
    let scene = scene_of_balls();
    show(&mut renderer, &scene);
    advance(&mut renderer, 3);
    let expected = renderer.color().unwrap();
    renderer.gpu().inject(InjectedFault::Submission, 2, 1);
    assert!(renderer.color().unwrap() == expected);
    let [notice] = &renderer.notices()[..] else { panic!("one notice") };
    assert!(notice.contains("opening the device again") && !notice.contains('\n'), "{notice}");
    assert_eq!(advance(&mut renderer, 4).spp, 4);
    // Once more right after that is given up, in one line.
    renderer.forget_scene();
    show(&mut renderer, &scene);
    advance(&mut renderer, 1);
    renderer.gpu().inject(InjectedFault::Allocation, 1, 2);
    let error = renderer.color().unwrap_err();
    assert!(matches!(&error, RenderError::Device(text) if text.contains("out of GPU memory")), "{error}");
}
