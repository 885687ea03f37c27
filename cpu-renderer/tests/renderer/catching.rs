//! How shadow catchers and other objects affect one another, on the floor of [`super::catchers`].

use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Duration;

use glam::DMat3;
use pumice_core::{Job, MeshData};
use pumice_picture::Pass;
use pumice_scene::{Adaptive, Environment, Material, Passes, Sun};
use pumice_transport::Renderer as _;

use super::catchers::{
    SIDE, SLICE, Sheet, alpha, draw, draw_apart, draw_on, floor, lambert, plate, scene_of, sun, wall, x_of,
};

/// Objects that are not catchers see a catcher as an ordinary floor: their colours are those beside an ordinary floor, to the last bit.
#[test]
fn others_see_the_floor() {
    let (mut scene, meshes) = scene_of(&[floor(), plate(1.0)], 0.3);
    scene.suns = vec![Sun { direction: [1.0, 0.0, -1.0], ..sun() }];
    scene.settings.bounces = 3;
    // From below the plate: the sun on the floor.
    scene.camera.world_from_camera.translation.z = 0.5;
    scene.camera.world_from_camera.matrix3 = DMat3::from_rotation_x(PI);
    let picture = draw(&scene, &meshes, 8);
    scene.meshes[0].shadow_catcher = false;
    let ordinary = draw(&scene, &meshes, 8);
    let mut seen = 0;
    for (i, (a, b)) in picture.color.pixels.iter().zip(&ordinary.color.pixels).enumerate() {
        if alpha(&picture)[i] == 1.0 {
            assert_eq!(a, b);
            seen += usize::from(a[0] > 0.1);
        }
    }
    assert!(seen > 500, "{seen} pixels of a lit plate");
}

/// A catcher hides objects behind it; emissive objects do not light catchers in the catchers-only light, and reduce no alpha.
#[test]
fn things_below_and_things_that_shine() {
    let (mut scene, meshes) = scene_of(&[floor(), plate(-1.0)], 0.5);
    scene.settings.bounces = 2;
    let (picture, shadow) = draw_apart(&scene, &meshes, 4);
    assert!(alpha(&picture).iter().all(|a| *a == 0.0) && shadow.iter().all(|s| *s == [1.0; 3]));

    let shining = Sheet { material: Material { emission: [5.0; 3], ..lambert(0.0) }, ..plate(2.0) };
    let (mut scene, meshes) = scene_of(&[floor(), shining], 0.0);
    let (_, shadow) = draw_apart(&scene, &meshes, 4);
    assert!(shadow.iter().all(|s| *s == [1.0; 3]), "alone there is no light");
    scene.world.environment = Environment::Constant { radiance: [0.01; 3] };
    let (_, shadow) = draw_apart(&scene, &meshes, 4);
    let picture = draw(&scene, &meshes, 4);
    let left = |i: &usize| x_of(i % SIDE as usize) < 0.0;
    let brighter = (0..shadow.len()).filter(left).filter(|&i| shadow[i][0] > 1.5).count();
    assert!(brighter > 1000, "{brighter} pixels");
    assert!((0..shadow.len()).filter(left).all(|i| shadow[i][0] <= 1.0 || alpha(&picture)[i] == 0.0));
    // An emissive catcher lights catchers.
    scene.meshes[1].shadow_catcher = true;
    let (_, shadow) = draw_apart(&scene, &meshes, 4);
    assert!(shadow.iter().all(|s| *s == [1.0; 3]));
}

/// The error includes that of the shadow, even where the shadow is in alpha alone; and it decides which pixels rest.
#[test]
fn shadows_count_as_error() {
    let (mut scene, meshes) = scene_of(&[floor(), wall(1.5)], 0.9);
    let mut renderer = super::renderer();
    let (rough, _) = draw_on!(renderer, &scene, &meshes, SLICE, 8);
    let (fine, _) = draw_on!(renderer, &scene, &meshes, SLICE, 128);
    assert!(rough > 0.02 && fine < 0.5 * rough && fine > 0.0, "{rough} {fine}");
    scene.settings.adaptive = Some(Adaptive { threshold: 0.04, min_spp: 16 });
    scene.film.passes = Passes::NONE.with(Pass::Samples);
    let (_, picture) = draw_on!(renderer, &scene, &meshes, SLICE, 256);
    let samples = picture.samples.unwrap();
    let mean = |column: usize| {
        (0..SIDE as usize).map(|row| samples[row * SIDE as usize + column]).sum::<f32>() / SIDE as f32
    };
    // At the wall and 4 units away.
    assert!(mean(31) > 1.3 * mean(0) && mean(0) >= 16.0, "{} {}", mean(31), mean(0));
}

/// A catcher has its own normals, whatever precedes it in the list.
#[test]
fn a_smooth_floor_catches() {
    let (mut scene, mut meshes) = scene_of(&[plate(-1.0), floor()], 0.0);
    scene.suns = vec![sun()];
    let smooth = MeshData::clone(&meshes[1]).with_corner_normals(&[[0.3, 0.0, 1.0]; 4]).unwrap();
    meshes[1] = Arc::new(smooth);
    let (_, shadow) = draw_apart(&scene, &meshes, 2);
    assert!(shadow.iter().all(|s| *s == [1.0; 3]), "among catchers it is lit by the same normals");
}

/// A floor that becomes a catcher, or ceases to be one, is drawn as if it had always been so; slices make no difference.
#[test]
fn edits_and_slices() {
    let (mut scene, meshes) = scene_of(&[floor(), wall(1.5), plate(3.0)], 0.9);
    scene.suns = vec![sun()];
    scene.settings.bounces = 2;
    let caught = draw(&scene, &meshes, 5);
    let mut ordinary = scene.clone();
    ordinary.meshes[0].shadow_catcher = false;
    let plain = draw(&ordinary, &meshes, 5);
    assert_ne!(caught, plain);
    let mut renderer = super::renderer();
    for (scene, expected) in [(&ordinary, &plain), (&scene, &caught), (&ordinary, &plain)] {
        let (_, picture) = draw_on!(renderer, scene, &meshes, Duration::ZERO, 5);
        assert_eq!(picture, *expected);
    }
    // A film whose sums have another number of floats is a different film.
    scene.film.transparent = false;
    let (_, picture) = draw_on!(renderer, &scene, &meshes, SLICE, 5);
    assert_eq!(picture, draw(&scene, &meshes, 5));
    // The pass is 1 everywhere where there is no catcher.
    let (picture, shadow) = draw_apart(&ordinary, &meshes, 1);
    assert!(shadow.iter().all(|s| *s == [1.0; 3]));
    assert_eq!(picture.color, draw(&ordinary, &meshes, 1).color);
}
