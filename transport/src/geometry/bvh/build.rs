//! Building the hierarchy: `obvhs` groups the boxes, then every node is fitted again in whole numbers.
//!
//! PLOC (Meister and Bittner 2018) makes nodes of two children, reinsertion improves them, and the collapse of *Efficient Incoherent
//! Ray Traversal on GPUs Through Compressed Wide BVHs* (Ylitie, Karras, Laine, HPG 2017) makes nodes of eight.
//!
//! **Memory.** The collapse needs most: by box, in bytes,
//!
//! ```text
//! bounds and item   28   the caller's list
//! binary nodes      96   2 of 48; the boxes in f32 and the optimiser's parents are gone by then
//! order of boxes     8   4 in the binary tree, 4 in the wide one
//! wide nodes        80   room for one a box; a sixth of it is used
//! decisions        112   2 of 7 ways to collapse a node, 8 each
//!                  ───
//!                  324   [`BUILD_BYTES_A_BOX`]; about 13 stay
//! ```
//! Smaller parts one after the other, under a few nodes on top, would bound this by the part. Tried and left: two parts in place of
//! one cost every ray a level, 5 to 8 % of its time.

use std::ops::Range;

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::{BoxBounds, Node};

/// Most bytes that building holds at once for each box, the list of boxes included: see the module.
pub const BUILD_BYTES_A_BOX: usize = 324;

/// A hierarchy's arrays; the root is node 0.
pub(super) struct Built {
    pub(super) nodes: Vec<Node>,
    pub(super) items: Vec<u32>,
    pub(super) bounds: BoxBounds,
    pub(super) depth: usize,
}

/// Builds over boxes in Morton order, at least one.
pub(super) fn build(boxes: &[(BoxBounds, u32)]) -> Built {
    // 1. Two children a node. Bounds are fitted again in the end: here they decide only which boxes are near.
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
    // 2. Eight. What only the optimiser needs goes first: the collapse needs most.
    binary.parents = Vec::new();
    let wide = bvh2_to_cwbvh(&binary, 3, true, false);
    drop(binary);
    // 3. Bounds in whole numbers.
    let (nodes, bounds, depth) = fit(&wide.nodes, &wide.primitive_indices, boxes);
    let items = wide.primitive_indices.iter().map(|&i| boxes[i as usize].1).collect();
    Built { nodes, items, bounds, depth }
}

/// Moves boxes that lie along a line, each by chance a little otherwise.
///
/// PLOC merges boxes that are each other's nearest. Where all are equally far from their neighbours, as along a thin straight label, each
/// takes the one on the same side, and one pair a round is left: 127,000 boxes of a line took 13 CPU seconds, and 100 times as many
/// would have taken 10⁴ times as long. Where no two distances are equal, a third of the boxes find a partner in every round.
///
/// Boxes that fill a space are never all so, and are left where they are: by its luck, moving them changed what rays cost by −0 to +9 %.
struct Apart {
    /// Subtracted, so that a step of f32 is as short as can be.
    centre: [f32; 3],
    /// Most that a box is moved along an axis, in voxels: some steps of f32; 0 where they stay.
    most: f32,
}

impl Apart {
    /// For boxes in Morton order.
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

    /// Box number `i`, moved.
    fn moved(&self, i: usize, bounds: BoxBounds) -> Aabb {
        let shift = [0, 1, 2].map(|axis| {
            // Three fractions of one number's multiples of irrational ones (Weyl): as unlike as need be, and the same every time.
            let step = [0.754_877_666, 0.569_840_291, 0.438_744_877][axis]
                * (i as f64 + 1.0)
                * (i % 1021 + 1) as f64;
            step.fract() as f32 * self.most - self.centre[axis]
        });
        let corner = |v: [u32; 3]| Vec3A::from([0, 1, 2].map(|a| v[a] as f32 + shift[a]));
        Aabb::new(corner(bounds.lo), corner(bounds.hi))
    }
}

/// Whether boxes in Morton order, within bounds so long, are spread over fewer than one and a half dimensions: n boxes over d of them
/// make a path of n^(1 − 1/d) times that length.
fn lie_along_a_line(boxes: &[(BoxBounds, u32)], longest: u32) -> bool {
    let step = |pair: &[(BoxBounds, u32)]| {
        let lo = |i: usize| pair[i].0.lo;
        (0..3).map(|a| u64::from(lo(0)[a].abs_diff(lo(1)[a]))).max().unwrap_or(0)
    };
    let path: u64 = boxes.windows(2).map(step).sum();
    (path as f64) < (boxes.len() as f64).cbrt() * f64::from(longest)
}

/// So many equal boxes in a row are not grouped by nearness: each that is added to a group is as near to it as any other, which makes a
/// chain of as many levels, in time that grows with their square, and at last ends the thread's stack.
const LONGEST_CHAIN: usize = 200;

/// Whether so many boxes in a row are equal that their order must group them.
pub(super) fn has_chain(boxes: &[(BoxBounds, u32)]) -> bool {
    boxes.chunk_by(|a, b| a.0 == b.0).any(|equal| equal.len() > LONGEST_CHAIN)
}

/// Most boxes of a leaf.
const LEAF: usize = 3;

/// Builds over boxes in Morton order by that order alone: nodes have eight parts of as many boxes each, the last ones fewer. Rays meet
/// more boxes there than in what [`build`] makes; it is no deeper than log₈ of how many there are.
pub(super) fn in_order(boxes: &[(BoxBounds, u32)]) -> Built {
    let all = |range: &Range<usize>| {
        boxes[range.clone()].iter().fold(BoxBounds::EMPTY, |b, &(other, _)| b.union(other))
    };
    let mut built = Built { nodes: Vec::new(), items: Vec::new(), bounds: all(&(0..boxes.len())), depth: 0 };
    // Level by level: a node's children are put behind all nodes that are known.
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

/// A node with nothing but the planes of its children; those of empty slots contain nothing.
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

    /// Share of boxes that are the nearest of their nearest, by what a box around both has of surface; of equal ones the first.
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
