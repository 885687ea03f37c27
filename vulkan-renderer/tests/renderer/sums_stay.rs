//! With passes a film has many more sums, of which a frame reads none; with alpha it reads 4 bytes a pixel more.

use std::time::Duration;

use pumice_core::Job;
use pumice_scene::Pass;
use pumice_transport::Renderer as _;

use super::catchers::{loaded, plate, scene_of};

#[test]
fn passes_are_not_read_each_frame() {
    let mut renderer = super::renderer();
    let (mut scene, meshes) = scene_of(&[plate(1.0)], 0.5);
    scene.film.passes = [Pass::Albedo, Pass::Normal, Pass::DiffuseDirect].into_iter().collect();
    let pixels = u64::from(scene.film.width * scene.film.height);
    renderer.set_scene(&loaded(&scene, &meshes)).unwrap();
    // The first launch compiles on a driver that computes on the CPU, which counts as time of samples; the picture is read then.
    renderer.advance(Duration::ZERO, 1, &Job::new()).unwrap();
    renderer.picture().unwrap();
    let before = renderer.gpu().downloaded_bytes();
    while renderer.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
    let (color, alpha) = (renderer.color().unwrap(), renderer.alpha().unwrap());
    assert_eq!(renderer.gpu().downloaded_bytes() - before, 16 * pixels);
    // The plate covers a half of the picture.
    assert!(alpha.iter().flatten().any(|&a| a == 1.0) && alpha.iter().flatten().any(|&a| a == 0.0));
    let picture = renderer.picture().unwrap();
    assert!(picture.color == color && picture.alpha == alpha);
    // 12 sums of classes, alpha, 6 features, 33 of light.
    assert!(renderer.gpu().downloaded_bytes() - before >= (16 + 4 * 52) * pixels);
}
