//! Validation of the camera.

use super::{Check, Checked};
use crate::{Camera, Projection};

/// Most corners of a lens opening: more look like a disk.
const MOST_BLADES: u32 = 64;

pub(super) fn validate_camera(c: &Check, camera: &Camera) -> Checked {
    c.without_shear("world_from_camera", &camera.world_from_camera)?;
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
