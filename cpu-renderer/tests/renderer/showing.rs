//! Labels are hidden and shown again: what is built for many labels serves for fewer of them, and the picture is that of a new renderer.

use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DVec3};
use pumice_core::{CompressedVolume, Job};
use pumice_oracle::volumes::{Random, blobs};
use pumice_picture::Image;
use pumice_scene::{Cut, CutShape, Environment, Film, Filter, Lod, Material, Scene, Show, Sun};
use pumice_transport::{LoadedScene, Renderer};

use super::floor::{lambert, looking_down};

const LABELS: u32 = 60;

fn picture(renderer: &mut impl Renderer, scene: &Scene, volume: &Arc<CompressedVolume>) -> Image {
    let volumes = vec![Arc::clone(volume); scene.instances.len()];
    renderer.set_scene(&LoadedScene::new(scene.clone(), volumes, vec![]).unwrap()).unwrap();
    while renderer.advance(Duration::from_millis(20), 2, &Job::new()).unwrap().spp < 2 {}
    renderer.color().unwrap()
}

/// Blobs that touch, some of glass and some that emit, from above.
fn scene(volume: &CompressedVolume) -> Scene {
    let sun = Sun { direction: [0.3, 0.0, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.1 };
    let mut scene = looking_down(Environment::Constant { radiance: [0.5; 3] }, vec![sun], lambert(0.6));
    scene.camera.world_from_camera.translation = DVec3::new(24.0, 20.0, 80.0);
    scene.camera.projection = pumice_scene::Projection::Orthographic { scale: 50.0 };
    scene.film = Film::new(24, 20, Filter::Box { width: 1.0 });
    scene.settings.bounces = 6;
    let style = &mut scene.instances[0].style;
    for (i, &id) in volume.labels().ids().iter().enumerate() {
        let material = match i % 10 {
            3 => Material { transmission: 1.0, roughness: 0.0, ..Material::default() },
            7 => Material { emission: [1.0, 0.8, 0.3], ..lambert(0.2) },
            _ => continue,
        };
        style.materials.insert(id, material);
    }
    scene
}

/// Random edits of what is shown, with edits of place, level of detail, smooth voxels and cuts between them.
#[test]
fn hidden_labels_leave_the_picture_of_a_new_renderer() {
    let (_, volume) = blobs([48, 40, 36], LABELS, 50, 3);
    let (mut scene, mut random) = (scene(&volume), Random(11));
    let ids = volume.labels().ids();
    let (mut renderer, mut visible) = (super::renderer(), vec![true; ids.len()]);
    picture(&mut renderer, &scene, &volume);
    let (mut edits, mut built) = (0, 0);
    for round in 0..60 {
        let shows = round % 4 != 3;
        if shows {
            match random.below(5) {
                0 => visible.fill(true),
                1 => visible.iter_mut().for_each(|v| *v = !*v),
                2 => visible.iter_mut().for_each(|v| *v = random.below(3) == 0),
                3 => visible.iter_mut().for_each(|v| *v = random.below(20) == 0),
                _ => visible[random.below(ids.len() as u32) as usize] ^= true,
            }
            scene.instances[0].style.show =
                Show::from_flags(ids.iter().copied(), visible.iter().copied()).unwrap();
        } else {
            match random.below(4) {
                0 => {
                    scene.instances[0].world_from_index =
                        DAffine3::from_translation(DVec3::splat(random.unit()))
                }
                1 => scene.settings.smooth_voxels ^= true,
                2 => {
                    let (point, normal) = ([20.0, 20.0, 30.0 * random.unit()], [0.2, 0.1, 1.0]);
                    scene.cuts = vec![Cut { shape: CutShape::Plane { point, normal }, instances: None }];
                }
                _ => {
                    let lods = [Lod::Voxels, Lod::Cells, Lod::Boxes, Lod::Distance { pixels: 4.0 }];
                    scene.settings.lod = lods[random.below(4) as usize];
                }
            }
        }
        let before = renderer.rebuilt().acceleration;
        let image = picture(&mut renderer, &scene, &volume);
        assert!(image == picture(&mut super::renderer(), &scene, &volume), "round {round}: {visible:?}");
        if shows {
            edits += 1;
            built += renderer.rebuilt().acceleration - before;
        }
    }
    // Of the five kinds of edits, one shows so few labels that a hierarchy of their own is built, and some show others than before.
    assert!(built > 0 && 2 * built < edits, "{built} hierarchies were built in {edits} edits");
}

/// Hiding most labels and showing all again builds one small hierarchy, and none for the way back.
#[test]
fn showing_all_again_builds_nothing() {
    let (_, volume) = blobs([48, 40, 36], LABELS, 50, 3);
    let mut scene = scene(&volume);
    let ids = volume.labels().ids();
    let mut renderer = super::renderer();
    let whole = picture(&mut renderer, &scene, &volume);
    let mut built = |renderer: &mut _, show: Show| {
        scene.instances[0].style.show = show;
        let before = Renderer::rebuilt(renderer).acceleration;
        let image = picture(renderer, &scene, &volume);
        (Renderer::rebuilt(renderer).acceleration - before, image == whole)
    };
    assert_eq!(built(&mut renderer, Show::Only(vec![ids[4]])), (1, false));
    assert_eq!(built(&mut renderer, Show::All), (0, true));
    assert_eq!(built(&mut renderer, Show::Except(vec![ids[4]])), (0, false));
    assert_eq!(built(&mut renderer, Show::Only(vec![ids[4], ids[5]])), (1, false));
    assert_eq!(built(&mut renderer, Show::All), (0, true));
}
