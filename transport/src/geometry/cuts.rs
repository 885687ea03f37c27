//! The parts of space that are cut away from an instance, as planes of its index space.
//!
//! Each cut removes a convex part of space, the intersection of its half-spaces: one for a plane, six for a box. `cut_ray` computes from
//! them which pieces of a ray remain.

use glam::{DAffine3, DVec3};
use pumice_scene::CutShape;

/// A half-space that is removed: index-space points x with `normal·x > offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// Index-space normal, scaled so that its largest component is ±1.
    pub normal: [f64; 3],
    /// Offset of the plane along `normal`.
    pub offset: f64,
    /// The axis that the plane is perpendicular to, or 3 where there is none.
    pub axis: u32,
    /// Unit normal in the world, used as the normal of caps.
    pub normal_in_world: DVec3,
    /// Whether this is the last plane of its convex part.
    pub ends_part: bool,
}

/// Everything that is removed from an instance: the planes of one convex part after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cuts {
    planes: Vec<CutPlane>,
}

/// Tolerance in roundings of the terms: an offset this near to a whole number, or a component this near to 0, becomes exactly that. A cut
/// between voxels that is given in nanometres is meant to be exact.
const SNAP: f64 = 16.0 * f64::EPSILON;

impl CutPlane {
    /// The half-space that starts at the plane through `point` and extends along `normal`, both in the world.
    fn new(world_from_index: &DAffine3, point: DVec3, normal: DVec3) -> Self {
        // Scaled first, because squares of tiny components underflow.
        let normal_in_world = (normal / normal.abs().max_element()).normalize();
        let m = world_from_index.matrix3;
        let columns = [m.x_axis, m.y_axis, m.z_axis];
        let mut across = columns.map(|c| c.dot(normal_in_world));
        for a in 0..3 {
            let terms = columns[a].abs().dot(normal_in_world.abs());
            across[a] = if across[a].abs() <= terms * SNAP { 0.0 } else { across[a] };
        }
        let largest = DVec3::from(across).abs().max_element();
        let normal = across.map(|n| n / largest);
        let mut offset = normal_in_world.dot(point - world_from_index.translation) / largest;
        let terms = normal_in_world.abs().dot(point.abs() + world_from_index.translation.abs()) / largest;
        if (offset - offset.round()).abs() <= terms * SNAP {
            offset = offset.round();
        }
        let across = (0..3).find(|&a| (0..3).all(|b| (normal[b] == 0.0) == (a != b)));
        Self { normal, offset, axis: across.map_or(3, |a| a as u32), normal_in_world, ends_part: false }
    }

    /// Coordinate of the plane along the axis that it is perpendicular to.
    pub fn across_axis(&self) -> f64 {
        let up = self.axis < 3 && self.normal[self.axis as usize] > 0.0;
        if up { self.offset } else { -self.offset }
    }
}

impl Cuts {
    /// The cuts that these shapes make in an instance with this matrix.
    pub fn new<'a>(shapes: impl IntoIterator<Item = &'a CutShape>, world_from_index: &DAffine3) -> Self {
        let mut cuts = Self::default();
        for shape in shapes {
            match shape {
                CutShape::Plane { point, normal } => {
                    let (point, normal) = (DVec3::from(*point), DVec3::from(*normal));
                    cuts.planes.push(CutPlane::new(world_from_index, point, normal));
                }
                CutShape::Box { world_from_box } => {
                    let sides = world_from_box.matrix3;
                    let columns = [sides.x_axis, sides.y_axis, sides.z_axis];
                    let directions = columns.map(|c| c / c.abs().max_element());
                    for a in 0..3 {
                        // Perpendicular to the two other edges, on the side of this one.
                        let out = directions[(a + 1) % 3].cross(directions[(a + 2) % 3]);
                        let out = if out.dot(columns[a]) < 0.0 { -out } else { out };
                        for sign in [-1.0, 1.0] {
                            let point = world_from_box.translation + sign * columns[a];
                            cuts.planes.push(CutPlane::new(world_from_index, point, -sign * out));
                        }
                    }
                }
            }
            if let Some(last) = cuts.planes.last_mut() {
                last.ends_part = true;
            }
        }
        cuts
    }

    /// Whether nothing is removed.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }

    /// The planes of all parts.
    pub fn planes(&self) -> &[CutPlane] {
        &self.planes
    }
}
