//! The triangle meshes of a scene, each with the materials of its faces and the matrix that it stands by.
//!
//! Normals are those that Pumice shades with: of each triangle's corners where a mesh is smooth, of each triangle where it is flat. Both
//! sides of a triangle are seen. Points are rounded to single precision, which is what USD has. A mesh that is named several times is
//! written as often. A shadow catcher is an ordinary mesh in USD; that it is one is a note.

use std::sync::Arc;

use pumice_core::{Error, MeshData, octahedral};
use pumice_scene::Mesh;
use rustc_hash::FxHashMap;

use super::materials::Materials;
use super::mesh_parts::{MeshParts, in_pieces, subset};
use super::placement::{note, outer_and_inner, placement};
use crate::notes::source_name;
use crate::usd::{Array, ArrayElement, Prim, Property, Value};
use crate::{Budget, Result};

/// A mesh of the scene, number `place` among its meshes; none for one without triangles, of which nothing is seen.
///
/// # Errors
/// [`Error::Limit`] where its faces take more than the budget; [`Error::Caller`] for a position beyond single precision.
pub(super) fn prim(
    place: usize,
    mesh: &Mesh,
    data: &Arc<MeshData>,
    materials: &mut Materials,
    budget: &mut Budget,
) -> Result<Option<Prim<'static>>> {
    if data.triangles().is_empty() {
        return Ok(None);
    }
    budget.take_faces(data.triangles().len() as u64)?;
    let extent = extent(place, data)?;
    // Faces of each material; a triangle whose number is past the end has the last.
    let mut faces_of = vec![Vec::new(); mesh.materials.len()];
    let last = mesh.materials.len().saturating_sub(1);
    for triangle in 0..data.triangles().len() {
        faces_of[(data.material(triangle) as usize).min(last)].push(triangle as i32);
    }
    let mut colors = Vec::new();
    let mut color_of = vec![0i32; data.triangles().len()];
    let mut subsets = Vec::new();
    for (number, (faces, material)) in faces_of.into_iter().zip(&mesh.materials).enumerate() {
        if faces.is_empty() {
            continue;
        }
        faces.iter().for_each(|&face| color_of[face as usize] = colors.len() as i32);
        colors.push(material.base_color);
        subsets.push(subset(number, Array::of(faces), &materials.path(material)));
    }
    let (outer, inner) = outer_and_inner(&mesh.world_from_mesh);
    let mut properties = Vec::from(placement(inner.as_ref().unwrap_or(&outer)));
    let parts = MeshParts {
        extent,
        corner_counts: of_triangles(data, 1, |_, _, out| out.push(3i32)),
        corners: of_triangles(data, 3, |data, t, out| out.extend(data.triangles()[t].map(|c| c as i32))),
        points: points(data),
        colors,
        color_of_face: Value::Array(Array::of(color_of)),
    };
    properties.extend(parts.properties(Vec::new()));
    properties.extend([
        Property::uniform("doubleSided", "bool", Value::Bool(true)),
        note("source", "string", Value::String(source_name(&mesh.source))),
        note("shadow_catcher", "bool", Value::Bool(mesh.shadow_catcher)),
    ]);
    properties.extend(normals(data));
    let name = format!("mesh_{}", mesh.id);
    let prim =
        Prim { name: name.clone(), type_name: "Mesh", properties, children: subsets, ..Prim::default() };
    Ok(Some(match inner {
        None => prim,
        Some(_) => Prim {
            name,
            type_name: "Xform",
            properties: placement(&outer).into(),
            children: vec![Prim { name: "mesh".into(), ..prim }],
            ..Prim::default()
        },
    }))
}

/// Lowest and highest coordinates.
fn extent(place: usize, data: &MeshData) -> Result<Vec<[f32; 3]>> {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for (corner, position) in data.positions().iter().enumerate() {
        let rounded = rounded(*position);
        if rounded.iter().any(|c| !c.is_finite()) {
            return Err(Error::Caller(format!(
                "meshes[{place}]: corner {corner}: expected coordinates within ±3.4e38, as USD has, got {position:?}"
            ))
            .into());
        }
        bounds[0] = [0, 1, 2].map(|a| bounds[0][a].min(rounded[a]));
        bounds[1] = [0, 1, 2].map(|a| bounds[1][a].max(rounded[a]));
    }
    Ok(bounds.to_vec())
}

/// An array with `each` elements a triangle.
fn of_triangles<T: ArrayElement>(
    data: &Arc<MeshData>,
    each: u64,
    of: impl Fn(&MeshData, usize, &mut Vec<T>) + Send + Sync + 'static,
) -> Value<'static> {
    let data = Arc::clone(data);
    in_pieces(data.triangles().len(), each, move |triangle, out| of(&data, triangle, out))
}

fn points(data: &Arc<MeshData>) -> Value<'static> {
    let data = Arc::clone(data);
    in_pieces(data.positions().len(), 1, move |place, out| out.push(rounded(data.positions()[place])))
}

/// The normals, each once, with the place of that of each corner or triangle: most meshes have far fewer normals than corners.
fn normals(data: &MeshData) -> [Property<'static>; 2] {
    let mut all = DistinctNormals::default();
    let triangles = 0..data.triangles().len();
    let (interpolation, places) = if data.is_smooth() {
        let of_corner = |(triangle, word)| match word {
            octahedral::FLAT => flat_normal(data, triangle),
            word => rounded(unit(octahedral::decode(word).map(f64::from))),
        };
        let corners = triangles.flat_map(|t| data.normals()[t].map(|word| (t, word)));
        ("faceVarying", corners.map(|corner| all.place(of_corner(corner))).collect())
    } else {
        ("uniform", triangles.map(|t| all.place(flat_normal(data, t))).collect::<Vec<i32>>())
    };
    [
        Property::primvar("normals", "normal3f[]", interpolation, Value::Array(Array::of(all.normals))),
        Property::new("primvars:normals:indices", "int[]", Value::Array(Array::of(places))),
    ]
}

/// Normals in the order of their first appearance.
#[derive(Default)]
struct DistinctNormals {
    normals: Vec<[f32; 3]>,
    /// Place in `normals` by the bits of the coordinates.
    places: FxHashMap<[u32; 3], i32>,
}

impl DistinctNormals {
    fn place(&mut self, normal: [f32; 3]) -> i32 {
        // −0 and 0 are the same direction.
        let normal = normal.map(|c| c + 0.0);
        *self.places.entry(normal.map(f32::to_bits)).or_insert_with(|| {
            self.normals.push(normal);
            (self.normals.len() - 1) as i32
        })
    }
}

/// The normal of a triangle on the side from which its corners turn counterclockwise; +z for one without area, of which nothing is seen.
fn flat_normal(data: &MeshData, triangle: usize) -> [f32; 3] {
    let [a, b, c] = data.triangles()[triangle].map(|corner| data.positions()[corner as usize]);
    let [u, v] = [b, c].map(|p| unit([0, 1, 2].map(|i| p[i] - a[i])));
    rounded(unit([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]))
}

/// The vector scaled to length 1; +z for one of length 0.
fn unit(v: [f64; 3]) -> [f64; 3] {
    // By its largest component first, because squares of tiny ones would be 0.
    let largest = v.iter().fold(0.0f64, |most, c| most.max(c.abs()));
    if largest == 0.0 {
        return [0.0, 0.0, 1.0];
    }
    let v = v.map(|c| c / largest);
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}

fn rounded(v: [f64; 3]) -> [f32; 3] {
    v.map(|c| c as f32)
}
