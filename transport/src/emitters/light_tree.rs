//! A binary tree over emitters, by which one of many is chosen as it matters to a receiver.
//!
//! ```text
//! emitters  e0 e1 e2 e3 e4          in the tree's order
//! nodes     [0,5) [0,3) [0,2) e0 e1 e2 [3,5) e3 e4
//!           a node of n emitters, ⌈n/2⌉ on its left, is followed by the left one, and 2⌈n/2⌉ places further by the right one
//! ```
//! Ranges are halved at the middle, along the longest side of what they hold: where an emitter is follows from its number and no link
//! is stored, so that the chance of an emitter that a ray happened to meet is found again on the same way down.
//!
//! At each node one side is taken with a chance in proportion to its importance: power over squared distance, the distance at least
//! half of the node's diagonal, times a bound of the receiver's cosine (Conty Estevez and Kulla 2018, *Importance Sampling of Many
//! Lights with Adaptive Tree Splitting*, §5, without its cones of normals: labels are closed and shine to all sides; and without
//! splitting). What lies wholly below the receiver's horizon has none.
//!
//! Places are counted from the middle of all, in halves of the longest side of all: no size of voxels overflows f32.

use glam::{DVec3, Vec3};

/// After so many levels the second random number takes over: 24 bits would not tell 10⁷ emitters apart.
const LEVELS_A_NUMBER: u32 = 12;

/// Receivers farther than this are moved here: all directions and ratios of distances are the same to 1e-4.
const FARTHEST_RECEIVER: f32 = 1e4;

/// Least squared distance: emitters of no extent.
const LEAST_SQUARED: f32 = 1e-20;

/// Largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// An emitter as the tree sees it.
#[derive(Clone, Copy, Debug)]
pub struct Bounded {
    /// Lowest corner in the world.
    pub lo: DVec3,
    /// Highest corner in the world.
    pub hi: DVec3,
    /// What it sends out; any unit that all share.
    pub power: f64,
}

/// See the module. Bounds are in the tree's units, powers add up to about 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct LightNode {
    /// Lowest corner.
    pub lo: [f32; 3],
    /// Highest corner.
    pub hi: [f32; 3],
    /// Of all emitters below it.
    pub power: f32,
}

/// See the module.
#[derive(Clone, Debug)]
pub struct LightTree {
    nodes: Vec<LightNode>,
    /// The middle of all emitters, in the world.
    pub middle: DVec3,
    /// Tree units a world unit.
    pub scale: f64,
}

/// A receiver as the tree sees it.
#[derive(Clone, Copy, Debug)]
pub struct SeenFrom {
    point: Vec3,
    normal: Vec3,
    both_sides: bool,
}

/// How many of `count` emitters are on the left.
#[inline]
fn left_of(count: u32) -> u32 {
    count.div_ceil(2)
}

impl LightNode {
    /// How much the emitters below it matter to a receiver.
    #[inline]
    fn importance(&self, from: &SeenFrom) -> f32 {
        let (lo, hi) = (Vec3::from_array(self.lo), Vec3::from_array(self.hi));
        let half = (hi - lo) * 0.5;
        let way = (lo + hi) * 0.5 - from.point;
        let squared = way.dot(way).max(half.dot(half)).max(LEAST_SQUARED);
        if from.both_sides {
            return self.power / squared;
        }
        // Of the corner that is highest above the receiver.
        let height = way.dot(from.normal) + half.dot(from.normal.abs());
        if height <= 0.0 { 0.0 } else { self.power * (height / squared.sqrt()).min(1.0) / squared }
    }
}

impl LightTree {
    /// Builds over emitters, at least one and fewer than 2³¹; and their order in the tree.
    pub fn new(emitters: &[Bounded]) -> (Self, Vec<u32>) {
        let lo = emitters.iter().fold(DVec3::INFINITY, |m, e| m.min(e.lo));
        let hi = emitters.iter().fold(DVec3::NEG_INFINITY, |m, e| m.max(e.hi));
        let middle = lo + (hi - lo) * 0.5;
        let half = (hi - lo).max_element() * 0.5;
        let scale = if half > 0.0 { 1.0 / half } else { 1.0 };
        let total: f64 = emitters.iter().map(|e| e.power).sum();
        let leaves: Vec<LightNode> = emitters
            .iter()
            .map(|e| LightNode {
                lo: ((e.lo - middle) * scale).as_vec3().to_array(),
                hi: ((e.hi - middle) * scale).as_vec3().to_array(),
                power: (e.power / total) as f32,
            })
            .collect();
        let mut order: Vec<u32> = (0..emitters.len() as u32).collect();
        let mut nodes = vec![LightNode::default(); 2 * emitters.len() - 1];
        fill(&leaves, &mut order, &mut nodes);
        (Self { nodes, middle, scale }, order)
    }

    /// All nodes.
    pub fn nodes(&self) -> &[LightNode] {
        &self.nodes
    }

    /// Number of emitters.
    pub fn len(&self) -> u32 {
        self.nodes.len().div_ceil(2) as u32
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// A receiver at `point` with that normal.
    #[inline]
    pub fn seen_from(&self, point: DVec3, normal: Vec3, both_sides: bool) -> SeenFrom {
        let point =
            ((point - self.middle) * self.scale).as_vec3().clamp(Vec3::splat(-1e30), Vec3::splat(1e30));
        let away = point.abs().max_element();
        let point = if away > FARTHEST_RECEIVER { point * (FARTHEST_RECEIVER / away) } else { point };
        SeenFrom { point, normal, both_sides }
    }

    /// Chance of the left one of a node's halves; `None` where neither matters.
    #[inline]
    fn probability_left(&self, node: u32, left: u32, from: &SeenFrom) -> Option<f32> {
        let a = self.nodes[node as usize + 1].importance(from);
        let b = self.nodes[(node + 2 * left) as usize].importance(from);
        let both = a + b;
        (both > 0.0).then(|| a / both)
    }

    /// An emitter, and the chance with which it is chosen; `None` where none matters.
    #[inline]
    pub fn choose(&self, from: &SeenFrom, u: [f32; 2]) -> Option<(u32, f32)> {
        let (mut node, mut first, mut count) = (0, 0, self.len());
        let (mut chance, mut u, further) = (1.0f32, u[0], u[1]);
        let mut level = 0;
        while count > 1 {
            if level == LEVELS_A_NUMBER {
                u = further;
            }
            level += 1;
            let left = left_of(count);
            let part = self.probability_left(node, left, from)?;
            if u < part {
                u /= part;
                chance *= part;
                (node, count) = (node + 1, left);
            } else {
                u = (u - part) / (1.0 - part);
                chance *= 1.0 - part;
                (node, first, count) = (node + 2 * left, first + left, count - left);
            }
            u = u.min(BELOW_ONE);
        }
        Some((first, chance))
    }

    /// The chance with which [`LightTree::choose`] gives this emitter.
    #[inline]
    pub fn probability(&self, from: &SeenFrom, emitter: u32) -> f32 {
        let (mut node, mut first, mut count) = (0, 0, self.len());
        let mut chance = 1.0f32;
        while count > 1 {
            let left = left_of(count);
            let Some(part) = self.probability_left(node, left, from) else { return 0.0 };
            if emitter < first + left {
                chance *= part;
                (node, count) = (node + 1, left);
            } else {
                chance *= 1.0 - part;
                (node, first, count) = (node + 2 * left, first + left, count - left);
            }
        }
        chance
    }

    /// Heap bytes.
    pub fn bytes(&self) -> u64 {
        (self.nodes.capacity() * size_of::<LightNode>()) as u64
    }
}

/// Puts a range of emitters into the tree's order and fills the nodes over it; the first of them is the one over all.
fn fill(leaves: &[LightNode], order: &mut [u32], nodes: &mut [LightNode]) {
    if let [only] = order {
        nodes[0] = leaves[*only as usize];
        return;
    }
    let middle = |e: u32, a: usize| leaves[e as usize].lo[a] + leaves[e as usize].hi[a];
    let reach = |a: usize| {
        let (lo, hi) = order.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &e| {
            (lo.min(middle(e, a)), hi.max(middle(e, a)))
        });
        hi - lo
    };
    let reaches = [reach(0), reach(1), reach(2)];
    let longest = if reaches[0] >= reaches[1] && reaches[0] >= reaches[2] {
        0
    } else if reaches[1] >= reaches[2] {
        1
    } else {
        2
    };
    let left = left_of(order.len() as u32) as usize;
    order.select_nth_unstable_by(left, |&a, &b| {
        middle(a, longest).total_cmp(&middle(b, longest)).then(a.cmp(&b))
    });
    let (of_left, of_right) = order.split_at_mut(left);
    // What comes first in memory is filled by its own half: a node, then 2·left − 1 of the left, then the right.
    let (first, rest) = nodes.split_at_mut(1);
    let (nodes_left, nodes_right) = rest.split_at_mut(2 * left - 1);
    rayon::join(|| fill(leaves, of_left, nodes_left), || fill(leaves, of_right, nodes_right));
    let (a, b) = (nodes_left[0], nodes_right[0]);
    first[0] = LightNode {
        lo: [0, 1, 2].map(|i| a.lo[i].min(b.lo[i])),
        hi: [0, 1, 2].map(|i| a.hi[i].max(b.hi[i])),
        power: a.power + b.power,
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in [0, 1) that look random.
    fn number(i: u32) -> f64 {
        let mut x = u64::from(i).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        x ^= x >> 31;
        x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (x >> 11) as f64 / (1u64 << 53) as f64
    }

    fn emitters(count: u32) -> Vec<Bounded> {
        (0..count)
            .map(|i| {
                let lo = DVec3::new(number(4 * i), number(4 * i + 1), 3.0 * number(4 * i + 2)) * 1e-9 + 7.0;
                Bounded { lo, hi: lo + 1e-11, power: 0.01 + number(4 * i + 3).powi(6) }
            })
            .collect()
    }

    fn receivers(tree: &LightTree) -> Vec<SeenFrom> {
        let mut list = Vec::new();
        for i in 0..12 {
            let n = DVec3::new(number(i) - 0.5, number(i + 50) - 0.5, number(i + 90) - 0.5).normalize();
            let away = [0.0, 1e-9, 1e-3, 1e30][i as usize % 4];
            let point = DVec3::splat(7.0 + 5e-10) + DVec3::new(number(i + 7), -1.0, number(i + 8)) * away;
            list.push(tree.seen_from(point, n.as_vec3(), i % 5 == 4));
        }
        list
    }

    #[test]
    fn chances_add_up_to_one_and_are_those_of_choosing() {
        for count in [1, 2, 3, 5, 64, 100, 777] {
            let (tree, order) = LightTree::new(&emitters(count));
            assert_eq!(tree.len(), count);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.iter().copied().eq(0..count), "each emitter is there once");
            for from in receivers(&tree) {
                let sum: f64 = (0..count).map(|e| f64::from(tree.probability(&from, e))).sum();
                // Where the box around two halves reaches above the horizon and neither half does, nothing is chosen.
                let (steps, mut none) = (20_000u32, 0);
                // Evenly spaced numbers choose each emitter as often as its chance says, but for one at each end of its stretch.
                let mut counts = vec![0u32; count as usize];
                for i in 0..steps {
                    let Some((e, chance)) = tree.choose(&from, [(i as f32 + 0.5) / steps as f32, 0.5]) else {
                        none += 1;
                        continue;
                    };
                    assert_eq!(chance, tree.probability(&from, e));
                    counts[e as usize] += 1;
                }
                // A product of ten roundings each; one step at each end of a stretch without.
                let lost = f64::from(none) / f64::from(steps);
                assert!(
                    (sum + lost - 1.0).abs() < 1e-5 + 16.0 * lost.min(1.0 / f64::from(steps)),
                    "{sum}, {lost}"
                );
                for (e, &n) in counts.iter().enumerate() {
                    let expected = f64::from(tree.probability(&from, e as u32)) * f64::from(steps);
                    assert!((f64::from(n) - expected).abs() < 2.0, "{n} instead of {expected}");
                }
            }
        }
    }

    #[test]
    fn nodes_hold_what_is_below_them() {
        let all = emitters(333);
        let (tree, order) = LightTree::new(&all);
        let (mut node, mut first, mut count) = (0u32, 0u32, tree.len());
        let target = 200;
        loop {
            let n = tree.nodes()[node as usize];
            let below = &order[first as usize..(first + count) as usize];
            let power: f64 = below.iter().map(|&e| all[e as usize].power).sum();
            let total: f64 = all.iter().map(|e| e.power).sum();
            assert!((f64::from(n.power) - power / total).abs() < 1e-5);
            for &e in below {
                let lo = (all[e as usize].lo - tree.middle) * tree.scale;
                assert!((0..3).all(|a| f64::from(n.lo[a]) <= lo[a] + 1e-7));
            }
            if count == 1 {
                break;
            }
            let left = left_of(count);
            if target < first + left {
                (node, count) = (node + 1, left);
            } else {
                (node, first, count) = (node + 2 * left, first + left, count - left);
            }
        }
        assert_eq!(first, target);
    }

    #[test]
    fn what_is_near_is_chosen_rather_than_what_is_far() {
        let at = |x: f64| Bounded { lo: DVec3::splat(x), hi: DVec3::splat(x + 0.1), power: 1.0 };
        let (tree, order) = LightTree::new(&[at(0.0), at(10.0)]);
        let from = tree.seen_from(DVec3::splat(-1.0), Vec3::ONE.normalize(), false);
        let near = order.iter().position(|&e| e == 0).unwrap() as u32;
        assert!(tree.probability(&from, near) > 0.98);
        // Below the horizon there is nothing.
        let away = tree.seen_from(DVec3::splat(-1.0), -Vec3::ONE.normalize(), false);
        assert_eq!(tree.choose(&away, [0.5; 2]), None);
    }
}
