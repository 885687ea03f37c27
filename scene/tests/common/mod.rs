//! A scene in which every field is set to something other than its default.

use glam::{DAffine3, DMat3, DVec3};
use pumice_scene::{
    AbsentChunks, Adaptive, Aperture, AxisOrder, Camera, Cut, CutShape, Environment, Film, Filter, Instance,
    LabelGroup, LabelGroups, LabelStyle, LevelOfFile, Light, LightShape, Lod, Material, Mesh, Mode, Outline,
    Passes, Projection, RawVoxels, Reading, SCENE_VERSION, Scene, SensorFit, Settings, Show, Sun,
    ViewTransform, World,
};

pub(crate) fn full_scene() -> Scene {
    let green = Material {
        base_color: [0.1, 0.7, 0.2],
        metallic: 0.25,
        roughness: 0.3,
        specular: 0.75,
        specular_tint: [0.9, 0.8, 0.7],
        ior: 1.33,
        transmission: 0.5,
        subsurface: 0.125,
        subsurface_radius: [0.3, 0.2, 0.1],
        coat: 0.6,
        coat_roughness: 0.05,
        coat_ior: 1.6,
        coat_tint: [0.95, 0.9, 0.85],
        sheen: 0.35,
        sheen_roughness: 0.4,
        sheen_tint: [0.2, 0.4, 0.6],
        alpha: 0.55,
        multiscatter: false,
        emission: [0.0, 2.5, 0.0],
    };
    let instance = |id: u32, x: f64| Instance {
        id,
        source: format!("volume-{id}.pumice").into(),
        reading: Reading {
            layer: Some(1),
            time: Some(2),
            channel: Some(3),
            array: Some("cells".into()),
            axes: Some(AxisOrder::Zyx),
            spacing: Some([4.0, 5.0, 0.1]),
            raw: Some(RawVoxels {
                dims: [9, 8, 7],
                label_type: pumice_core::LabelType::U16,
                big_endian: true,
                offset: 352,
            }),
            scale: Some(LevelOfFile::Size([8.0, 8.0, 4.5])),
            roi: Some([[Some(1), None], [None, Some(7)], [Some(0), Some(5)]]),
            label: Some("nuclei".into()),
            dataset: Some("main/labels".into()),
            missing_chunks: Some(AbsentChunks::Error),
            relabel: Some("segments.csv".into()),
        },
        world_from_index: DAffine3::from_mat3_translation(
            DMat3::from_diagonal(DVec3::new(-0.5, 0.25, 2.0)),
            DVec3::new(x, 2.0, 3.0),
        ),
        style: LabelStyle {
            show: Show::Only(vec![3, 17, u64::MAX]),
            material: Material { roughness: 0.9, ..Material::default() },
            auto_color: true,
            groups: LabelGroups::new(vec![
                LabelGroup::new(green, vec![3], vec![[0.5, 0.25, 0.125]]).unwrap(),
                LabelGroup::new(Material { ior: 1.1, ..green }, vec![5, 6], vec![]).unwrap(),
            ])
            .unwrap(),
            materials: [(17, green), (u64::MAX, Material { metallic: 1.0, ..green })].into(),
        },
    };
    let mesh = |id: u32, x: f64| Mesh {
        id,
        source: format!("mesh-{id}.ply").into(),
        world_from_mesh: DAffine3::from_translation(DVec3::new(x, 0.0, 1.0)),
        materials: vec![green, Material { roughness: 0.1, ..Material::default() }],
        shadow_catcher: true,
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
            fit: SensorFit::Vertical,
            shift: [0.1, -0.2],
            clip: [0.5, 1e6],
            aperture: Some(Aperture {
                radius: 0.02,
                focus_distance: 9.5,
                blades: 6,
                rotation_rad: 0.3,
                ratio: 2.0,
            }),
        },
        film: Film {
            pixel_aspect: 1.5,
            transparent: true,
            background: Some([0.25, 0.5, 0.75]),
            passes: Passes::ALL,
            cryptomatte_ranks: 8,
            shadow_fade: 0.125,
            half: true,
            view_transform: ViewTransform::Agx,
            ..Film::new(640, 360, Filter::BlackmanHarris { width: 3.0 })
        },
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
        lights: vec![
            Light {
                shape: LightShape::Point { position: [1.0, 2.0, 3.0], radius: 0.1, soft_falloff: true },
                power_w: 100.0,
                color: [1.0, 0.5, 0.25],
                visible_to_camera: false,
            },
            Light {
                shape: LightShape::Spot {
                    position: [-1.0, 0.0, 5.0],
                    direction: [0.0, 0.5, -1.0],
                    radius: 0.2,
                    angle_rad: 0.8,
                    blend: 0.15,
                    soft_falloff: false,
                },
                power_w: 50.0,
                color: [0.9, 0.8, 0.7],
                visible_to_camera: false,
            },
            Light {
                shape: LightShape::Area {
                    world_from_light: DAffine3::from_translation(DVec3::new(0.0, 0.0, 8.0)),
                    outline: Outline::Ellipse,
                    size: [2.0, 1.0],
                    spread_rad: 2.5,
                },
                power_w: 75.0,
                color: [0.7, 0.8, 0.9],
                visible_to_camera: false,
            },
        ],
        meshes: vec![mesh(3, -2.0), mesh(4, 2.0)],
        cuts: vec![
            Cut {
                shape: CutShape::Plane { point: [0.0, 0.5, 0.0], normal: [0.0, 1.0, 0.5] },
                instances: Some(vec![8]),
            },
            Cut {
                shape: CutShape::Box { world_from_box: DAffine3::from_scale(DVec3::new(1.0, 2.0, 3.0)) },
                instances: Some(vec![7, 8]),
            },
        ],
        settings: Settings {
            mode: Mode::OneBounce,
            bounces: 5,
            russian_roulette: false,
            ao_distance: 12.5,
            lod: Lod::Distance { pixels: 1.5 },
            seed: u64::MAX,
            clamp_direct: 100.0,
            clamp_indirect: 10.0,
            adaptive: Some(Adaptive { threshold: 0.02, min_spp: 16 }),
            smooth_voxels: true,
        },
    }
}
