//! The smoothed surface of a volume as a mesh.
//!
//! ```text
//! a vertex: 28 bytes; one for each corner, label and kind of face there
//!  0  position   3 × f32   voxels
//! 12  normal     3 × f32
//! 24  _LABEL     as of exact surfaces
//! ```
//! Primitives, one for each material, share the vertices. A face is two triangles, divided from its first corner to its third.

use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::Semantic;
use gltf_json::{Index, Mesh};
use pumice_core::Job;
use serde_json::json;

use super::binary::put_floats;
use super::surface::{LabelNumbers, mesh};
use super::writer::{Elements, Writer, addressable};
use crate::drawn::Drawn;
use crate::smooth_surface::SmoothSurface;
use crate::{Budget, Result, SmoothMesh, SmoothVertex};

/// Bytes of a vertex.
const VERTEX_BYTES: u64 = 28;
/// Bytes of the six corners of a face's triangles.
const FACE_BYTES: u64 = 24;

/// Adds the mesh of what is drawn; none where that has no surface.
///
/// # Errors
/// [`pumice_core::Error::Limit`] where it takes more than is left of the budget, or for more labels or vertices than glTF can number;
/// [`pumice_core::Error::Cancelled`].
pub(super) fn add_smooth(
    writer: &mut Writer<'_>,
    drawn: &Drawn<'_>,
    budget: &mut Budget,
    job: &Job,
) -> Result<Option<Index<Mesh>>> {
    let numbers = LabelNumbers::of(drawn.visible.len() as u64)?;
    let surface = SmoothSurface::new(drawn, budget, job)?;
    let bounds = surface.bounds().map(|corner| json!(corner));
    let SmoothSurface { mesh: SmoothMesh { points, vertices, quads }, of_material } = surface;
    if quads.is_empty() {
        return Ok(None);
    }
    let count = vertices.len() as u64;
    addressable(count)?;
    let put_vertex = move |vertex: &SmoothVertex, out: &mut Vec<u8>| {
        put_floats(points[vertex.point as usize], out);
        put_floats(vertex.normal, out);
        out.extend_from_slice(&numbers.bytes(vertex.label));
    };
    let offset = writer.binary.add_values(vertices, VERTEX_BYTES, put_vertex);
    let view = writer.view(offset, VERTEX_BYTES * count, Some(VERTEX_BYTES as usize));
    let elements =
        |type_, component, offset| Elements { type_, component, is_normalized: false, offset, count };
    let attributes = [
        (
            Semantic::Positions,
            writer.accessor(view, elements(Type::Vec3, ComponentType::F32, 0), Some(bounds)),
        ),
        (Semantic::Normals, writer.accessor(view, elements(Type::Vec3, ComponentType::F32, 12), None)),
        (
            Semantic::Extras("LABEL".into()),
            writer.accessor(view, elements(Type::Scalar, numbers.component(), 24), None),
        ),
    ];

    let faces = quads.len() as u64;
    let offset = writer.binary.add_values(quads, FACE_BYTES, |[a, b, c, d]: &[u32; 4], out| {
        [a, b, c, a, c, d].iter().for_each(|corner| out.extend_from_slice(&corner.to_le_bytes()));
    });
    let corners = writer.view(offset, FACE_BYTES * faces, None);
    let mut primitives = Vec::new();
    for (range, material) in of_material.iter().zip(&drawn.materials).filter(|(range, _)| !range.is_empty()) {
        let elements = Elements {
            type_: Type::Scalar,
            component: ComponentType::U32,
            is_normalized: false,
            offset: FACE_BYTES * u64::from(range.start),
            count: 6 * u64::from(range.end - range.start),
        };
        let corners = writer.accessor(corners, elements, None);
        primitives.push(writer.primitive(attributes.clone(), corners, material)?);
    }
    Ok(Some(writer.root.push(mesh(drawn.name(), primitives))))
}
