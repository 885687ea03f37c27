//! Each edit sets exactly the flags of what it changes, and every change sets some flag.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::full_scene;
use pumice_scene::{
    Environment, Filter, InstanceDiff, Lod, Material, MeshDiff, Mode, Passes, Projection, Scene, SceneDiff,
    Show,
};
use serde_json::Value;

fn after(edit: impl FnOnce(&mut Scene)) -> SceneDiff {
    let old = full_scene();
    let mut new = old.clone();
    edit(&mut new);
    SceneDiff::between(Some(&old), &new)
}

#[test]
fn nothing_differs_from_itself() {
    let diff = after(|_| ());
    assert!(diff.is_empty(), "{diff:?}");
    assert_eq!(diff, SceneDiff::default());
}

#[test]
fn all_is_sent_first() {
    let scene = full_scene();
    let first = SceneDiff {
        camera: true,
        film: true,
        world: true,
        suns: true,
        lights: true,
        cuts: true,
        lod: true,
        light_settings: true,
        added: vec![7, 8],
        meshes_added: vec![3, 4],
        ..SceneDiff::default()
    };
    assert_eq!(SceneDiff::between(None, &scene), first);
    assert!(!first.is_empty());
}

#[test]
fn each_edit_of_the_scene_sends_only_its_own_kind() {
    type Edit = fn(&mut Scene);
    let none = SceneDiff::default;
    let cases: Vec<(SceneDiff, Vec<Edit>)> = vec![
        (
            SceneDiff { camera: true, ..none() },
            vec![
                |s| s.camera.world_from_camera.translation.x += 1e-9,
                |s| s.camera.projection = Projection::Orthographic { scale: 1.0 },
                |s| s.camera.shift[1] = 0.0,
                |s| s.camera.clip[0] = 0.0,
            ],
        ),
        (
            SceneDiff { film: true, ..none() },
            vec![|s| s.film.width += 1, |s| s.film.height += 1, |s| s.film.passes = Passes::NONE, |s| {
                s.film.filter = Filter::Box { width: 3.0 }
            }],
        ),
        (
            SceneDiff { world: true, ..none() },
            vec![|s| s.world.environment = Environment::Constant { radiance: [1.0; 3] }, |s| {
                s.world.backdrop = None
            }],
        ),
        (
            SceneDiff { suns: true, ..none() },
            vec![|s| s.suns[0].strength = 9.0, |s| s.suns.truncate(1), |s| s.suns.swap(0, 1)],
        ),
        (
            SceneDiff { lod: true, ..none() },
            vec![|s| s.settings.lod = Lod::Cells, |s| s.settings.lod = Lod::Distance { pixels: 2.0 }],
        ),
        (
            SceneDiff { light_settings: true, ..none() },
            vec![
                |s| s.settings.mode = Mode::Path,
                |s| s.settings.bounces = 6,
                |s| s.settings.russian_roulette = true,
                |s| s.settings.ao_distance = 1.0,
                |s| s.settings.seed = 0,
            ],
        ),
    ];
    for (expected, edits) in cases {
        for (i, edit) in edits.into_iter().enumerate() {
            assert_eq!(after(edit), expected, "edit {i}");
        }
    }
}

#[test]
fn each_edit_of_an_instance_sends_only_its_own_kind() {
    type Edit = fn(&mut pumice_scene::Instance);
    let none = || InstanceDiff { id: 8, ..InstanceDiff::default() };
    let cases: Vec<(InstanceDiff, Vec<Edit>)> = vec![
        (InstanceDiff { moved: true, ..none() }, vec![|i| i.world_from_index.translation.y = 0.0]),
        (
            InstanceDiff { geometry: true, ..none() },
            vec![|i| i.source = "other.pumice".into(), |i| i.reading.time = Some(9)],
        ),
        (
            InstanceDiff { visibility: true, ..none() },
            vec![|i| i.style.show = Show::All, |i| i.style.show = Show::Only(vec![3, 17]), |i| {
                i.style.show = Show::Except(vec![3, 17, u64::MAX])
            }],
        ),
        (
            InstanceDiff { materials: true, ..none() },
            vec![
                |i| i.style.material.base_color[0] = 0.0,
                |i| i.style.auto_color = false,
                |i| i.style.materials.retain(|id, _| *id != 17),
                |i| i.style.materials.extend([(18, Material::default())]),
                |i| i.style.materials.get_mut(&17).unwrap().emission[2] = 1.0,
            ],
        ),
    ];
    for (expected, edits) in cases {
        for (n, edit) in edits.into_iter().enumerate() {
            let diff = after(|s| edit(&mut s.instances[1]));
            assert_eq!(diff, SceneDiff { changed: vec![expected], ..SceneDiff::default() }, "edit {n}");
        }
    }
}

#[test]
fn ids_listed_in_another_order_are_no_difference() {
    assert!(after(|s| s.instances[0].style.show = Show::Only(vec![u64::MAX, 17, 3, 3])).is_empty());
}

#[test]
fn instances_are_matched_by_id() {
    let none = SceneDiff::default;
    assert_eq!(after(|s| drop(s.instances.remove(0))), SceneDiff { removed: vec![7], ..none() });
    assert_eq!(after(|s| s.instances[0].id = 9), SceneDiff { added: vec![9], removed: vec![7], ..none() });
    assert_eq!(after(|s| s.instances.swap(0, 1)), SceneDiff { reordered: true, ..none() });
    // Inserted before the others: this is still only an addition.
    let more = after(|s| {
        let mut new = s.instances[1].clone();
        new.id = 1;
        s.instances.insert(0, new);
    });
    assert_eq!(more, SceneDiff { added: vec![1], ..none() });
}

#[test]
fn meshes_are_matched_by_id() {
    let none = SceneDiff::default;
    let mesh = |change: fn(&mut MeshDiff)| {
        let mut diff = MeshDiff { id: 4, ..MeshDiff::default() };
        change(&mut diff);
        SceneDiff { meshes_changed: vec![diff], ..none() }
    };
    assert_eq!(after(|s| drop(s.meshes.remove(0))), SceneDiff { meshes_removed: vec![3], ..none() });
    assert_eq!(after(|s| s.meshes.swap(0, 1)), SceneDiff { meshes_reordered: true, ..none() });
    assert_eq!(after(|s| s.meshes[1].world_from_mesh.translation.x += 1.0), mesh(|d| d.moved = true));
    assert_eq!(after(|s| s.meshes[1].source = "other.ply".into()), mesh(|d| d.geometry = true));
    assert_eq!(after(|s| s.meshes[1].shadow_catcher = false), mesh(|d| d.materials = true));
}

/// JSON pointers to all leaf values.
fn leaves(value: &Value, at: &str, out: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| leaves(v, &format!("{at}/{k}"), out)),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| leaves(v, &format!("{at}/{i}"), out));
        }
        _ => out.push(at.to_owned()),
    }
}

/// A change of any value of the JSON form is a difference. Fields added later are covered too.
#[test]
fn no_change_of_any_value_goes_unnoticed() {
    let old = full_scene();
    let text: Value = serde_json::to_value(&old).unwrap();
    let mut places = Vec::new();
    leaves(&text, "", &mut places);
    let mut changed = 0;
    for place in places.iter().filter(|p| *p != "/version") {
        let mut edited = text.clone();
        let leaf = edited.pointer_mut(place).unwrap();
        *leaf = match &*leaf {
            Value::Bool(b) => (!b).into(),
            Value::Number(n) if n.as_u64().is_some() => (n.as_u64().unwrap() ^ 1).into(),
            Value::Number(n) => (n.as_f64().unwrap() + 0.25).into(),
            // A list of all passes except one.
            Value::String(s) if s == "depth" => "position".into(),
            Value::String(_) if place.starts_with("/film/passes/") => "depth".into(),
            Value::String(s) if s == "one_bounce" => "path".into(),
            Value::String(s) if s == "vertical" => "auto".into(),
            Value::String(s) if s == "zyx" => "xyz".into(),
            Value::String(s) if s == "error" => "fill".into(),
            // An end of a region.
            Value::Null => 9.into(),
            Value::String(_) if place.ends_with("/label_type") => "u8".into(),
            Value::String(s) if s == "agx" => "filmic".into(),
            Value::String(s) if s == "ellipse" => "rectangle".into(),
            Value::String(s) => format!("{s}x").into(),
            other => panic!("{place} is {other}"),
        };
        let new: Scene = serde_json::from_value(edited).unwrap_or_else(|e| panic!("{place}: {e}"));
        assert!(!SceneDiff::between(Some(&old), &new).is_empty(), "{place}");
        assert!(!SceneDiff::between(Some(&new), &old).is_empty(), "{place}");
        changed += 1;
    }
    assert!(changed > 100, "{changed}");
}
