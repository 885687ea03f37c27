//! Light sources: the environment, suns and lamps.

use std::path::PathBuf;

use glam::DAffine3;
use serde::{Deserialize, Serialize};

/// Radiance that arrives from infinity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Environment {
    /// The same radiance from every direction.
    Constant {
        /// Linear RGB radiance.
        radiance: [f32; 3],
    },
    /// An equirectangular picture (OpenEXR), laid out as in Cycles' `direction_to_equirectangular`: its centre is in direction +x, its
    /// left quarter in direction +y, and its first row is up (+z).
    Image {
        /// The file; relative paths are relative to the scene file.
        path: PathBuf,
        /// Rotation about +z, counter-clockwise seen from above.
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
    /// The environment, which lights the scene and is seen in reflections.
    pub environment: Environment,
    /// Background that camera rays see where they hit nothing, instead of the environment: linear RGB at the bottom and the top of
    /// the picture, blended between.
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

/// A lamp that stands in the scene, in Blender's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Its kind, position and size.
    pub shape: LightShape,
    /// Blender's *Power* in watts, at least 0. As in Blender, a point or spot light of power P has the radiant intensity P / (4π) W/sr
    /// (a spot only within its cone, so that a narrower cone emits less in total), and an area light emits P in total, however narrow
    /// its spread.
    pub power_w: f32,
    /// Linear RGB factor.
    #[serde(default = "white")]
    pub color: [f32; 3],
    /// Whether camera rays see it: Blender's *Camera* ray visibility, which is off for new lamps. Reflections always see it.
    #[serde(default)]
    pub visible_to_camera: bool,
}

/// The kinds of lamps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightShape {
    /// A sphere that emits evenly; with radius 0 a point.
    Point {
        /// Its centre, world space.
        position: [f64; 3],
        /// In world units, at least 0.
        radius: f64,
        /// Blender's *Soft Falloff*: a disk that always faces the shaded point, instead of the sphere. On for Blender's new lamps.
        #[serde(default)]
        soft_falloff: bool,
    },
    /// A sphere whose light is limited to a cone.
    Spot {
        /// Its centre, world space.
        position: [f64; 3],
        /// Axis along which the cone opens, world space; any length above 0.
        direction: [f64; 3],
        /// In world units, at least 0.
        radius: f64,
        /// Full angle of the cone, in [0, π].
        angle_rad: f64,
        /// Softness of the cone's edge: 0 ends sharply, 1 fades from the axis outwards.
        blend: f32,
        /// As for a point light.
        #[serde(default)]
        soft_falloff: bool,
    },
    /// A flat shape that emits to one side.
    Area {
        /// Lamp to world: the lamp lies in the plane z = 0, centred on the origin, and emits along −z. Columns are perpendicular, of any length.
        world_from_light: DAffine3,
        /// Rectangle or ellipse.
        outline: Outline,
        /// Extent along x and y in the lamp's own space, above 0.
        size: [f64; 2],
        /// Full angle of emission: π covers the whole half-space, as a diffuse emitter; a smaller angle narrows it like a honeycomb grid.
        #[serde(default = "half_turn")]
        spread_rad: f64,
    },
}

/// Outline of an area light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outline {
    /// A rectangle (a square with equal sides).
    Rectangle,
    /// An ellipse (a disk with equal sides).
    Ellipse,
}

fn half_turn() -> f64 {
    std::f64::consts::PI
}
