//! What cuts leave of faces, and the caps that close them, as primitives of the mesh whose rectangles they stand beside.
//!
//! ```text
//! a vertex: 28 bytes
//!  0  position   3 × f32   voxels, from the mesh's place
//! 12  normal     3 × f32
//! 24  _LABEL     as of rectangles
//! ```
//! A convex polygon is a fan of triangles about its first corner.

use gltf_json::Index;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::View;
use gltf_json::mesh::Semantic;
use pumice_core::Error;
use pumice_core::reserve::sort_by_key;
use serde_json::json;

use super::binary::put_floats;
use super::surface::{LabelNumbers, PlacedPrimitive};
use super::writer::{Elements, Writer, addressable};
use crate::drawn::Drawn;
use crate::labelled_surface::{FACES, Face};
use crate::{CutPolygon, Result};

/// Bytes of a vertex.
const VERTEX_BYTES: u64 = 28;

/// Adds primitives of polygons: one for each part of the volume and each material in it.
///
/// # Errors
/// [`pumice_core::Error::Limit`] for more vertices than glTF can number.
pub(super) fn add_polygons(
    writer: &mut Writer<'_>,
    drawn: &Drawn<'_>,
    numbers: LabelNumbers,
    mut polygons: Vec<CutPolygon>,
    part: impl Fn(&CutPolygon) -> [u32; 3] + Copy + 'static,
) -> Result<Vec<PlacedPrimitive>> {
    let material = |polygon: &CutPolygon| drawn.material_of[polygon.label as usize] as usize;
    // They are sorted by material already, and the sort is stable.
    sort_by_key(&mut polygons, part, FACES).map_err(Error::from)?;
    let of_group = |a: &CutPolygon, b: &CutPolygon| part(a) == part(b) && material(a) == material(b);
    let corners: u64 = polygons.iter().map(|polygon| polygon.corner_count() as u64).sum();
    let triangles = corners - 2 * polygons.len() as u64;
    let vertices = writer.view(writer.binary.bytes(), VERTEX_BYTES * corners, Some(VERTEX_BYTES as usize));
    let offset_of_triangles = writer.binary.bytes() + VERTEX_BYTES * corners;
    let indices = writer.view(offset_of_triangles, 12 * triangles, None);
    let (mut primitives, mut place) = (Vec::new(), Place::default());
    for group in polygons.chunk_by(of_group) {
        let count: u64 = group.iter().map(|polygon| polygon.corner_count() as u64).sum();
        addressable(count)?;
        let triangles = count - 2 * group.len() as u64;
        let attributes = place.attributes(writer, vertices, numbers, count, bounds(group, part(&group[0])));
        let of_corners = Elements {
            type_: Type::Scalar,
            component: ComponentType::U32,
            is_normalized: false,
            offset: 12 * place.triangle,
            count: 3 * triangles,
        };
        let of_corners = writer.accessor(indices, of_corners, None);
        let primitive = writer.primitive(attributes, of_corners, &drawn.materials[material(&group[0])])?;
        primitives.push((primitive, part(&group[0])));
        place = Place { vertex: place.vertex + count, triangle: place.triangle + triangles };
    }
    let fans: Vec<Vec<u32>> =
        polygons.chunk_by(of_group).map(|g| g.iter().map(|p| p.corner_count() as u32).collect()).collect();
    writer.binary.add(VERTEX_BYTES * corners, move |out| {
        let mut buffer = Vec::new();
        for polygon in &polygons {
            buffer.clear();
            put_polygon(polygon, part(polygon), numbers, &mut buffer);
            out.write_all(&buffer)?;
        }
        Ok(())
    });
    writer.binary.add(12 * triangles, move |out| {
        let mut buffer = Vec::new();
        for group in &fans {
            let mut first = 0u32;
            for &corners in group {
                buffer.clear();
                for second in 1..corners - 1 {
                    let triangle = [first, first + second, first + second + 1];
                    triangle.iter().for_each(|corner| buffer.extend_from_slice(&corner.to_le_bytes()));
                }
                out.write_all(&buffer)?;
                first += corners;
            }
        }
        Ok(())
    });
    Ok(primitives)
}

/// Vertices and triangles of the primitives so far.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    vertex: u64,
    triangle: u64,
}

impl Place {
    /// Accessors of the next `count` vertices.
    fn attributes(
        self,
        writer: &mut Writer<'_>,
        view: Index<View>,
        numbers: LabelNumbers,
        count: u64,
        bounds: [[f32; 3]; 2],
    ) -> [(Semantic, Index<gltf_json::Accessor>); 3] {
        let elements = |type_, component, place| Elements {
            type_,
            component,
            is_normalized: false,
            offset: self.vertex * VERTEX_BYTES + place,
            count,
        };
        let bounds = Some(bounds.map(|corner| json!(corner)));
        let positions = writer.accessor(view, elements(Type::Vec3, ComponentType::F32, 0), bounds);
        let normals = writer.accessor(view, elements(Type::Vec3, ComponentType::F32, 12), None);
        let labels = writer.accessor(view, elements(Type::Scalar, numbers.component(), 24), None);
        [
            (Semantic::Positions, positions),
            (Semantic::Normals, normals),
            (Semantic::Extras("LABEL".into()), labels),
        ]
    }
}

/// Corners from `origin`, in single precision.
fn for_each_position(polygon: &CutPolygon, origin: [u32; 3], mut visit: impl FnMut([f32; 3])) {
    let origin = glam::DVec3::from_array(origin.map(f64::from));
    polygon.for_each_corner(&mut |corner| visit((corner - origin).as_vec3().to_array()));
}

/// Appends the vertices of a polygon.
fn put_polygon(polygon: &CutPolygon, origin: [u32; 3], numbers: LabelNumbers, out: &mut Vec<u8>) {
    let normal = polygon.normal().as_vec3().to_array();
    for_each_position(polygon, origin, |position| {
        put_floats(position, out);
        put_floats(normal, out);
        out.extend_from_slice(&numbers.bytes(polygon.label));
    });
}

/// Lowest and highest corner, from `origin`.
fn bounds(polygons: &[CutPolygon], origin: [u32; 3]) -> [[f32; 3]; 2] {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for polygon in polygons {
        for_each_position(polygon, origin, |position| {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(position[axis]);
                bounds[1][axis] = bounds[1][axis].max(position[axis]);
            }
        });
    }
    bounds
}
