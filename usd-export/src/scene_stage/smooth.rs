//! The smoothed surface as a mesh.
//!
//! Faces share the points of their label; normals belong to the corners of faces, because a point where the outside and a common face meet
//! has one for each. `userProperties:not_exact` says what has been done to it.

use std::iter;
use std::sync::Arc;

use pumice_core::Job;

use super::mesh_parts::{MeshParts, PIECE, array_of_ranges, in_pieces, indexable, subset, surface};
use super::placement::note;
use crate::drawn::Drawn;
use crate::smooth_mesh::NOT_EXACT;
use crate::smooth_surface::SmoothSurface;
use crate::usd::{Array, ArrayElement, Prim, Property, Value};
use crate::{Budget, Result, SmoothMesh};

/// The mesh of a volume's smoothed surface.
///
/// # Errors
/// As [`super::stage_of_scene`].
pub(super) fn prim(
    drawn: &Drawn<'_>,
    materials: &[String],
    budget: &mut Budget,
    job: &Job,
) -> Result<Prim<'static>> {
    let smooth = SmoothSurface::new(drawn, budget, job)?;
    indexable(4 * smooth.mesh.quads.len() as u64)?;
    let used = smooth.of_material.iter().zip(materials).enumerate().filter(|(_, (f, _))| !f.is_empty());
    let children = used
        .map(|(number, (faces, material))| {
            subset(number, array_of_ranges(iter::once(faces.clone())), material)
        })
        .collect();
    Ok(surface(properties(smooth, drawn), children))
}

fn properties(surface: SmoothSurface, drawn: &Drawn<'_>) -> Vec<Property<'static>> {
    let extent = surface.bounds().to_vec();
    let SmoothSurface { mesh, of_material } = surface;
    let mesh = &Arc::new(mesh);
    let used = of_material.into_iter().zip(&drawn.materials).filter(|(faces, _)| !faces.is_empty());
    let (faces_of, colors): (Vec<_>, Vec<_>) = used.map(|(faces, m)| (faces, m.base_color)).unzip();
    let color_of = Array::new(mesh.quads.len() as u64, move |sink| {
        for (number, faces) in (0..).zip(&faces_of) {
            vec![number; faces.len()].chunks(PIECE).try_for_each(&mut *sink)?;
        }
        Ok(())
    });
    let quads = mesh.quads.len();
    let parts = MeshParts {
        extent,
        corner_counts: in_pieces(quads, 1, |_, out| out.push(4i32)),
        corners: array(mesh, quads, 4, |mesh, quad, out| {
            out.extend(mesh.quads[quad].map(|v| mesh.vertices[v as usize].point as i32));
        }),
        points: array(mesh, mesh.points.len(), 1, |mesh, point, out| out.push(mesh.points[point])),
        colors,
        color_of_face: Value::Array(color_of),
    };
    let normals =
        array(mesh, mesh.vertices.len(), 1, |mesh, vertex, out| out.push(mesh.vertices[vertex].normal));
    let normal_of_corner =
        array(mesh, quads, 4, |mesh, quad, out| out.extend(mesh.quads[quad].map(|v| v as i32)));
    let labels = array(mesh, quads, 1, |mesh, quad, out| out.push(mesh.label(&mesh.quads[quad]) as i32));
    let mut properties = parts.properties(vec![
        Property::primvar("label", "int[]", "uniform", labels),
        Property::primvar("normals", "normal3f[]", "faceVarying", normals),
        Property::new("primvars:normals:indices", "int[]", normal_of_corner),
    ]);
    properties.push(note("not_exact", "string", Value::String(NOT_EXACT.into())));
    properties
}

/// An array with `each` elements for each of `count` parts of the mesh.
fn array<E: ArrayElement>(
    mesh: &Arc<SmoothMesh>,
    count: usize,
    each: u64,
    of: impl Fn(&SmoothMesh, usize, &mut Vec<E>) + Send + Sync + 'static,
) -> Value<'static> {
    let mesh = Arc::clone(mesh);
    in_pieces(count, each, move |place, out| of(&mesh, place, out))
}
