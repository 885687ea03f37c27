//! Every box as a scaled cube.

use std::sync::Arc;

use pumice_core::Job;

use super::Shared;
use super::mesh_parts::in_pieces;
use super::surface::NORMALS;
use crate::drawn::Drawn;
use crate::drawn_boxes::{DrawnBox, drawn_boxes};
use crate::usd::{Array, ArrayElement, Prim, Property, Value};
use crate::{Budget, Result};

/// The instancer of a volume's boxes.
///
/// # Errors
/// As [`super::stage_of_scene`].
pub(super) fn prim(
    drawn: &Drawn<'_>,
    materials: &[String],
    budget: &mut Budget,
    job: &Job,
) -> Result<Prim<'static>> {
    let boxes = drawn_boxes(drawn, budget, job)?;
    let path = format!("{}/{}/boxes", super::CONTENTS, drawn.name());
    let prototypes: Vec<Prim<'_>> = drawn
        .materials
        .iter()
        .zip(materials)
        .enumerate()
        .map(|(number, (material, path))| cube(number, path, material.base_color))
        .collect();
    let targets = prototypes.iter().map(|cube| format!("{path}/prototypes/{}", cube.name)).collect();
    let boxes = Arc::new(boxes);
    let material_of = drawn.material_of.clone();
    Ok(Prim {
        name: "boxes".into(),
        type_name: "PointInstancer",
        properties: vec![
            Property::new("extent", "float3[]", Value::Array(Array::of(extent(&boxes)))),
            Property::new("positions", "point3f[]", array(&boxes, |b| b.low.map(|c| c as f32))),
            Property::new("scales", "float3[]", array(&boxes, |b| b.extent.map(f32::from))),
            Property::new(
                "protoIndices",
                "int[]",
                array(&boxes, move |b| material_of[b.label as usize] as i32),
            ),
            Property::primvar("label", "int[]", "varying", array(&boxes, |b| b.label as i32)),
            Property::relationship("prototypes", targets),
        ],
        children: vec![Prim {
            name: "prototypes".into(),
            type_name: "Scope",
            children: prototypes,
            ..Prim::default()
        }],
        ..Prim::default()
    })
}

fn array<T: ArrayElement>(
    boxes: &Shared<DrawnBox>,
    of: impl Fn(&DrawnBox) -> T + Send + Sync + 'static,
) -> Value<'static> {
    let boxes = Arc::clone(boxes);
    in_pieces(boxes.len(), 1, move |place, out| out.push(of(&boxes[place])))
}

/// A cube from the origin to (1, 1, 1) of one material.
fn cube(number: usize, material: &str, color: [f32; 3]) -> Prim<'static> {
    let corners: Vec<[f32; 3]> = (0..8).map(|c| [c & 1, c >> 1 & 1, c >> 2].map(|b| b as f32)).collect();
    // Counter-clockwise as seen from outside, in the order of `NORMALS`.
    let faces = [0, 4, 6, 2, 1, 3, 7, 5, 0, 1, 5, 4, 2, 6, 7, 3, 0, 2, 3, 1, 4, 5, 7, 6];
    Prim {
        name: format!("cube_{number}"),
        type_name: "Mesh",
        api_schemas: vec!["MaterialBindingAPI"],
        properties: vec![
            Property::new("extent", "float3[]", Value::Array(Array::of(vec![[0.0f32; 3], [1.0; 3]]))),
            Property::new("faceVertexCounts", "int[]", Value::Array(Array::of(vec![4; 6]))),
            Property::new("faceVertexIndices", "int[]", Value::Array(Array::of(faces.to_vec()))),
            Property::new("points", "point3f[]", Value::Array(Array::of(corners))),
            Property::primvar("displayColor", "color3f[]", "constant", Value::Array(Array::of(vec![color]))),
            Property::primvar("normals", "normal3f[]", "uniform", Value::Array(Array::of(NORMALS.to_vec()))),
            Property::relationship("material:binding", vec![material.into()]),
            Property::uniform("subdivisionScheme", "token", Value::Token("none".into())),
        ],
        ..Prim::default()
    }
}

/// Lowest and highest corner of all boxes.
fn extent(boxes: &[DrawnBox]) -> Vec<[f32; 3]> {
    let bounds = boxes.iter().fold(None, |bounds: Option<[[u32; 3]; 2]>, b| {
        let [low, high] = bounds.unwrap_or([b.low; 2]);
        let end = [0, 1, 2].map(|a| b.low[a] + u32::from(b.extent[a]));
        Some([[0, 1, 2].map(|a| low[a].min(b.low[a])), [0, 1, 2].map(|a| high[a].max(end[a]))])
    });
    bounds.unwrap_or_default().map(|corner| corner.map(|c| c as f32)).to_vec()
}
