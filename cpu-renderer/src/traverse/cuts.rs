//! What cuts leave of a ray.
//!
//! A cut takes away a convex part of space, which is where its half-spaces meet: one for a plane, six for a box. A ray is within a
//! half-space from one t on, or up to one t, and so within each part in one interval. What is between them is kept:
//!
//! ```text
//!   part A        ├───────────┤
//!   part B               ├─────────┤            ├────
//!   ──────────────────────────────────────────────────► t
//!   kept   ───────┤                ├────────────┤
//!                 leaves           enters       leaves
//! ```
//! Each kept stretch is traced by itself. Where one begins inside of a label, the ray meets a cap: the plane through which it came
//! is the surface, and its normal points to what was taken away.
//!
//! Planes are of index space. **A plane between voxels** has the very t of the faces in it (the same product), so that a cut along
//! them leaves no sliver of the next voxels; and a point on a cap is put there exactly. Oblique planes meet faces in lines alone,
//! and there whichever comes first by rounding is taken.

use glam::{DAffine3, DVec3};
use pumice_scene::CutShape;

use super::IndexRay;
use super::four::Lanes;

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
    pub(crate) fn across_axis(&self) -> f64 {
        let up = self.axis < 3 && self.normal[self.axis as usize] > 0.0;
        if up { self.offset } else { -self.offset }
    }

    /// The scaled t at which the ray crosses the plane, and whether it goes to what is taken away.
    #[inline]
    pub(crate) fn crossing(&self, ray: &IndexRay) -> (f64, bool) {
        if self.axis < 3 {
            let a = self.axis as usize;
            let up = self.normal[a] > 0.0;
            return (ray.t_of(a, self.across_axis()), ray.is_down(a) != up);
        }
        let rate = dot_of(&self.normal, &ray.direction);
        let height = self.offset - dot_of(&self.normal, &ray.origin);
        if rate == 0.0 {
            // Along the plane: always within, or never.
            return (if height < 0.0 { f64::NEG_INFINITY } else { f64::INFINITY }, true);
        }
        (height / rate, rate > 0.0)
    }
}

fn dot_of(a: &[f64; 3], b: &Lanes) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
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

/// A ray that cuts are asked about.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CutRay<'a> {
    pub(crate) cuts: &'a Cuts,
    pub(crate) ray: &'a IndexRay,
    /// The plane that the ray starts on, and whether it goes to what that takes away: rounding must not decide that again.
    pub(crate) from: Option<(u32, bool)>,
}

/// The interval in which a ray is within a part, and the planes at its ends. Empty unless `enter < leave`.
struct Within {
    enter: f64,
    enter_plane: u32,
    leave: f64,
    leave_plane: u32,
}

impl CutRay<'_> {
    /// The part that begins with plane `next`, which becomes the first of the part after it.
    fn within(&self, next: &mut u32) -> Within {
        let mut within =
            Within { enter: f64::NEG_INFINITY, enter_plane: 0, leave: f64::INFINITY, leave_plane: 0 };
        loop {
            let i = *next;
            let plane = &self.cuts.planes[i as usize];
            *next += 1;
            let (mut t, mut rises) = plane.crossing(self.ray);
            if let Some((_, outward)) = self.from.filter(|from| from.0 == i) {
                (t, rises) = (0.0, outward);
            }
            if rises && t > within.enter {
                (within.enter, within.enter_plane) = (t, i);
            } else if !rises && t < within.leave {
                (within.leave, within.leave_plane) = (t, i);
            }
            if plane.ends_part {
                return within;
            }
        }
    }

    /// The least t from `t` on that is kept, and the plane through which the ray comes to it, if it does not start there.
    pub(crate) fn kept_from(&self, mut t: f64) -> (f64, Option<u32>) {
        let mut plane = None;
        // What follows a part in the list may end later and what comes before it too: once more until nothing takes t away.
        loop {
            let before = t;
            let mut next = 0;
            while (next as usize) < self.cuts.planes.len() {
                let within = self.within(&mut next);
                if within.enter <= t && t < within.leave {
                    (t, plane) = (within.leave, Some(within.leave_plane));
                }
            }
            if t == before {
                return (t, plane);
            }
        }
    }

    /// Where what is kept at `t` ends, and the plane through which the ray leaves it; infinite where it does not.
    pub(crate) fn kept_to(&self, t: f64) -> (f64, u32) {
        let (mut end, mut plane) = (f64::INFINITY, 0);
        let mut next = 0;
        while (next as usize) < self.cuts.planes.len() {
            let within = self.within(&mut next);
            if within.enter < within.leave && within.enter > t && within.enter < end {
                (end, plane) = (within.enter, within.enter_plane);
            }
        }
        (end, plane)
    }
}
