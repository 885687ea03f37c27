//! What a scene has and its file has not.

use pumice_scene::Scene;

use crate::FileFormat;
use crate::scene_gltf::left_out_of_gltf;
use crate::scene_stage::left_out_of_stage;

/// What a file of this format leaves out of a scene, each in a few words for people.
pub fn left_out_of(scene: &Scene, format: FileFormat) -> Vec<String> {
    match format {
        FileFormat::Usda | FileFormat::Usdc | FileFormat::Usdz => left_out_of_stage(scene, format),
        FileFormat::Gltf | FileFormat::Glb => left_out_of_gltf(scene),
        FileFormat::Ply | FileFormat::Obj => surroundings(scene),
        FileFormat::Stl => {
            let mut all = surroundings(scene);
            all.push("labels and materials".into());
            all
        }
    }
}

/// Everything but the volumes.
fn surroundings(scene: &Scene) -> Vec<String> {
    let counted = |count: usize, [one, several]: [&str; 2]| match count {
        0 => None,
        1 => Some(format!("a {one}")),
        n => Some(format!("{n} {several}")),
    };
    [
        Some("the camera".into()),
        Some("the world".into()),
        counted(scene.suns.len(), ["sun", "suns"]),
        counted(scene.lights.len(), ["lamp", "lamps"]),
        counted(scene.meshes.len(), ["mesh", "meshes"]),
    ]
    .into_iter()
    .flatten()
    .collect()
}
