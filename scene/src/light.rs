//! What lights the scene.

use std::path::PathBuf;

use glam::DAffine3;
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

/// A lamp that stands in the scene, in Blender's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Where it is and what it is like.
    pub shape: LightShape,
    /// Blender's *Power* in watts, at least 0. As there, a point or spot light of power P has the radiant intensity P / (4π) W/sr (a spot:
    /// within its cone, the narrower, the less in all), and an area light sends out P in all, however narrow its spread.
    pub power_w: f32,
    /// Linear RGB factor.
    #[serde(default = "white")]
    pub color: [f32; 3],
    /// Whether camera rays see it, as Blender's *Camera* ray visibility, which is off for new lamps. (Reflections always see it.)
    #[serde(default)]
    pub visible_to_camera: bool,
}

/// The kinds of lamps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LightShape {
    /// A ball that shines evenly; of radius 0: a point.
    Point {
        /// Its middle, world space.
        position: [f64; 3],
        /// In world units, at least 0.
        radius: f64,
        /// Blender's *Soft Falloff*: a disk that faces whoever looks, instead of the ball. On for Blender's new lamps.
        #[serde(default)]
        soft_falloff: bool,
    },
    /// A ball whose light is held within a cone.
    Spot {
        /// Its middle, world space.
        position: [f64; 3],
        /// Along which the cone opens, world space; any length above 0.
        direction: [f64; 3],
        /// In world units, at least 0.
        radius: f64,
        /// Full angle of the cone, in [0, π].
        angle_rad: f64,
        /// How softly the cone ends: 0 sharply, 1 from the axis on.
        blend: f32,
        /// As a point's.
        #[serde(default)]
        soft_falloff: bool,
    },
    /// A flat shape that shines to one side.
    Area {
        /// Lamp to world: it lies in the plane z = 0 about the origin and shines along −z. Columns need not be unit vectors.
        world_from_light: DAffine3,
        /// Rectangle or ellipse.
        outline: Outline,
        /// Extent along x and y in the lamp's own space, above 0.
        size: [f64; 2],
        /// Full angle in which it shines: π is all of its side, as a surface that emits evenly; less narrows it as a honeycomb grid does.
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
