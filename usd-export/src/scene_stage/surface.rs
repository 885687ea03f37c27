//! The visible surface at one level of detail as a mesh: rectangles, and after them the polygons that cuts leave.

use std::iter;
use std::sync::Arc;

use glam::{UVec3, Vec3};
use pumice_core::Job;
use pumice_transport::geometry::DetailLevel;

use super::mesh_parts::{MeshParts, PIECE, array_of_ranges, indexable, subset};
use crate::drawn::Drawn;
use crate::labelled_surface::{Face, LabelledSurface};
use crate::usd::{Array, Prim, Property, Value};
use crate::{Budget, CutPolygon, Merging, Rectangle, Result};

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
    indexable(surface.corner_count())?;
    let rectangles = surface.rectangles.faces.len() as u32;
    let subsets = (0..materials.len()).filter(|&place| surface.has_material(place));
    let children = subsets
        .map(|place| {
            let polygons = &surface.polygons.of_material[place];
            let polygons = rectangles + polygons.start..rectangles + polygons.end;
            let faces = [surface.rectangles.of_material[place].clone(), polygons];
            subset(place, array_of_ranges(faces), &materials[place])
        })
        .collect();
    Ok(super::mesh_parts::surface(properties(surface, drawn), children))
}

/// An integer for each face.
fn integers(
    surface: &Arc<LabelledSurface>,
    of_rectangle: impl Fn(&Rectangle) -> i32 + Send + Sync + 'static,
    of_polygon: impl Fn(&CutPolygon) -> i32 + Send + Sync + 'static,
) -> Value<'static> {
    let surface = Arc::clone(surface);
    Value::Array(Array::new(surface.face_count(), move |sink| {
        let LabelledSurface { rectangles, polygons } = surface.as_ref();
        let mut rectangles = rectangles.faces.chunks(PIECE);
        rectangles.try_for_each(|faces| sink(&faces.iter().map(&of_rectangle).collect::<Vec<i32>>()))?;
        let mut polygons = polygons.faces.chunks(PIECE);
        polygons.try_for_each(|faces| sink(&faces.iter().map(&of_polygon).collect::<Vec<i32>>()))
    }))
}

fn properties(surface: LabelledSurface, drawn: &Drawn<'_>) -> Vec<Property<'static>> {
    let surface = &Arc::new(surface);
    let corners = surface.corner_count();
    let indices = array_of_ranges(iter::once(0..corners as u32));
    let [normals, normal_of_face] = normals(surface);
    let (colors, color_of_face) = colors(surface, drawn);
    let labels = integers(surface, |rectangle| rectangle.label as i32, |polygon| polygon.label as i32);
    let parts = MeshParts {
        extent: extent(surface),
        corner_counts: integers(surface, |_| 4, |polygon| polygon.corners.len() as i32),
        corners: Value::Array(indices),
        points: points(surface, corners),
        colors,
        color_of_face,
    };
    parts.properties(vec![
        Property::primvar("label", "int[]", "uniform", labels),
        Property::primvar("normals", "normal3f[]", "uniform", normals),
        Property::new("primvars:normals:indices", "int[]", normal_of_face),
    ])
}

/// The corners of each face. Those of rectangles, of which there are most, are not asked for one by one.
fn points(surface: &Arc<LabelledSurface>, corners: u64) -> Value<'static> {
    let surface = Arc::clone(surface);
    Value::Array(Array::new(corners, move |sink| {
        let mut piece: Vec<[f32; 3]> = Vec::with_capacity(PIECE);
        for rectangles in surface.rectangles.faces.chunks(PIECE / 4) {
            for rectangle in rectangles {
                piece.extend_from_slice(&rectangle.corners().map(|corner| corner.map(|c| c as f32)));
            }
            sink(&piece)?;
            piece.clear();
        }
        for polygon in &surface.polygons.faces {
            polygon.for_each_corner(&mut |corner| piece.push(corner.as_vec3().to_array()));
            if piece.len() >= PIECE {
                sink(&piece)?;
                piece.clear();
            }
        }
        sink(&piece)
    }))
}

/// Lowest and highest corner; both 0 where there is no face.
fn extent(surface: &LabelledSurface) -> Vec<[f32; 3]> {
    if surface.is_empty() {
        return vec![[0.0; 3]; 2];
    }
    let (mut low, mut high) = (UVec3::MAX, UVec3::ZERO);
    for rectangle in &surface.rectangles.faces {
        let [lowest, highest] = rectangle.bounds().map(UVec3::from_array);
        (low, high) = (low.min(lowest), high.max(highest));
    }
    let mut extent = match surface.rectangles.faces.is_empty() {
        true => [Vec3::INFINITY, Vec3::NEG_INFINITY],
        false => [low, high].map(|corner| corner.as_vec3()),
    };
    for polygon in &surface.polygons.faces {
        polygon.for_each_corner(&mut |corner| {
            let corner = corner.as_vec3();
            extent = [extent[0].min(corner), extent[1].max(corner)];
        });
    }
    extent.map(|corner| corner.to_array()).to_vec()
}

/// The six normals of rectangles and those of the polygons, and which of them each face has.
fn normals(surface: &Arc<LabelledSurface>) -> [Value<'static>; 2] {
    let of_polygons = surface.polygons.faces.iter().map(|polygon| polygon.normal().as_vec3().to_array());
    let normals: Vec<[f32; 3]> = NORMALS.into_iter().chain(of_polygons).collect();
    let (faces, surface) = (surface.face_count(), Arc::clone(surface));
    let of_face = Array::new(faces, move |sink| {
        let rectangles = surface.rectangles.faces.chunks(PIECE);
        rectangles.into_iter().try_for_each(|r| sink(&r.iter().map(normal_of).collect::<Vec<i32>>()))?;
        let first = NORMALS.len() as i32;
        let of_polygons: Vec<i32> = (first..first + surface.polygons.faces.len() as i32).collect();
        of_polygons.chunks(PIECE).try_for_each(sink)
    });
    [Value::Array(Array::of(normals)), Value::Array(of_face)]
}

/// The colours of the materials that faces have, because labels may be drawn and have none, and which of them each face has.
fn colors(surface: &Arc<LabelledSurface>, drawn: &Drawn<'_>) -> (Vec<[f32; 3]>, Value<'static>) {
    let (mut colors, mut color_of_material) = (Vec::new(), Vec::new());
    for (place, material) in drawn.materials.iter().enumerate() {
        color_of_material.push(colors.len() as i32);
        if surface.has_material(place) {
            colors.push(material.base_color);
        }
    }
    let (faces, surface) = (surface.face_count(), Arc::clone(surface));
    let of_face = Array::new(faces, move |sink| {
        surface.runs_of_materials().try_for_each(|(place, faces)| {
            let piece = [color_of_material[place]; PIECE];
            let mut left = faces.len();
            while left > 0 {
                let now = left.min(PIECE);
                sink(&piece[..now])?;
                left -= now;
            }
            Ok(())
        })
    });
    (colors, Value::Array(of_face))
}
