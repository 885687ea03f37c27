//! Parts that are built and compiled although the scene does not need them. `super::renderer()` returns the renderer under test, and
//! `super::besides()` the sets of such parts.

use std::time::Duration;

use glam::DVec3;
use pumice_core::Job;
use pumice_scene::{Environment, Film, Filter, PartSet, Projection, Scene, Show};
use pumice_transport::{LoadedScene, Renderer as _};

use super::floor::{lambert, looking_down, volume};

/// Whatever is built in addition to the scene's needs, the picture stays the same. The tower is hidden and would be in the way if it were
/// not; beside the floor a ray hits nothing.
#[test]
fn what_is_built_besides_changes_no_picture() {
    let mut scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.8));
    scene.instances[0].style.show = Show::Only(vec![5]);
    scene.camera.world_from_camera.translation = DVec3::new(12.0, 12.0, 20.0);
    scene.camera.projection = Projection::Orthographic { scale: 12.0 };
    scene.film = Film::new(24, 24, Filter::Box { width: 1.0 });
    let mut renderer = super::renderer();
    let mut draw = |besides: PartSet, scene: &Scene| {
        let loaded = LoadedScene::new(scene.clone(), vec![volume()], vec![]).unwrap();
        renderer.set_scene(&loaded.with_parts(besides)).unwrap();
        while renderer.advance(Duration::ZERO, 8, &Job::new()).unwrap().spp < 8 {}
        // (Bricks, which only serve speed, are replaced by boxes where levels differ.)
        let bytes: u64 =
            renderer.bytes().iter().filter(|(part, _)| *part != "bricks").map(|(_, bytes)| bytes).sum();
        let seen = renderer.pick(18, 6).unwrap();
        (renderer.color().unwrap().pixels, seen, bytes)
    };
    let (least, seen, least_bytes) = draw(PartSet::NONE, &scene);
    for besides in super::besides() {
        let (all, seen_too, bytes) = draw(besides, &scene);
        // In a different program, the last bits may differ.
        let off =
            all.iter().flatten().zip(least.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off <= 2e-6, "{off}");
        assert!(seen.is_some() && seen_too == seen, "{seen:?}, {seen_too:?}");
        assert!(bytes > least_bytes, "{bytes} bytes, {least_bytes} at least");
    }
    // Negative control: a visible tower would be noticed.
    scene.instances[0].style.show = Show::All;
    let (other, seen_too, _) = draw(PartSet::NONE, &scene);
    let off =
        other.iter().flatten().zip(least.iter().flatten()).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
    assert!(off > 100 && seen_too != seen, "{off}");
}
