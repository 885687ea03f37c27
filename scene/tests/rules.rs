//! Every rule of validation: one scene that breaks it, and the path of the field that must be named.

#![allow(clippy::expect_used, clippy::panic, reason = "tests")]

use glam::{DAffine3, DVec3};
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Lod, Material, Projection, SCENE_VERSION, Scene,
    SceneError, Settings, Show, Sun, World,
};

fn instance(id: u32) -> Instance {
    let mut style = LabelStyle::default();
    style.materials.insert(12, Material::default());
    Instance { id, source: "a.pumice".into(), world_from_index: DAffine3::IDENTITY, style }
}

fn scene() -> Scene {
    Scene {
        version: SCENE_VERSION,
        instances: vec![instance(0), instance(1)],
        camera: Camera {
            world_from_camera: DAffine3::IDENTITY,
            projection: Projection::Perspective { fov_rad: 1.0 },
            shift: [0.0; 2],
            clip: [0.0, f64::MAX],
        },
        film: Film { width: 4, height: 3, filter: Filter::Box { width: 1.0 } },
        world: World {
            environment: Environment::Image { path: "a.exr".into(), rotation_rad: 0.0, strength: 1.0 },
            backdrop: Some([[0.0; 3]; 2]),
        },
        suns: vec![Sun { direction: [0.0, 0.0, -1.0], strength: 1.0, color: [1.0; 3], angle_rad: 0.0 }],
        settings: Settings::default(),
    }
}

/// Each breaks `scene` in one place; the path that must be named stands beside it.
type Fault = (&'static str, fn(&mut Scene));

fn flat() -> DAffine3 {
    DAffine3::from_cols(DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 1e-14), DVec3::ZERO)
}

#[rustfmt::skip]
const FAULTS: &[Fault] = &[
    ("instances[1].id", |s| s.instances[1].id = 0),
    ("instances[1].source", |s| s.instances[1].source = "".into()),
    ("instances[0].world_from_index", |s| s.instances[0].world_from_index = flat()),
    ("instances[0].world_from_index", |s| s.instances[0].world_from_index.matrix3.x_axis = DVec3::ZERO),
    ("instances[0].world_from_index", |s| s.instances[0].world_from_index.translation.x = f64::NAN),
    ("instances[0].style.material.base_color", |s| s.instances[0].style.material.base_color[1] = 1.001),
    ("instances[0].style.material.base_color", |s| s.instances[0].style.material.base_color[2] = -0.1),
    ("instances[0].style.material.base_color", |s| s.instances[0].style.material.base_color[2] = f32::NAN),
    ("instances[1].style.materials.12.metallic", |s| style(s).metallic = 1.1),
    ("instances[1].style.materials.12.metallic", |s| style(s).metallic = f32::NAN),
    ("instances[1].style.materials.12.roughness", |s| style(s).roughness = -0.1),
    ("instances[1].style.materials.12.specular", |s| style(s).specular = f32::INFINITY),
    ("instances[1].style.materials.12.ior", |s| style(s).ior = 0.99),
    ("instances[1].style.materials.12.emission", |s| style(s).emission[0] = f32::INFINITY),
    ("camera.world_from_camera", |s| s.camera.world_from_camera = flat()),
    ("camera.projection.perspective.fov_rad", |s| s.camera.projection = Projection::Perspective { fov_rad: 0.0 }),
    ("camera.projection.perspective.fov_rad", |s| s.camera.projection = Projection::Perspective { fov_rad: 3.2 }),
    ("camera.projection.orthographic.scale", |s| s.camera.projection = Projection::Orthographic { scale: 0.0 }),
    ("camera.shift", |s| s.camera.shift[1] = f64::INFINITY),
    ("camera.clip", |s| s.camera.clip = [1.0, 1.0]),
    ("camera.clip", |s| s.camera.clip = [-1.0, 1.0]),
    ("camera.clip", |s| s.camera.clip = [0.0, f64::INFINITY]),
    ("film.width", |s| s.film.width = 0),
    ("film.height", |s| s.film.height = 65_537),
    ("film.width", |s| (s.film.width, s.film.height) = (65_536, 65_536)),
    ("film.filter.box.width", |s| s.film.filter = Filter::Box { width: 0.0 }),
    ("film.filter.blackman_harris.width", |s| s.film.filter = Filter::BlackmanHarris { width: f32::NAN }),
    ("world.environment.constant.radiance", |s| s.world.environment = Environment::Constant { radiance: [-1.0; 3] }),
    ("world.environment.image.path", |s| s.world.environment = image("", 0.0, 1.0)),
    ("world.environment.image.rotation_rad", |s| s.world.environment = image("a", f64::NAN, 1.0)),
    ("world.environment.image.strength", |s| s.world.environment = image("a", 0.0, -1.0)),
    ("world.backdrop", |s| s.world.backdrop = Some([[0.0; 3], [f32::NAN; 3]])),
    ("suns[0].direction", |s| s.suns[0].direction = [0.0; 3]),
    ("suns[0].direction", |s| s.suns[0].direction[0] = f64::INFINITY),
    ("suns[0].strength", |s| s.suns[0].strength = -1.0),
    ("suns[0].color", |s| s.suns[0].color[0] = -1.0),
    ("suns[0].angle_rad", |s| s.suns[0].angle_rad = 3.15),
    ("settings.bounces", |s| s.settings.bounces = u32::MAX),
    ("settings.ao_distance", |s| s.settings.ao_distance = 0.0),
    ("settings.lod.distance.pixels", |s| s.settings.lod = Lod::Distance { pixels: 0.0 }),
];

fn style(s: &mut Scene) -> &mut Material {
    s.instances[1].style.materials.get_mut(&12).expect("there")
}

fn image(path: &str, rotation_rad: f64, strength: f32) -> Environment {
    Environment::Image { path: path.into(), rotation_rad, strength }
}

#[test]
fn each_rule_names_its_field() {
    scene().validate().expect("the unbroken scene is valid");
    for (i, (path, fault)) in FAULTS.iter().enumerate() {
        let mut scene = scene();
        fault(&mut scene);
        match scene.validate() {
            Err(SceneError::Field { field, problem }) => {
                assert_eq!(field, *path, "fault {i}: {problem}");
                assert!(!problem.is_empty() && !problem.contains('\n'));
            }
            other => panic!("fault {i} of {path}: {other:?}"),
        }
        assert!(scene.to_json().is_err(), "an invalid scene is not written");
    }
    let mut other = scene();
    other.version = 2;
    assert!(matches!(other.validate(), Err(SceneError::Version { got: 2, .. })));
}

/// Values at the very edge of what is allowed pass.
#[test]
fn edges_are_inside() {
    let mut s = scene();
    s.film = Film { width: 65_536, height: 16_384, filter: Filter::BlackmanHarris { width: 16.0 } };
    s.suns[0].angle_rad = std::f64::consts::PI;
    s.suns[0].direction = [0.0, 0.0, 1e-150];
    s.settings.bounces = 1 << 20;
    *style(&mut s) =
        Material { base_color: [1.0; 3], metallic: 1.0, roughness: 0.0, ior: 1.0, ..Material::default() };
    s.instances[0].world_from_index = DAffine3::from_scale(DVec3::new(1e-9, -1.0, 1e9));
    s.camera.clip = [0.0, f64::MIN_POSITIVE];
    s.validate().expect("valid");
}

#[test]
fn labels_that_are_to_be_drawn_must_be_there() {
    let ids = [2, 5, 98_340_797];
    let mut i = instance(0);
    for (show, bad) in [
        (Show::All, None),
        (Show::Only(vec![]), None),
        (Show::Only(vec![5, 2, 5]), None),
        (Show::Except(vec![3]), None),
        (Show::Only(vec![5, 3]), Some("instances[4].style.show.only[1]: the volume has no label 3")),
        (Show::Only(vec![0]), Some("instances[4].style.show.only[0]: 0 is the background")),
    ] {
        i.style.show = show;
        match (i.validate_ids(4, &ids), bad) {
            (Ok(()), None) => {}
            (Err(e), Some(text)) => assert!(e.to_string().starts_with(text), "{e}"),
            (got, _) => panic!("{:?}: {got:?}", i.style.show),
        }
    }
    i.style.show = Show::Only(vec![1]);
    assert!(i.validate_ids(0, &[]).is_err());
}
