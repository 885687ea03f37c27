//! The faces of emissive boxes that light sampling can choose: those with no visible voxel in front of them.
//!
//! ```text
//! code of a face      bits 0-3 x, 4-7 y, 8-11 z: its voxel, relative to the box's lowest
//! its direction       given by the list that holds it: −x, +x, −y, +y, −z, +z
//! ```
//! A face against another visible voxel is left out, and so is one that a cut may remove or turn into a cap. Light reaches a receiver from
//! such a face only through a surface that is not fully opaque; BSDF sampling finds it.

use std::collections::{HashMap, HashSet};

use glam::DVec3;
use pumice_core::{BoxView, CompressedVolume};

use crate::geometry::Cuts;

/// Mask of the voxels of a cell with coordinate 0 along x, y, z.
const LOWEST: [u64; 3] = [0x1111_1111_1111_1111, 0x000F_000F_000F_000F, 0xFFFF];

/// log₂ of the edge of the cubes that serve to skip boxes far from all emitters.
const BRICK_SHIFT: u32 = 5;

/// Voxel masks of all drawn labels near some boxes, by 4³ cell.
#[derive(Debug)]
pub(super) struct Occupied {
    cells: HashMap<[u32; 3], u64>,
}

fn cell_of(b: &BoxView, c: u32) -> [u32; 3] {
    [0, 1, 2].map(|a| b.origin[a] / 4 + (c >> (2 * a) & 3))
}

impl Occupied {
    /// Collects the voxels of the `drawn` boxes next to the `near` ones.
    pub(super) fn new(volume: &CompressedVolume, drawn: &[u32], near: &[u32]) -> Self {
        let mut bricks = HashSet::new();
        for &i in near {
            let b = volume.get_box(i as usize);
            for_corners(b.origin.map(|o| o.saturating_sub(1)), b.extent.map(|e| e + 1), |brick| {
                bricks.insert(brick);
            });
        }
        let mut cells: HashMap<[u32; 3], u64> = HashMap::new();
        for &i in drawn {
            let b = volume.get_box(i as usize);
            let mut is_near = false;
            for_corners(b.origin, b.extent.map(|e| e - 1), |brick| is_near |= bricks.contains(&brick));
            for (c, field) in b.node.fields().take_while(|_| is_near) {
                *cells.entry(cell_of(&b, c)).or_default() |= field;
            }
        }
        Self { cells }
    }

    fn cell(&self, cell: [u32; 3]) -> u64 {
        self.cells.get(&cell).copied().unwrap_or(0)
    }

    /// Mask of the voxels of a cell that have a voxel in front of their lower or upper face along an axis.
    fn before(&self, cell: [u32; 3], axis: usize, positive: bool) -> u64 {
        let (here, low) = (self.cell(cell), LOWEST[axis]);
        let step = 1 << (2 * axis);
        let mut next = cell;
        if positive {
            next[axis] += 1;
            let high = low << (3 * step);
            return here >> step & !high | self.cell(next) << (3 * step) & high;
        }
        next[axis] = next[axis].wrapping_sub(1);
        here << step & !low | self.cell(next) >> (3 * step) & low
    }
}

/// Calls `visit` with the brick of each corner of a box whose last voxel is `origin + reach`.
fn for_corners(origin: [u32; 3], reach: [u32; 3], mut visit: impl FnMut([u32; 3])) {
    for corner in 0..8 {
        visit(
            [0, 1, 2].map(|a| (origin[a] + if corner >> a & 1 == 1 { reach[a] } else { 0 }) >> BRICK_SHIFT),
        );
    }
}

/// Whether a unit face with these corners is kept whole and lies in no cutting plane.
fn is_kept(cuts: &Cuts, corners: [DVec3; 4]) -> bool {
    // The face must lie before some plane of each convex part; an edge may lie in the plane.
    let mut before_some = false;
    for plane in cuts.planes() {
        let heights = corners.map(|c| DVec3::from(plane.normal).dot(c) - plane.offset);
        before_some |= heights.iter().all(|h| *h <= 0.0) && heights.iter().any(|h| *h < 0.0);
        if plane.ends_part {
            if !before_some {
                return false;
            }
            before_some = false;
        }
    }
    true
}

/// Appends the faces of a box, direction by direction; returns where each direction's list ends, relative to the box's first face.
pub(super) fn append_faces(b: &BoxView, around: &Occupied, cuts: &Cuts, faces: &mut Vec<u16>) -> [u16; 6] {
    let first = faces.len();
    [0, 1, 2, 3, 4, 5].map(|direction| {
        let (axis, positive) = (direction / 2, direction % 2 == 1);
        let start = faces.len();
        let mut left = b.node.occupied;
        while left != 0 {
            let c = left.trailing_zeros();
            left &= left - 1;
            let mut open = b.node.field(c) & !around.before(cell_of(b, c), axis, positive);
            while open != 0 {
                let v = open.trailing_zeros();
                open &= open - 1;
                let at = [0, 1, 2].map(|a| 4 * (c >> (2 * a) & 3) + (v >> (2 * a) & 3));
                let kept = cuts.is_empty() || {
                    let lowest = DVec3::from([0, 1, 2].map(|a| {
                        f64::from(b.origin[a] + at[a]) + if a == axis && positive { 1.0 } else { 0.0 }
                    }));
                    let [u, w] = [DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]];
                    is_kept(cuts, [lowest, lowest + u, lowest + w, lowest + u + w])
                };
                if kept {
                    faces.push((at[0] | at[1] << 4 | at[2] << 8) as u16);
                }
            }
        }
        faces[start..].sort_unstable();
        // At most 16³ · 6 / 2.
        (faces.len() - first) as u16
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use pumice_oracle::volumes::volume;

    /// Finds exposed faces by looking at each voxel's neighbours.
    fn naive(dims: [u32; 3], at: impl Fn(u32, u32, u32) -> u32, label: u32) -> HashSet<([u32; 3], usize)> {
        let mut found = HashSet::new();
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    for direction in 0..6 {
                        let mut n = [i64::from(x), i64::from(y), i64::from(z)];
                        n[direction / 2] += if direction % 2 == 1 { 1 } else { -1 };
                        let inside = (0..3).all(|a| (0..i64::from(dims[a])).contains(&n[a]));
                        let open = !inside || at(n[0] as u32, n[1] as u32, n[2] as u32) == 0;
                        if at(x, y, z) == label && open {
                            found.insert(([x, y, z], direction));
                        }
                    }
                }
            }
        }
        found
    }

    #[test]
    fn exposed_faces_match_naive() {
        let dims = [37, 26, 41];
        // Blobs of three labels that touch each other and reach the volume's end.
        let at = |x: u32, y: u32, z: u32| {
            let h =
                (x / 3).wrapping_mul(2_654_435_761) ^ (y / 5).wrapping_mul(40_503) ^ (z / 4).wrapping_mul(97);
            match (h >> 3) % 7 {
                0 | 1 => 1,
                2 => 2,
                3 if (x + y + z).is_multiple_of(2) => 3,
                _ => 0,
            }
        };
        let (_, volume) = volume(dims, at);
        let all: Vec<u32> = (0..volume.boxes().len() as u32).collect();
        for label in 0..3u32 {
            let near: Vec<u32> =
                all.iter().copied().filter(|&i| volume.label_of_box(i as usize) == label).collect();
            let around = Occupied::new(&volume, &all, &near);
            let mut found = HashSet::new();
            for &i in &near {
                let b = volume.get_box(i as usize);
                let mut faces = Vec::new();
                let ends = append_faces(&b, &around, &Cuts::default(), &mut faces);
                let mut start = 0;
                for (direction, end) in ends.into_iter().enumerate() {
                    let list = &faces[usize::from(start)..usize::from(end)];
                    assert!(list.is_sorted());
                    for code in list {
                        let at = [0, 1, 2].map(|a| b.origin[a] + u32::from(code >> (4 * a) & 15));
                        assert!(found.insert((at, direction)), "{at:?} twice");
                    }
                    start = end;
                }
            }
            assert_eq!(found, naive(dims, at, label + 1));
        }
    }
}
