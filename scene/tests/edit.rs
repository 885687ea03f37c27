//! Edits: each changes only its own part, the JSON form matches the types, and errors name the faulty edit.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::full_scene;
use pumice_scene::{LabelGroups, Material, MeshDiff, Scene, SceneDiff, SceneEdit, Show};
use serde_json::{Value, json};

/// One edit of each kind that changes something, with the diff's flags that it must set.
fn edits() -> Vec<(SceneEdit, SceneDiff)> {
    let scene = full_scene();
    let none = SceneDiff::default;
    let instance = |change: fn(&mut pumice_scene::InstanceDiff)| {
        let mut diff = pumice_scene::InstanceDiff { id: 8, ..Default::default() };
        change(&mut diff);
        SceneDiff { changed: vec![diff], ..none() }
    };
    let mut camera = scene.camera;
    camera.shift[0] += 0.25;
    let mut film = scene.film;
    film.width = 11;
    let mut world = scene.world.clone();
    world.backdrop = None;
    let mut settings = scene.settings;
    settings.seed = 3;
    let mut place = scene.instances[1].world_from_index;
    place.translation.x += 1.0;
    let gray = Material { base_color: [0.5; 3], ..Material::default() };
    let mesh = |change: fn(&mut MeshDiff)| {
        let mut diff = MeshDiff { id: 4, ..MeshDiff::default() };
        change(&mut diff);
        SceneDiff { meshes_changed: vec![diff], ..none() }
    };
    let place_mesh = SceneEdit::PlaceMesh { id: 4, world_from_mesh: place };
    vec![
        (SceneEdit::Camera { camera }, SceneDiff { camera: true, ..none() }),
        (SceneEdit::Film { film }, SceneDiff { film: true, ..none() }),
        (SceneEdit::World { world }, SceneDiff { world: true, ..none() }),
        (SceneEdit::Suns { suns: vec![] }, SceneDiff { suns: true, ..none() }),
        (SceneEdit::Lights { lights: vec![] }, SceneDiff { lights: true, ..none() }),
        (SceneEdit::Cuts { cuts: vec![] }, SceneDiff { cuts: true, ..none() }),
        (SceneEdit::Settings { settings }, SceneDiff { light_settings: true, ..none() }),
        (SceneEdit::Place { id: 8, world_from_index: place }, instance(|d| d.moved = true)),
        (SceneEdit::Show { id: 8, show: Show::All }, instance(|d| d.visibility = true)),
        (SceneEdit::Material { id: 8, material: gray }, instance(|d| d.materials = true)),
        (SceneEdit::AutoColor { id: 8, auto_color: false }, instance(|d| d.materials = true)),
        (
            SceneEdit::LabelMaterials { id: 8, materials: [(17, None), (3, Some(gray))].into() },
            instance(|d| d.materials = true),
        ),
        (SceneEdit::Groups { id: 8, groups: LabelGroups::default() }, instance(|d| d.materials = true)),
        (SceneEdit::GroupMaterial { id: 8, group: 1, material: gray }, instance(|d| d.materials = true)),
        (SceneEdit::Remove { id: 8 }, SceneDiff { removed: vec![8], ..none() }),
        (place_mesh, mesh(|d| d.moved = true)),
        (SceneEdit::MeshMaterials { id: 4, materials: vec![gray] }, mesh(|d| d.materials = true)),
        (SceneEdit::RemoveMesh { id: 4 }, SceneDiff { meshes_removed: vec![4], ..none() }),
    ]
}

#[test]
fn each_edit_changes_its_own_part_and_no_other() {
    for (edit, expected) in edits() {
        let (old, mut new) = (full_scene(), full_scene());
        new.apply(vec![edit.clone()]).unwrap();
        assert_eq!(SceneDiff::between(Some(&old), &new), expected, "{}", edit.name());
    }
}

#[test]
fn what_is_put_in_is_added_or_replaces_that_with_its_id() {
    let none = SceneDiff::default;
    let mut scene = full_scene();
    let mut third = scene.instances[1].clone();
    third.id = 9;
    scene.put_instance(third.clone());
    assert_eq!(SceneDiff::between(Some(&full_scene()), &scene), SceneDiff { added: vec![9], ..none() });
    third.style.auto_color = !third.style.auto_color;
    scene.put_instance(third.clone());
    assert_eq!((scene.instances.len(), scene.instances.last()), (3, Some(&third)));

    let mut scene = full_scene();
    let mut fifth = scene.meshes[1].clone();
    fifth.id = 5;
    scene.put_mesh(fifth.clone());
    assert_eq!(
        SceneDiff::between(Some(&full_scene()), &scene),
        SceneDiff { meshes_added: vec![5], ..none() }
    );
    fifth.materials.clear();
    scene.put_mesh(fifth.clone());
    assert_eq!((scene.meshes.len(), scene.meshes.last()), (3, Some(&fifth)));
}

#[test]
fn the_json_form_comes_back_as_it_was() {
    let all: Vec<SceneEdit> = edits().into_iter().map(|(edit, _)| edit).collect();
    let text = serde_json::to_string(&all).unwrap();
    assert_eq!(SceneEdit::list_from_json(&text).unwrap(), all);
    for edit in &all {
        let value: Value = serde_json::to_value(edit).unwrap();
        assert_eq!(value["edit"], edit.name());
    }
    assert_eq!(all.iter().map(SceneEdit::name).collect::<Vec<_>>(), SceneEdit::NAMES);
}

#[test]
fn the_form_that_clients_write() {
    let text = json!([
        {"edit": "label_materials", "id": 7, "materials": {"17": null, "18446744073709551615": {"metallic": 0.5}}},
        {"edit": "show", "id": 7, "show": {"except": [3]}},
    ]);
    let mut scene = full_scene();
    scene.apply(SceneEdit::list_from_json(&text.to_string()).unwrap()).unwrap();
    let style = &scene.instances[0].style;
    assert_eq!(style.show, Show::Except(vec![3]));
    assert_eq!(style.materials.len(), 1);
    assert_eq!(style.materials[&u64::MAX], Material { metallic: 0.5, ..Material::default() });
}

#[test]
fn what_is_no_edit_is_named() {
    let problem = |value: Value| SceneEdit::list_from_json(&value.to_string()).unwrap_err().to_string();
    assert!(problem(json!([{"edit": "colour"}])).contains("unknown variant `colour`"));
    assert!(problem(json!([{"edit": "remove"}])).contains("missing field `id`"));
    assert!(problem(json!([{"edit": "remove", "id": 7, "now": true}])).contains("unknown field `now`"));
    for key in ["-1", "017", "x", "18446744073709551616"] {
        let mut materials = serde_json::Map::new();
        materials.insert(key.into(), Value::Null);
        let text = problem(json!([{"edit": "label_materials", "id": 7, "materials": materials}]));
        assert!(text.contains("a label id from 0 to"), "{text}");
    }
    let twice = r#"[{"edit": "label_materials", "id": 7, "materials": {"3": null, "3": null}}]"#;
    assert!(
        SceneEdit::list_from_json(twice).unwrap_err().to_string().contains("materials: label 3 occurs twice")
    );

    let mut scene: Scene = full_scene();
    let error = scene.apply(vec![SceneEdit::Remove { id: 8 }, SceneEdit::Remove { id: 8 }]).unwrap_err();
    let group = SceneEdit::GroupMaterial { id: 7, group: 2, material: Material::default() };
    let error_of_group = scene.apply(vec![group]).unwrap_err();
    assert_eq!(
        error_of_group.to_string(),
        "edits[0].group_material.group: instance 7 has no group 2; it has 2"
    );
    assert_eq!(error.to_string(), "edits[1].remove.id: the scene has no instance 8; its instances are [7]");
}
