//! Where the picture is taken from.

use glam::DAffine3;
use serde::{Deserialize, Serialize};

/// How rays leave the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Projection {
    /// A pinhole; `fov_rad` spans the longer side of the picture (Blender's sensor fit *Auto*).
    Perspective {
        /// Full angle over the longer side, in (0, π).
        fov_rad: f64,
    },
    /// Parallel rays; `scale` is the width in world units of the longer side (Blender's *Orthographic Scale*).
    Orthographic {
        /// Extent of the longer side, above 0.
        scale: f64,
    },
}

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Rigid or mirrored; its scale is ignored.
    pub world_from_camera: DAffine3,
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Shift of the picture in units of its longer side, as Blender's lens shift.
    #[serde(default)]
    pub shift: [f64; 2],
    /// Distances along the view axis outside which nothing is seen: [near, far], 0 ≤ near < far.
    #[serde(default = "Camera::default_clip")]
    pub clip: [f64; 2],
}

impl Camera {
    fn default_clip() -> [f64; 2] {
        [0.0, f64::MAX]
    }
}
