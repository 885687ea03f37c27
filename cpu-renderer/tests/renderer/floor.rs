//! The volume and the scene of most tests of renderers.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Material, Projection, Reading, SCENE_VERSION,
    Scene, Settings, Sun, World,
};

/// A slab of label 5 with a tower of label 9 on it: 16 × 16 × 8 voxels, floor up to z = 2, tower 4 × 4 voxels to z = 8.
pub(crate) fn volume() -> Arc<CompressedVolume> {
    let mut labels = vec![0u8; 16 * 16 * 8];
    for (i, label) in labels.iter_mut().enumerate() {
        let (x, y, z) = (i % 16, i / 16 % 16, i / 256);
        *label = match z {
            0 | 1 => 5,
            _ if (12..16).contains(&x) && (12..16).contains(&y) => 9,
            _ => 0,
        };
    }
    Arc::new(compress_labels(VolumeInfo::new([16, 16, 8], LabelType::U8), LabelBuffer::U8(labels)).unwrap())
}

/// A scene that looks straight down on the floor's corner away from the tower: 3 × 3 voxels around (3, 3), every pixel floor.
pub(crate) fn looking_down(environment: Environment, suns: Vec<Sun>, material: Material) -> Scene {
    let lambert = material;
    Scene {
        version: SCENE_VERSION,
        instances: vec![Instance {
            id: 1,
            source: "memory".into(),
            reading: Reading::default(),
            world_from_index: DAffine3::IDENTITY,
            style: LabelStyle { material: lambert, ..LabelStyle::default() },
        }],
        camera: Camera::new(
            DAffine3 { matrix3: DMat3::IDENTITY, translation: DVec3::new(3.0, 3.0, 20.0) },
            Projection::Orthographic { scale: 3.0 },
        ),
        film: Film::new(8, 8, Filter::Box { width: 1.0 }),
        world: World { environment, backdrop: None },
        suns,
        lights: Vec::new(),
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings::default(),
    }
}

pub(crate) fn lambert(albedo: f32) -> Material {
    Material { base_color: [albedo; 3], specular: 0.0, roughness: 1.0, ..Material::default() }
}
