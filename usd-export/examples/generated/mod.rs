//! What the examples that write scenes of generated volumes share: a scene with one volume, and the file of its labels.
//!
//! ```text
//! NAME.labels   dims as 3 u32, number of labels, whether each label is shown, dense index + 1 at each voxel, x fastest; all u32
//! ```

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use glam::DAffine3;
use pumice_oracle::Dense;
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Projection, Reading, SCENE_VERSION, Scene,
    Settings, World,
};
use pumice_transport::LoadedScene;

/// The result of an example.
pub(crate) type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// A scene with one volume under an even sky, seen by a perspective camera in this place.
pub(crate) fn scene(style: LabelStyle, world_from_index: DAffine3, world_from_camera: DAffine3) -> Scene {
    Scene {
        version: SCENE_VERSION,
        instances: vec![Instance {
            id: 7,
            source: "generated".into(),
            reading: Reading::default(),
            world_from_index,
            style,
        }],
        camera: Camera::new(world_from_camera, Projection::Perspective { fov_rad: 0.7 }),
        film: Film::new(64, 48, Filter::Box { width: 1.0 }),
        world: World { environment: Environment::Constant { radiance: [1.0; 3] }, backdrop: None },
        suns: vec![],
        lights: vec![],
        meshes: vec![],
        cuts: vec![],
        settings: Settings::default(),
    }
}

/// Writes the labels of a scene's first volume (see the module).
pub(crate) fn write_labels(folder: &Path, name: &str, dense: &Dense, loaded: &LoadedScene) -> Outcome {
    let mut file = BufWriter::new(File::create(folder.join(format!("{name}.labels")))?);
    let visible = loaded.visible(0).into_iter().map(u32::from);
    for number in dense.dims.into_iter().chain([loaded.visible(0).len() as u32]).chain(visible) {
        file.write_all(&number.to_le_bytes())?;
    }
    file.write_all(bytemuck::cast_slice(&dense.labels))?;
    Ok(file.flush()?)
}
