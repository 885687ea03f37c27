//! Which labels lie on the device, and cancelled passes. The code is the same for all backends, so one backend is tested.

use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DVec3};
use pumice_core::Job;
use pumice_scene::{Film, Filter, Scene, Show};
use pumice_transport::{LoadedScene, Renderer as _};

use super::Validated;
use super::edits::{balls, scene_of_balls};

/// Only drawn labels lie on the device. Showing a label for the first time uploads its nodes; nothing else of the nodes is sent again.
#[test]
fn hidden_labels_are_not_on_the_device() {
    let mut renderer = super::bare();
    let (mut scene, volume) = (scene_of_balls(), balls());
    let part = |renderer: &Validated, name: &str| {
        renderer.bytes().into_iter().find(|(n, _)| *n == name).unwrap_or_else(|| panic!("{name}")).1
    };
    let show = |renderer: &mut Validated, scene: &Scene| {
        renderer
            .set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![]).unwrap())
            .unwrap();
    };
    show(&mut renderer, &scene);
    let of_volume: u64 = ["boxes", "labels"].map(|p| part(&renderer, p)).iter().sum();
    let in_memory = volume.boxes().len() as u64 * 12;
    assert!(of_volume >= in_memory && of_volume < in_memory + 4096, "{of_volume}, in memory {in_memory}");
    let nodes_in_memory = 2 * volume.nodes().len() as u64;
    assert!(part(&renderer, "nodes") < nodes_in_memory + 64);
    assert!(part(&renderer, "leaves") < 512 + 8 * volume.leaves()[0].patterns().len() as u64 + 64);

    renderer.forget_scene();
    scene.instances[0].style.show = Show::Only(vec![1, 2]);
    show(&mut renderer, &scene);
    assert!(part(&renderer, "boxes") < in_memory / 10);
    let before = renderer.sent();
    scene.instances[0].style.show = Show::Only(vec![1, 2, 3]);
    show(&mut renderer, &scene);
    assert_eq!(renderer.sent().nodes, before.nodes + 1, "label 3 was not there");
    // The volume is in the scene twice and on the device once.
    let nodes = part(&renderer, "nodes");
    let mut second = scene.instances[0].clone();
    second.id = 2;
    second.world_from_index = DAffine3::from_translation(DVec3::new(0.0, 60.0, 0.0));
    scene.instances.push(second);
    renderer
        .set_scene(
            &LoadedScene::new(scene.clone(), vec![Arc::clone(&volume), Arc::clone(&volume)], vec![]).unwrap(),
        )
        .unwrap();
    assert_eq!(part(&renderer, "nodes"), nodes);
    assert_eq!(renderer.sent().nodes, before.nodes + 1);
}

/// A cancelled pass stops after the launch in flight, and continues from there later.
#[test]
fn a_pass_that_is_cancelled_midway_goes_on() {
    let (mut scene, volume) = (scene_of_balls(), balls());
    scene.film = Film::new(320, 180, Filter::Box { width: 1.0 });
    let whole = |renderer: &mut Validated| {
        while renderer.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
        renderer.color().unwrap()
    };
    let mut renderer = super::bare();
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![]).unwrap()).unwrap();
    let expected = whole(&mut renderer);
    drop(renderer);
    let mut cut = 0;
    for delay_ms in [5, 30, 60, 120] {
        let mut other = super::bare();
        other
            .set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![]).unwrap())
            .unwrap();
        let job = Arc::new(Job::new());
        let canceller = Arc::clone(&job);
        let thread = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(delay_ms));
            canceller.cancel();
        });
        let before = other.launches().0;
        let cancelled = other.advance(Duration::from_secs(3600), 2, &job).is_err();
        cut += u32::from(cancelled && other.launches().0 > before);
        thread.join().unwrap();
        assert_eq!(whole(&mut other), expected, "{delay_ms} ms");
    }
    assert!(cut > 0, "no pass was cut within");
}
