//! The visible surface of a volume as meshes of whole numbers of voxels (KHR_mesh_quantization).
//!
//! ```text
//! a vertex: 16 bytes; four for each rectangle
//!  0  position   3 × u16   voxels, from the mesh's place
//!  6             2 bytes   0
//!  8  normal     3 × i8    ±127 along one axis, normalized
//! 11             1 byte    0
//! 12  _LABEL     u8, 3 bytes 0       up to 256 labels of the volume
//!                f32                 above, up to 2²⁴: exact
//! ```
//! Labels have no u16, which would do up to 65,536, because Blender drops an attribute of that type.
//!
//! A volume with an axis of more than 65,535 voxels is divided among meshes of at most 32,768 + 256 voxels along an axis, each placed by a
//! node. A mesh has a primitive for each material, and another for each material of what cuts leave ([`polygons`](super::polygons)).

use std::collections::BTreeMap;

use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::{Primitive, Semantic};
use gltf_json::{Index, Mesh};
use pumice_core::Error;
use pumice_core::reserve::sort_by_key;
use serde_json::json;

use super::polygons::add_polygons;
use super::writer::{Elements, Writer};
use crate::drawn::Drawn;
use crate::labelled_surface::{FACES, LabelledSurface};
use crate::{CutPolygon, Rectangle, Result};

/// Bytes of a vertex.
pub(super) const VERTEX_BYTES: u64 = 16;

/// Side of what a mesh holds where a volume is too large for one, in voxels. A rectangle begins within it and is at most 256 long.
const PART: u32 = 1 << 15;

/// Most labels whose numbers are exact in single precision.
const MOST_LABELS: u64 = 1 << 24;

/// How the numbers of labels are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LabelNumbers {
    Byte,
    Float,
}

impl LabelNumbers {
    /// What `labels` labels need.
    ///
    /// # Errors
    /// [`Error::Limit`] where no type of glTF holds their numbers exactly.
    pub(super) fn of(labels: u64) -> Result<Self> {
        match labels {
            0..=0x100 => Ok(Self::Byte),
            0x101..=MOST_LABELS => Ok(Self::Float),
            _ => {
                let what =
                    "labels of a volume in a glTF file, which has no larger whole numbers for vertices";
                Err(Error::Limit { what: what.into(), limit: MOST_LABELS, got: labels }.into())
            }
        }
    }

    pub(super) fn component(self) -> ComponentType {
        match self {
            Self::Byte => ComponentType::U8,
            Self::Float => ComponentType::F32,
        }
    }

    /// Four bytes.
    pub(super) fn bytes(self, label: u32) -> [u8; 4] {
        match self {
            Self::Byte => label.to_le_bytes(),
            Self::Float => (label as f32).to_le_bytes(),
        }
    }
}

/// A mesh and the lowest corner of its part of the volume, in voxels.
pub(super) type PlacedMesh = (Index<Mesh>, [u32; 3]);

/// A primitive and the lowest corner of its part of the volume, in voxels.
pub(super) type PlacedPrimitive = (Primitive, [u32; 3]);

/// Adds the meshes of a surface.
///
/// # Errors
/// [`Error::Limit`] for more labels or vertices than glTF can number.
pub(super) fn add_surface(
    writer: &mut Writer<'_>,
    drawn: &Drawn<'_>,
    surface: LabelledSurface,
) -> Result<Vec<PlacedMesh>> {
    let numbers = LabelNumbers::of(drawn.visible.len() as u64)?;
    let is_divided = drawn.volume.info().dims.iter().any(|&n| n > u32::from(u16::MAX));
    let part_at = move |low: [u32; 3]| low.map(|c| if is_divided { c / PART * PART } else { 0 });
    let LabelledSurface { rectangles, polygons } = surface;
    let mut primitives = Vec::new();
    if !rectangles.faces.is_empty() {
        let part = move |r: &Rectangle| part_at(r.low);
        primitives.extend(add_rectangles(writer, drawn, numbers, rectangles.faces, part)?);
    }
    if !polygons.faces.is_empty() {
        let part = move |polygon: &CutPolygon| part_at(polygon.corners[0].to_array().map(|c| c as u32));
        primitives.extend(add_polygons(writer, drawn, numbers, polygons.faces, part)?);
    }
    let mut of_part: BTreeMap<[u32; 3], Vec<Primitive>> = BTreeMap::new();
    for (primitive, part) in primitives {
        of_part.entry(part).or_default().push(primitive);
    }
    let meshes = of_part.into_iter().map(|([x, y, z], primitives)| {
        let name = if is_divided { format!("{}_{x}_{y}_{z}", drawn.name()) } else { drawn.name() };
        (writer.root.push(mesh(name, primitives)), [x, y, z])
    });
    Ok(meshes.collect())
}

/// Adds primitives of rectangles: one for each part of the volume and each material in it.
fn add_rectangles(
    writer: &mut Writer<'_>,
    drawn: &Drawn<'_>,
    numbers: LabelNumbers,
    mut rectangles: Vec<Rectangle>,
    part: impl Fn(&Rectangle) -> [u32; 3] + Copy + 'static,
) -> Result<Vec<PlacedPrimitive>> {
    let material = |r: &Rectangle| drawn.material_of[r.label as usize] as usize;
    // They are sorted by material already, and the sort is stable.
    sort_by_key(&mut rectangles, part, FACES).map_err(Error::from)?;
    let bytes = 4 * VERTEX_BYTES * rectangles.len() as u64;
    let view = writer.view(writer.binary.bytes(), bytes, Some(VERTEX_BYTES as usize));
    let (mut primitives, mut offset) = (Vec::new(), 0);
    for group in rectangles.chunk_by(|a, b| part(a) == part(b) && material(a) == material(b)) {
        let count = 4 * group.len() as u64;
        let elements = |type_, component, is_normalized, place| Elements {
            type_,
            component,
            is_normalized,
            offset: offset + place,
            count,
        };
        let corners = writer.corners(group.len() as u64)?;
        let bounds = bounds(group, part(&group[0])).map(|corner| json!(corner));
        let positions = elements(Type::Vec3, ComponentType::U16, false, 0);
        let normals = elements(Type::Vec3, ComponentType::I8, true, 8);
        let labels = elements(Type::Scalar, numbers.component(), false, 12);
        let attributes = [
            (Semantic::Positions, writer.accessor(view, positions, Some(bounds))),
            (Semantic::Normals, writer.accessor(view, normals, None)),
            (Semantic::Extras("LABEL".into()), writer.accessor(view, labels, None)),
        ];
        let primitive = writer.primitive(attributes, corners, &drawn.materials[material(&group[0])])?;
        primitives.push((primitive, part(&group[0])));
        offset += count * VERTEX_BYTES;
    }
    writer.binary.add_values(rectangles, 4 * VERTEX_BYTES, move |r: &Rectangle, out| {
        put_rectangle(r, part(r), numbers, out)
    });
    Ok(primitives)
}

pub(super) fn mesh(name: String, primitives: Vec<gltf_json::mesh::Primitive>) -> Mesh {
    Mesh { extensions: None, extras: None, name: Some(name), primitives, weights: None }
}

/// Appends the four vertices of a rectangle.
pub(super) fn put_rectangle(
    rectangle: &Rectangle,
    origin: [u32; 3],
    numbers: LabelNumbers,
    out: &mut Vec<u8>,
) {
    let mut normal = [0i8; 4];
    normal[usize::from(rectangle.axis)] = if rectangle.is_up { 127 } else { -127 };
    for corner in rectangle.corners() {
        for axis in 0..3 {
            // At most 65,535: the whole volume's axes, or those of a part of it.
            out.extend_from_slice(&((corner[axis] - origin[axis]) as u16).to_le_bytes());
        }
        out.extend_from_slice(&[0, 0]);
        out.extend(normal.map(|v| v.to_le_bytes()[0]));
        out.extend_from_slice(&numbers.bytes(rectangle.label));
    }
}

/// Lowest and highest corner, from `origin`.
fn bounds(rectangles: &[Rectangle], origin: [u32; 3]) -> [[u32; 3]; 2] {
    let mut bounds = [[u32::MAX; 3], [0; 3]];
    for corner in rectangles.iter().flat_map(Rectangle::corners) {
        for axis in 0..3 {
            let place = corner[axis] - origin[axis];
            bounds[0][axis] = bounds[0][axis].min(place);
            bounds[1][axis] = bounds[1][axis].max(place);
        }
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_labels_are_exact_or_refused() {
        assert_eq!(LabelNumbers::of(256).unwrap(), LabelNumbers::Byte);
        assert_eq!(LabelNumbers::Byte.bytes(255), [0xff, 0, 0, 0]);
        assert_eq!(LabelNumbers::of(1 << 24).unwrap(), LabelNumbers::Float);
        for label in [256, (1 << 24) - 1] {
            assert_eq!(f32::from_le_bytes(LabelNumbers::Float.bytes(label)) as u32, label);
        }
        let error = LabelNumbers::of((1 << 24) + 1).unwrap_err().to_string();
        assert!(error.ends_with("for vertices: 16777217 is more than the limit of 16777216"), "{error}");
    }

    #[test]
    fn a_vertex_is_as_drawn() {
        let rectangle =
            Rectangle { low: [40_000, 7, 300], size: [256, 2], axis: 1, is_up: false, label: 203 };
        let mut bytes = Vec::new();
        put_rectangle(&rectangle, [32_768, 0, 0], LabelNumbers::Byte, &mut bytes);
        assert_eq!(bytes.len() as u64, 4 * VERTEX_BYTES);
        // The first corner: z is across, x is along and at its end.
        let [x, y, z] = [40_000 + 2 - 32_768, 7, 300u16].map(u16::to_le_bytes);
        assert_eq!(bytes[..16], [x[0], x[1], y[0], y[1], z[0], z[1], 0, 0, 0, 129, 0, 0, 203, 0, 0, 0]);
    }
}
