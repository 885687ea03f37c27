//! Builds the hierarchy: `obvhs` groups the boxes, then the bounds of every node are computed again in whole numbers.
//!
//! PLOC (Meister and Bittner 2018) makes nodes of two children, reinsertion improves them, and the collapse of *Efficient Incoherent
//! Ray Traversal on GPUs Through Compressed Wide BVHs* (Ylitie, Karras, Laine, HPG 2017) makes nodes of eight.
//!
//! **Memory.** The collapse into wide nodes has the highest peak; in bytes for each box:
//!
//! ```text
//! bounds and item   28   the caller's list
//! binary nodes      96   2 of 48; the f32 boxes and the optimiser's parent indices are freed by then
//! order of boxes     8   4 in the binary tree, 4 in the wide one
//! wide nodes        80   allocated as one for each box; a sixth is used
//! decisions        112   2 of 7 ways to collapse a node, 8 each
//!                  ───
//!                  324   [`BUILD_BYTES_A_BOX`]; about 13 remain after the build
//! ```
//! Building several parts one after another under a few top nodes would bound the peak by one part. It was tried and dropped: two parts
//! instead of one cost every ray one more level, 5 to 8 % of its time.

use std::ops::Range;

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::{BoxBounds, Node};

/// Peak memory of a build in bytes for each box, including the list of boxes (see the module).
pub const BUILD_BYTES_A_BOX: usize = 324;

/// A hierarchy's arrays; the root is node 0.
pub(super) struct Built {
    pub(super) nodes: Vec<Node>,
    pub(super) items: Vec<u32>,
    pub(super) bounds: BoxBounds,
    pub(super) depth: usize,
}

/// Builds over boxes in Morton order; there must be at least one.
pub(super) fn build(boxes: &[(BoxBounds, u32)]) -> Built {
    // 1. Nodes with two children. The final bounds are computed later: these only decide which boxes are near each other.
    let apart = Apart::new(boxes);
    let aabbs: Vec<Aabb> = boxes.iter().enumerate().map(|(i, (b, _))| apart.moved(i, *b)).collect();
    let indices = (0..aabbs.len() as u32).collect();
    let mut binary = PlocBuilder::with_capacity(aabbs.len()).build(
        PlocSearchDistance::Medium,
        &aabbs,
        indices,
        SortPrecision::U64,
        3,
    );
    drop(aabbs);
    ReinsertionOptimizer::default().run(&mut binary, 0.05, None);
    // 2. Nodes with eight children. The optimiser's data is freed first, because the collapse has the highest peak.
    binary.parents = Vec::new();
    let wide = bvh2_to_cwbvh(&binary, 3, true, false);
    drop(binary);
    // 3. Bounds in whole numbers.
    let (nodes, bounds, depth) = fit(&wide.nodes, &wide.primitive_indices, boxes);
    let items = wide.primitive_indices.iter().map(|&i| boxes[i as usize].1).collect();
    Built { nodes, items, bounds, depth }
}

/// Moves boxes that lie along a line apart, each by a pseudo-random amount.
///
/// PLOC merges boxes that are each other's nearest neighbour. Where all boxes are equally far from their neighbours, as along a thin
/// straight label, each chooses the neighbour on the same side, and only one pair is merged in a round: 127,000 boxes of a line took 13 CPU
/// seconds, and 100 times as many would have taken 10⁴ times as long. Where no two distances are equal, a third of the boxes find a partner
/// in every round.
///
/// Boxes that fill a space are never all equally far apart, so they stay where they are: moving them changed the cost of rays by −0 to +9
/// %, depending on chance.
struct Apart {
    /// Subtracted from coordinates, so that one step of f32 is as short as possible.
    centre: [f32; 3],
    /// Largest distance that a box is moved along an axis, in voxels: some steps of f32; 0 where boxes stay.
    most: f32,
}

impl Apart {
    /// Decides for boxes in Morton order.
    fn new(boxes: &[(BoxBounds, u32)]) -> Self {
        let all = boxes.iter().fold(BoxBounds::EMPTY, |all, &(b, _)| all.union(b));
        let longest = (0..3).map(|a| all.hi[a] - all.lo[a]).max().unwrap_or(0);
        if !lie_along_a_line(boxes, longest) {
            return Self { centre: [0.0; 3], most: 0.0 };
        }
        Self {
            centre: [0, 1, 2].map(|a| (all.lo[a] + (all.hi[a] - all.lo[a]) / 2) as f32),
            most: (longest as f32 / 2_097_152.0).max(0.25),
        }
    }

    /// Bounds of box number `i` after the move.
    fn moved(&self, i: usize, bounds: BoxBounds) -> Aabb {
        let shift = [0, 1, 2].map(|axis| {
            // Three fractional parts of multiples of irrational numbers (a Weyl sequence): different enough, and the same in every run.
            let step = [0.754_877_666, 0.569_840_291, 0.438_744_877][axis]
                * (i as f64 + 1.0)
                * (i % 1021 + 1) as f64;
            step.fract() as f32 * self.most - self.centre[axis]
        });
        let corner = |v: [u32; 3]| Vec3A::from([0, 1, 2].map(|a| v[a] as f32 + shift[a]));
        Aabb::new(corner(bounds.lo), corner(bounds.hi))
    }
}

/// Whether boxes in Morton order, within bounds of this longest side, have fewer than one and a half dimensions: n boxes spread over d
/// dimensions make a path of n^(1 − 1/d) times that length.
fn lie_along_a_line(boxes: &[(BoxBounds, u32)], longest: u32) -> bool {
    let step = |pair: &[(BoxBounds, u32)]| {
        let lo = |i: usize| pair[i].0.lo;
        (0..3).map(|a| u64::from(lo(0)[a].abs_diff(lo(1)[a]))).max().unwrap_or(0)
    };
    let path: u64 = boxes.windows(2).map(step).sum();
    (path as f64) < (boxes.len() as f64).cbrt() * f64::from(longest)
}

/// Longest run of equal boxes that are grouped by nearness. Each box that joins a group is equally near to it, so the group becomes a chain
/// with one level for each box, in time that grows with the square of the run, until the thread's stack overflows.
const LONGEST_CHAIN: usize = 200;

/// Whether a run of equal boxes is so long that boxes must be grouped by their order.
pub(super) fn has_chain(boxes: &[(BoxBounds, u32)]) -> bool {
    boxes.chunk_by(|a, b| a.0 == b.0).any(|equal| equal.len() > LONGEST_CHAIN)
}

/// Largest number of boxes in a leaf.
const LEAF: usize = 3;

/// Builds over boxes in Morton order by that order alone: a node has eight parts of equally many boxes, the last ones fewer. Rays meet more
/// boxes than in the result of [`build`]; the depth is at most log₈ of the number of boxes.
pub(super) fn in_order(boxes: &[(BoxBounds, u32)]) -> Built {
    let all = |range: &Range<usize>| {
        boxes[range.clone()].iter().fold(BoxBounds::EMPTY, |b, &(other, _)| b.union(other))
    };
    let mut built = Built { nodes: Vec::new(), items: Vec::new(), bounds: all(&(0..boxes.len())), depth: 0 };
    // Level by level: the children of a node are appended after all nodes so far.
    let mut level: Vec<Range<usize>> = std::iter::once(0..boxes.len()).collect();
    while !level.is_empty() {
        let mut next = Vec::new();
        let first_of_next = (built.nodes.len() + level.len()) as u32;
        for range in level {
            let step = range.len().div_ceil(8).max(LEAF);
            let mut children = [BoxBounds::EMPTY; 8];
            let mut node = Node {
                first_child: first_of_next + next.len() as u32,
                first_item: built.items.len() as u32,
                ..Node::default()
            };
            for (c, first) in range.clone().step_by(step).enumerate() {
                let part = first..range.end.min(first + step);
                children[c] = all(&part);
                if part.len() <= LEAF {
                    let offset = built.items.len() as u32 - node.first_item;
                    node.meta[c] = offset as u8 | (part.len() as u8) << 5;
                    built.items.extend(boxes[part].iter().map(|b| b.1));
                } else {
                    node.inner |= 1 << c;
                    next.push(part);
                }
            }
            let planes = quantised(&children);
            built.nodes.push(Node {
                origin: planes.origin,
                exponent: planes.exponent,
                lo: planes.lo,
                hi: planes.hi,
                ..node
            });
        }
        built.depth += 1;
        level = next;
    }
    built
}

/// Rebuilds every node with bounds in whole numbers. Children come after their parents in `wide`.
fn fit(wide: &[CwBvhNode], item_order: &[u32], boxes: &[(BoxBounds, u32)]) -> (Vec<Node>, BoxBounds, usize) {
    let mut bounds = vec![BoxBounds::EMPTY; wide.len()];
    let mut height = vec![1u32; wide.len()];
    let mut nodes = Vec::with_capacity(wide.len());
    for (i, source) in wide.iter().enumerate().rev() {
        let mut children = [BoxBounds::EMPTY; 8];
        let mut meta = [0u8; 8];
        let mut child = source.child_base_idx as usize;
        for c in 0..8 {
            if source.imask >> c & 1 == 1 {
                children[c] = bounds[child];
                height[i] = height[i].max(height[child] + 1);
                child += 1;
            } else if !source.is_child_empty(c) {
                let (first, count) = source.child_primitives(c);
                let items = &item_order[first as usize..(first + count) as usize];
                children[c] = items.iter().fold(BoxBounds::EMPTY, |b, &i| b.union(boxes[i as usize].0));
                meta[c] = (first - source.primitive_base_idx) as u8 | (count as u8) << 5;
            }
        }
        bounds[i] = children.iter().fold(BoxBounds::EMPTY, |b, &c| b.union(c));
        nodes.push(Node {
            inner: source.imask,
            first_child: source.child_base_idx,
            first_item: source.primitive_base_idx,
            meta,
            ..quantised(&children)
        });
    }
    nodes.reverse();
    (nodes, bounds[0], height[0] as usize)
}

/// A node that has only the planes of its children set; empty slots contain nothing.
fn quantised(children: &[BoxBounds; 8]) -> Node {
    let bounds = children.iter().fold(BoxBounds::EMPTY, |b, &c| b.union(c));
    let mut node =
        Node { origin: bounds.lo.map(|v| v as f32), lo: [[255; 8]; 3], hi: [[0; 8]; 3], ..Node::default() };
    for a in 0..3 {
        let mut e = 0;
        while bounds.hi[a] - bounds.lo[a] > 255 << e {
            e += 1;
        }
        node.exponent[a] = e;
        for (c, child) in children.iter().enumerate().filter(|(_, b)| b.lo[0] < b.hi[0]) {
            node.lo[a][c] = ((child.lo[a] - bounds.lo[a]) >> e) as u8;
            node.hi[a][c] = (child.hi[a] - bounds.lo[a]).div_ceil(1 << e) as u8;
        }
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `n` boxes of 16³ voxels, each `step` from the one before, with `copies` at each place.
    fn boxes_in_line(n: u32, step: [u32; 3], copies: u32) -> Vec<(BoxBounds, u32)> {
        let at = |i: u32| step.map(|s| s * (i / copies));
        let mut boxes: Vec<_> =
            (0..n).map(|i| (BoxBounds { lo: at(i), hi: at(i).map(|v| v + 16) }, i)).collect();
        boxes.sort_unstable_by_key(|&(b, item)| (pumice_core::morton::encode(b.lo.map(|v| v / 4)), b, item));
        boxes
    }

    /// Share of boxes that are the nearest neighbour of their own nearest neighbour, by the surface area of the box around both; among
    /// equals the first counts.
    fn partners(boxes: &[Aabb]) -> f64 {
        let nearest = |i: usize| {
            let near = i.saturating_sub(14)..boxes.len().min(i + 15);
            near.filter(|&j| j != i)
                .min_by(|&j, &k| {
                    let area = |j: usize| boxes[i].union(&boxes[j]).half_area();
                    area(j).total_cmp(&area(k))
                })
                .unwrap()
        };
        let mutual = (0..boxes.len()).filter(|&i| nearest(nearest(i)) == i).count();
        mutual as f64 / boxes.len() as f64
    }

    #[test]
    fn boxes_of_a_line_find_partners() {
        for step in [[0, 0, 16], [16, 0, 0], [16, 16, 16], [12, 16, 0]] {
            let boxes = boxes_in_line(4000, step, 1);
            let apart = Apart::new(&boxes);
            let stay = Apart { centre: [0.0; 3], most: 0.0 };
            let placed = |apart: &Apart| -> Vec<Aabb> {
                boxes.iter().enumerate().map(|(i, (b, _))| apart.moved(i, *b)).collect()
            };
            let (before, after) = (partners(&placed(&stay)), partners(&placed(&apart)));
            assert!(before < 0.001 && after > 0.5, "{step:?}: {before} without moving, {after} with");
            let built = build(&boxes);
            assert!(built.depth <= 16, "{step:?}: {} levels", built.depth);
            let mut items = built.items;
            items.sort_unstable();
            assert!(items.into_iter().eq(0..4000));
        }
        assert!(Apart::new(&boxes_in_line(4000, [0, 32, 0], 4)).most > 0.0);
    }

    #[test]
    fn boxes_that_fill_a_space_stay_where_they_are() {
        let cube = |i: u32| [i % 20, i / 20 % 20, i / 400].map(|c| 16 * c);
        let sheet = |i: u32| [16 * (i % 90), 16 * (i / 90), 0];
        for place in [&cube as &dyn Fn(u32) -> [u32; 3], &sheet] {
            let mut boxes: Vec<_> =
                (0..8000).map(|i| (BoxBounds { lo: place(i), hi: place(i).map(|v| v + 16) }, i)).collect();
            boxes.sort_unstable_by_key(|b| pumice_core::morton::encode(b.0.lo.map(|v| v / 4)));
            assert_eq!(Apart::new(&boxes).most, 0.0);
        }
    }
}
