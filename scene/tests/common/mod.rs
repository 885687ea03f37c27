//! A scene in which every field is set and none has its default.

use glam::{DAffine3, DMat3, DVec3};
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Lod, Material, Mode, Projection, SCENE_VERSION,
    Scene, Settings, Show, Sun, World,
};

pub(crate) fn full_scene() -> Scene {
    let green = Material {
        base_color: [0.1, 0.7, 0.2],
        metallic: 0.25,
        roughness: 0.3,
        specular: 0.75,
        ior: 1.33,
        emission: [0.0, 2.5, 0.0],
    };
    let instance = |id: u32, x: f64| Instance {
        id,
        source: format!("volume-{id}.pumice").into(),
        world_from_index: DAffine3::from_mat3_translation(
            DMat3::from_diagonal(DVec3::new(-0.5, 0.25, 2.0)),
            DVec3::new(x, 2.0, 3.0),
        ),
        style: LabelStyle {
            show: Show::Only(vec![3, 17, u64::MAX]),
            material: Material { roughness: 0.9, ..Material::default() },
            auto_color: true,
            materials: [(17, green), (u64::MAX, Material { metallic: 1.0, ..green })].into(),
        },
    };
    Scene {
        version: SCENE_VERSION,
        instances: vec![instance(7, -1.0), instance(8, 1.0)],
        camera: Camera {
            world_from_camera: DAffine3::from_rotation_translation(
                glam::DQuat::from_rotation_x(1.1),
                DVec3::new(0.0, -10.0, 4.0),
            ),
            projection: Projection::Perspective { fov_rad: 0.7 },
            shift: [0.1, -0.2],
            clip: [0.5, 1e6],
        },
        film: Film { width: 640, height: 360, filter: Filter::BlackmanHarris { width: 3.0 } },
        world: World {
            environment: Environment::Image {
                path: "sky/dawn.exr".into(),
                rotation_rad: -0.4,
                strength: 1.5,
            },
            backdrop: Some([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]),
        },
        suns: vec![
            Sun { direction: [1.0, 2.0, -3.0], strength: 3.0, color: [1.0, 0.9, 0.8], angle_rad: 0.01 },
            Sun { direction: [0.0, 0.0, -1.0], strength: 0.5, color: [0.5, 0.6, 0.7], angle_rad: 0.0 },
        ],
        settings: Settings {
            mode: Mode::OneBounce,
            bounces: 5,
            russian_roulette: false,
            ao_distance: 12.5,
            lod: Lod::Distance { pixels: 1.5 },
            seed: u64::MAX,
        },
    }
}
