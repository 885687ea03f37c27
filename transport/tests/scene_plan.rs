//! Tests which data an edit rebuilds: a table of edits with the whole plan of each, and, for every number and switch of a full scene, that
//! the data which depends on it is not kept.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../../scene/tests/common/mod.rs"]
mod common;

use std::sync::Arc;

use common::full_scene;
use glam::DAffine3;
use pumice_core::{CompressedVolume, LabelBuffer, LabelType, MeshData, VolumeInfo, compress_labels};
use pumice_scene::{CutShape, Lod, Material, Part, PartSet, Pass, Scene, Show};
use pumice_transport::Reuse::{Build, Keep};
use pumice_transport::Source::{Built, Kept, Shared};
use pumice_transport::{InstancePlan, LoadedScene, MeshPlan, Reuse, ScenePlan};
use serde_json::Value;

/// The data of all test scenes: one volume for all instances, one mesh for all meshes.
struct Data {
    volume: Arc<CompressedVolume>,
    mesh: Arc<MeshData>,
}

impl Data {
    fn new() -> Self {
        let labels = LabelBuffer::U64(vec![3, 17, u64::MAX, 3, 5, 5]);
        let volume = compress_labels(VolumeInfo::new([6, 1, 1], LabelType::U64), labels).unwrap();
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = MeshData::new(corners, vec![[0, 1, 2]], vec![]).unwrap();
        Self { volume: Arc::new(volume), mesh: Arc::new(mesh) }
    }

    fn load(&self, scene: Scene) -> Option<LoadedScene> {
        let volumes = vec![Arc::clone(&self.volume); scene.instances.len()];
        let meshes = vec![Arc::clone(&self.mesh); scene.meshes.len()];
        LoadedScene::new(scene, volumes, meshes).ok()
    }
}

fn instance_kept(place: usize) -> InstancePlan {
    InstancePlan {
        former: Some(place),
        materials: Kept(place),
        hierarchy: Kept(place),
        levels: Kept(place),
        neighbors: Kept(place),
        number: Keep,
        placement: Keep,
        cuts: Keep,
    }
}

fn mesh_kept(place: usize) -> MeshPlan {
    MeshPlan { materials: Kept(place), triangles: Kept(place), number: Keep, placement: Keep }
}

/// The plan without any edit.
fn kept() -> ScenePlan {
    ScenePlan {
        camera: Keep,
        film: Keep,
        filter: Keep,
        sums: Keep,
        lights: Keep,
        instances: vec![instance_kept(0), instance_kept(1)],
        meshes: vec![mesh_kept(0), mesh_kept(1)],
        emitters: Keep,
        top_level: Keep,
    }
}

/// The full scene with all voxels drawn: levels do not depend on distance, and both instances show the same labels.
fn plain_scene() -> Scene {
    let mut scene = full_scene();
    scene.settings.lod = Lod::Voxels;
    scene.settings.smooth_voxels = false;
    scene
}

type Edit = fn(&mut Scene);
type Expected = fn(&mut ScenePlan);

/// One row for each edit, with the differences of its plan from that of no edit.
const TABLE: [(&str, Edit, Expected); 27] = [
    ("nothing", |_| (), |_| ()),
    ("camera", |s| s.camera.shift[0] = 0.5, |p| p.camera = Build),
    ("film's size", |s| s.film.width = 8, |p| (p.camera, p.film, p.sums) = (Build, Build, Build)),
    (
        "its filter",
        |s| s.film.filter = pumice_scene::Filter::Box { width: 1.0 },
        |p| {
            (p.camera, p.film, p.filter) = (Build, Build, Build);
        },
    ),
    ("how it is shown", |s| s.film.half = false, |p| (p.camera, p.film) = (Build, Build)),
    (
        "its mattes",
        |s| s.film.passes = Pass::LIGHT.iter().copied().collect(),
        |p| {
            (p.camera, p.film, p.sums) = (Build, Build, Build);
            (p.instances[0].materials, p.instances[1].materials) = (Built, Shared(0));
            p.meshes.iter_mut().for_each(|m| m.materials = Built);
        },
    ),
    ("sky", |s| s.world.backdrop = None, |p| p.lights = Build),
    ("suns", |s| s.suns[0].strength = 9.0, |p| p.lights = Build),
    ("lamps", |s| s.lights.clear(), |p| p.lights = Build),
    ("bounces and seed", |s| (s.settings.bounces, s.settings.seed) = (1, 2), |_| ()),
    (
        "smooth voxels",
        |s| s.settings.smooth_voxels = true,
        |p| {
            (p.instances[0].neighbors, p.instances[1].neighbors) = (Built, Shared(0));
            p.emitters = Build;
        },
    ),
    (
        "one level of detail",
        |s| s.settings.lod = Lod::Cells,
        |p| {
            for (place, source) in [(0, Built), (1, Shared(0))] {
                let i = &mut p.instances[place];
                (i.hierarchy, i.levels, i.neighbors, i.placement) = (source, source, source, Build);
            }
            (p.emitters, p.top_level) = (Build, Build);
        },
    ),
    (
        "place",
        |s| s.instances[1].world_from_index.translation.x = 7.0,
        |p| {
            // The instance is cut, and cuts are planes of its own space.
            (p.instances[1].placement, p.instances[1].cuts) = (Build, Build);
            (p.emitters, p.top_level) = (Build, Build);
        },
    ),
    (
        "show",
        |s| s.instances[1].style.show = Show::Only(vec![3]),
        |p| {
            let i = &mut p.instances[1];
            (i.materials, i.hierarchy, i.levels, i.neighbors) = (Built, Built, Built, Built);
            (p.emitters, p.top_level) = (Build, Build);
        },
    ),
    (
        "the same labels, listed otherwise",
        |s| {
            s.instances[1].style.show = Show::Only(vec![u64::MAX, 17, 3, 3]);
        },
        |_| (),
    ),
    (
        "colour of what does not shine",
        |s| s.instances[1].style.material.metallic = 1.0,
        |p| {
            p.instances[1].materials = Built;
        },
    ),
    (
        "colour of what shines",
        |s| own_material(s).base_color = [0.3; 3],
        |p| p.instances[1].materials = Built,
    ),
    (
        "its light",
        |s| own_material(s).emission = [1.0; 3],
        |p| {
            (p.instances[1].materials, p.emitters) = (Built, Build);
        },
    ),
    (
        "the cut of one",
        |s| s.cuts[0].shape = CutShape::Plane { point: [1.0; 3], normal: [1.0; 3] },
        |p| {
            (p.instances[1].cuts, p.emitters) = (Build, Build);
        },
    ),
    (
        "the cut of both",
        |s| drop(s.cuts.pop()),
        |p| {
            (p.instances[0].cuts, p.instances[1].cuts, p.emitters) = (Build, Build, Build);
        },
    ),
    (
        "the first instance goes",
        |s| {
            s.instances.remove(0);
            // The remaining instance is cut as before.
            s.cuts[1].instances = Some(vec![8]);
        },
        |p| {
            p.instances = vec![InstancePlan { number: Build, ..instance_kept(1) }];
            // Meshes are numbered after volumes.
            p.meshes.iter_mut().for_each(|m| m.number = Build);
            (p.emitters, p.top_level) = (Build, Build);
        },
    ),
    (
        "one more",
        |s| {
            let mut third = s.instances[0].clone();
            third.id = 9;
            s.instances.push(third);
        },
        |p| {
            p.instances.push(InstancePlan {
                former: None,
                materials: Shared(0),
                hierarchy: Shared(0),
                levels: Shared(0),
                neighbors: Shared(0),
                number: Build,
                placement: Build,
                cuts: Build,
            });
            p.meshes.iter_mut().for_each(|m| m.number = Build);
            (p.emitters, p.top_level) = (Build, Build);
        },
    ),
    (
        "another order",
        |s| s.instances.reverse(),
        |p| {
            p.instances = [1, 0].map(|i| InstancePlan { number: Build, ..instance_kept(i) }).to_vec();
            (p.emitters, p.top_level) = (Build, Build);
        },
    ),
    (
        "place of a mesh",
        |s| s.meshes[0].world_from_mesh = DAffine3::IDENTITY,
        |p| {
            (p.meshes[0].placement, p.emitters, p.top_level) = (Build, Build, Build);
        },
    ),
    (
        "colour of a mesh",
        |s| s.meshes[0].materials[0].base_color = [0.7; 3],
        |p| p.meshes[0].materials = Built,
    ),
    (
        "light of a mesh",
        |s| s.meshes[0].materials[1].emission = [3.0; 3],
        |p| {
            (p.meshes[0].materials, p.emitters) = (Built, Build);
        },
    ),
    (
        "name of a mesh, which mattes tell",
        |s| s.meshes[0].source = "other.ply".into(),
        |p| {
            p.meshes[0].materials = Built;
        },
    ),
];

fn own_material(scene: &mut Scene) -> &mut Material {
    scene.instances[1].style.materials.get_mut(&17).unwrap()
}

#[test]
fn each_edit_has_its_plan() {
    let data = Data::new();
    let old = data.load(plain_scene()).unwrap();
    for (name, edit, expected) in TABLE {
        let (mut scene, mut plan) = (plain_scene(), kept());
        edit(&mut scene);
        expected(&mut plan);
        let new = data.load(scene).unwrap_or_else(|| panic!("{name}: not valid"));
        assert_eq!(ScenePlan::between(Some(&old), &new), plan, "{name}");
    }
}

#[test]
fn levels_by_distance_follow_the_camera_and_keep_what_is_built() {
    let data = Data::new();
    let by_distance = |scene: fn(&mut Scene)| {
        let mut all = plain_scene();
        all.settings.lod = Lod::Distance { pixels: 1.5 };
        scene(&mut all);
        data.load(all).unwrap()
    };
    let old = by_distance(|_| ());
    let moved = by_distance(|s| s.camera.world_from_camera.translation.x += 1.0);
    let mut expected = kept();
    expected.instances.iter_mut().for_each(|i| i.placement = Build);
    (expected.camera, expected.emitters) = (Build, Build);
    assert_eq!(ScenePlan::between(Some(&old), &moved), expected);
    // When all boxes had one coarser level before, the hierarchy can be kept and the bricks cannot.
    let cells = by_distance(|s| s.settings.lod = Lod::Cells);
    let plan = ScenePlan::between(Some(&cells), &old);
    assert_eq!((plan.instances[0].hierarchy, plan.instances[0].levels), (Kept(0), Built));
    assert_eq!((plan.instances[0].boxes(), plan.instances[1].boxes()), (Built, Shared(0)));
}

/// Parts that are built in addition are built, and parts that are no longer built are not kept.
#[test]
fn what_a_scene_is_built_with_is_part_of_its_plan() {
    let data = Data::new();
    let mut scene = plain_scene();
    scene.film.passes = Pass::LIGHT.iter().copied().collect();
    let plain = data.load(scene).unwrap();
    let more = |part| plain.with_parts(PartSet::NONE.with(part));
    let table: [(Part, Expected); 5] = [
        (Part::Mattes, |p| {
            (p.instances[0].materials, p.instances[1].materials) = (Built, Shared(0));
            p.meshes.iter_mut().for_each(|m| m.materials = Built);
        }),
        (Part::HiddenLabels, |p| {
            for (place, source) in [(0, Built), (1, Shared(0))] {
                let i = &mut p.instances[place];
                (i.hierarchy, i.levels, i.neighbors) = (source, source, source);
            }
            (p.emitters, p.top_level) = (Build, Build);
        }),
        (Part::Levels, |p| {
            for (place, source) in [(0, Built), (1, Shared(0))] {
                let i = &mut p.instances[place];
                (i.hierarchy, i.levels, i.neighbors, i.placement) = (source, source, source, Build);
            }
            (p.emitters, p.top_level) = (Build, Build);
        }),
        (Part::InstanceTree, |p| p.top_level = Build),
        // Concerns shaders only.
        (Part::Coats, |_| ()),
    ];
    for (part, expected) in table {
        let mut plan = kept();
        expected(&mut plan);
        assert_eq!(ScenePlan::between(Some(&plain), &more(part)), plan, "{part:?} put in");
        assert_eq!(ScenePlan::between(Some(&more(part)), &plain), plan, "{part:?} left out");
        assert_eq!(ScenePlan::between(Some(&more(part)), &more(part)), kept(), "{part:?} as before");
    }
}

#[test]
fn another_volume_under_the_same_name_keeps_nothing() {
    let (data, other) = (Data::new(), Data::new());
    let old = data.load(plain_scene()).unwrap();
    let plan = ScenePlan::between(Some(&old), &other.load(plain_scene()).unwrap());
    let first = ScenePlan::between(None, &old);
    assert_eq!(plan.instances, first.instances);
    assert_eq!(plan.meshes, first.meshes);
    assert_eq!((plan.camera, plan.lights, plan.emitters, plan.top_level), (Keep, Keep, Build, Build));
}

#[test]
fn the_first_scene_is_built_and_shares_what_is_alike() {
    let plan = ScenePlan::between(None, &Data::new().load(plain_scene()).unwrap());
    let once = [plan.camera, plan.film, plan.filter, plan.sums, plan.lights, plan.emitters, plan.top_level];
    assert_eq!(once, [Build; 7]);
    assert_eq!(plan.instances.iter().map(InstancePlan::boxes).collect::<Vec<_>>(), [Built, Shared(0)]);
    assert_eq!(plan.meshes.iter().map(|m| m.triangles).collect::<Vec<_>>(), [Built, Shared(0)]);
    assert_eq!(plan.instances[1].boxes().unshared(), Built);
}

/// The paths of all numbers and switches in a JSON value.
fn leaves(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Array(all) => {
            all.iter().enumerate().for_each(|(i, v)| leaves(v, &format!("{path}/{i}"), found))
        }
        Value::Object(all) => all.iter().for_each(|(k, v)| leaves(v, &format!("{path}/{k}"), found)),
        Value::Number(_) | Value::Bool(_) => found.push(path.to_owned()),
        Value::String(_) | Value::Null => {}
    }
}

/// Other values for a leaf, some of which may be invalid.
fn others(leaf: &Value) -> Vec<Value> {
    match leaf {
        Value::Bool(is) => vec![Value::Bool(!is)],
        Value::Number(n) if n.is_u64() => {
            [1, 2, 9].map(|i| Value::from(n.as_u64().unwrap().wrapping_sub(i))).to_vec()
        }
        Value::Number(n) => {
            [1.25, 0.75, -1.0].map(|f| Value::from(f * n.as_f64().unwrap() + 0.001 * f)).to_vec()
        }
        _ => vec![],
    }
}

/// Whether a plan keeps nothing that depends on the field at this path; `None` where no built data depends on it.
fn makes_anew(plan: &ScenePlan, path: &str) -> Option<bool> {
    let parts: Vec<&str> = path.split('/').skip(1).collect();
    let place = || parts[1].parse::<usize>().unwrap();
    let all = |parts: &[Reuse]| Some(parts.iter().all(|part| part.is_build()));
    let not_kept = |source| !matches!(source, Kept(_));
    match parts[0] {
        "camera" => all(&[plan.camera]),
        "film"
            if matches!(
                parts[1],
                "width" | "height" | "cryptomatte_ranks" | "transparent" | "shadow_fade"
            ) =>
        {
            all(&[plan.camera, plan.film, plan.sums])
        }
        "film" if parts[1] == "filter" => all(&[plan.camera, plan.film, plan.filter]),
        "film" => all(&[plan.camera, plan.film]),
        "world" | "suns" | "lights" => all(&[plan.lights]),
        "cuts" => Some(plan.instances.iter().any(|i| i.cuts.is_build()) && plan.emitters.is_build()),
        "instances" => {
            let instance = plan.instances[place()];
            match (parts[2], *parts.last().unwrap()) {
                ("id", _) => Some(instance.former.is_none()),
                ("world_from_index", _) => {
                    all(&[instance.placement, instance.cuts, plan.emitters, plan.top_level])
                }
                ("style", _) if parts[3] == "show" => Some(
                    not_kept(instance.boxes())
                        && not_kept(instance.hierarchy)
                        && not_kept(instance.materials),
                ),
                ("style", last) => {
                    let own =
                        parts[3] == "materials" && !matches!(parts[5], "base_color") && last != "auto_color";
                    Some(not_kept(instance.materials) && (!own || plan.emitters.is_build()))
                }
                _ => None,
            }
        }
        "meshes" => {
            let mesh = plan.meshes[place()];
            match parts[2] {
                "id" => Some(not_kept(mesh.materials)),
                "world_from_mesh" => all(&[mesh.placement, plan.emitters, plan.top_level]),
                "shadow_catcher" => Some(not_kept(mesh.materials)),
                "materials" => {
                    // The second material does not emit.
                    let lit = parts[3] == "0" && parts[4] != "base_color";
                    Some(not_kept(mesh.materials) && (!lit || plan.emitters.is_build()))
                }
                _ => None,
            }
        }
        "settings" if parts[1] == "lod" => Some(plan.instances.iter().all(|i| i.placement.is_build())),
        "settings" if parts[1] == "smooth_voxels" => {
            Some(plan.instances.iter().all(|i| not_kept(i.neighbors)))
        }
        "settings" => None,
        _ => None,
    }
}

/// Whatever number or switch of the scene changes, the data that depends on it is not kept. Negative control: a plan that keeps everything
/// is caught for each of them.
#[test]
fn what_hangs_on_a_field_is_not_kept_when_it_changes() {
    let data = Data::new();
    let old = data.load(full_scene()).unwrap();
    let json: Value = serde_json::from_str(&full_scene().to_json().unwrap()).unwrap();
    let mut paths = Vec::new();
    leaves(&json, "", &mut paths);
    let (mut tried, mut untried) = (0, Vec::new());
    for path in &paths {
        let edited = others(json.pointer(path).unwrap()).into_iter().find_map(|other| {
            let mut json = json.clone();
            *json.pointer_mut(path)? = other;
            let scene = Scene::from_json(&json.to_string()).ok()?;
            (scene != full_scene()).then(|| data.load(scene)).flatten()
        });
        let Some(new) = edited else {
            untried.push(path);
            continue;
        };
        if let Some(holds) = makes_anew(&ScenePlan::between(Some(&old), &new), path) {
            assert!(holds, "{path}: {:#?}", ScenePlan::between(Some(&old), &new));
            assert_eq!(
                makes_anew(&ScenePlan::between(Some(&old), &old), path),
                Some(false),
                "{path}: control"
            );
            tried += 1;
        }
    }
    println!("{tried} of {} fields, not valid otherwise: {untried:?}", paths.len());
    assert!(tried > 200, "{tried} of {}", paths.len());
}
