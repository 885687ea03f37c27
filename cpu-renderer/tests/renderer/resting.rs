//! Resting pixels as a renderer's users see them. `super::renderer()` returns the renderer under test.

use std::time::Duration;

use glam::DVec3;
use pumice_core::Job;
use pumice_picture::{Pass, Passes};
use pumice_scene::{Adaptive, Environment, Scene, Settings, Sun};
use pumice_transport::{LoadedScene, Progress, Renderer as _};

use super::floor::{lambert, looking_down, volume};

const RULE: Adaptive = Adaptive { threshold: 0.05, min_spp: 8 };
const MOST: u32 = 200;

/// The floor under a uniform sky, the tower and its shadow: flat parts are free of noise, edges are noisy.
fn scene() -> Scene {
    let sun = Sun { direction: [-0.6, 0.2, -0.8], strength: 3.0, color: [1.0, 0.8, 0.6], angle_rad: 0.2 };
    let mut scene = looking_down(Environment::Constant { radiance: [0.3; 3] }, vec![sun], lambert(0.7));
    scene.camera.world_from_camera.translation = DVec3::new(9.0, 9.0, 20.0);
    scene.camera.projection = pumice_scene::Projection::Orthographic { scale: 14.0 };
    scene.settings = Settings { bounces: 1, adaptive: Some(RULE), ..Settings::default() };
    scene.film.passes = [Pass::Samples, Pass::DiffuseDirect].into_iter().collect::<Passes>();
    scene
}

/// Draws until all pixels rest or there are enough samples (a macro, because the result of `super::renderer()` need not be a renderer
/// itself).
macro_rules! draw {
    ($renderer:expr, $slice:expr, $most:expr) => {
        loop {
            let progress: Progress = $renderer.advance($slice, $most, &Job::new()).unwrap();
            if progress.all_rest || progress.spp >= $most {
                break (progress, $renderer.picture().unwrap());
            }
        }
    };
}

#[test]
fn a_pixel_that_rests_is_that_of_an_even_picture_with_its_samples() {
    let mut renderer = super::renderer();
    renderer.set_scene(&LoadedScene::new(scene(), vec![volume()], vec![]).unwrap()).unwrap();
    let (progress, rested) = draw!(renderer, Duration::from_millis(30), MOST);
    let counts = rested.samples.clone().unwrap();
    let mut kinds: Vec<u32> = counts.iter().map(|&n| n as u32).collect();
    assert!((progress.mean_spp - kinds.iter().map(|&n| f64::from(n)).sum::<f64>() / 64.0).abs() < 1e-9);
    kinds.sort_unstable();
    kinds.dedup();
    println!("samples of pixels: {kinds:?}, mean {:.1}", progress.mean_spp);
    assert!(kinds.len() >= 3 && kinds[0] == RULE.min_spp, "{kinds:?}");

    // The same number of samples for all pixels: those that came to rest at that number are the same, in colour and pass.
    let mut even = scene();
    even.settings.adaptive = None;
    for &n in &kinds {
        renderer.set_scene(&LoadedScene::new(even.clone(), vec![volume()], vec![]).unwrap()).unwrap();
        let (progress, picture) = draw!(renderer, Duration::from_millis(30), n);
        assert_eq!((progress.spp, progress.mean_spp, progress.all_rest), (n, f64::from(n), false));
        assert!(picture.samples.unwrap().iter().all(|&s| s == n as f32));
        let mut others = 0;
        for (i, &count) in counts.iter().enumerate() {
            let same = picture.color.pixels[i] == rested.color.pixels[i]
                && picture.light[0].1.pixels[i] == rested.light[0].1.pixels[i];
            assert!(same || count as u32 != n, "pixel {i} with {n} samples");
            others += u32::from(!same);
        }
        assert!(others > 0, "pixels with other counts differ");
    }

    // However the work is divided into slices.
    renderer.set_scene(&LoadedScene::new(scene(), vec![volume()], vec![]).unwrap()).unwrap();
    let (_, again) = draw!(renderer, Duration::ZERO, MOST);
    assert_eq!((again.color.pixels, again.samples), (rested.color.pixels, rested.samples));
}

#[test]
fn a_picture_without_noise_is_done_at_the_first_look() {
    let mut renderer = super::renderer();
    let mut still = scene();
    still.suns[0].angle_rad = 0.0;
    still.settings.mode = pumice_scene::Mode::OneBounce;
    still.world.environment = Environment::Constant { radiance: [0.0; 3] };
    still.camera.world_from_camera.translation = DVec3::new(3.0, 3.0, 20.0);
    still.camera.projection = pumice_scene::Projection::Orthographic { scale: 3.0 };
    // Six is no multiple of the number of classes: eight.
    still.settings.adaptive = Some(Adaptive { threshold: 1e-3, min_spp: 6 });
    renderer.set_scene(&LoadedScene::new(still.clone(), vec![volume()], vec![]).unwrap()).unwrap();
    let (progress, _) = draw!(renderer, Duration::from_millis(30), MOST);
    assert_eq!((progress.spp, progress.all_rest), (8, true));
    // Continuing changes nothing and ends at once.
    let more = renderer.advance(Duration::from_secs(3600), MOST, &Job::new()).unwrap();
    assert_eq!((more.spp, more.all_rest), (8, true));
}
