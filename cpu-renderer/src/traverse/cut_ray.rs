//! The pieces of a ray that cuts keep.
//!
//! Each cut removes a convex part of space, the intersection of its half-spaces: one for a plane, six for a box. A ray is within a
//! half-space from one t on, or up to one t, and so within each part in one interval. Everything between these intervals is kept:
//!
//! ```text
//!   part A        ├───────────┤
//!   part B               ├─────────┤            ├────
//!   ──────────────────────────────────────────────────► t
//!   kept   ───────┤                ├────────────┤
//!                 leaves           enters       leaves
//! ```
//! Each kept piece is traced by itself. Where a piece begins inside a label, the ray hits a cap: the surface is the plane through which the
//! ray entered the piece, and its normal points to the removed side.
//!
//! Planes are in index space. **A plane between voxels** has exactly the t of the faces in it (the same product), so that a cut along them
//! leaves no sliver of the next voxels, and a point on a cap is placed exactly. Oblique planes meet faces only in lines, where whichever
//! comes first by rounding is taken.

use pumice_transport::geometry::cuts::{CutPlane, Cuts};

use super::IndexRay;
use super::f64x4::Lanes;

/// The scaled t at which the ray crosses the plane, and whether it moves into the removed half-space.
#[inline]
pub(crate) fn crossing(plane: &CutPlane, ray: &IndexRay) -> (f64, bool) {
    if plane.axis < 3 {
        let a = plane.axis as usize;
        let up = plane.normal[a] > 0.0;
        return (ray.t_of(a, plane.across_axis()), ray.is_down(a) != up);
    }
    let rate = dot_of(&plane.normal, &ray.direction);
    let height = plane.offset - dot_of(&plane.normal, &ray.origin);
    if rate == 0.0 {
        // Parallel to the plane: always within, or never.
        return (if height < 0.0 { f64::NEG_INFINITY } else { f64::INFINITY }, true);
    }
    (height / rate, rate > 0.0)
}

fn dot_of(a: &[f64; 3], b: &Lanes) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A ray together with the cuts of its instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CutRay<'a> {
    pub(crate) cuts: &'a Cuts,
    pub(crate) ray: &'a IndexRay,
    /// The plane that the ray starts on, and whether the ray moves into the removed half-space; rounding must not decide that again.
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
    /// The interval of the part that begins with plane `next`, which is advanced to the first plane of the next part.
    fn within(&self, next: &mut u32) -> Within {
        let mut within =
            Within { enter: f64::NEG_INFINITY, enter_plane: 0, leave: f64::INFINITY, leave_plane: 0 };
        loop {
            let i = *next;
            let plane = &self.cuts.planes()[i as usize];
            *next += 1;
            let (mut t, mut rises) = crossing(plane, self.ray);
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

    /// The least kept t that is at least `t`, and the plane through which the ray enters the kept piece, unless it starts there.
    pub(crate) fn kept_from(&self, mut t: f64) -> (f64, Option<u32>) {
        let mut plane = None;
        // Parts may overlap in any order of the list, so the search repeats until no part removes t.
        loop {
            let before = t;
            let mut next = 0;
            while (next as usize) < self.cuts.planes().len() {
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

    /// The end of the kept piece that contains `t`, and the plane through which the ray leaves it; infinite where the piece does not end.
    pub(crate) fn kept_to(&self, t: f64) -> (f64, u32) {
        let (mut end, mut plane) = (f64::INFINITY, 0);
        let mut next = 0;
        while (next as usize) < self.cuts.planes().len() {
            let within = self.within(&mut next);
            if within.enter < within.leave && within.enter > t && within.enter < end {
                (end, plane) = (within.enter, within.enter_plane);
            }
        }
        (end, plane)
    }
}
