//! The smoothed surface of the labels in one block: a surface net over their voxels.
//!
//! ```text
//!   A │ A │ B      a node at each corner of voxels that do not all have one label;        A ╲ A ╱ B
//!  ───●───●───     its neighbours are the nodes one voxel away, along edges where           ●──●
//!   A │ 0 │ B      labels meet. In each step a node goes half of the way to the      ─►   A │ 0 ╲ B
//!  ───●───●───     middle of its neighbours, and stays within 0.4 of a voxel,               ●────●
//!   A │ B │ B      along each axis, of where it was                                       A  ╲ B  B
//! ```
//! (Gibson 1998, *Constrained Elastic Surface Nets*; Frisken 2022, *SurfaceNets for Multi-Label Segmentations with Preservation of Sharp
//! Boundaries*, JCGT 11(1).) The faces are those of the voxels, with moved corners, so whatever label a face belongs to has the same border:
//! there is neither gap nor overlap. 0 stands for background and labels that are not shown.
//!
//! Edges around which three or more labels meet are the border of a common face; nodes at such edges follow them alone, or borders
//! between labels would sink into the surface (Frisken). Where the region ends, the surface is flat: nodes stay in that plane, and follow
//! others as if labels went on beyond it, so that what is cut off is not rounded there.
//!
//! A node's place depends on nodes up to [`STEPS`] away. The block is therefore decoded with a margin, and each step makes one layer of
//! nodes at the margin's end wrong. What is left agrees to the last bit with the same nodes of other blocks: all sums have the same
//! order, and nodes are displacements from their corners, which do not depend on where the block begins.

use glam::{IVec3, Vec3};
use pumice_core::Error;
use rustc_hash::FxHashMap;

use crate::surface::Surface;

/// Steps of smoothing. Of a ball of 20 voxels' radius the area is 1.2 % too large after four, 0.3 % after six; more take volume: of a ball of
/// 10 voxels' radius 2.7 % after six, 3.4 % after eight.
const STEPS: usize = 6;

/// Share of the way to the middle of its neighbours that a node goes in a step: with a half no pattern of neighbours swings.
const SHARE: f32 = 0.5;

/// Farthest that a node goes along an axis, in voxels. At 0.5 nodes of neighbouring corners would meet, and single voxels and thin fibres
/// vanish; at 0.4 they keep a fifth of their width. At 0.3 steps of gentle slopes stay visible.
const FARTHEST: f32 = 0.4;

/// Voxels that are decoded around a block: for the steps, for normals, which depend on the nodes one voxel away, and for labels beyond.
const MARGIN: usize = STEPS + 2;

/// What is beyond faces at the region's end: this number plus 2 · axis, plus one for up. No volume has as many labels.
const END: u32 = u32::MAX - 5;

/// A place of no node.
const NONE: u32 = u32::MAX;

/// Corners of a face, whose edges these are in order, across and along the two axes after its own.
const RING: [[usize; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];

/// The directions of neighbours.
const DIRECTIONS: [Vec3; 6] = [Vec3::NEG_X, Vec3::X, Vec3::NEG_Y, Vec3::Y, Vec3::NEG_Z, Vec3::Z];

/// The surface in a block.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct NetBlock {
    /// A point for each corner of voxels and label that has a face there.
    pub(crate) points: Vec<NetPoint>,
    /// A vertex for each point and kind of face there.
    pub(crate) vertices: Vec<NetVertex>,
    /// Vertices of each face, counter-clockwise as seen from outside its label; the diagonal from the first to the third is the shorter one.
    pub(crate) quads: Vec<[u32; 4]>,
}

/// A corner of voxels, moved, as a label sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NetPoint {
    /// Where it was, in index space.
    pub(crate) corner: [u32; 3],
    /// Dense index of the label.
    pub(crate) label: u32,
    /// Where it is.
    pub(crate) position: [f32; 3],
    /// Whether blocks next to this one have it too.
    pub(crate) is_shared: bool,
}

/// A point with the normal of the faces of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NetVertex {
    /// Its place among the points.
    pub(crate) point: u32,
    /// What is beyond the faces: dense index + 1 of a label, 0 for what is not shown, a number from [`END`] on for the region's end.
    pub(crate) beyond: u32,
    /// Length 1, in index space.
    pub(crate) normal: [f32; 3],
}

impl NetBlock {
    /// The faces of the labels' voxels in the block of `side` voxels whose lowest is `origin`.
    ///
    /// # Errors
    /// Errors of the volume.
    pub(crate) fn new(surface: &Surface<'_>, origin: [u32; 3], side: usize) -> Result<Self, Error> {
        let net = Net::new(surface, origin, side)?;
        let mut block = Self::default();
        let mut point_of = FxHashMap::default();
        let mut vertex_of = FxHashMap::default();
        net.for_each_face(|corners, label, beyond| {
            let quad = corners.map(|place| {
                *vertex_of.entry((place, label, beyond)).or_insert_with(|| {
                    let point = *point_of.entry((place, label)).or_insert_with(|| {
                        block.points.push(net.point(place, label));
                        block.points.len() as u32 - 1
                    });
                    block.vertices.push(NetVertex {
                        point,
                        beyond,
                        normal: net.normal(place, label, beyond),
                    });
                    block.vertices.len() as u32 - 1
                })
            });
            block.quads.push(quad);
        });
        Ok(block)
    }
}

/// Corners of voxels and their labels, around a block.
struct Net {
    /// The lowest corner, in index space.
    lowest: IVec3,
    /// Voxels of the block along an axis.
    side: usize,
    /// Lowest and highest corner of the region.
    ends: [IVec3; 2],
    /// Corners along an axis, of the block and its margin.
    corners: usize,
    /// Dense index + 1 at each voxel, x fastest: one more along an axis than there are corners, of which each has voxels on both sides.
    voxels: Vec<u32>,
    /// The node at each corner, x fastest, or [`NONE`].
    node_at: Vec<u32>,
    /// How far each node is from its corner.
    moved: Vec<Vec3>,
}

/// A node while the net is smoothed.
struct Node {
    /// Nodes one voxel away that it follows, or [`NONE`], in the order −x, +x, −y, +y, −z, +z.
    neighbours: [u32; 6],
    /// 0 along axes on which it stays.
    free: Vec3,
}

impl Net {
    fn new(surface: &Surface<'_>, origin: [u32; 3], side: usize) -> Result<Self, Error> {
        let corners = side + 2 * MARGIN - 1;
        let lowest = IVec3::from_array(origin.map(|o| o as i32)) + IVec3::splat(1 - MARGIN as i32);
        let before = (lowest - IVec3::ONE).to_array().map(i64::from);
        let voxels = surface.voxels_around(before, corners + 1)?;
        let region = surface.region();
        let ends = [region.low(), region.high()].map(|end| IVec3::from_array(end.map(|c| c as i32)));
        let node_at = vec![NONE; corners.pow(3)];
        let mut net = Self { lowest, side, ends, corners, voxels, node_at, moved: vec![] };
        let mut links = Vec::new();
        for place in net.mixed() {
            net.node_at[place] = links.len() as u32;
            // A node within a face at the region's end has no links, and stays.
            links.push((place, links_of(&net.continued(place, &net.around(place))).unwrap_or(0)));
        }
        let nodes: Vec<Node> = links.iter().map(|(place, of_node)| net.node(*place, *of_node)).collect();
        net.moved = smoothed(&nodes);
        Ok(net)
    }

    /// A corner's place along each axis, from the lowest corner.
    fn at(&self, place: usize) -> [usize; 3] {
        [place % self.corners, place / self.corners % self.corners, place / self.corners.pow(2)]
    }

    fn steps(&self) -> [usize; 3] {
        [1, self.corners, self.corners.pow(2)]
    }

    /// Steps between neighbouring voxels.
    fn voxel_steps(&self) -> [usize; 3] {
        let n = self.corners + 1;
        [1, n, n * n]
    }

    /// Places of the corners of voxels that do not all have one label. Most corners are none, so they are passed by quickly.
    fn mixed(&self) -> Vec<usize> {
        let (corners, [_, y_step, z_step]) = (self.corners, self.voxel_steps());
        let mut places = Vec::new();
        for z in 0..corners {
            for y in 0..corners {
                let first = z * z_step + y * y_step;
                let rows = [0, y_step, z_step, y_step + z_step]
                    .map(|step| &self.voxels[first + step..][..corners + 1]);
                let is_mixed = |x: usize| {
                    let label = rows[0][x];
                    rows.iter().any(|row| row[x] != label || row[x + 1] != label)
                };
                let row = (z * corners + y) * corners;
                places.extend((0..corners).filter(|&x| is_mixed(x)).map(|x| row + x));
            }
        }
        places
    }

    /// Labels of the eight voxels at a corner: bit a of the index is set for those above it on axis a.
    fn around(&self, place: usize) -> [u32; 8] {
        let (at, steps) = (self.at(place), self.voxel_steps());
        let first: usize = (0..3).map(|a| at[a] * steps[a]).sum();
        [0, 1, 2, 3, 4, 5, 6, 7]
            .map(|bits: usize| self.voxels[first + (0..3).map(|a| (bits >> a & 1) * steps[a]).sum::<usize>()])
    }

    /// The same where the region goes on as it ends.
    fn continued(&self, place: usize, around: &[u32; 8]) -> [u32; 8] {
        let corner = self.corner(place);
        let mask = |end: IVec3| (0..3).fold(0, |mask, a| mask | usize::from(end[a] == corner[a]) << a);
        let [low, high] = self.ends.map(mask);
        [0, 1, 2, 3, 4, 5, 6, 7].map(|bits: usize| around[(bits | low) & !high])
    }

    fn node(&self, place: usize, links: u8) -> Node {
        let (at, steps) = (self.at(place), self.steps());
        let neighbours = [0, 1, 2, 3, 4, 5].map(|direction: usize| {
            let (axis, is_up) = (direction / 2, direction % 2 == 1);
            let is_there = if is_up { at[axis] + 1 < self.corners } else { at[axis] > 0 };
            if links >> direction & 1 == 0 || !is_there {
                return NONE;
            }
            self.node_at[if is_up { place + steps[axis] } else { place - steps[axis] }]
        });
        let free = [0, 1, 2].map(|axis| if self.is_at_end(place, axis) { 0.0 } else { 1.0 });
        Node { neighbours, free: Vec3::from_array(free) }
    }

    /// A corner in index space.
    fn corner(&self, place: usize) -> IVec3 {
        self.lowest + IVec3::from_array(self.at(place).map(|c| c as i32))
    }

    /// Whether a corner is where the region ends along an axis.
    fn is_at_end(&self, place: usize, axis: usize) -> bool {
        let corner = self.corner(place)[axis];
        self.ends.iter().any(|end| end[axis] == corner)
    }

    /// How far the node at a corner is from it.
    fn moved(&self, place: usize) -> Vec3 {
        self.moved[self.node_at[place] as usize]
    }

    fn point(&self, place: usize, label: u32) -> NetPoint {
        let (corner, moved) = (self.corner(place).to_array(), self.moved(place).to_array());
        let position = [0, 1, 2].map(|a| (f64::from(corner[a]) + f64::from(moved[a])) as f32);
        let is_shared = self.at(place).iter().any(|&c| c == MARGIN - 1 || c == MARGIN - 1 + self.side);
        NetPoint { corner: corner.map(|c| c as u32), label: label - 1, position, is_shared }
    }

    /// Visits the faces of the block's voxels: places of their corners, counter-clockwise as seen from outside, label as dense index + 1, and
    /// what is beyond it.
    fn for_each_face(&self, mut visit: impl FnMut([usize; 4], u32, u32)) {
        let (steps, voxel_steps) = (self.steps(), self.voxel_steps());
        let range = MARGIN..MARGIN + self.side;
        let rows = range.clone().flat_map(|z| range.clone().map(move |y| [y, z]));
        let places = rows.flat_map(|[y, z]| range.clone().map(move |x| [x, y, z]));
        for at in places {
            let voxel = at[0] + at[1] * voxel_steps[1] + at[2] * voxel_steps[2];
            let label = self.voxels[voxel];
            let is_within = label == 0
                || (0..3).all(|a| {
                    self.voxels[voxel - voxel_steps[a]] == label
                        && self.voxels[voxel + voxel_steps[a]] == label
                });
            if is_within {
                continue;
            }
            // The corner below a voxel has the number of the voxel before it.
            let below: usize = (0..3).map(|a| (at[a] - 1) * steps[a]).sum();
            for axis in 0..3 {
                for is_up in [false, true] {
                    let step = voxel_steps[axis];
                    let beyond = self.voxels[if is_up { voxel + step } else { voxel - step }];
                    if beyond != label {
                        let lowest = below + if is_up { steps[axis] } else { 0 };
                        let end = END + 2 * axis as u32 + u32::from(is_up);
                        let beyond = if self.is_at_end(lowest, axis) { end } else { beyond };
                        visit(self.ring(lowest, axis, is_up), label, beyond);
                    }
                }
            }
        }
    }

    /// The corners of a face whose lowest is given. Both labels of a common face divide it by the same diagonal, the shorter one.
    fn ring(&self, lowest: usize, axis: usize, is_up: bool) -> [usize; 4] {
        let [a, b, c, d] = self.corners_of_face(lowest, axis);
        let [a, b, c, d] = if self.between(b, d).length_squared() < self.between(a, c).length_squared() {
            [b, c, d, a]
        } else {
            [a, b, c, d]
        };
        if is_up { [a, b, c, d] } else { [a, d, c, b] }
    }

    /// Places of the corners of a face, counter-clockwise as seen from above its axis.
    fn corners_of_face(&self, lowest: usize, axis: usize) -> [usize; 4] {
        let steps = self.steps();
        RING.map(|[across, along]| lowest + across * steps[(axis + 1) % 3] + along * steps[(axis + 2) % 3])
    }

    /// From one node to another: their places' difference first, which is exact.
    fn between(&self, from: usize, to: usize) -> Vec3 {
        (self.corner(to) - self.corner(from)).as_vec3() + (self.moved(to) - self.moved(from))
    }

    /// Normal of a face, as long as twice its area, towards its axis.
    fn area(&self, lowest: usize, axis: usize) -> Vec3 {
        let [a, b, c, d] = self.corners_of_face(lowest, axis);
        self.between(a, c).cross(self.between(b, d))
    }

    /// The normal of the faces at a corner that are alike: of those to what is not shown, whatever their label, so that the outside is
    /// smooth across labels; of those between two labels, as the first sees them; of those in a plane where the region ends.
    fn normal(&self, place: usize, label: u32, beyond: u32) -> [f32; 3] {
        if let Some(direction) = beyond.checked_sub(END) {
            return DIRECTIONS[direction as usize].to_array();
        }
        let (around, steps) = (self.around(place), self.steps());
        let (mut sum, mut first) = (Vec3::ZERO, Vec3::ZERO);
        for axis in 0..3 {
            let is_at_end = self.is_at_end(place, axis);
            for [across, along] in RING.into_iter().filter(|_| !is_at_end) {
                let bits = across << ((axis + 1) % 3) | along << ((axis + 2) % 3);
                let [below, above] = [around[bits], around[bits | 1 << axis]];
                let is_up = match beyond {
                    0 => above == 0,
                    _ => below == label,
                };
                let is_alike = match beyond {
                    0 => (below == 0) != (above == 0),
                    _ => [below, above] == [label, beyond] || [below, above] == [beyond, label],
                };
                if is_alike {
                    let lowest =
                        place - (1 - across) * steps[(axis + 1) % 3] - (1 - along) * steps[(axis + 2) % 3];
                    let area = if is_up { self.area(lowest, axis) } else { -self.area(lowest, axis) };
                    if first == Vec3::ZERO {
                        first = area;
                    }
                    sum += area;
                }
            }
        }
        // Faces that look away from each other, where voxels touch at a corner, may leave none, or what rounding makes of it: areas are
        // 0.04 and more.
        let normal = if sum.length_squared() > 1e-6 { sum } else { first };
        normal.normalize_or(Vec3::Z).to_array()
    }
}

/// The directions in which a node has neighbours, by the labels of the voxels around it: bit 2 · axis, plus one for up. None where there is
/// no node, because all are the same.
fn links_of(around: &[u32; 8]) -> Option<u8> {
    if around.iter().all(|&label| label == around[0]) {
        return None;
    }
    let (mut all, mut borders) = (0u8, 0u8);
    for direction in 0..6 {
        let (axis, up) = (direction / 2, direction % 2);
        let of_edge = RING.map(|[across, along]| {
            around[up << axis | across << ((axis + 1) % 3) | along << ((axis + 2) % 3)]
        });
        match distinct(of_edge) {
            1 => {}
            2 => all |= 1 << direction,
            _ => borders |= 1 << direction,
        }
    }
    // A border has two ends or none here; a single one would drag the node along.
    Some(if borders.count_ones() > 1 { borders } else { all | borders })
}

/// How many different labels there are.
fn distinct(labels: [u32; 4]) -> usize {
    (0..4).filter(|&i| !labels[..i].contains(&labels[i])).count()
}

/// How far each node is from its corner in the end.
fn smoothed(nodes: &[Node]) -> Vec<Vec3> {
    let mut moved = vec![Vec3::ZERO; nodes.len()];
    let mut next = moved.clone();
    for _ in 0..STEPS {
        for ((node, before), after) in nodes.iter().zip(&moved).zip(&mut next) {
            let (mut sum, mut count) = (Vec3::ZERO, 0.0);
            for (neighbour, direction) in node.neighbours.iter().zip(DIRECTIONS) {
                if *neighbour != NONE {
                    sum += direction + moved[*neighbour as usize];
                    count += 1.0;
                }
            }
            let middle = if count > 0.0 { sum / count } else { *before };
            let goal = *before + SHARE * (middle - *before);
            *after = node.free * goal.clamp(Vec3::splat(-FARTHEST), Vec3::splat(FARTHEST));
        }
        std::mem::swap(&mut moved, &mut next);
    }
    moved
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes;
    use pumice_transport::geometry::DetailLevel;

    use super::*;
    use crate::{Merging, VoxelRegion};

    /// A face as bits: label, what is beyond it, positions and normals of its corners.
    type Face = (u32, u32, [[[u32; 3]; 2]; 4]);

    /// All faces, from blocks of this side.
    fn faces(surface: &Surface<'_>, dims: [u32; 3], side: usize) -> Vec<Face> {
        let mut all = Vec::new();
        let starts = |a: usize| (0..dims[a]).step_by(side);
        for z in starts(2) {
            for y in starts(1) {
                for x in starts(0) {
                    let block = NetBlock::new(surface, [x, y, z], side).unwrap();
                    all.extend(block.quads.iter().map(|quad| {
                        let vertices = quad.map(|v| block.vertices[v as usize]);
                        let points = vertices.map(|v| block.points[v.point as usize]);
                        let of_corner =
                            |i: usize| [points[i].position, vertices[i].normal].map(|v| v.map(f32::to_bits));
                        (points[0].label, vertices[0].beyond, [0, 1, 2, 3].map(of_corner))
                    }));
                }
            }
        }
        all.sort_unstable();
        all
    }

    #[test]
    fn blocks_of_any_size_give_the_same_bits() {
        let (dense, volume) = volumes::blobs([21, 18, 15], 30, 20, 4);
        let visible = vec![true; volume.labels().len()];
        let region = VoxelRegion::new([3, 0, 2], [21, 16, 14]).unwrap();
        for region in [None, Some(region)] {
            let surface =
                Surface::new(&volume, &visible, DetailLevel::Voxels, Merging::Plain).unwrap().within(region);
            let whole = faces(&surface, dense.dims, 64);
            assert!(whole.len() > 1000);
            for side in [9, 16] {
                assert!(faces(&surface, dense.dims, side) == whole, "{side}");
            }
        }
    }

    #[test]
    fn labels_that_meet_along_an_edge_are_followed_there() {
        // Two labels on a floor of nothing: their border runs along y.
        let around = [0, 0, 0, 0, 1, 2, 1, 2];
        assert_eq!(links_of(&around), Some(0b001100));
        // One label on a floor: x and y.
        assert_eq!(links_of(&[0, 0, 0, 0, 1, 1, 1, 1]), Some(0b001111));
        assert_eq!(links_of(&[3; 8]), None);
        // A single voxel: the three edges of it that end here.
        assert_eq!(links_of(&[0, 0, 0, 0, 0, 0, 0, 5]), Some(0b101010));
    }
}
