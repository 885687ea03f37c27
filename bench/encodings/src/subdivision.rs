//! Subdivides the voxels of each label into boxes as the paper does (§3.1): the tight box of a region is halved along its longest side
//! until it is small enough, and each half is tightened again.

use pumice_core::CompressedVolume;
use rayon::prelude::*;

/// A nonempty cell of 4³ voxels: its Morton index among the cells of the box's cube, and its occupancy field (bit x + 4y + 16z).
pub(crate) type Cell = (u64, u64);

/// A tight box of voxels of one label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TightBox {
    /// Lowest voxel.
    pub lo: [u32; 3],
    /// One past the highest voxel.
    pub hi: [u32; 3],
    /// Dense index of the label.
    pub label: u32,
    /// Index of its first cell in [`Subdivision::cells`].
    first_cell: usize,
}

/// All boxes of a volume by rising labels, with their cells.
#[derive(Clone, Debug)]
pub struct Subdivision {
    boxes: Vec<TightBox>,
    cells: Vec<Cell>,
    side: Option<u32>,
}

impl Subdivision {
    /// Subdivides a volume into boxes of at most `side` voxels along each axis (a power of two, at least 8), or into one box per label where
    /// `side` is `None`.
    ///
    /// # Panics
    /// When `side` is less than 8 or no power of two.
    pub fn new(volume: &CompressedVolume, side: Option<u32>) -> Self {
        assert!(
            side.is_none_or(|s| s >= 8 && s.is_power_of_two()),
            "the side of boxes must be a power of two, at least 8"
        );
        let mut of_label = vec![Vec::new(); volume.labels().len()];
        let mut number = 0;
        volume.for_each_box(|label, _| {
            of_label[label as usize].push(number);
            number += 1;
        });
        let parts: Vec<(Vec<TightBox>, Vec<Cell>)> = of_label
            .par_iter()
            .enumerate()
            .map(|(label, boxes)| {
                let mut voxels = voxels_of(volume, boxes);
                let (mut boxes, mut cells) = (Vec::new(), Vec::new());
                subdivide(&mut voxels, side, &mut |lo, hi, voxels| {
                    boxes.push(TightBox { lo, hi, label: label as u32, first_cell: cells.len() });
                    cells_of(lo, voxels, &mut cells);
                });
                (boxes, cells)
            })
            .collect();
        let (mut boxes, mut cells) = (Vec::new(), Vec::new());
        for (of_label, its_cells) in parts {
            let first = cells.len();
            boxes.extend(of_label.iter().map(|b| TightBox { first_cell: b.first_cell + first, ..*b }));
            cells.extend(its_cells);
        }
        Self { boxes, cells, side }
    }

    /// All boxes, by rising labels.
    pub fn boxes(&self) -> &[TightBox] {
        &self.boxes
    }

    /// Upper limit of the sides of boxes in voxels; `None` where each label is one box.
    pub fn side(&self) -> Option<u32> {
        self.side
    }

    pub(crate) fn cells(&self, index: usize) -> &[Cell] {
        let end = self.boxes.get(index + 1).map_or(self.cells.len(), |next| next.first_cell);
        &self.cells[self.boxes[index].first_cell..end]
    }

    /// Levels of a box's tree above its cells: its cube has 4 · 2^levels voxels along each side. At least 1, so that the root of each box
    /// has children.
    pub(crate) fn levels(&self, index: usize) -> u32 {
        let b = &self.boxes[index];
        levels_of(self.side, b.lo, b.hi)
    }
}

/// Levels of the tree of a box from `lo` to `hi`; see [`Subdivision::levels`].
pub(crate) fn levels_of(side: Option<u32>, lo: [u32; 3], hi: [u32; 3]) -> u32 {
    let longest = side.unwrap_or_else(|| (0..3).map(|a| hi[a] - lo[a]).fold(8, u32::max));
    longest.next_power_of_two().trailing_zeros() - 2
}

fn voxels_of(volume: &CompressedVolume, boxes: &[usize]) -> Vec<[u32; 3]> {
    let mut voxels = Vec::new();
    for &i in boxes {
        let b = volume.get_box(i);
        for (c, mut field) in b.node.fields() {
            let low = [0, 1, 2].map(|a| b.origin[a] + 4 * (c >> (2 * a) & 3));
            while field != 0 {
                let v = field.trailing_zeros();
                field &= field - 1;
                voxels.push([low[0] + (v & 3), low[1] + (v >> 2 & 3), low[2] + (v >> 4)]);
            }
        }
    }
    voxels
}

/// Subdivides voxels into tight boxes and calls `emit` for each: lowest voxel, one past the highest, the box's voxels.
fn subdivide(
    voxels: &mut [[u32; 3]],
    side: Option<u32>,
    emit: &mut impl FnMut([u32; 3], [u32; 3], &[[u32; 3]]),
) {
    let (mut lo, mut hi) = ([u32::MAX; 3], [0; 3]);
    for v in voxels.iter() {
        for a in 0..3 {
            (lo[a], hi[a]) = (lo[a].min(v[a]), hi[a].max(v[a] + 1));
        }
    }
    if voxels.is_empty() {
        return;
    }
    let extent = [0, 1, 2].map(|a| hi[a] - lo[a]);
    let longest = (0..3).fold(0, |best, a| if extent[a] > extent[best] { a } else { best });
    if side.is_none_or(|side| extent[longest] <= side) {
        return emit(lo, hi, voxels);
    }
    let middle = lo[longest] + extent[longest] / 2;
    let mut below = 0;
    for i in 0..voxels.len() {
        if voxels[i][longest] < middle {
            voxels.swap(i, below);
            below += 1;
        }
    }
    let (first, second) = voxels.split_at_mut(below);
    subdivide(first, side, emit);
    subdivide(second, side, emit);
}

/// Appends the cells of a box's voxels, in Morton order.
fn cells_of(lo: [u32; 3], voxels: &[[u32; 3]], cells: &mut Vec<Cell>) {
    let start = cells.len();
    let mut bits: Vec<Cell> = voxels
        .iter()
        .map(|v| {
            let local = [0, 1, 2].map(|a| v[a] - lo[a]);
            let bit = (local[0] & 3) + 4 * (local[1] & 3) + 16 * (local[2] & 3);
            (pumice_core::morton::encode(local.map(|l| l / 4)), 1u64 << bit)
        })
        .collect();
    bits.sort_unstable_by_key(|b| b.0);
    for (place, bit) in bits {
        match cells[start..].last_mut() {
            Some(last) if last.0 == place => last.1 |= bit,
            _ => cells.push((place, bit)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L of voxels, 20 along x and 3 along y, is halved once along x, and both halves are tightened.
    #[test]
    fn boxes_are_cut_in_the_middle_and_tight() {
        let mut voxels: Vec<[u32; 3]> = (0..20).map(|x| [5 + x, 7, 9]).collect();
        voxels.extend([[5, 8, 9], [5, 9, 9]]);
        let mut found = Vec::new();
        subdivide(&mut voxels, Some(16), &mut |lo, hi, v| found.push((lo, hi, v.len())));
        assert_eq!(found, [([5, 7, 9], [15, 10, 10], 12), ([15, 7, 9], [25, 8, 10], 10)]);
        found.clear();
        subdivide(&mut voxels, None, &mut |lo, hi, v| found.push((lo, hi, v.len())));
        assert_eq!(found, [([5, 7, 9], [25, 10, 10], 22)]);
        assert_eq!(
            [(Some(16), [1; 3]), (None, [9, 1, 1]), (None, [1; 3])].map(|(s, hi)| levels_of(s, [0; 3], hi)),
            [2, 2, 1]
        );
    }

    #[test]
    fn cells_are_in_morton_order_with_their_voxels() {
        let mut cells = Vec::new();
        cells_of([2, 0, 0], &[[2, 0, 0], [6, 0, 0], [2, 5, 3], [5, 3, 3]], &mut cells);
        assert_eq!(cells, [(0, 1 | 1 << 63), (1, 1), (2, 1 << (4 + 48))]);
    }
}
