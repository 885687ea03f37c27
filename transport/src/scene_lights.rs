//! Prepares the lights of a scene.

use std::sync::Arc;

use pumice_picture::Image;
use pumice_scene::{Environment, Scene};

use crate::lights::{Lights, Sky};
use crate::{EnvironmentTable, ReadyLamp, ReadySun, RenderError};

/// Reads a scene-linear picture that a scene names as its environment; the caller provides the file access. Its error names the file.
pub type ReadImage = fn(&std::path::Path) -> Result<Image, String>;

/// The lights of a scene, with its environment picture read by `read_image`.
///
/// # Errors
/// [`RenderError::Source`] if the picture cannot be read.
pub fn scene_lights(scene: &Scene, read_image: ReadImage) -> Result<Lights, RenderError> {
    let sky = match &scene.world.environment {
        Environment::Constant { radiance } => Sky::Constant(glam::Vec3::from_array(*radiance)),
        Environment::Image { path, rotation_rad, strength } => {
            let at = |what: String| RenderError::Source(format!("{}: {what}", path.display()));
            let image = read_image(path).map_err(RenderError::Source)?;
            Sky::Image(Arc::new(EnvironmentTable::new(image, *strength, *rotation_rad).map_err(at)?))
        }
    };
    let lamps = scene.lights.iter().map(ReadyLamp::new).filter(ReadyLamp::is_lit).collect();
    let suns = scene.suns.iter().map(ReadySun::new).collect();
    Ok(Lights::new(sky, suns, scene.world.backdrop).with_lamps(lamps))
}
