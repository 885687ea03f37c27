//! What is cut away from an instance, as planes of its index space.
//!
//! A cut takes away a convex part of space, which is where its half-spaces meet: one for a plane, six for a box. What a ray keeps of
//! itself follows from them (`cut_ray`).

use glam::{DAffine3, DVec3};
use pumice_scene::CutShape;

/// A half-space that is taken away: index-space points x with `normal·x > offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// Scaled so that its largest component is 1 in size.
    pub normal: [f64; 3],
    /// Where it lies along the normal.
    pub offset: f64,
    /// The axis that it is across, 3 where it is across none.
    pub axis: u32,
    /// Unit normal in the world: that of caps.
    pub normal_in_world: DVec3,
    /// Whether the part that it belongs to ends with it.
    pub ends_part: bool,
}

/// All that is taken away from an instance: the planes of one part after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cuts {
    planes: Vec<CutPlane>,
}

/// What is within this many roundings of its terms of a whole number, or of 0, is that: whoever cuts between voxels, in nanometres,
/// means it.
const SNAP: f64 = 16.0 * f64::EPSILON;

impl CutPlane {
    /// What the normal points to, from the point's plane on; both in the world.
    fn new(world_from_index: &DAffine3, point: DVec3, normal: DVec3) -> Self {
        // Lengths are taken out first: squares of tiny normals vanish.
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

    /// Its coordinate along the axis that it is across.
    pub fn across_axis(&self) -> f64 {
        let up = self.axis < 3 && self.normal[self.axis as usize] > 0.0;
        if up { self.offset } else { -self.offset }
    }
}

impl Cuts {
    /// What the shapes take away from an instance with this matrix.
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
                        // Across the two other sides, on the side of this one.
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

    /// Whether nothing is taken away.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }

    /// The planes of all parts.
    pub fn planes(&self) -> &[CutPlane] {
        &self.planes
    }
}
