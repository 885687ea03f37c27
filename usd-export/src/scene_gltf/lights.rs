//! Suns, points and spots as KHR_lights_punctual, whose units are those of photometry.
//!
//! | ours | glTF |
//! |---|---|
//! | sun of E W/m² | directional, 683 E lux |
//! | point or spot of P watts: P / (4π) W/sr | 683 P / (4π) candela |
//! | spot of full angle α and blend b | outer cone α / 2, inner cone (1 − b) α / 2 |
//!
//! 683 lumens a watt is what Blender and others take for white light of no certain spectrum. The lights of glTF have no size: a sun's angle,
//! a lamp's radius and its soft falloff are lost. Area lights and the world have no word.

use std::f32::consts::FRAC_PI_2;
use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf_json::extensions::scene as scene_extensions;
use gltf_json::extensions::scene::khr_lights_punctual::{KhrLightsPunctual, Light, Spot, Type};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Index, Node, Root};
use pumice_scene::{LightShape, Scene};

use super::placement::{place, single};
use crate::Result;

/// Lumens a watt.
const LUMENS_A_WATT: f64 = 683.0;

/// Adds the nodes of a scene's lights.
///
/// # Errors
/// [`pumice_core::Error::Caller`] for numbers beyond single precision.
pub(super) fn add_lights(scene: &Scene, root: &mut Root) -> Result<Vec<Index<Node>>> {
    let mut nodes = Vec::new();
    for (number, sun) in scene.suns.iter().enumerate() {
        let name = format!("sun_{number}");
        let light = light(&name, Type::Directional, f64::from(sun.strength) * LUMENS_A_WATT, sun.color)?;
        nodes.push(node(root, &name, light, DVec3::ZERO, sun.direction)?);
    }
    for (number, lamp) in scene.lights.iter().enumerate() {
        let name = format!("lamp_{number}");
        let candela = f64::from(lamp.power_w) / (4.0 * PI) * LUMENS_A_WATT;
        match lamp.shape {
            LightShape::Point { position, .. } => {
                let light = light(&name, Type::Point, candela, lamp.color)?;
                nodes.push(node(root, &name, light, DVec3::from_array(position), [0.0, 0.0, -1.0])?);
            }
            // A closed cone lights nothing, and glTF has none.
            LightShape::Spot { position, direction, angle_rad, blend, .. } if angle_rad > 0.0 => {
                let mut light = light(&name, Type::Spot, candela, lamp.color)?;
                light.spot = Some(cone(angle_rad, blend));
                nodes.push(node(root, &name, light, DVec3::from_array(position), direction)?);
            }
            LightShape::Spot { .. } | LightShape::Area { .. } => {}
        }
    }
    Ok(nodes)
}

/// A light of this intensity. Colours above 1, which glTF has not, become intensity.
fn light(name: &str, type_: Type, intensity: f64, color: [f32; 3]) -> Result<Light> {
    let brightest = color.into_iter().fold(1.0, f32::max);
    let [intensity] = single(name, [intensity * f64::from(brightest)])?;
    Ok(Light {
        color: color.map(|c| c / brightest),
        extensions: None,
        extras: None,
        intensity,
        name: Some(name.to_owned()),
        range: None,
        spot: None,
        type_: Valid(type_),
    })
}

fn cone(angle_rad: f64, blend: f32) -> Spot {
    let outer = 0.5 * angle_rad;
    let inner = outer * (1.0 - f64::from(blend));
    // A right angle is the most; in single precision it would round to more.
    let outer_cone_angle = (outer as f32).min(FRAC_PI_2.next_down());
    // The inner cone must be the smaller one, also where the edge is sharp.
    let inner_cone_angle = (inner as f32).min(outer_cone_angle.next_down()).max(0.0);
    Spot { inner_cone_angle, outer_cone_angle }
}

/// A node at `position` whose −z axis is `direction`.
fn node(
    root: &mut Root,
    name: &str,
    light: Light,
    position: DVec3,
    direction: [f64; 3],
) -> Result<Index<Node>> {
    let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::from_array(direction).normalize());
    let matrix = DAffine3::from_mat3_translation(DMat3::from_quat(turn), position);
    let light = root.push(light);
    place(root, name, matrix, |node| {
        let khr_lights_punctual = Some(KhrLightsPunctual { light });
        node.extensions = Some(scene_extensions::Node { khr_lights_punctual, ..Default::default() });
    })
}
