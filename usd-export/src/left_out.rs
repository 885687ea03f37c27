//! What a scene has and its file has not.

use pumice_scene::{Scene, Show};

use crate::scene_gltf::left_out_of_gltf;
use crate::scene_stage::left_out_of_stage;
use crate::{FileFormat, Form};

/// What a file of this format, with volumes in these forms, leaves out of a scene, each in a few words for people. Without `surroundings`
/// nothing but the volumes is asked for.
pub fn left_out_of(scene: &Scene, format: FileFormat, forms: &[Form], surroundings: bool) -> Vec<String> {
    let mut all = match format {
        _ if !surroundings => Vec::new(),
        FileFormat::Usda | FileFormat::Usdc | FileFormat::Usdz => left_out_of_stage(scene, format),
        FileFormat::Gltf | FileFormat::Glb => left_out_of_gltf(scene),
        FileFormat::Ply | FileFormat::Obj | FileFormat::Stl => surroundings_of(scene),
    };
    if format == FileFormat::Stl {
        all.push("labels and materials".into());
    }
    let shows_one = |show: &Show| matches!(show, Show::Only(ids) if ids.len() < 2);
    let styles = || scene.instances.iter().map(|instance| &instance.style);
    if styles().any(|style| style.lets_light_through() && !shows_one(&style.show)) {
        all.push("faces between labels that touch, which light reaches through glass and alpha".into());
    }
    if !scene.cuts.is_empty() && forms.contains(&Form::Instances) {
        all.push("what cuts take off the boxes of instances that they pass through".into());
    }
    all
}

/// Everything but the volumes.
fn surroundings_of(scene: &Scene) -> Vec<String> {
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
