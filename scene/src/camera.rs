//! The camera: its pose, its projection and its depth of field.

use glam::DAffine3;
use serde::{Deserialize, Serialize};

/// Which side of the picture the field of view, the orthographic scale and the shift are measured along (Blender's *Sensor Fit*).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorFit {
    /// The longer side, with the pixel aspect taken into account.
    #[default]
    Auto,
    /// The width.
    Horizontal,
    /// The height.
    Vertical,
}

/// How rays leave the camera. The *fitted side* is the side of the picture that [`SensorFit`] chooses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Projection {
    /// A pinhole; `fov_rad` spans the fitted side.
    Perspective {
        /// Full angle over the fitted side, in (0, π).
        fov_rad: f64,
    },
    /// Parallel rays; `scale` is the extent in world units of the fitted side (Blender's *Orthographic Scale*).
    Orthographic {
        /// Extent of the fitted side, above 0.
        scale: f64,
    },
}

/// A lens opening of finite size: what is not at the focus distance is blurred (Blender's *Depth of Field*).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aperture {
    /// Radius in world units, above 0. Blender's f-stop N gives focal length / (2 N), both in metres; 1 / (2 N) for an
    /// orthographic camera.
    pub radius: f64,
    /// Distance of the plane in focus along the view axis, in world units, above 0.
    pub focus_distance: f64,
    /// Corners of the opening: 0 for a disk, else 3 to 64.
    #[serde(default)]
    pub blades: u32,
    /// Rotation of the opening about the view axis.
    #[serde(default)]
    pub rotation_rad: f64,
    /// Width over height of the blur (anamorphic lenses), above 0; the opening's extent along x is divided by it.
    #[serde(default = "one")]
    pub ratio: f64,
}

fn one() -> f64 {
    1.0
}

/// A camera. It looks along −z with +y up and +x right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Camera to world: rigid or mirrored; its scale is ignored.
    pub world_from_camera: DAffine3,
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Which side the projection and the shift are measured along.
    #[serde(default)]
    pub fit: SensorFit,
    /// Shift of the picture in units of its fitted side, as Blender's lens shift.
    #[serde(default)]
    pub shift: [f64; 2],
    /// Distances along the view axis outside which nothing is seen: [near, far], 0 ≤ near < far.
    #[serde(default = "Camera::default_clip")]
    pub clip: [f64; 2],
    /// Depth of field; without it everything is sharp.
    #[serde(default)]
    pub aperture: Option<Aperture>,
}

impl Camera {
    /// A camera without shift, clipping and depth of field.
    pub fn new(world_from_camera: DAffine3, projection: Projection) -> Self {
        Self {
            world_from_camera,
            projection,
            fit: SensorFit::Auto,
            shift: [0.0; 2],
            clip: Self::default_clip(),
            aperture: None,
        }
    }

    fn default_clip() -> [f64; 2] {
        [0.0, f64::MAX]
    }
}
