//! The page `docs/scene.md` agrees with the program.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::full_scene;
use glam::DVec3;
use pumice_scene::{LabelStyle, Material, Scene, Settings, Show};
use serde_json::Value;

const PAGE: &str = include_str!("../../docs/scene.md");

/// The first fenced block of the page that is JSON: a whole scene. The others are fields of one.
fn example() -> &'static str {
    let block = PAGE.split("```json\n").nth(1).expect("the page has an example");
    block.split("```").next().unwrap()
}

#[test]
fn the_example_is_a_scene() {
    let scene = Scene::from_json(example()).unwrap();
    let instance = &scene.instances[0];
    assert_eq!(instance.style.show, Show::Only(vec![26, 27]));
    assert_eq!(instance.style.materials[&26].roughness, 0.2);
    assert_eq!(Scene::from_json(&scene.to_json().unwrap()).unwrap(), scene);

    // Columns, then the translation; the camera looks along +y with z up.
    assert_eq!(instance.world_from_index.matrix3.z_axis, DVec3::new(0.0, 0.0, 0.1));
    assert_eq!(instance.world_from_index.translation, DVec3::new(-19.0, -11.0, 0.0));
    let m = scene.camera.world_from_camera.matrix3;
    assert_eq!((m * DVec3::NEG_Z, m * DVec3::Y), (DVec3::Y, DVec3::Z));
}

/// All names of fields in the JSON form.
fn names(value: &Value, out: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| {
            out.push(k.clone());
            names(v, out);
        }),
        Value::Array(list) => list.iter().for_each(|v| names(v, out)),
        _ => (),
    }
}

#[test]
fn every_field_is_on_the_page() {
    let mut all = Vec::new();
    names(&serde_json::to_value(full_scene()).unwrap(), &mut all);
    all.retain(|name| name.parse::<u64>().is_err());
    assert!(all.len() > 60);
    for name in all {
        assert!(
            PAGE.contains(&format!("`{name}`")) || PAGE.contains(&format!("{{\"{name}\": ")),
            "{name} is not on the page"
        );
    }
}

#[test]
fn the_defaults_are_those_of_the_page() {
    let row = |line: &str| assert!(PAGE.contains(line), "the page lacks: {line}");
    let m = Material::default();
    row(&format!("| {:?} |\n| `metallic`", m.base_color));
    row(&format!("| 0 to 1 | {} |\n| `roughness`", m.metallic));
    row(&format!("| 0 to 1 | {} |\n| `specular`", m.roughness));
    row(&format!("| from 0 | {} |\n| `specular_tint`", m.specular));
    row(&format!("| 0 to 1 | {:?} |\n| `ior`", m.specular_tint));
    row(&format!("| from 1 | {} |\n| `transmission`", m.ior));
    row(&format!("| 0 to 1 | {} |\n| `subsurface`", m.transmission));
    row(&format!("| 0 to 1 | {} |\n| `subsurface_radius`", m.subsurface));
    row(&format!("| from 0 | {:?} |\n| `coat`", m.subsurface_radius));
    row(&format!("| 0 to 1 | {} |\n| `coat_roughness`", m.coat));
    row(&format!("| 0 to 1 | {} |\n| `coat_ior`", m.coat_roughness));
    row(&format!("| from 1 | {} |\n| `coat_tint`", m.coat_ior));
    row(&format!("| 0 to 1 | {:?} |\n| `sheen`", m.coat_tint));
    row(&format!("| 0 to 1 | {} |\n| `sheen_roughness`", m.sheen));
    row(&format!("| 0 to 1 | {} |\n| `sheen_tint`", m.sheen_roughness));
    row(&format!("| 0 to 1 | {:?} |\n| `alpha`", m.sheen_tint));
    row(&format!("| 0 to 1 | {} |\n| `multiscatter`", m.alpha));
    row(&format!("| true or false | {} |\n| `emission`", m.multiscatter));
    assert_eq!(m.emission, [0.0; 3]);
    let s = Settings::default();
    row(&format!("surface points | {} |", s.bounces));
    row(&format!("not the mean | {} |", s.russian_roulette));
    row(&format!("the same picture | {} |", s.seed));
    assert_eq!((s.clamp_direct, s.clamp_indirect, s.adaptive, s.smooth_voxels), (0.0, 0.0, None, false));
    assert_eq!(serde_json::to_string(&s.mode).unwrap(), "\"path\"");
    assert_eq!(serde_json::to_string(&s.lod).unwrap(), "\"voxels\"");
    assert_eq!(s.ao_distance, f64::MAX);
    let style = LabelStyle::default();
    assert_eq!((style.show, style.auto_color), (Show::All, false));
}
