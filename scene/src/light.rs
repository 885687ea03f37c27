//! What lights the scene.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Radiance that arrives from infinity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Environment {
    /// The same from everywhere.
    Constant {
        /// Linear RGB radiance.
        radiance: [f32; 3],
    },
    /// An equirectangular picture (OpenEXR), laid out as Cycles' `direction_to_equirectangular`: its middle is seen along +x, its
    /// left quarter along +y, its first row is up (+z).
    Image {
        /// The file; relative paths are relative to the scene file.
        path: PathBuf,
        /// Turn about +z, counter-clockwise seen from above.
        #[serde(default)]
        rotation_rad: f64,
        /// Factor on the picture's values.
        #[serde(default = "one")]
        strength: f32,
    },
}

fn one() -> f32 {
    1.0
}

/// The world around the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct World {
    /// What lights the scene and what reflections see.
    pub environment: Environment,
    /// What camera rays see where they hit nothing, if not the environment: linear RGB at the bottom and the top of the picture,
    /// blended between.
    #[serde(default)]
    pub backdrop: Option<[[f32; 3]; 2]>,
}

/// A distant disk light, in Blender's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sun {
    /// Direction in which the light travels, world space; any length above 0.
    pub direction: [f64; 3],
    /// Irradiance on a surface that faces it, W/m².
    pub strength: f32,
    /// Linear RGB factor.
    #[serde(default = "white")]
    pub color: [f32; 3],
    /// Angular diameter, in [0, π].
    pub angle_rad: f64,
}

fn white() -> [f32; 3] {
    [1.0; 3]
}
