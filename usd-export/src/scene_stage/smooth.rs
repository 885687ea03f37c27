//! The smoothed surface as a mesh.
//!
//! Faces share the points of their label; normals belong to the corners of faces, because a point where the outside and a common face meet
//! has one for each. `userProperties:not_exact` says what has been done to it.

use std::iter;
use std::sync::Arc;

use pumice_core::Job;

use super::placement::note;
use super::surface::{array_of_ranges, indexable, subset};
use crate::drawn::Drawn;
use crate::smooth_mesh::NOT_EXACT;
use crate::smooth_surface::SmoothSurface;
use crate::usd::{Array, ArrayElement, Prim, Property, Value};
use crate::{Budget, Result, SmoothMesh};

/// Elements that are produced at a time.
const PIECE: usize = 4096;

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
    let surface = SmoothSurface::new(drawn, budget, job)?;
    indexable(4 * surface.mesh.quads.len() as u64)?;
    let used = surface.of_material.iter().zip(materials).enumerate().filter(|(_, (f, _))| !f.is_empty());
    let children = used
        .map(|(number, (faces, material))| {
            subset(number, array_of_ranges(iter::once(faces.clone())), material)
        })
        .collect();
    Ok(Prim {
        name: "surface".into(),
        type_name: "Mesh",
        properties: properties(surface, drawn),
        children,
        ..Prim::default()
    })
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
    vec![
        Property::new("extent", "float3[]", Value::Array(Array::of(extent))),
        Property::new("faceVertexCounts", "int[]", array(mesh, quads, 1, |_, _, out| out.push(4))),
        Property::new(
            "faceVertexIndices",
            "int[]",
            array(mesh, quads, 4, |mesh, quad, out| {
                out.extend(quad.map(|v| mesh.vertices[v as usize].point as i32));
            }),
        ),
        Property::new(
            "points",
            "point3f[]",
            array(mesh, |mesh| mesh.points.as_slice(), 1, |_, point, out| out.push(*point)),
        ),
        Property::primvar("displayColor", "color3f[]", "uniform", Value::Array(Array::of(colors))),
        Property::new("primvars:displayColor:indices", "int[]", Value::Array(color_of)),
        Property::primvar(
            "label",
            "int[]",
            "uniform",
            array(mesh, quads, 1, |mesh, quad, out| out.push(mesh.label(quad) as i32)),
        ),
        Property::primvar(
            "normals",
            "normal3f[]",
            "faceVarying",
            array(mesh, |mesh| mesh.vertices.as_slice(), 1, |_, vertex, out| out.push(vertex.normal)),
        ),
        Property::new(
            "primvars:normals:indices",
            "int[]",
            array(mesh, quads, 4, |_, quad, out| out.extend(quad.map(|v| v as i32))),
        ),
        Property::uniform("subdivisionScheme", "token", Value::Token("none".into())),
        // Every face is of one subset.
        Property::uniform("subsetFamily:materialBind:familyType", "token", Value::Token("partition".into())),
        note("not_exact", "string", Value::String(NOT_EXACT.into())),
    ]
}

fn quads(mesh: &SmoothMesh) -> &[[u32; 4]] {
    &mesh.quads
}

/// An array with `each` elements for each of the things that `all` are.
fn array<T: Sync + 'static, E: ArrayElement>(
    mesh: &Arc<SmoothMesh>,
    all: impl Fn(&SmoothMesh) -> &[T] + Send + Sync + 'static,
    each: u64,
    of: impl Fn(&SmoothMesh, &T, &mut Vec<E>) + Send + Sync + 'static,
) -> Value<'static> {
    let mesh = Arc::clone(mesh);
    let len = each * all(&mesh).len() as u64;
    Value::Array(Array::new(len, move |sink| {
        let mut piece = Vec::new();
        for group in all(&mesh).chunks(PIECE) {
            piece.clear();
            group.iter().for_each(|thing| of(&mesh, thing, &mut piece));
            sink(&piece)?;
        }
        Ok(())
    }))
}
