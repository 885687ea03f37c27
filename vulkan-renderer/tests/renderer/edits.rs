//! What an edit sends to the device, and whether memory is freed. `super::bare()` makes the renderer that is tested.

use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;
use pumice_core::{CompressedVolume, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_oracle::volumes::Random;
use pumice_scene::{Cut, CutShape, Environment, Film, Filter, Lod, Material, Projection, Scene, Show};
use pumice_transport::{LoadedScene, Renderer as _};
use pumice_vulkan::Sent;

use super::Validated;
use super::floor::{lambert, looking_down};

/// Balls of 60 labels side by side, 480 × 48 × 48 voxels.
pub(crate) fn balls() -> Arc<CompressedVolume> {
    let dims = [480u32, 48, 48];
    let ids = (0..dims[0] * dims[1] * dims[2])
        .map(|i| {
            let p = [i % 480, i / 480 % 48, i / (480 * 48)].map(|v| v as i32);
            let away = p.map(|v| v % 24 - 12).iter().map(|d| d * d).sum::<i32>();
            if away < 110 { (1 + p[0] / 24 * 4 + p[1] / 24 * 2 + p[2] / 24) as u16 } else { 0 }
        })
        .collect();
    Arc::new(compress_labels(VolumeInfo::new(dims, LabelType::U16), LabelBuffer::U16(ids)).unwrap())
}

/// All of them from the side, under a uniform sky.
pub(crate) fn scene_of_balls() -> Scene {
    let mut scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.7));
    scene.camera.world_from_camera.translation = DVec3::new(240.0, 24.0, 600.0);
    scene.camera.projection = Projection::Perspective { fov_rad: 0.8 };
    scene.film = Film::new(96, 40, Filter::Box { width: 1.0 });
    scene
}

fn cut_at(x: f64) -> Cut {
    Cut { shape: CutShape::Plane { point: [x, 0.0, 0.0], normal: [1.0, 0.0, 0.2] }, instances: None }
}

#[test]
fn an_edit_sends_what_it_changes_and_no_more() {
    type Edit = fn(&mut Scene);
    let none = Sent { header: 1, ..Sent::default() };
    let cases: [(&str, Edit, Sent); 22] = [
        ("all", |_| (), Sent { header: 1, lights: 1, filter: 1, materials: 1, boxes: 1, nodes: 1, cuts: 0 }),
        ("camera", |s| s.camera.world_from_camera.translation.x += 3.0, none),
        ("bounces", |s| s.settings.bounces = 2, none),
        ("place", |s| s.instances[0].world_from_index.translation.x += 0.25, none),
        ("film's size", |s| s.film.width += 8, none),
        (
            "film's filter",
            |s| s.film.filter = Filter::BlackmanHarris { width: 1.5 },
            Sent { filter: 1, ..none },
        ),
        (
            "sky",
            |s| s.world.environment = Environment::Constant { radiance: [0.5; 3] },
            Sent { lights: 1, ..none },
        ),
        (
            "a label's colour",
            |s| {
                let red = Material { base_color: [0.9, 0.1, 0.1], ..s.instances[0].style.material };
                let materials = &mut s.instances[0].style.materials;
                *materials = [(9, red)].into_iter().collect();
            },
            Sent { materials: 1, ..none },
        ),
        (
            "a label hidden",
            |s| s.instances[0].style.show = Show::Except(vec![7]),
            Sent { materials: 1, boxes: 1, ..none },
        ),
        (
            "another hidden",
            |s| s.instances[0].style.show = Show::Except(vec![7, 8]),
            Sent { materials: 1, boxes: 1, ..none },
        ),
        ("shown again", |s| s.instances[0].style.show = Show::All, Sent { materials: 1, ..none }),
        (
            "a label shines",
            |s| {
                let shines = Material { emission: [2.0, 1.0, 0.5], ..s.instances[0].style.material };
                s.instances[0].style.materials = [(9, shines)].into_iter().collect();
            },
            Sent { materials: 1, lights: 1, ..none },
        ),
        (
            "others' colour, shining",
            |s| s.instances[0].style.material.base_color = [0.2; 3],
            Sent { materials: 1, ..none },
        ),
        ("camera, shining", |s| s.camera.world_from_camera.translation.x -= 2.0, none),
        (
            "place, shining",
            |s| s.instances[0].world_from_index.translation.x -= 0.5,
            Sent { lights: 1, ..none },
        ),
        ("dark again", |s| s.instances[0].style.materials.clear(), Sent { materials: 1, ..none }),
        ("coarse", |s| s.settings.lod = Lod::Distance { pixels: 2.0 }, Sent { boxes: 1, ..none }),
        ("a cut", |s| s.cuts.push(cut_at(100.0)), Sent { cuts: 1, ..none }),
        ("camera, cut", |s| s.camera.world_from_camera.translation.z += 50.0, none),
        ("the cut moved", |s| s.cuts[0] = cut_at(120.0), Sent { cuts: 1, ..none }),
        ("no cut", |s| s.cuts.clear(), none),
        ("camera, coarse", |s| s.camera.world_from_camera.translation.z += 500.0, none),
    ];
    let mut renderer = super::bare();
    let (mut scene, volume) = (scene_of_balls(), balls());
    for (name, edit, expected) in &cases {
        let before = renderer.sent();
        edit(&mut scene);
        renderer
            .set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![]).unwrap())
            .unwrap();
        let after = renderer.sent();
        let sent = Sent {
            header: after.header - before.header,
            lights: after.lights - before.lights,
            filter: after.filter - before.filter,
            materials: after.materials - before.materials,
            boxes: after.boxes - before.boxes,
            nodes: after.nodes - before.nodes,
            cuts: after.cuts - before.cuts,
        };
        assert_eq!(sent, *expected, "{name}");
    }
}

/// A row of 60 labels in a volume too long and thin for bricks, and its scene from above.
fn row() -> (Scene, Arc<CompressedVolume>) {
    let dims = [(1u32 << 22) + 64, 3, 2];
    let label = |x: u32, y: u32, z: u32| {
        if x < 480 && !(x / 3 + y + z).is_multiple_of(4) { (1 + (x / 8 + y) % 60) as u8 } else { 0 }
    };
    let ids = (0..dims[2])
        .flat_map(|z| (0..dims[1]).flat_map(move |y| (0..dims[0]).map(move |x| label(x, y, z))))
        .collect();
    let volume = compress_labels(VolumeInfo::new(dims, LabelType::U8), LabelBuffer::U8(ids)).unwrap();
    let mut scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.7));
    scene.camera.world_from_camera.translation = DVec3::new(240.0, 1.5, 200.0);
    scene.camera.projection = Projection::Perspective { fov_rad: 1.7 };
    (scene, Arc::new(volume))
}

/// Random edits of what is shown draw what a renderer draws that never showed anything else. Few hierarchies are built for them, and what
/// was shown before is shown again without sending a box.
#[test]
fn other_labels_are_drawn_as_if_no_others_had_been() {
    let of_bricks = (scene_of_balls(), balls());
    for (by, (mut scene, volume)) in [("bricks", of_bricks), ("boxes", row())] {
        scene.film = Film::new(48, 12, Filter::Box { width: 1.0 });
        let (mut random, mut visible) = (Random(3), vec![true; volume.labels().len()]);
        let (mut renderer, mut fresh) = (super::renderer(), super::renderer());
        let draw = |renderer: &mut Validated, scene: &Scene| {
            let loaded = LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![]).unwrap();
            renderer.set_scene(&loaded).unwrap();
            while renderer.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
            renderer.color().unwrap()
        };
        // But for scratch memory, which suffices for the largest launch so far, and a launch is as large as the machine is fast.
        let lasting = |renderer: &Validated| {
            renderer.bytes().into_iter().filter(|(part, _)| *part != "scratch").collect::<Vec<_>>()
        };
        let whole = draw(&mut renderer, &scene);
        let held = lasting(&renderer);
        let has_bricks = held.iter().any(|(part, bytes)| *part == "bricks" && *bytes > 0);
        assert_eq!(has_bricks, by == "bricks");
        let (mut built, mut kept, mut others) = (0, 0, 0);
        for round in 0..24 {
            match random.below(4) {
                0 => visible.fill(true),
                1 => visible.iter_mut().for_each(|v| *v = random.below(3) != 0),
                2 => visible.iter_mut().for_each(|v| *v = random.below(12) == 0),
                _ => visible[random.below(volume.labels().len() as u32) as usize] ^= true,
            }
            let ids = volume.labels().ids().iter().copied();
            scene.instances[0].style.show = Show::from_flags(ids, visible.iter().copied()).unwrap();
            let before = (renderer.rebuilt().acceleration, renderer.sent().boxes);
            let image = draw(&mut renderer, &scene);
            fresh.forget_scene();
            assert!(image == draw(&mut fresh, &scene), "{by}, round {round}: {visible:?}");
            let after = (renderer.rebuilt().acceleration, renderer.sent().boxes);
            built += after.0 - before.0;
            kept += u64::from(after.1 == before.1);
            others += u32::from(image != whole);
        }
        assert!(0 < built && built < 12 && 0 < kept && others > 8, "{by}: {built}, {kept}, {others}");
        // What was made for some labels goes with them.
        scene.instances[0].style.show = Show::All;
        assert!(draw(&mut renderer, &scene) == whole, "{by}");
        assert_eq!(lasting(&renderer), held, "{by}");
    }
}

/// All allocated memory is freed.
#[test]
fn nothing_is_left_on_the_device() {
    let mut renderer = super::bare();
    let (scene, volume) = (scene_of_balls(), balls());
    let mut held = Vec::new();
    for _ in 0..3 {
        renderer
            .set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![]).unwrap())
            .unwrap();
        renderer.advance(Duration::ZERO, 1, &Job::new()).unwrap();
        renderer.picture().unwrap();
        let counted: u64 = renderer.bytes().iter().map(|(_, b)| b).sum();
        let allocated = renderer.gpu().allocated_bytes();
        // Beside the scene's parts there are shader binding tables, albedo tables, staging memory, and the alignment of each buffer.
        assert!(allocated >= counted && allocated < counted + (20 << 20), "{allocated} {counted}");
        // Programs outlive scenes, and so does the scratch memory of rays. It is as large as the largest launch needed, which depends on
        // how fast the launches were.
        let scratch: u64 = renderer.bytes().iter().filter(|(n, _)| *n == "scratch").map(|(_, b)| b).sum();
        renderer.forget_scene();
        held.push(renderer.gpu().allocated_bytes() - scratch);
    }
    assert_eq!(held[1], held[2]);
}
