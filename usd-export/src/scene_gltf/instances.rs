//! Every box of a volume as a placed cube (EXT_mesh_gpu_instancing).
//!
//! ```text
//! volume_ID ─┬ node: mesh of a unit cube with the first material, instances 0 … n₀
//!            ├ node: … second material, instances n₀ … n₁
//!            └ …                         TRANSLATION 3 × f32, SCALE 3 × f32, _LABEL f32
//! ```

use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::Semantic;
use gltf_json::{Index, Node};
use pumice_core::reserve::sort_by_key;
use pumice_core::{Error, Job};
use serde_json::json;

use super::binary::put_floats;
use super::surface::{LabelNumbers, VERTEX_BYTES, mesh, put_rectangle};
use super::writer::{Elements, Writer};
use crate::drawn::Drawn;
use crate::drawn_boxes::{BOXES, DrawnBox, drawn_boxes};
use crate::{Budget, Rectangle, Result};

/// Faces of a unit cube.
const FACES: u64 = 6;

/// Adds the nodes of the boxes of what is drawn, one for each material that has boxes.
///
/// # Errors
/// [`pumice_core::Error::Limit`] where they take more than is left of the budget; [`pumice_core::Error::Cancelled`].
pub(super) fn add_boxes(
    writer: &mut Writer<'_>,
    drawn: &Drawn<'_>,
    budget: &mut Budget,
    job: &Job,
) -> Result<Vec<Index<Node>>> {
    LabelNumbers::of(drawn.visible.len() as u64)?;
    let mut boxes = drawn_boxes(drawn, budget, job)?;
    if boxes.is_empty() {
        return Ok(Vec::new());
    }
    let material = |b: &DrawnBox| drawn.material_of[b.label as usize] as usize;
    sort_by_key(&mut boxes, material, BOXES).map_err(Error::from)?;

    // The cube's vertices are those of six rectangles.
    let cube: Vec<Rectangle> = (0..FACES as u8)
        .map(|face| {
            let (axis, is_up) = (face / 2, face % 2 != 0);
            let mut low = [0; 3];
            low[usize::from(axis)] = u32::from(is_up);
            Rectangle { low, size: [1, 1], axis, is_up, label: 0 }
        })
        .collect();
    let put = |r: &Rectangle, out: &mut Vec<u8>| put_rectangle(r, [0; 3], LabelNumbers::Byte, out);
    let of_cube = |type_, component, is_normalized, offset| Elements {
        type_,
        component,
        is_normalized,
        offset,
        count: 4 * FACES,
    };
    let offset = writer.binary.add_values(cube, 4 * VERTEX_BYTES, put);
    let vertices = writer.view(offset, 4 * FACES * VERTEX_BYTES, Some(VERTEX_BYTES as usize));
    let bounds = Some([json!([0, 0, 0]), json!([1, 1, 1])]);
    let positions = writer.accessor(vertices, of_cube(Type::Vec3, ComponentType::U16, false, 0), bounds);
    let normals = writer.accessor(vertices, of_cube(Type::Vec3, ComponentType::I8, true, 8), None);
    let corners = writer.corners(FACES)?;

    // Three arrays of the instances, which each material has a part of.
    let count = boxes.len() as u64;
    let groups: Vec<(usize, u64)> = boxes
        .chunk_by(|a, b| material(a) == material(b))
        .map(|g| (material(&g[0]), g.len() as u64))
        .collect();
    let boxes = std::rc::Rc::<[DrawnBox]>::from(boxes);
    let places = writer
        .binary
        .add_values(boxes.clone(), 12, |b: &DrawnBox, out| put_floats(b.low.map(|c| c as f32), out));
    let scales = writer
        .binary
        .add_values(boxes.clone(), 12, |b: &DrawnBox, out| put_floats(b.extent.map(f32::from), out));
    let labels = writer.binary.add_values(boxes, 4, |b: &DrawnBox, out| put_floats([b.label as f32], out));
    let arrays = [
        ("TRANSLATION", Type::Vec3, places, 12),
        ("SCALE", Type::Vec3, scales, 12),
        ("_LABEL", Type::Scalar, labels, 4),
    ];
    let arrays = arrays
        .map(|(name, type_, offset, each)| (name, type_, each, writer.plain_view(offset, each * count)));
    let mut first = 0;
    let mut nodes = Vec::new();
    for (material, count) in groups {
        let attributes = [(Semantic::Positions, positions), (Semantic::Normals, normals)];
        let primitive = writer.primitive(attributes, corners, &drawn.materials[material])?;
        let name = format!("{}_cube_{material}", drawn.name());
        let cube = writer.root.push(mesh(name, vec![primitive]));
        let attributes = arrays.map(|(name, type_, each, view)| {
            let component = ComponentType::F32;
            let elements = Elements { type_, component, is_normalized: false, offset: first * each, count };
            (name.to_owned(), json!(writer.accessor(view, elements, None)))
        });
        let instancing = json!({ "attributes": serde_json::Map::from_iter(attributes) });
        let extensions = gltf_json::extensions::scene::Node {
            others: [(super::INSTANCING.to_owned(), instancing)].into_iter().collect(),
            ..Default::default()
        };
        nodes.push(writer.root.push(Node {
            mesh: Some(cube),
            extensions: Some(extensions),
            ..Node::default()
        }));
        first += count;
    }
    writer.used.insert(super::INSTANCING);
    Ok(nodes)
}
