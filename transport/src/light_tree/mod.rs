//! A binary tree over emitters (emissive surfaces, or lamps) that chooses one of many in proportion to its importance for a receiver.
//!
//! ```text
//! emitters  e0 e1 e2 e3 e4          in the tree's order
//! nodes     [0,5) [0,3) [0,2) e0 e1 e2 [3,5) e3 e4
//!           a node of n emitters has ⌈n/2⌉ on its left; its left child is the next node, its right child is 2⌈n/2⌉ nodes further
//! ```
//! Each range is halved at the middle, along the longest side of its bounds. The position of an emitter in the tree therefore follows from
//! its index without stored links, and the probability of an emitter that a ray hit by chance is computed on the same way down.
//!
//! At each node one side is chosen with a probability proportional to its importance: power over squared distance, the distance being at
//! least half of the node's diagonal, times a bound of the receiver's cosine (Conty Estevez and Kulla 2018, *Importance Sampling of Many
//! Lights with Adaptive Tree Splitting*, §5; without its cones of normals, because labels are closed and shine to all sides, and without
//! splitting). Nodes wholly below the receiver's horizon have importance 0.
//!
//! Positions are relative to the middle of all emitters, in units of half of the longest side, so that no voxel size overflows f32.

mod cone;

use glam::{DVec3, Vec3};

pub use cone::Cone;

/// After this many levels the second random number is used: the 24 bits of one number cannot tell 10⁷ emitters apart.
const LEVELS_A_NUMBER: u32 = 12;

/// Receivers farther away than this are moved to this distance: all directions and ratios of distances stay the same to 1e-4.
const FARTHEST_RECEIVER: f32 = 1e4;

/// Least squared distance, for emitters without extent.
const LEAST_SQUARED: f32 = 1e-20;

/// Largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Bounds and power of an emitter.
#[derive(Clone, Copy, Debug)]
pub struct Bounded {
    /// Lowest corner in the world.
    pub lo: DVec3,
    /// Highest corner in the world.
    pub hi: DVec3,
    /// Emitted power, in any unit that all emitters share.
    pub power: f64,
    /// Directions in which it shines.
    pub cone: Cone,
}

/// A node of the tree. Bounds are in the tree's units; the powers of all emitters add up to about 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct LightNode {
    /// Lowest corner.
    pub lo: [f32; 3],
    /// Highest corner.
    pub hi: [f32; 3],
    /// Power of all emitters below the node.
    pub power: f32,
}

/// The tree (see the module).
#[derive(Clone, Debug)]
pub struct LightTree {
    nodes: Vec<LightNode>,
    /// Directions in which the emitters of each node shine; empty where all shine to all sides.
    cones: Vec<Cone>,
    /// Middle of all emitters, in the world.
    pub middle: DVec3,
    /// Tree units for each world unit.
    pub scale: f64,
}

/// A receiver in the tree's units.
#[derive(Clone, Copy, Debug)]
pub struct SeenFrom {
    point: Vec3,
    normal: Vec3,
    both_sides: bool,
}

/// Number of emitters on the left of a node with `count` emitters.
#[inline]
fn left_of(count: u32) -> u32 {
    count.div_ceil(2)
}

impl LightNode {
    /// Importance of the emitters below this node to a receiver.
    #[inline]
    fn importance(&self, cone: Option<&Cone>, from: &SeenFrom) -> f32 {
        let (lo, hi) = (Vec3::from_array(self.lo), Vec3::from_array(self.hi));
        let half = (hi - lo) * 0.5;
        let way = (lo + hi) * 0.5 - from.point;
        let squared = way.dot(way).max(half.dot(half)).max(LEAST_SQUARED);
        let power = cone.map_or(self.power, |cone| self.power * cone.towards(way, half.dot(half)));
        if from.both_sides {
            return power / squared;
        }
        // Height of the corner that is highest above the receiver.
        let height = way.dot(from.normal) + half.dot(from.normal.abs());
        if height <= 0.0 { 0.0 } else { power * (height / squared.sqrt()).min(1.0) / squared }
    }
}

impl LightTree {
    /// Builds over the emitters, of which there are at least one and fewer than 2³¹; also returns their order in the tree.
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
        let mut cones = Vec::new();
        if emitters.iter().any(|e| !e.cone.is_all()) {
            cones.resize(nodes.len(), Cone::ALL);
            fill_cones(emitters, &order, &mut cones);
        }
        (Self { nodes, cones, middle, scale }, order)
    }

    /// All nodes, each followed by its left subtree.
    pub fn nodes(&self) -> &[LightNode] {
        &self.nodes
    }

    /// Directions in which the emitters of each node shine; empty where all shine to all sides.
    pub fn cones(&self) -> &[Cone] {
        &self.cones
    }

    /// Number of emitters.
    pub fn len(&self) -> u32 {
        self.nodes.len().div_ceil(2) as u32
    }

    /// Whether the tree has no emitters.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Importance of all emitters to a receiver.
    #[inline]
    pub fn importance(&self, from: &SeenFrom) -> f32 {
        self.importance_of(0, from)
    }

    #[inline]
    fn importance_of(&self, node: u32, from: &SeenFrom) -> f32 {
        self.nodes[node as usize].importance(self.cones.get(node as usize), from)
    }

    /// Calls `visit` with the emitters whose bounds a ray (origin in the tree's units, unit direction) may meet, in order. A node is left out
    /// where the ray passes the ball around it; `slack` is the part of squared distances that rounding may add up to.
    #[inline]
    pub fn near(&self, origin: Vec3, direction: Vec3, slack: f32, mut visit: impl FnMut(u32)) {
        // Each step goes down and leaves one node behind; a tree of fewer than 2³¹ emitters has at most 32 levels.
        let mut waiting = [(0u32, 0u32, 0u32); 32];
        let mut depth = 0;
        let (mut node, mut first, mut count) = (0, 0, self.len());
        loop {
            let n = &self.nodes[node as usize];
            let (lo, hi) = (Vec3::from_array(n.lo), Vec3::from_array(n.hi));
            let half = (hi - lo) * 0.5;
            let way = (lo + hi) * 0.5 - origin;
            let (squared, along) = (way.dot(way), way.dot(direction));
            // The squared distance from the whole line; behind the start, that from the start. (Where numbers overflow, all are near.)
            let beside = squared - if along > 0.0 { along * along } else { 0.0 };
            let reach = half.dot(half);
            let is_far = beside > reach + (reach + squared) * slack;
            if !is_far && count == 1 {
                visit(first);
            }
            if !is_far && count > 1 {
                let left = left_of(count);
                waiting[depth] = (node + 2 * left, first + left, count - left);
                depth += 1;
                (node, count) = (node + 1, left);
            } else if depth > 0 {
                depth -= 1;
                (node, first, count) = waiting[depth];
            } else {
                return;
            }
        }
    }

    /// Prepares a receiver at `point` (world) with this normal.
    #[inline]
    pub fn seen_from(&self, point: DVec3, normal: Vec3, both_sides: bool) -> SeenFrom {
        let point =
            ((point - self.middle) * self.scale).as_vec3().clamp(Vec3::splat(-1e30), Vec3::splat(1e30));
        let away = point.abs().max_element();
        let point = if away > FARTHEST_RECEIVER { point * (FARTHEST_RECEIVER / away) } else { point };
        SeenFrom { point, normal, both_sides }
    }

    /// Probability of the left half of a node; `None` where neither half has importance.
    #[inline]
    fn probability_left(&self, node: u32, left: u32, from: &SeenFrom) -> Option<f32> {
        let a = self.importance_of(node + 1, from);
        let b = self.importance_of(node + 2 * left, from);
        let both = a + b;
        (both > 0.0).then(|| a / both)
    }

    /// Chooses an emitter and returns it with its probability; `None` where none has importance.
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

    /// The probability with which [`LightTree::choose`] returns this emitter.
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

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        (self.nodes.capacity() * size_of::<LightNode>() + self.cones.capacity() * size_of::<Cone>()) as u64
    }
}

/// Sorts a range of emitters into the tree's order and fills the nodes over it; the first of these is the root of the range.
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
    // Memory order: the node, then 2·left − 1 nodes of the left half, then the right half; each half fills its own part.
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

/// Fills the cones of the nodes over a range of emitters in the tree's order.
fn fill_cones(emitters: &[Bounded], order: &[u32], cones: &mut [Cone]) {
    if let [only] = order {
        cones[0] = emitters[*only as usize].cone;
        return;
    }
    let left = left_of(order.len() as u32) as usize;
    fill_cones(emitters, &order[..left], &mut cones[1..]);
    fill_cones(emitters, &order[left..], &mut cones[2 * left..]);
    cones[0] = cones[1].joined(&cones[2 * left]);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random number in [0, 1).
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
                Bounded { lo, hi: lo + 1e-11, power: 0.01 + number(4 * i + 3).powi(6), cone: Cone::ALL }
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
                // Evenly spaced numbers choose each emitter as often as its probability says, except for one at each end of its interval.
                let mut counts = vec![0u32; count as usize];
                for i in 0..steps {
                    let Some((e, chance)) = tree.choose(&from, [(i as f32 + 0.5) / steps as f32, 0.5]) else {
                        none += 1;
                        continue;
                    };
                    assert_eq!(chance, tree.probability(&from, e));
                    counts[e as usize] += 1;
                }
                // A product of ten roundings each; one step at each end of an interval without a choice.
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
        let at =
            |x: f64| Bounded { lo: DVec3::splat(x), hi: DVec3::splat(x + 0.1), power: 1.0, cone: Cone::ALL };
        let (tree, order) = LightTree::new(&[at(0.0), at(10.0)]);
        let from = tree.seen_from(DVec3::splat(-1.0), Vec3::ONE.normalize(), false);
        let near = order.iter().position(|&e| e == 0).unwrap() as u32;
        assert!(tree.probability(&from, near) > 0.98);
        // Below the horizon nothing is chosen.
        let away = tree.seen_from(DVec3::splat(-1.0), -Vec3::ONE.normalize(), false);
        assert_eq!(tree.choose(&away, [0.5; 2]), None);
    }
}
