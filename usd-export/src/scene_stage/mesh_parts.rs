//! What the meshes of a stage have in common, whether they are surfaces of volumes or meshes of the scene: corners, points, a colour for each face,
//! and a subset of the faces for each material. Arrays are produced in pieces, when they are written.

use std::ops::Range;

use pumice_core::Error;

use crate::Result;
use crate::usd::{Array, ArrayElement, Prim, Property, Value};

/// Elements that are produced at a time.
pub(super) const PIECE: usize = 4096;

/// Most corners of a mesh: USD's indices of corners are `int`.
const MOST_CORNERS: u64 = i32::MAX as u64 + 1;

/// The shape of a mesh and the colours of its faces.
pub(super) struct MeshParts {
    /// Lowest and highest corner.
    pub(super) extent: Vec<[f32; 3]>,
    /// Number of corners of each face.
    pub(super) corner_counts: Value<'static>,
    /// The point of each corner, face by face.
    pub(super) corners: Value<'static>,
    /// All points.
    pub(super) points: Value<'static>,
    /// The colours that occur, linear Rec. 709.
    pub(super) colors: Vec<[f32; 3]>,
    /// Which of them each face has.
    pub(super) color_of_face: Value<'static>,
}

impl MeshParts {
    /// The properties of the mesh, with those that it has of its own; every face is of one subset.
    pub(super) fn properties(self, own: Vec<Property<'static>>) -> Vec<Property<'static>> {
        let colors = Value::Array(Array::of(self.colors));
        let mut properties = vec![
            Property::new("extent", "float3[]", Value::Array(Array::of(self.extent))),
            Property::new("faceVertexCounts", "int[]", self.corner_counts),
            Property::new("faceVertexIndices", "int[]", self.corners),
            Property::new("points", "point3f[]", self.points),
            Property::primvar("displayColor", "color3f[]", "uniform", colors),
            Property::new("primvars:displayColor:indices", "int[]", self.color_of_face),
        ];
        properties.extend(own);
        let family = Value::Token("partition".into());
        properties.extend([
            Property::uniform("subdivisionScheme", "token", Value::Token("none".into())),
            Property::uniform("subsetFamily:materialBind:familyType", "token", family),
        ]);
        properties
    }
}

/// The mesh of a volume's surface, with the subsets of its faces.
pub(super) fn surface(properties: Vec<Property<'static>>, subsets: Vec<Prim<'static>>) -> Prim<'static> {
    Prim { name: "surface".into(), type_name: "Mesh", properties, children: subsets, ..Prim::default() }
}

/// Checks that USD can number so many corners.
///
/// # Errors
/// [`Error::Limit`].
pub(super) fn indexable(corners: u64) -> Result<()> {
    if corners <= MOST_CORNERS {
        return Ok(());
    }
    let what = "corners of a mesh in a USD file".into();
    Err(Error::Limit { what, limit: MOST_CORNERS, got: corners }.into())
}

/// An array with `each` elements for each of `count` things, which `of` appends by their places.
pub(super) fn in_pieces<T: ArrayElement>(
    count: usize,
    each: u64,
    of: impl Fn(usize, &mut Vec<T>) + Send + Sync + 'static,
) -> Value<'static> {
    Value::Array(Array::new(each * count as u64, move |sink| {
        let mut piece = Vec::new();
        for start in (0..count).step_by(PIECE) {
            piece.clear();
            (start..count.min(start + PIECE)).for_each(|place| of(place, &mut piece));
            sink(&piece)?;
        }
        Ok(())
    }))
}

/// Numbers that follow each other, in ranges.
pub(super) fn array_of_ranges(ranges: impl IntoIterator<Item = Range<u32>>) -> Array<'static> {
    let ranges: Vec<Range<u32>> = ranges.into_iter().collect();
    let len = ranges.iter().map(|range| u64::from(range.end - range.start)).sum();
    Array::new(len, move |sink| {
        for range in &ranges {
            for start in range.clone().step_by(PIECE) {
                let end = range.end.min(start.saturating_add(PIECE as u32));
                sink(&(start..end).map(|face| face as i32).collect::<Vec<i32>>())?;
            }
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_beyond_31_bits_are_refused() {
        assert!(indexable(1 << 31).is_ok(), "the last index is 2³¹ − 1");
        let error = indexable((1 << 31) + 4).unwrap_err().to_string();
        assert_eq!(error, "corners of a mesh in a USD file: 2147483652 is more than the limit of 2147483648");
    }
}
