//! Validation of the camera.

use glam::DMat3;

use super::{Check, Checked, unit_columns};
use crate::{Camera, Projection};

/// Largest cosine between two axes of a camera. Blender's matrices are f32, and a chain of parents leaves errors of some 1e-6; a shear
/// that is visible in a picture of 4096 pixels (a quarter pixel at its edge) is above this limit.
const MOST_CAMERA_SHEAR: f64 = 1e-4;

/// Most corners of a lens opening: more look like a disk.
const MOST_BLADES: u32 = 64;

pub(super) fn validate_camera(c: &Check, camera: &Camera) -> Checked {
    c.matrix("world_from_camera", &camera.world_from_camera)?;
    let m = unit_columns(&camera.world_from_camera.matrix3).unwrap_or(DMat3::IDENTITY);
    let shear = [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)];
    c.field("world_from_camera", shear.iter().all(|s| s.abs() <= MOST_CAMERA_SHEAR), || {
        format!("expected axes at right angles, got cosines {shear:?} between them")
    })?;
    match camera.projection {
        Projection::Perspective { fov_rad } => {
            let good = fov_rad > 0.0 && fov_rad < std::f64::consts::PI;
            c.field("projection.perspective.fov_rad", good, || {
                format!("expected above 0 and below π, got {fov_rad}")
            })?;
        }
        Projection::Orthographic { scale } => c.above("projection.orthographic.scale", scale, 0.0)?,
    }
    for (i, v) in camera.shift.iter().enumerate() {
        c.field(&format!("shift[{i}]"), v.is_finite(), || format!("expected a finite number, got {v}"))?;
    }
    let [near, far] = camera.clip;
    c.field("clip", near >= 0.0 && near < far && far.is_finite(), || {
        format!("expected 0 ≤ near < far, got {near} and {far}")
    })?;
    let Some(aperture) = &camera.aperture else { return Ok(()) };
    c.above("aperture.radius", aperture.radius, 0.0)?;
    c.above("aperture.focus_distance", aperture.focus_distance, 0.0)?;
    let blades = aperture.blades;
    c.field("aperture.blades", blades == 0 || (3..=MOST_BLADES).contains(&blades), || {
        format!("expected 0 or 3 to {MOST_BLADES}, got {blades}")
    })?;
    let rotation = aperture.rotation_rad;
    c.field("aperture.rotation_rad", rotation.is_finite(), || {
        format!("expected a finite number, got {rotation}")
    })?;
    c.above("aperture.ratio", aperture.ratio, 0.0)
}
