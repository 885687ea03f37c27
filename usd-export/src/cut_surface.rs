//! The surface of a volume that cuts pass through: its faces as far as they are left, and the caps that close it, exactly.
//!
//! ```text
//!        cut │                 cut │
//!      ┌─────┼───┐           ┌─────┤           faces that no cut touches: rectangles
//!      │     │   │    ─►     │     │ cap       faces that a cut halves, and caps: convex polygons
//!      └─────┼───┘           └─────┘
//! ```
//! A cut is a convex region of index space: a half-space, or the inside of a box. Several remove their union. A face loses one region after
//! the other: what lies outside a plane of the region is left, what lies inside all planes is gone (Bernstein and Fussell 2009, *Fast,
//! exact, linear booleans*, do the same with BSP trees). A cap is the section of a plane with each element, within the region's other planes
//! and outside the other regions; it has the element's label.

use glam::{DAffine3, DVec3};
use pumice_core::{CompressedVolume, Job};
use pumice_scene::{CutShape, Instance, Scene};
use pumice_transport::geometry::DetailLevel;

use crate::surface::Surface;
use crate::{Interfaces, Merging, Rectangle, Result};

/// Distance in voxels within which a corner lies on a plane. Coordinates are whole numbers up to 2²³ and planes come from matrices of f64, so
/// that planes meant to lie between voxels are off by 1e-9 of that at most; files have f32, whose last bit is a thousand times as much.
const ON_PLANE: f64 = 1e-6;

/// A plane: points with `normal · p + offset` above 0 are on its inner side. The normal has length 1 in voxels.
#[derive(Clone, Copy, Debug)]
struct Plane {
    normal: DVec3,
    offset: f64,
}

impl Plane {
    fn new(normal: DVec3, offset: f64) -> Self {
        let length = normal.length();
        Self { normal: normal / length, offset: offset / length }
    }

    fn distance(&self, p: DVec3) -> f64 {
        self.normal.dot(p) + self.offset
    }
}

/// A convex part of index space that is removed.
#[derive(Clone, Debug)]
pub struct CutRegion {
    planes: Vec<Plane>,
}

impl CutRegion {
    /// The region of a cut in the index space of an instance.
    pub fn new(shape: &CutShape, world_from_index: &DAffine3) -> Self {
        let planes = match shape {
            CutShape::Plane { point, normal } => {
                let normal = DVec3::from_array(*normal);
                // n · (M p − q) = (Mᵀ n) · p + n · (t − q)
                let in_index = world_from_index.matrix3.transpose() * normal;
                let offset = normal.dot(world_from_index.translation - DVec3::from_array(*point));
                vec![Plane::new(in_index, offset)]
            }
            CutShape::Box { world_from_box } => {
                let box_from_index = world_from_box.inverse() * *world_from_index;
                let rows = box_from_index.matrix3.transpose();
                let rows = [rows.x_axis, rows.y_axis, rows.z_axis];
                let side = |(row, t): (DVec3, f64)| [Plane::new(row, 1.0 + t), Plane::new(-row, 1.0 - t)];
                rows.into_iter().zip(box_from_index.translation.to_array()).flat_map(side).collect()
            }
        };
        Self { planes }
    }

    /// The regions of the cuts that apply to an instance.
    pub fn of_instance(scene: &Scene, instance: &Instance) -> Vec<Self> {
        scene.cuts_of(instance.id).map(|shape| Self::new(shape, &instance.world_from_index)).collect()
    }

    /// Whether nothing of the box between two corners, in voxels, is left.
    pub(crate) fn removes(&self, ends: [[u32; 3]; 2]) -> bool {
        self.planes.iter().all(|plane| corners_between(ends).all(|p| plane.distance(p) > ON_PLANE))
    }

    /// Whether all points lie outside one of its planes, or on it.
    fn misses(&self, points: impl Iterator<Item = DVec3> + Clone) -> bool {
        self.planes.iter().any(|plane| points.clone().all(|p| plane.distance(p) < -ON_PLANE))
    }
}

/// A convex polygon in index space.
#[derive(Clone, Debug, PartialEq)]
pub struct CutPolygon {
    /// Its corners, counter-clockwise as seen from outside.
    pub corners: Vec<DVec3>,
    /// Dense index of its label.
    pub label: u32,
}

impl CutPolygon {
    /// The direction of its outside, of length 1 in voxels: that of its vector area, so that short sides turn it little.
    pub fn normal(&self) -> DVec3 {
        let corners = &self.corners;
        let fan =
            (1..corners.len() - 1).map(|i| (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]));
        fan.sum::<DVec3>().normalize_or(DVec3::Z)
    }
}

/// The faces that a surface has, and how they become rectangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faces {
    /// Whether faces between two shown labels are among them.
    pub interfaces: Interfaces,
    /// Whether neighbouring faces become one rectangle.
    pub merging: Merging,
}

/// Visits the surface of the labels that are `visible` without what `cuts` remove, block by block: rectangles of faces that no cut touches,
/// and polygons.
///
/// # Errors
/// As [`for_each_surface_block`](crate::for_each_surface_block).
pub fn for_each_cut_block(
    volume: &CompressedVolume,
    visible: &[bool],
    level: DetailLevel,
    faces: Faces,
    cuts: &[CutRegion],
    job: &Job,
    visit: impl FnMut(&[Rectangle], &[CutPolygon]) -> Result<()>,
) -> Result<()> {
    let surface = Surface::new(volume, visible, level, faces.merging)?.with_interfaces(faces.interfaces);
    cut_blocks(&surface, cuts, job, visit)
}

/// Visits what `cuts` leave of a surface, as [`for_each_cut_block`] does.
pub(crate) fn cut_blocks(
    surface: &Surface<'_>,
    cuts: &[CutRegion],
    job: &Job,
    mut visit: impl FnMut(&[Rectangle], &[CutPolygon]) -> Result<()>,
) -> Result<()> {
    surface.for_each_block(
        job,
        |origin| {
            let ends = surface.block_ends(origin);
            if cuts.iter().any(|cut| cut.removes(ends)) {
                return Ok((Vec::new(), Vec::new()));
            }
            let elements = surface.elements(origin)?;
            if cuts.iter().all(|cut| cut.misses(corners_between(ends))) {
                return Ok((surface.rectangles_of(&elements, origin, |_| true), Vec::new()));
            }
            let mut polygons = Vec::new();
            let whole = surface.rectangles_of(&elements, origin, |face| is_whole(face, cuts, &mut polygons));
            surface.for_each_element(&elements, origin, |ends, label, beyond| {
                caps(ends, label, beyond, cuts, &mut polygons);
            });
            Ok((whole, polygons))
        },
        |(whole, polygons)| visit(&whole, &polygons),
    )
}

fn point(corner: [u32; 3]) -> DVec3 {
    DVec3::from_array(corner.map(f64::from))
}

/// The eight corners of the box between two corners.
fn corners_between(ends: [[u32; 3]; 2]) -> impl Iterator<Item = DVec3> + Clone {
    let [low, high] = ends.map(point);
    (0..8).map(move |c| {
        DVec3::new([low.x, high.x][c & 1], [low.y, high.y][c >> 1 & 1], [low.z, high.z][c >> 2])
    })
}

/// Whether cuts leave a face as it is. If not, what is left of it joins the polygons.
fn is_whole(face: &Rectangle, cuts: &[CutRegion], polygons: &mut Vec<CutPolygon>) -> bool {
    let corners = face.corners().map(point);
    let touching = || cuts.iter().filter(|cut| !cut.misses(corners.iter().copied()));
    if touching().next().is_none() {
        return true;
    }
    let mut outward = DVec3::ZERO;
    outward[usize::from(face.axis)] = if face.is_up { 1.0 } else { -1.0 };
    let mut left = vec![corners.to_vec()];
    for cut in touching() {
        left = left.into_iter().flat_map(|polygon| without(polygon, outward, cut, false)).collect();
    }
    if left.len() == 1 && left[0] == corners {
        return true;
    }
    polygons.extend(left.into_iter().map(|corners| CutPolygon { corners, label: face.label }));
    false
}

/// The caps of an element between two corners.
fn caps(
    ends: [[u32; 3]; 2],
    label: u32,
    beyond: [bool; 6],
    cuts: &[CutRegion],
    polygons: &mut Vec<CutPolygon>,
) {
    let [low, high] = ends.map(point);
    let corners = corners_between(ends);
    for (number, cut) in cuts.iter().enumerate() {
        if cut.misses(corners.clone()) {
            continue;
        }
        for (side, plane) in cut.planes.iter().enumerate() {
            let distances = corners.clone().map(|c| plane.distance(c));
            let [least, most] = distances
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], d| [least.min(d), most.max(d)]);
            // An element that ends at the plane has a cap there only if nothing but the cut exposes that face.
            let is_passed = least < -ON_PLANE && most > ON_PLANE;
            let ends_there = most.abs() <= ON_PLANE && is_hidden_beyond(plane, beyond);
            if !(is_passed || ends_there) {
                continue;
            }
            let mut cap = section(plane, low, high);
            for (_, other) in cut.planes.iter().enumerate().filter(|(other, _)| *other != side) {
                cap = part(&cap, other, true);
            }
            let mut left = if cap.len() < 3 { vec![] } else { vec![cap] };
            for (place, other) in cuts.iter().enumerate().filter(|(place, _)| *place != number) {
                // Of caps that coincide the first region's is kept.
                let drops_same = place < number;
                left = left
                    .into_iter()
                    .flat_map(|polygon| without(polygon, plane.normal, other, drops_same))
                    .collect();
            }
            polygons.extend(left.into_iter().map(|corners| CutPolygon { corners, label }));
        }
    }
}

/// Whether the element beyond the face that lies on a plane hides that face; not for a plane that is not parallel to a face.
fn is_hidden_beyond(plane: &Plane, beyond: [bool; 6]) -> bool {
    let axis = (0..3).find(|&a| plane.normal[a].abs() > 1.0 - 1e-12);
    axis.is_some_and(|axis| beyond[2 * axis + usize::from(plane.normal[axis] > 0.0)])
}

/// The section of a plane with the box between two corners, counter-clockwise as seen from where the normal points.
fn section(plane: &Plane, low: DVec3, high: DVec3) -> Vec<DVec3> {
    let normal = plane.normal;
    let middle = 0.5 * (low + high);
    let on_plane = middle - plane.distance(middle) * normal;
    // A square of the plane that is larger than the box.
    let across = normal.any_orthonormal_vector() * (high - low).length();
    let along = normal.cross(across);
    let mut polygon = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[a, b]| on_plane + a * across + b * along)
        .to_vec();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        polygon = part(&polygon, &Plane::new(axis, -axis.dot(low)), true);
        polygon = part(&polygon, &Plane::new(-axis, axis.dot(high)), true);
    }
    polygon
}

/// The part of a convex polygon on one side of a plane (Sutherland and Hodgman 1974, *Reentrant polygon clipping*); corners within
/// [`ON_PLANE`] belong to both sides. Fewer than three corners are left where there is none.
fn part(polygon: &[DVec3], plane: &Plane, inner: bool) -> Vec<DVec3> {
    let distance = |p: DVec3| {
        let d = plane.distance(p);
        if d.abs() <= ON_PLANE {
            0.0
        } else if inner {
            d
        } else {
            -d
        }
    };
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &from) in polygon.iter().enumerate() {
        let to = polygon[(i + 1) % polygon.len()];
        let [at_from, at_to] = [distance(from), distance(to)];
        if at_from >= 0.0 {
            kept.push(from);
        }
        if (at_from > 0.0 && at_to < 0.0) || (at_from < 0.0 && at_to > 0.0) {
            kept.push(from + at_from / (at_from - at_to) * (to - from));
        }
    }
    kept
}

/// What a convex polygon whose outside is towards `outward` has outside of a region, as convex polygons. A polygon within a plane of the
/// region bounds what is left if it faces the region, and what is removed if it faces away; `drops_same` takes the first for removed too.
fn without(polygon: Vec<DVec3>, outward: DVec3, region: &CutRegion, drops_same: bool) -> Vec<Vec<DVec3>> {
    if region.misses(polygon.iter().copied()) {
        return vec![polygon];
    }
    let (mut left, mut rest) = (Vec::new(), polygon.clone());
    for plane in &region.planes {
        let distances = || rest.iter().map(|p| plane.distance(*p));
        let [is_outside, is_inside] =
            [distances().all(|d| d <= ON_PLANE), distances().all(|d| d >= -ON_PLANE)];
        if is_outside && is_inside {
            if outward.dot(plane.normal) > 0.0 && !drops_same {
                left.push(rest);
                return left;
            }
        } else if is_outside {
            left.push(rest);
            return left;
        } else if !is_inside {
            let outside = part(&rest, plane, false);
            if outside.len() > 2 {
                left.push(outside);
            }
            rest = part(&rest, plane, true);
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[DVec3]) -> f64 {
        let fan = polygon.windows(2).skip(1).map(|w| (w[0] - polygon[0]).cross(w[1] - polygon[0]));
        0.5 * fan.sum::<DVec3>().length()
    }

    fn region(planes: &[([f64; 3], f64)]) -> CutRegion {
        CutRegion { planes: planes.iter().map(|(n, d)| Plane::new(DVec3::from_array(*n), *d)).collect() }
    }

    #[test]
    fn a_box_is_taken_out_of_the_middle_of_a_square() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        // 1 < x < 3, 1 < y < 2, −1 < z < 1.
        let hole = region(&[
            ([1.0, 0.0, 0.0], -1.0),
            ([-1.0, 0.0, 0.0], 3.0),
            ([0.0, 1.0, 0.0], -1.0),
            ([0.0, -1.0, 0.0], 2.0),
            ([0.0, 0.0, 1.0], 1.0),
            ([0.0, 0.0, -1.0], 1.0),
        ]);
        let left = without(square.to_vec(), DVec3::Z, &hole, false);
        let areas: f64 = left.iter().map(|p| area(p)).sum();
        assert!((areas - 14.0).abs() < 1e-12, "{areas}");
        assert!(left.iter().all(|p| (p[1] - p[0]).cross(p[2] - p[1]).z > 0.0), "all keep their side");
        let centre = |p: &Vec<DVec3>| p.iter().sum::<DVec3>() / p.len() as f64;
        assert!(left.iter().map(centre).all(|c| !(c.x > 1.0 && c.x < 3.0 && c.y > 1.0 && c.y < 2.0)));
    }

    #[test]
    fn a_square_within_a_plane_bounds_what_it_turns_its_back_to() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 5.0));
        let above = region(&[([0.0, 0.0, 2.0], -10.0)]);
        let left = |outward, drops_same| without(square.to_vec(), outward, &above, drops_same).len();
        assert_eq!([left(DVec3::Z, false), left(-DVec3::Z, false), left(DVec3::Z, true)], [1, 0, 0]);
    }

    #[test]
    fn the_diagonal_section_of_a_cube_is_a_hexagon() {
        let diagonal = Plane::new(DVec3::ONE, -1.5);
        let cut = section(&diagonal, DVec3::ZERO, DVec3::ONE);
        assert_eq!(cut.len(), 6, "{cut:?}");
        // Its sides are √½ long.
        assert!((area(&cut) - 1.5 * 3f64.sqrt() * 0.5).abs() < 1e-12);
        let turn = (cut[1] - cut[0]).cross(cut[2] - cut[1]);
        assert!(turn.dot(DVec3::ONE) > 0.0, "as seen from where the normal points");
    }
}
