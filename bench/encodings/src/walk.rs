//! The walk through a box (§4.2): a 3D-DDA of several levels. It descends the tree to a cube that is empty, solid or an occupancy field,
//! steps from one such cube to the next, and steps voxel by voxel within a field.
//!
//! Everything is computed in f64 from planes at whole numbers: `t = (p − o)·(1/d)` is a function of ray, axis and plane alone, and a plane
//! is crossed when its t is at most the ray's current t. (The published shader steps by an epsilon in f32, and misses voxels on diagonals.)

use glam::DVec3;

use crate::tree::{Node, Tree};

/// A ray in index space, scaled so that the largest absolute component of its direction is 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IndexRay {
    pub(crate) origin: [f64; 3],
    pub(crate) direction: [f64; 3],
    pub(crate) inverse: [f64; 3],
}

/// The voxel that a walk found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) t: f64,
    /// Axis of the plane through which the ray enters the voxel; `None` where it starts inside.
    pub(crate) axis: Option<usize>,
    pub(crate) voxel: [u32; 3],
}

impl IndexRay {
    /// Makes a ray from origin and direction in index space; also returns the factor by which the direction was divided. `None` where the
    /// origin is not finite or the direction is zero, subnormal or not finite.
    pub(crate) fn new(origin: DVec3, direction: DVec3) -> Option<(Self, f64)> {
        let length = direction.abs().max_element();
        let usable = origin.is_finite() && length.is_normal();
        let direction = (direction / length).to_array();
        let mut origin = origin.to_array();
        let mut inverse = [0.0; 3];
        for a in 0..3 {
            // A ray that runs in a plane between voxels counts as in the voxel above the plane.
            if direction[a] == 0.0 && origin[a] == origin[a].floor() {
                origin[a] += 0.5;
            }
            inverse[a] = 1.0 / direction[a].abs().max(f64::MIN_POSITIVE).copysign(direction[a]);
        }
        usable.then_some((Self { origin, direction, inverse }, length))
    }

    #[inline]
    fn t_of(&self, a: usize, plane: u32) -> f64 {
        (f64::from(plane) - self.origin[a]) * self.inverse[a]
    }

    #[inline]
    fn is_down(&self, a: usize) -> bool {
        self.inverse[a] < 0.0
    }

    /// The interval (enter, leave) of t ≥ 0 in which the ray is inside a box; empty unless enter < leave.
    #[inline]
    pub(crate) fn clip(&self, lo: [u32; 3], hi: [u32; 3]) -> (f64, f64) {
        let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
        for a in 0..3 {
            let (near, far) = if self.is_down(a) { (hi[a], lo[a]) } else { (lo[a], hi[a]) };
            enter = enter.max(self.t_of(a, near));
            leave = leave.min(self.t_of(a, far));
        }
        (enter, leave)
    }

    /// Coordinate along an axis, within `low..end`, of the voxel in which the ray is at t; planes with at most that t are crossed.
    #[inline]
    fn voxel_at(&self, a: usize, t: f64, low: u32, end: u32) -> u32 {
        let at = self.origin[a] + t * self.direction[a];
        let mut v = (at.max(f64::from(low)) as u32).min(end - 1);
        if self.is_down(a) {
            while v > low && self.t_of(a, v) <= t {
                v -= 1;
            }
            while v + 1 < end && self.t_of(a, v + 1) > t {
                v += 1;
            }
        } else {
            while v + 1 < end && self.t_of(a, v + 1) <= t {
                v += 1;
            }
            while v > low && self.t_of(a, v) > t {
                v -= 1;
            }
        }
        v
    }

    /// Moves `voxel` out of the cube of side 2^`shift` that holds it; such cubes are aligned with `lo`. Returns t and the axis of the plane
    /// crossed. A coordinate may end up outside the box (below 0 it wraps).
    #[inline]
    fn step(&self, lo: [u32; 3], shift: u32, voxel: &mut [u32; 3]) -> (f64, usize) {
        let (mut t, mut axis) = (f64::INFINITY, 0);
        let mut planes = [0; 3];
        let mut at = [0.0; 3];
        for a in 0..3 {
            let cube = (voxel[a] - lo[a]) >> shift;
            planes[a] = lo[a] + (if self.is_down(a) { cube << shift } else { (cube + 1) << shift });
            at[a] = self.t_of(a, planes[a]);
            if at[a] < t {
                (t, axis) = (at[a], a);
            }
        }
        for a in 0..3 {
            if at[a] == t {
                voxel[a] = if self.is_down(a) { planes[a].wrapping_sub(1) } else { planes[a] };
            } else if shift > 0 {
                let low = lo[a] + ((voxel[a] - lo[a]) >> shift << shift);
                voxel[a] = self.voxel_at(a, t, low, low + (1 << shift));
            }
        }
        (t, axis)
    }

    /// The first voxel of a box that the ray meets from t = `enter` on, where it is inside the box. `side` is the side of the cube that the
    /// tree divides. Adds the number of nodes read to `nodes`.
    pub(crate) fn first_voxel<T: Tree>(
        &self,
        (tree, root): (&T, Node),
        (lo, hi): ([u32; 3], [u32; 3]),
        side: u32,
        enter: f64,
        nodes: &mut u64,
    ) -> Option<Found> {
        let mut voxel = [0, 1, 2].map(|a| self.voxel_at(a, enter, lo[a], hi[a]));
        let near = |a: usize| if self.is_down(a) { hi[a] } else { lo[a] };
        let mut found = Found { t: enter, axis: (0..3).find(|&a| self.t_of(a, near(a)) == enter), voxel };
        let top = side.trailing_zeros() as usize;
        // The nodes that hold the voxel, by the logarithm of their side.
        let mut path = [Node::Empty; 24];
        path[top] = root;
        let mut level = top;
        loop {
            while let (Node::Inner(inner), true) = (path[level], level > 0) {
                level -= 1;
                let bit = |a: usize| (voxel[a] - lo[a]) >> level & 1;
                path[level] = tree.child(inner, bit(0) | bit(1) << 1 | bit(2) << 2);
                *nodes += 1;
            }
            let before = voxel;
            match path[level] {
                Node::Solid => return Some(Found { voxel, ..found }),
                Node::Field(field) => loop {
                    let [x, y, z] = [0, 1, 2].map(|a| (voxel[a] - lo[a]) & 3);
                    if field >> (x + 4 * y + 16 * z) & 1 != 0 {
                        return Some(Found { voxel, ..found });
                    }
                    let (t, axis) = self.step(lo, 0, &mut voxel);
                    (found.t, found.axis) = (t, Some(axis));
                    if (0..3).any(|a| (voxel[a].wrapping_sub(lo[a]) ^ (before[a] - lo[a])) > 3) {
                        break;
                    }
                },
                Node::Empty | Node::Inner(_) => {
                    let (t, axis) = self.step(lo, level as u32, &mut voxel);
                    (found.t, found.axis) = (t, Some(axis));
                }
            }
            if (0..3).any(|a| voxel[a].wrapping_sub(lo[a]) >= hi[a] - lo[a]) {
                return None;
            }
            // Ascends to the lowest node that holds the voxels before and after the step.
            let apart = (0..3).fold(0, |all, a| all | ((voxel[a] - lo[a]) ^ (before[a] - lo[a])));
            level = (u32::BITS - apart.leading_zeros()) as usize;
        }
    }
}
