//! Suns and lamps as UsdLux lights.
//!
//! Power is normalised (`inputs:normalize`): then the intensity I does not depend on the light's size, and
//!
//! | light | UsdLux: radiance | ours | so I is |
//! |---|---|---|---|
//! | sun of angular diameter 2θ | I / (π sin² θ): irradiance I | irradiance E | E |
//! | ball of radius r | I / (4π r²): as a disk of π r² it has I / 4 in W/sr | P / (4π) W/sr | P / π |
//! | rectangle or ellipse of area A | I / A | P / (π A) | P / π |
//!
//! (UsdLux, `LightAPI` *inputs:normalize*, with lights of each family.) Blender's importer makes P of π I for lamps, and 4 I and 4θ of I and
//! 2θ for suns.
//!
//! **A point** is a ball that is to be treated as a point. It has a radius all the same, for programs that disregard that hint: so small
//! that its shadows are sharp as seen from the camera.
//!
//! **A spot** fades at the edge of its cone over angles in UsdLux, and over cosines in Pumice and Cycles. The softness is such that both fade
//! from the same angle on. Between that and the edge they differ by at most 0.02 of the light in the axis at a blend of 0.15, 0.07 at 0.5 and
//! 0.36 at 1 (a softness equal to the blend: 0.54, 0.47, 0.36). Blender's importer takes the softness for its blend, which is ours.
//!
//! What UsdLux has no word for is a note: spread, soft falloff, visibility to the camera.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3};
use pumice_scene::{Light, LightShape, Outline, Sun};

use super::placement::{facing, note, placement, without_scale};
use crate::Reader;
use crate::usd::{Prim, Property, Value};

/// Radius of a point, as a part of its distance from the camera: a tenth of a pixel of a picture 4000 pixels wide, or less.
const POINT: f64 = 1e-5;

fn input(name: &str, type_name: &'static str, value: Value<'static>) -> Property<'static> {
    Property::new(format!("inputs:{name}"), type_name, value)
}

fn float(name: &str, value: f64) -> Property<'static> {
    input(name, "float", Value::Float(value as f32))
}

/// What all lights have.
fn emission(intensity: f64, color: [f32; 3]) -> [Property<'static>; 4] {
    [
        float("intensity", intensity),
        float("exposure", 0.0),
        input("normalize", "bool", Value::Bool(true)),
        input("color", "color3f", Value::Float3(color)),
    ]
}

/// A sun as a DistantLight.
pub(super) fn sun(number: usize, sun: &Sun, reader: Reader) -> Prim<'static> {
    let (strength, angle_rad) = (f64::from(sun.strength), sun.angle_rad);
    let (intensity, angle_rad) = match reader {
        Reader::Specification => (strength, angle_rad),
        Reader::Blender => (0.25 * strength, 0.5 * angle_rad),
    };
    let mut properties = Vec::from(placement(&facing(DVec3::ZERO, DVec3::from_array(sun.direction))));
    properties.extend(emission(intensity, sun.color));
    properties.push(float("angle", angle_rad.to_degrees()));
    Prim { name: format!("sun_{number}"), type_name: "DistantLight", properties, ..Prim::default() }
}

/// A lamp as a SphereLight, a RectLight or a DiskLight. `eye` is the camera's position.
pub(super) fn lamp(number: usize, light: &Light, eye: DVec3, reader: Reader) -> Prim<'static> {
    let (type_name, world_from_light, mut shape) = match light.shape {
        LightShape::Point { position, radius, soft_falloff } => {
            let position = DVec3::from_array(position);
            let shape = ball(position, radius, soft_falloff, eye);
            ("SphereLight", DAffine3::from_translation(position), shape)
        }
        LightShape::Spot { position, direction, radius, angle_rad, blend, soft_falloff } => {
            let position = DVec3::from_array(position);
            let mut shape = ball(position, radius, soft_falloff, eye);
            let half_angle = 0.5 * angle_rad;
            let softness = match reader {
                Reader::Specification => softness(half_angle, blend.into()),
                Reader::Blender => blend.into(),
            };
            shape.push(float("shaping:cone:angle", half_angle.to_degrees()));
            shape.push(float("shaping:cone:softness", softness));
            shape.push(note("blend", "double", Value::Double(blend.into())));
            ("SphereLight", facing(position, DVec3::from_array(direction)), shape)
        }
        LightShape::Area { world_from_light, outline, size, spread_rad } => {
            let spread = note("spread_deg", "double", Value::Double(spread_rad.to_degrees()));
            let (type_name, matrix, mut shape) = flat(&world_from_light, outline, size);
            shape.push(spread);
            (type_name, matrix, shape)
        }
    };
    let mut properties = Vec::from(placement(&world_from_light));
    properties.extend(emission(f64::from(light.power_w) / PI, light.color));
    properties.append(&mut shape);
    properties.push(note("visible_to_camera", "bool", Value::Bool(light.visible_to_camera)));
    let is_spot = matches!(light.shape, LightShape::Spot { .. });
    Prim {
        name: format!("lamp_{number}"),
        type_name,
        api_schemas: if is_spot { vec!["ShapingAPI"] } else { vec![] },
        properties,
        ..Prim::default()
    }
}

fn ball(position: DVec3, radius: f64, soft_falloff: bool, eye: DVec3) -> Vec<Property<'static>> {
    // As a radius in f32, which is what the file has.
    let is_point = (radius as f32) == 0.0;
    let distance = (position - eye).length();
    let sharp = POINT * if distance > 0.0 { distance } else { 1.0 };
    vec![
        float("radius", if is_point { sharp } else { radius }),
        Property::new("treatAsPoint", "bool", Value::Bool(is_point)),
        note("soft_falloff", "bool", Value::Bool(soft_falloff)),
    ]
}

/// A flat lamp: its type, its matrix and its extent. An ellipse is a disk of radius ½ that its matrix stretches.
fn flat(
    world_from_light: &DAffine3,
    outline: Outline,
    size: [f64; 2],
) -> (&'static str, DAffine3, Vec<Property<'static>>) {
    let axes = world_from_light.matrix3;
    let [width, height] = [axes.x_axis.length() * size[0], axes.y_axis.length() * size[1]];
    let matrix = without_scale(world_from_light);
    match outline {
        Outline::Rectangle => ("RectLight", matrix, vec![float("width", width), float("height", height)]),
        Outline::Ellipse => {
            let stretched = matrix.matrix3 * DMat3::from_diagonal(DVec3::new(width, height, 1.0));
            let matrix = DAffine3::from_mat3_translation(stretched, matrix.translation);
            ("DiskLight", matrix, vec![float("radius", 0.5)])
        }
    }
}

/// UsdLux's softness of a cone whose light begins to fade where Cycles' does: where 1 − cos is 1 − blend of that of the cone's edge.
fn softness(half_angle: f64, blend: f64) -> f64 {
    // 1 − cos h = 2 sin²(h/2) keeps narrow cones exact.
    let start = 2.0 * ((1.0 - blend).sqrt() * (0.5 * half_angle).sin()).asin();
    if half_angle > 0.0 { (1.0 - start / half_angle).clamp(0.0, 1.0) } else { blend }
}
