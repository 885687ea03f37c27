//! The triangle meshes of a scene.
//!
//! A flat mesh shares its corners and has no normals: then glTF asks for flat faces. A smooth one has three vertices of its own for each
//! triangle, because an edge may be sharp on one side alone:
//!
//! ```text
//! flat     position 3 × f32                       12 bytes; triangles name corners, sorted by material
//! smooth   position 3 × f32, normal 3 × f32       24 bytes; triangles sorted by material, so corners count up
//! ```
//! Triangles that name a corner twice have no area and are not written.

use std::sync::Arc;

use glam::DVec3;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::View;
use gltf_json::mesh::Semantic;
use gltf_json::{Index, Mesh};
use pumice_core::reserve::{collected, sort_by_key};
use pumice_core::{Error, MeshData, octahedral};
use serde_json::json;

use super::binary::{put_floats, write_corners};
use super::placement::single;
use super::surface::mesh;
use super::writer::{Elements, Writer, addressable};
use crate::Result;

/// Adds a mesh; none where it has no triangle with an area.
///
/// # Errors
/// [`pumice_core::Error::Limit`] for more vertices than glTF can number; [`pumice_core::Error::Caller`] for positions beyond single
/// precision.
pub(super) fn add_mesh<'a>(
    writer: &mut Writer<'a>,
    name: &str,
    placed: &pumice_scene::Mesh,
    data: &'a Arc<MeshData>,
) -> Result<Option<Index<Mesh>>> {
    let data = data.as_ref();
    let last = placed.materials.len() - 1;
    let material = |t: &u32| (data.material(*t as usize) as usize).min(last);
    let has_area = |t: &u32| {
        let [a, b, c] = data.triangles()[*t as usize];
        a != b && b != c && c != a
    };
    let count = data.triangles().len();
    let all = (0..count as u32).filter(has_area);
    let mut triangles = collected(count, all, TRIANGLES).map_err(Error::from)?;
    if triangles.is_empty() {
        return Ok(None);
    }
    sort_by_key(&mut triangles, material, TRIANGLES).map_err(Error::from)?;
    let groups: Vec<(usize, u64)> = triangles
        .chunk_by(|a, b| material(a) == material(b))
        .map(|g| (material(&g[0]), g.len() as u64))
        .collect();
    let bounds = bounds(name, data)?;
    let (attributes, corners) = if data.is_smooth() {
        smooth(writer, data, triangles, bounds)?
    } else {
        flat(writer, data, triangles, bounds)?
    };
    let (mut primitives, mut first) = (Vec::new(), 0);
    for (material, count) in groups {
        let elements = Elements {
            type_: Type::Scalar,
            component: ComponentType::U32,
            is_normalized: false,
            offset: 12 * first,
            count: 3 * count,
        };
        let corners = writer.accessor(corners, elements, None);
        primitives.push(writer.primitive(attributes.clone(), corners, &placed.materials[material])?);
        first += count;
    }
    Ok(Some(writer.root.push(mesh(name.to_owned(), primitives))))
}

/// What memory is for, in errors.
const TRIANGLES: &str = "a list of the triangles of a mesh";

type Attributes = Vec<(Semantic, Index<gltf_json::Accessor>)>;

fn vectors(offset: u64, count: u64) -> Elements {
    Elements { type_: Type::Vec3, component: ComponentType::F32, is_normalized: false, offset, count }
}

/// Vertices that triangles share.
fn flat<'a>(
    writer: &mut Writer<'a>,
    data: &'a MeshData,
    triangles: Vec<u32>,
    bounds: [[f32; 3]; 2],
) -> Result<(Attributes, Index<View>)> {
    let count = data.positions().len() as u64;
    addressable(count)?;
    let offset = writer
        .binary
        .add_values(data.positions(), 12, |p: &[f64; 3], out| put_floats(p.map(|c| c as f32), out));
    let vertices = writer.view(offset, 12 * count, Some(12));
    let positions = writer.accessor(vertices, vectors(0, count), Some(bounds.map(|corner| json!(corner))));
    let bytes = 12 * triangles.len() as u64;
    let offset = writer.binary.add_values(triangles, 12, move |&t: &u32, out| {
        data.triangles()[t as usize].iter().for_each(|corner| out.extend_from_slice(&corner.to_le_bytes()));
    });
    Ok((vec![(Semantic::Positions, positions)], writer.view(offset, bytes, None)))
}

/// Three vertices for each triangle.
fn smooth<'a>(
    writer: &mut Writer<'a>,
    data: &'a MeshData,
    triangles: Vec<u32>,
    bounds: [[f32; 3]; 2],
) -> Result<(Attributes, Index<View>)> {
    let count = 3 * triangles.len() as u64;
    addressable(count)?;
    let offset = writer.binary.add_values(triangles, 72, move |&t: &u32, out| {
        let positions = data.triangles()[t as usize].map(|corner| data.positions()[corner as usize]);
        let [a, b, c] = positions.map(DVec3::from_array);
        let own = (b - a)
            .normalize_or_zero()
            .cross((c - a).normalize_or_zero())
            .try_normalize()
            .unwrap_or(DVec3::Z);
        for (position, word) in positions.iter().zip(data.normals()[t as usize]) {
            let normal = match word {
                octahedral::FLAT => own,
                word => DVec3::from_array(octahedral::decode(word).map(f64::from)).normalize(),
            };
            put_floats(position.map(|c| c as f32), out);
            put_floats(normal.to_array().map(|c| c as f32), out);
        }
    });
    let vertices = writer.view(offset, 24 * count, Some(24));
    let positions = writer.accessor(vertices, vectors(0, count), Some(bounds.map(|corner| json!(corner))));
    let normals = writer.accessor(vertices, vectors(12, count), None);
    let offset = writer.binary.add(4 * count, move |out| write_corners(count / 3, 3, &[0, 1, 2], out));
    let attributes = vec![(Semantic::Positions, positions), (Semantic::Normals, normals)];
    Ok((attributes, writer.view(offset, 4 * count, None)))
}

/// Lowest and highest position of the corners that are written.
fn bounds(name: &str, data: &MeshData) -> Result<[[f32; 3]; 2]> {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    let mut include = |position: &[f64; 3]| {
        let position = single(name, *position)?;
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(position[axis]);
            bounds[1][axis] = bounds[1][axis].max(position[axis]);
        }
        Ok::<_, crate::ExportError>(())
    };
    if data.is_smooth() {
        let with_area = data.triangles().iter().filter(|[a, b, c]| a != b && b != c && c != a);
        with_area.flatten().try_for_each(|&corner| include(&data.positions()[corner as usize]))?;
    } else {
        data.positions().iter().try_for_each(include)?;
    }
    Ok(bounds)
}
