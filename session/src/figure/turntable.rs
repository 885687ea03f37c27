//! A turntable: the camera goes around the vertical axis, and everything else stays.

use glam::DAffine3;
use pumice_scene::{Camera, Scene};

/// The scene seen from a camera that has gone around the world's vertical axis by this angle, counter-clockwise from above. The light stays
/// where it is.
#[must_use]
pub fn turned(scene: &Scene, angle_rad: f64) -> Scene {
    let world_from_camera = DAffine3::from_rotation_z(angle_rad) * scene.camera.world_from_camera;
    Scene { camera: Camera { world_from_camera, ..scene.camera }, ..scene.clone() }
}
