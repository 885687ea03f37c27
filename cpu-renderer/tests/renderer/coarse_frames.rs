//! Coarse frames: first samples of some pixels, which stay in the film.

use std::time::Duration;

use glam::DVec3;
use pumice_core::Job;
use pumice_picture::{CoarsePixels, Pass, Picture};
use pumice_scene::{Adaptive, Environment, Projection, Scene, Sun};
use pumice_transport::{LoadedScene, RenderError, Renderer as _};

use super::catchers::{floor, loaded, plate, scene_of, sun};
use super::floor::{lambert, looking_down, volume};

const FILM: [u32; 2] = [50, 31];
const FRAMES: [[u32; 2]; 4] = [[7, 4], [13, 8], [25, 16], [50, 31]];

/// Half floor, half sky, seen through wide pixels that blend both.
fn scene(transparent: bool) -> Scene {
    let sun = Sun { direction: [-0.6, 0.2, -0.8], strength: 3.0, color: [1.0, 0.8, 0.6], angle_rad: 0.2 };
    let mut scene = looking_down(Environment::Constant { radiance: [0.3; 3] }, vec![sun], lambert(0.7));
    scene.camera.world_from_camera.translation = DVec3::new(9.0, 9.0, 20.0);
    scene.camera.projection = Projection::Orthographic { scale: 30.0 };
    scene.film =
        pumice_scene::Film { transparent, ..pumice_scene::Film::new(FILM[0], FILM[1], scene.film.filter) };
    scene
}

/// A scene with shadow catchers.
fn catching() -> LoadedScene {
    let (mut scene, meshes) = scene_of(&[floor(), plate(1.0)], 0.3);
    scene.suns = vec![sun()];
    scene.settings.bounces = 2;
    (scene.film.width, scene.film.height) = (FILM[0], FILM[1]);
    loaded(&scene, &meshes)
}

fn scenes() -> [(&'static str, LoadedScene); 5] {
    let load = |scene: Scene| LoadedScene::new(scene, vec![volume()], vec![]).unwrap();
    let mut with_passes = scene(true);
    with_passes.film.passes = [Pass::DiffuseDirect, Pass::Samples].into_iter().collect();
    let mut resting = scene(false);
    resting.settings.adaptive = Some(Adaptive { threshold: 0.2, min_spp: 4 });
    [
        ("opaque", load(scene(false))),
        ("transparent", load(scene(true))),
        ("passes", load(with_passes)),
        ("adaptive", load(resting)),
        ("catcher", catching()),
    ]
}

/// The picture of so many samples, without coarse frames.
fn plain(scene: &LoadedScene, spp: u32) -> (Picture, Option<Vec<f32>>) {
    let mut renderer = super::renderer();
    renderer.set_scene(scene).unwrap();
    renderer.advance(Duration::from_secs(60), spp, &Job::new()).unwrap();
    let alpha = renderer.alpha().unwrap();
    (renderer.picture().unwrap(), alpha)
}

/// A coarse frame shows first samples of the film's pixels to the bit, and guides that fit it.
#[test]
fn each_pixel_of_a_coarse_frame_is_a_first_sample() {
    for (name, scene) in scenes() {
        let (picture, alpha) = plain(&scene, 1);
        let mut renderer = super::renderer();
        renderer.set_scene(&scene).unwrap();
        assert!(renderer.has_coarse_frames());
        for size in FRAMES {
            let frame = renderer.coarse_frame(size, true, &Job::new()).unwrap().unwrap();
            assert_eq!([frame.color.width as u32, frame.color.height as u32], size);
            let pixels = CoarsePixels::new(FILM, size);
            assert!(frame.guides.unwrap().fit(&frame.color), "{name}");
            assert_eq!(frame.alpha.is_some(), alpha.is_some(), "{name}");
            for (number, color) in frame.color.pixels.iter().enumerate() {
                let [x, y] = pixels.pixel(number as u32 % size[0], number as u32 / size[0]);
                let of = (y * FILM[0] + x) as usize;
                assert_eq!(*color, picture.color.pixels[of], "{name}, {size:?}: {x} {y}");
                let shown = frame.alpha.as_ref().map(|alpha| alpha[number]);
                assert_eq!(shown, alpha.as_ref().map(|alpha| alpha[of]), "{name}, {size:?}: {x} {y}");
            }
        }
        let unguided = renderer.coarse_frame(FRAMES[0], false, &Job::new()).unwrap().unwrap();
        assert!(unguided.guides.is_none());
    }
}

/// What coarse frames have sampled is not sampled again, and the picture is that without them, to the bit and in all passes.
#[test]
fn samples_of_coarse_frames_stay_in_the_picture() {
    for (name, scene) in scenes() {
        for spp in [1, 2, 3, 9] {
            let (expected, alpha) = plain(&scene, spp);
            let mut renderer = super::renderer();
            renderer.set_scene(&scene).unwrap();
            let sampled = Job::new();
            for size in &FRAMES[..3] {
                renderer.coarse_frame(*size, false, &sampled).unwrap().unwrap();
            }
            let made = renderer.advance(Duration::from_secs(60), spp, &Job::new()).unwrap();
            assert!(made.spp == spp || made.all_rest, "{name}");
            assert_eq!(renderer.alpha().unwrap(), alpha, "{name}, {spp}");
            assert_eq!(renderer.picture().unwrap(), expected, "{name}, {spp}");
            // Whole passes have begun.
            assert!(renderer.coarse_frame(FRAMES[0], false, &Job::new()).unwrap().is_none());
            // A new scene on the same film begins anew.
            renderer.set_scene(&scene).unwrap();
            assert!(renderer.coarse_frame(FRAMES[0], false, &Job::new()).unwrap().is_some());
        }
    }
}

/// Negative control of the two above: the samples of a coarse frame are those that the film has then.
#[test]
fn a_film_has_the_samples_of_its_coarse_frames_alone() {
    let (_, scene) = &scenes()[0];
    let mut renderer = super::renderer();
    renderer.set_scene(scene).unwrap();
    renderer.coarse_frame(FRAMES[1], false, &Job::new()).unwrap();
    let color = renderer.color().unwrap();
    let pixels = CoarsePixels::new(FILM, FRAMES[1]);
    let shown: std::collections::BTreeSet<_> =
        pixels.rows().flat_map(|y| pixels.columns().map(move |x| [x, y])).collect();
    let (picture, _) = plain(scene, 1);
    for (i, pixel) in color.pixels.iter().enumerate() {
        let at = [i as u32 % FILM[0], i as u32 / FILM[0]];
        let expected = if shown.contains(&at) { picture.color.pixels[i] } else { [0.0; 3] };
        assert_eq!(*pixel, expected, "{at:?}");
    }
    // Each pixel lets something be seen, so that black means no sample.
    assert!(picture.color.pixels.iter().all(|p| p[0] > 0.0));
}

#[test]
fn a_cancelled_coarse_frame_is_continued() {
    let (_, scene) = &scenes()[1];
    let mut renderer = super::renderer();
    renderer.set_scene(scene).unwrap();
    let cancelled = Job::new();
    cancelled.cancel();
    let refused = renderer.coarse_frame(FRAMES[2], true, &cancelled);
    assert!(matches!(refused, Err(RenderError::Cancelled)), "{refused:?}");
    let refused = renderer.guides(&cancelled);
    assert!(matches!(refused, Err(RenderError::Cancelled)), "{refused:?}");
    assert!(renderer.guides(&Job::new()).unwrap().is_some());
    assert!(renderer.coarse_frame(FRAMES[2], true, &Job::new()).unwrap().is_some());
    renderer.advance(Duration::from_secs(60), 3, &Job::new()).unwrap();
    assert_eq!(renderer.picture().unwrap(), plain(scene, 3).0);
    let without = super::renderer().coarse_frame(FRAMES[0], false, &Job::new());
    assert!(matches!(without, Err(RenderError::Scene(_))), "{without:?}");
}
