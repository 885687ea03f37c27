//! The bounding volume hierarchy over boxes of voxels: eight children a node, 80 bytes, planes on whole numbers.
//!
//! The topology comes from the crate `obvhs` (see `build`). Its bounds do not: they are computed in f32 with a logarithm, which
//! loses up to a voxel in volumes near 2²³ voxels long. Here every node is fitted again in integers, so that a child's bounds
//! contain its boxes by construction, and rays are tested by our own loop.
//!
//! ```text
//! offset 0      12        15    16          20         24       32       40       48       56   64   72     80
//!        ┌──────┬─────────┬─────┬───────────┬──────────┬────────┬────────┬────────┬────────┬────┬────┬──────┐
//!        │origin│exponent │inner│first_child│first_item│ meta   │ lo x   │ lo y   │ lo z   │hi x│hi y│ hi z │
//!        │3×f32 │ 3×u8    │ u8  │ u32       │ u32      │ 8×u8   │ 8×u8   │ 8×u8   │ 8×u8   │    │    │ 8×u8 │
//!        └──────┴─────────┴─────┴───────────┴──────────┴────────┴────────┴────────┴────────┴────┴────┴──────┘
//! plane of child c along axis a: origin[a] + lo[a][c]·2^exponent[a], origin a whole number below 2²³, exponent ≥ 0
//! inner  bit c: child c is a node, at first_child + (number of inner bits below c)
//! meta   of a leaf child: its boxes are items first_item + (meta & 31) .. + (meta >> 5); 0 in an empty slot
//! ```
//!
//! # Why no ray is lost
//! A ray is tested in f32 after it was moved to the hierarchy's bounds (see [`BvhRay`]): |o| ≤ L and |plane − o| ≤ 2L, L the
//! longest side. A slab distance is `q·(2ᵉ·inv) + (origin − o)·inv`: at most six roundings of 2⁻²⁴ on terms that sum to less than
//! 4L·|inv|, so it is the distance of a plane displaced by less than 6·4L·2⁻²⁴ < L·2⁻¹⁹. Every plane is therefore moved outward by
//! `pad = L·2⁻¹⁸`, which covers that and the rounding of o (L·2⁻²⁴); what the move itself lost in f64 is added by the caller.

mod build;

pub use build::BUILD_BYTES_A_BOX;
use pumice_core::reserve::check_room;
use pumice_core::{MAX_DIM, morton};

use super::each_axis;
use crate::RenderError;

/// A half-open box of voxels: `lo` inside, `hi` outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BoxBounds {
    /// Lowest voxel.
    pub lo: [u32; 3],
    /// One past the highest voxel.
    pub hi: [u32; 3],
}

impl BoxBounds {
    /// Contains nothing; the neutral element of [`BoxBounds::union`].
    pub const EMPTY: Self = Self { lo: [u32::MAX; 3], hi: [0; 3] };

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Self {
            lo: [0, 1, 2].map(|a| self.lo[a].min(other.lo[a])),
            hi: [0, 1, 2].map(|a| self.hi[a].max(other.hi[a])),
        }
    }

    /// How far the planes must move outward, in voxels, so that rounding loses no ray (see the module).
    pub fn pad(&self) -> f32 {
        self.hi.into_iter().max().unwrap_or(0) as f32 / 262_144.0
    }

    /// Whether `voxel` lies inside.
    pub fn contains(&self, voxel: [u32; 3]) -> bool {
        (0..3).all(|a| self.lo[a] <= voxel[a] && voxel[a] < self.hi[a])
    }
}

/// Largest component of a ray's inverse direction; products with it do not overflow f32.
pub const LARGEST_INVERSE: f64 = (1u64 << 60) as f64;

/// A ray as the hierarchy sees it: moved to the hierarchy's bounds in f64, then rounded to f32.
#[derive(Clone, Copy, Debug)]
pub struct BvhRay {
    /// Position of the ray at the hierarchy's t = 0, in voxels.
    pub origin: [f32; 3],
    /// 1 / direction, finite: a component of 0 gives ±2⁶⁰ (the direction's largest component is within [1, 2)).
    pub inverse: [f32; 3],
    /// How far each plane is moved outward, in voxels: [`Bvh::pad`] plus what rounding the origin lost.
    pub pad: f32,
}

/// A node with eight child slots; the module documentation draws its layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Node {
    origin: [f32; 3],
    exponent: [u8; 3],
    inner: u8,
    first_child: u32,
    first_item: u32,
    meta: [u8; 8],
    lo: [[u8; 8]; 3],
    hi: [[u8; 8]; 3],
}

/// Deepest hierarchy that fits the traversal's fixed stack. PLOC makes about log₂(boxes) levels of nodes with two children.
const MAX_DEPTH: usize = 64;

/// `ORDER[octant][mask]`: bit c of `mask` moved to bit c ^ octant.
static ORDER: [[u8; 256]; 8] = order_table();

const fn order_table() -> [[u8; 256]; 8] {
    let mut table = [[0; 256]; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut mask = 0;
        while mask < 256 {
            let mut c = 0;
            while c < 8 {
                if mask >> c & 1 == 1 {
                    table[octant][mask] |= 1 << (c ^ octant);
                }
                c += 1;
            }
            mask += 1;
        }
        octant += 1;
    }
    table
}

/// A hierarchy over boxes; each box carries a number that the caller chose.
#[derive(Debug, Default)]
pub struct Bvh {
    nodes: Vec<Node>,
    items: Vec<u32>,
    bounds: Option<BoxBounds>,
    depth: usize,
}

impl Bvh {
    /// Builds over `boxes`: bounds, and the number that traversal reports. The order of the boxes does not matter: they are first sorted
    /// into Morton order of their lowest cell, which every builder wants (some unsorted boxes trace up to 26 × slower).
    ///
    /// # Errors
    /// [`RenderError::Scene`] when a box is empty or reaches past [`MAX_DIM`], or when there are 2³¹ boxes or more;
    /// [`RenderError::Memory`].
    pub fn build(boxes: Vec<(BoxBounds, u32)>) -> Result<Self, RenderError> {
        Self::build_within(boxes, MAX_DEPTH)
    }

    /// Like [`Bvh::build`], for a traversal whose stack holds `depth` levels, at least 12. The builder chains boxes that lie at one place
    /// (a thousand equal ones make 143 levels); where that is too deep, boxes are grouped by their Morton order instead.
    ///
    /// # Errors
    /// As [`Bvh::build`].
    pub fn build_within(mut boxes: Vec<(BoxBounds, u32)>, depth: usize) -> Result<Self, RenderError> {
        if boxes.len() >= 1 << 31 {
            return Err(RenderError::Scene(format!(
                "{} visible boxes are more than the limit of 2^31 of one instance: hide some labels",
                boxes.len()
            )));
        }
        if let Some((b, _)) =
            boxes.iter().find(|(b, _)| (0..3).any(|a| b.lo[a] >= b.hi[a] || b.hi[a] > MAX_DIM))
        {
            return Err(RenderError::Scene(format!(
                "box {:?}..{:?} is empty or reaches past voxel {MAX_DIM}",
                b.lo, b.hi
            )));
        }
        if boxes.is_empty() {
            return Ok(Self::default());
        }
        // The list itself exists already, with 28 bytes a box.
        let needed = boxes.len() as u64 * (BUILD_BYTES_A_BOX - size_of::<(BoxBounds, u32)>()) as u64;
        check_room(&format!("the hierarchy of {} boxes", boxes.len()), needed)?;
        boxes.sort_unstable_by_key(|&(b, item)| (morton::encode(b.lo.map(|v| v / 4)), b, item));
        let grouped = (!build::has_chain(&boxes)).then(|| build::build(&boxes));
        let built = match grouped.filter(|b| b.depth <= depth.min(MAX_DEPTH)) {
            Some(built) => built,
            None => build::in_order(&boxes),
        };
        Ok(Self { nodes: built.nodes, items: built.items, bounds: Some(built.bounds), depth: built.depth })
    }

    /// The box around all boxes; `None` when there are none.
    pub fn bounds(&self) -> Option<BoxBounds> {
        self.bounds
    }

    /// Number of nodes from the root to the farthest leaf; a traversal's stack needs one entry less.
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Number of boxes.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there are no boxes.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        (self.nodes.capacity() * size_of::<Node>() + self.items.capacity() * size_of::<u32>()) as u64
    }

    /// The nodes in the layout that the module draws, for a device that traces this hierarchy itself.
    pub fn node_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.nodes)
    }

    /// The numbers of the boxes, in the order that nodes refer to.
    pub fn items(&self) -> &[u32] {
        &self.items
    }

    /// Least value of [`BvhRay::pad`], in voxels (see the module).
    pub fn pad(&self) -> f32 {
        self.bounds.map_or(0.0, |b| b.pad())
    }

    /// Calls `visit(item)` for each box whose bounds the ray meets at a distance in [0, `limit`], roughly front to back. `visit`
    /// returns the new limit; a negative one ends the traversal.
    #[inline(always)]
    pub fn along_ray(&self, ray: &BvhRay, mut limit: f32, mut visit: impl FnMut(u32) -> f32) {
        let Some(mut node) = self.nodes.first() else { return };
        // Slot c was filled so that c ^ octant, highest first, is front to back (Ylitie et al. 2017, §3.2).
        let octant = [4, 2, 1]
            .into_iter()
            .zip(ray.inverse)
            .map(|(bit, i)| if i < 0.0 { 0 } else { bit })
            .sum::<usize>();
        let order = &ORDER[octant];
        // Each entry packs its fields into one word: the compiler would clear the fields of a tuple one by one, for every ray.
        let mut stack = [0u64; MAX_DEPTH];
        let mut height = 0;
        loop {
            let hit = node.children_along(ray, limit);
            // Boxes first, since a hit may lower the limit.
            let mut leaves = order[usize::from(hit & !node.inner)];
            while leaves != 0 {
                let highest = 7 - leaves.leading_zeros() as usize;
                leaves &= !(1 << highest);
                let meta = node.meta[(highest ^ octant) & 7];
                let first = node.first_item as usize + usize::from(meta & 31);
                for &item in &self.items[first..first + usize::from(meta >> 5)] {
                    limit = visit(item);
                    if limit < 0.0 {
                        return;
                    }
                }
            }
            // Then the nearest node that remains.
            let mut base = node.first_child;
            let mut inner = node.inner;
            let mut pending = order[usize::from(hit & inner)];
            if pending == 0 {
                if height == 0 {
                    return;
                }
                height -= 1;
                let left = stack[height];
                (base, pending, inner) = (left as u32, (left >> 32) as u8, (left >> 40) as u8);
            }
            let highest = 7 - pending.leading_zeros() as usize;
            pending &= !(1 << highest);
            if pending != 0 {
                stack[height] = u64::from(base) | u64::from(pending) << 32 | u64::from(inner) << 40;
                height += 1;
            }
            let slot = (highest ^ octant) & 7;
            let below = inner & ((1u16 << slot) as u8).wrapping_sub(1);
            node = &self.nodes[base as usize + below.count_ones() as usize];
        }
    }

    /// Calls `visit(item)` for the boxes whose bounds may hold `voxel`, until it returns false. No box that holds the voxel is left out.
    pub fn at_voxel(&self, voxel: [u32; 3], mut visit: impl FnMut(u32) -> bool) {
        if !self.bounds.is_some_and(|b| b.contains(voxel)) {
            return;
        }
        let mut stack = [0u32; 8 * MAX_DEPTH];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let node = &self.nodes[stack[height] as usize];
            let mut child = node.first_child;
            for c in 0..8 {
                let is_node = node.inner >> c & 1 == 1;
                if node.child_bounds(c).contains(voxel) {
                    if is_node {
                        stack[height] = child;
                        height += 1;
                    } else {
                        let first = node.first_item as usize + usize::from(node.meta[c] & 31);
                        for &item in &self.items[first..first + usize::from(node.meta[c] >> 5)] {
                            if !visit(item) {
                                return;
                            }
                        }
                    }
                }
                child += u32::from(is_node);
            }
        }
    }
}

impl Node {
    /// Mask of the children that the ray meets: bit c for child c.
    #[inline(always)]
    fn children_along(&self, ray: &BvhRay, limit: f32) -> u8 {
        let mut near = [0.0f32; 8];
        let mut far = [limit; 8];
        for a in 0..3 {
            let inverse = ray.inverse[a];
            let scale = f32::from_bits((127 + u32::from(self.exponent[a])) << 23) * inverse;
            let at_origin = (self.origin[a] - ray.origin[a]) * inverse;
            let pad = ray.pad * inverse.abs();
            let (at_near, at_far) = (at_origin - pad, at_origin + pad);
            let (q_near, q_far) =
                if inverse < 0.0 { (&self.hi[a], &self.lo[a]) } else { (&self.lo[a], &self.hi[a]) };
            for c in 0..8 {
                let t_near = f32::from(q_near[c]) * scale + at_near;
                let t_far = f32::from(q_far[c]) * scale + at_far;
                near[c] = if t_near > near[c] { t_near } else { near[c] };
                far[c] = if t_far < far[c] { t_far } else { far[c] };
            }
        }
        let mut hit = 0;
        for c in 0..8 {
            hit |= u8::from(near[c] <= far[c]) << c;
        }
        hit
    }

    fn child_bounds(&self, c: usize) -> BoxBounds {
        let plane = |q: &[[u8; 8]; 3]| {
            each_axis(|a| self.origin[a] as u32 + (u32::from(q[a][c]) << self.exponent[a]))
        };
        BoxBounds { lo: plane(&self.lo), hi: plane(&self.hi) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_boxes(n: usize, reach: u32, seed: u64) -> Vec<(BoxBounds, u32)> {
        let mut state = seed;
        let mut next = move |below: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % u64::from(below)) as u32
        };
        (0..n as u32)
            .map(|i| {
                let lo = [next(reach), next(reach), next(reach)];
                (BoxBounds { lo, hi: lo.map(|v| (v + 1 + next(16)).min(MAX_DIM)) }, i)
            })
            .collect()
    }

    #[test]
    fn layout_is_as_drawn() {
        assert_eq!(size_of::<Node>(), 80);
        assert_eq!(std::mem::offset_of!(Node, exponent), 12);
        assert_eq!(std::mem::offset_of!(Node, first_child), 16);
        assert_eq!(std::mem::offset_of!(Node, meta), 24);
        assert_eq!(std::mem::offset_of!(Node, hi), 56);
    }

    /// A point query finds exactly the boxes that hold the voxel, once each, at every size of volume up to the largest.
    #[test]
    fn every_box_is_found_at_its_corners() {
        for (n, reach) in [(1, 5), (2, 5), (7, 40), (500, 64), (2000, 1 << 20), (2000, MAX_DIM - 1)] {
            let boxes = random_boxes(n, reach, 7 + n as u64);
            let bvh = Bvh::build(boxes.clone()).unwrap();
            assert_eq!(bvh.len(), n);
            for &(b, item) in &boxes {
                for corner in [b.lo, b.hi.map(|v| v - 1)] {
                    let mut found = Vec::new();
                    bvh.at_voxel(corner, |i| {
                        found.push(i);
                        true
                    });
                    assert_eq!(
                        found.iter().filter(|&&i| i == item).count(),
                        1,
                        "{b:?} of {n} within {reach}"
                    );
                }
            }
        }
    }

    /// Rays aimed at known points of boxes, computed in f64, then moved and rounded as a tracer does it: the box is always reported, also
    /// where the point is on its edge and where the volume is as long as the limit allows.
    #[test]
    fn no_ray_through_a_box_loses_it() {
        for reach in [32, 1000, 1 << 20, MAX_DIM - 1] {
            let boxes = random_boxes(600, reach, u64::from(reach));
            let bvh = Bvh::build(boxes.clone()).unwrap();
            let mut state = 1u64;
            let mut unit = move || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 11) as f64 / (1u64 << 53) as f64
            };
            for &(b, item) in &boxes {
                for try_edges in [false, true] {
                    // A target on the box, corners included, seen from anywhere in the volume.
                    let fraction = |f: f64| if try_edges { f.round() } else { f };
                    let target = [0, 1, 2]
                        .map(|a| f64::from(b.lo[a]) + fraction(unit()) * f64::from(b.hi[a] - b.lo[a]));
                    let eye = [0, 1, 2].map(|_| unit() * f64::from(reach));
                    let d = [0, 1, 2].map(|a| target[a] - eye[a]);
                    let largest = d.iter().fold(1e-30f64, |m, v| m.max(v.abs()));
                    let inverse = d.map(|v| {
                        let v = v / largest;
                        if v.abs() < 1e-18 { (60f64).exp2() as f32 } else { (1.0 / v) as f32 }
                    });
                    let ray = BvhRay { origin: eye.map(|v| v as f32), inverse, pad: bvh.pad() };
                    let mut found = false;
                    bvh.along_ray(&ray, f32::INFINITY, |i| {
                        found |= i == item;
                        f32::INFINITY
                    });
                    assert!(found, "{b:?} lost from {eye:?} to {target:?}");
                }
            }
        }
    }

    /// Negative control of the test above: without the outward move of the planes, that test would see lost rays.
    #[test]
    fn without_the_pad_rays_are_lost() {
        let reach = MAX_DIM - 1;
        let boxes = random_boxes(600, reach, 3);
        let bvh = Bvh::build(boxes.clone()).unwrap();
        let lost = boxes
            .iter()
            .filter(|(b, item)| {
                // Along the lower x and y edges, from 2²² voxels away, with a slope that f32 cannot represent.
                let eye = [0.3, f64::from(b.lo[1]) - 0.1, 0.7];
                let target = b.lo.map(|v| f64::from(v) + 1e-3);
                let d = [0, 1, 2].map(|a| target[a] - eye[a]);
                let largest = d.iter().fold(1e-30f64, |m, v| m.max(v.abs()));
                let inverse = d.map(|v| (largest / v) as f32);
                let ray = BvhRay { origin: eye.map(|v| v as f32), inverse, pad: 0.0 };
                let mut found = false;
                bvh.along_ray(&ray, f32::INFINITY, |i| {
                    found |= i == *item;
                    f32::INFINITY
                });
                !found
            })
            .count();
        assert!(lost > 0, "no ray was lost without the pad: the test above proves nothing");
    }

    /// Boxes are grouped in Morton order whatever their order in the input.
    #[test]
    fn input_order_does_not_matter() {
        let boxes = random_boxes(3000, 500, 11);
        let mut turned = boxes.clone();
        turned.reverse();
        turned.rotate_left(777);
        let (a, b) = (Bvh::build(boxes).unwrap(), Bvh::build(turned).unwrap());
        assert_eq!(a.nodes, b.nodes);
        assert_eq!(a.items, b.items);
    }

    /// Boxes with equal bounds are all found, by points and by rays, and the hierarchy does not become a chain as long as their number.
    #[test]
    fn equal_boxes_do_not_make_it_deep() {
        let equal = BoxBounds { lo: [5; 3], hi: [9; 3] };
        let other = BoxBounds { lo: [700, 5, 5], hi: [701, 6, 6] };
        for n in [1, 3, 4, 9, 24, 25, 1000, 70_000] {
            let boxes: Vec<_> = (0..n).map(|i| (equal, i)).chain([(other, n)]).collect();
            let bvh = Bvh::build_within(boxes, 12).unwrap();
            assert!(bvh.depth() <= 12, "{n}: {} levels", bvh.depth());
            let (mut at_place, mut along) = (Vec::new(), Vec::new());
            bvh.at_voxel([6; 3], |i| {
                at_place.push(i);
                true
            });
            let ray = BvhRay { origin: [0.0, 5.5, 5.5], inverse: [1.0, 1e18, 1e18], pad: bvh.pad() };
            bvh.along_ray(&ray, f32::INFINITY, |i| {
                along.push(i);
                f32::INFINITY
            });
            // (The other box may share a leaf with some of them.)
            at_place.retain(|&i| i < n);
            at_place.sort_unstable();
            along.sort_unstable();
            assert!(at_place.into_iter().eq(0..n) && along.into_iter().eq(0..=n), "of {n}");
        }
    }

    #[test]
    fn impossible_boxes_are_refused() {
        let empty = BoxBounds { lo: [3, 3, 3], hi: [4, 3, 4] };
        let outside = BoxBounds { lo: [0; 3], hi: [1, 1, MAX_DIM + 1] };
        for bad in [empty, outside] {
            assert!(matches!(Bvh::build(vec![(bad, 0)]), Err(RenderError::Scene(_))));
        }
        assert!(Bvh::build(Vec::new()).unwrap().is_empty());
    }
}
