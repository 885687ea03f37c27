//! The visible surface at one level of detail as a mesh.

use std::ops::Range;
use std::sync::Arc;

use pumice_core::{Error, Job};
use pumice_transport::geometry::DetailLevel;

use super::Shared;
use crate::drawn::Drawn;
use crate::labelled_surface::LabelledSurface;
use crate::usd::{Array, ArrayElement, Prim, Property, Value};
use crate::{Budget, Merging, Rectangle, Result};

/// Elements that are produced at a time.
const PIECE: usize = 4096;

/// Most faces of a mesh: USD's indices of corners are `int`, and each face has four.
const MOST_FACES: u64 = (i32::MAX as u64 + 1) / 4;

/// Normals by axis and side, in the order of [`normal_of`].
pub(super) const NORMALS: [[f32; 3]; 6] =
    [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];

fn normal_of(rectangle: &Rectangle) -> i32 {
    2 * i32::from(rectangle.axis) + i32::from(rectangle.is_up)
}

/// The mesh of a volume's surface.
///
/// # Errors
/// As [`super::stage_of_scene`].
pub(super) fn prim(
    drawn: &Drawn<'_>,
    materials: &[String],
    level: DetailLevel,
    merging: Merging,
    budget: &mut Budget,
    job: &Job,
) -> Result<Prim<'static>> {
    let surface = LabelledSurface::new(drawn, level, merging, budget, job)?;
    indexable(surface.rectangles.len() as u64)?;
    let subsets = surface.of_material.iter().zip(materials).enumerate().filter(|(_, (f, _))| !f.is_empty());
    let children = subsets
        .map(|(number, (faces, material))| subset(number, array_of_range(faces.clone()), material))
        .collect();
    Ok(Prim {
        name: "surface".into(),
        type_name: "Mesh",
        properties: properties(surface, drawn),
        children,
        ..Prim::default()
    })
}

pub(super) fn indexable(faces: u64) -> Result<()> {
    if faces <= MOST_FACES {
        return Ok(());
    }
    Err(Error::Limit { what: "faces of a mesh in a USD file".into(), limit: MOST_FACES, got: faces }.into())
}

/// Numbers of faces that follow each other.
pub(super) fn array_of_range(faces: Range<u32>) -> Array<'static> {
    Array::new(u64::from(faces.end - faces.start), move |sink| {
        let all: Vec<i32> = faces.clone().map(|face| face as i32).collect();
        all.chunks(PIECE).try_for_each(sink)
    })
}

/// The faces of one material: their indices, and the material's path.
pub(super) fn subset(number: usize, faces: Array<'static>, material: &str) -> Prim<'static> {
    Prim {
        name: format!("material_{number}"),
        type_name: "GeomSubset",
        api_schemas: vec!["MaterialBindingAPI"],
        properties: vec![
            Property::uniform("elementType", "token", Value::Token("face".into())),
            Property::uniform("familyName", "token", Value::Token("materialBind".into())),
            Property::new("indices", "int[]", Value::Array(faces)),
            Property::relationship("material:binding", vec![material.into()]),
        ],
        ..Prim::default()
    }
}

/// An array with `each` elements a rectangle.
fn array<T: ArrayElement>(
    rectangles: &Shared<Rectangle>,
    each: u64,
    of: impl Fn(usize, &Rectangle, &mut Vec<T>) + Send + Sync + 'static,
) -> Value<'static> {
    let rectangles = Arc::clone(rectangles);
    let len = each * rectangles.len() as u64;
    Value::Array(Array::new(len, move |sink| {
        let mut piece = Vec::new();
        for (number, group) in rectangles.chunks(PIECE).enumerate() {
            piece.clear();
            let places = number * PIECE..;
            places.zip(group).for_each(|(place, rectangle)| of(place, rectangle, &mut piece));
            sink(&piece)?;
        }
        Ok(())
    }))
}

fn properties(surface: LabelledSurface, drawn: &Drawn<'_>) -> Vec<Property<'static>> {
    let extent = surface.bounds().map(|corner| corner.map(|c| c as f32)).to_vec();
    let LabelledSurface { rectangles, of_material } = surface;
    let rectangles = &Arc::new(rectangles);
    // Of the materials that faces have: labels may be drawn and have none.
    let used = of_material.into_iter().zip(&drawn.materials).filter(|(faces, _)| !faces.is_empty());
    let (faces_of, colors): (Vec<_>, Vec<_>) = used.map(|(faces, m)| (faces, m.base_color)).unzip();
    let color_of = Array::new(rectangles.len() as u64, move |sink| {
        for (number, faces) in (0..).zip(&faces_of) {
            vec![number; faces.len()].chunks(PIECE).try_for_each(&mut *sink)?;
        }
        Ok(())
    });
    let position = |corner: [u32; 3]| corner.map(|c| c as f32);
    vec![
        Property::new("extent", "float3[]", Value::Array(Array::of(extent))),
        Property::new("faceVertexCounts", "int[]", array(rectangles, 1, |_, _, out| out.push(4))),
        Property::new(
            "faceVertexIndices",
            "int[]",
            array(rectangles, 4, |place, _, out| out.extend((0..4).map(|i| (4 * place + i) as i32))),
        ),
        Property::new(
            "points",
            "point3f[]",
            array(rectangles, 4, move |_, r, out| out.extend(r.corners().map(position))),
        ),
        Property::primvar("displayColor", "color3f[]", "uniform", Value::Array(Array::of(colors))),
        Property::new("primvars:displayColor:indices", "int[]", Value::Array(color_of)),
        Property::primvar(
            "label",
            "int[]",
            "uniform",
            array(rectangles, 1, |_, r, out| out.push(r.label as i32)),
        ),
        Property::primvar("normals", "normal3f[]", "uniform", Value::Array(Array::of(NORMALS.to_vec()))),
        Property::new(
            "primvars:normals:indices",
            "int[]",
            array(rectangles, 1, |_, r, out| out.push(normal_of(r))),
        ),
        Property::uniform("subdivisionScheme", "token", Value::Token("none".into())),
        // Every face is of one subset.
        Property::uniform("subsetFamily:materialBind:familyType", "token", Value::Token("partition".into())),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_beyond_31_bits_are_refused() {
        assert!(indexable(1 << 29).is_ok(), "the last index is 2³¹ − 1");
        let error = indexable((1 << 29) + 1).unwrap_err().to_string();
        assert_eq!(error, "faces of a mesh in a USD file: 536870913 is more than the limit of 536870912");
    }
}
