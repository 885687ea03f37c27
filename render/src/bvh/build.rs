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
    // 1. Two children a node. Whole numbers up to 2²³ are exact in f32.
    let corner = |v: [u32; 3]| Vec3A::new(v[0] as f32, v[1] as f32, v[2] as f32);
    let aabbs: Vec<Aabb> = boxes.iter().map(|(b, _)| Aabb::new(corner(b.lo), corner(b.hi))).collect();
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
