//! What a scene has and its stage has not: UsdLux, UsdGeomCamera and packages have no words for it.

use pumice_scene::{Environment, LightShape, Scene};

use crate::FileFormat;
use crate::sky_picture::is_packable;

/// What a stage of this format leaves out of a scene's surroundings, each in a few words for people.
pub(crate) fn left_out_of_stage(scene: &Scene, format: FileFormat) -> Vec<String> {
    let of_several = |count: usize, [one, several]: [&str; 2]| match count {
        0 => None,
        1 => Some(one.to_owned()),
        n => Some(several.replace('N', &n.to_string())),
    };
    let picture = match &scene.world.environment {
        Environment::Image { path, .. } if format == FileFormat::Usdz && !is_packable(path) => {
            let name = path.file_name().unwrap_or_default().display();
            Some(format!("the world, whose picture {name} a usdz package cannot hold (OpenEXR it can)"))
        }
        _ => None,
    };
    let shaped = scene.camera.aperture.is_some_and(|a| a.blades != 0 || a.ratio != 1.0);
    let narrow = |shape: &LightShape| match shape {
        LightShape::Area { spread_rad, .. } => *spread_rad < std::f64::consts::PI,
        LightShape::Point { .. } | LightShape::Spot { .. } => false,
    };
    let catchers = scene.meshes.iter().filter(|mesh| mesh.shadow_catcher).count();
    [
        picture,
        scene.world.backdrop.map(|_| "the backdrop".to_owned()),
        shaped.then(|| "the shape of the camera's aperture".to_owned()),
        of_several(
            scene.lights.iter().filter(|light| narrow(&light.shape)).count(),
            ["the spread of an area lamp", "the spread of N area lamps"],
        ),
        of_several(catchers, ["that a mesh shows shadows alone", "that N meshes show shadows alone"]),
    ]
    .into_iter()
    .flatten()
    .collect()
}
