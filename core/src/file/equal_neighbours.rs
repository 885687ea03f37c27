//! Finds which voxels have the same label as a neighbour, one bit a voxel, so that runs of one label are found 64 voxels at a time.
//!
//! ```text
//! links of a voxel      left ──●   up │   back ╱       one bit each, set where both ends have the same label
//!                                     ●       ●
//!
//! A voxel (?) is even where these eight neighbours, whose             slice before     this slice
//! rows are decoded before its own, all have one label                     · ● ·          ● ● ●
//!                                                                         ● ● ●            ?
//!                                                                         · ● ·
//! ```
//! Seven links join the eight neighbours, so 64 voxels take some ten operations. The links of a row are computed once its voxels are
//! decoded. Voxels outside of a slice count as label 0.

use super::slices::{Around, BORDER, words};
use super::sse2::{Labels16, equal_mask};

/// Links of 64 voxels; the first voxel is in bit 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Links {
    left: u64,
    up: u64,
    back: u64,
}

impl Links {
    const ALL: Self = Self { left: u64::MAX, up: u64::MAX, back: u64::MAX };
}

/// Links of a slice's voxels and of a border, one voxel wide, above, to the right and below.
#[derive(Clone, Debug)]
pub(super) struct SliceLinks {
    /// Words a row; they include a bit for the voxel after the last one.
    words: usize,
    /// Links of all rows, from the row above the first to the row below the last.
    links: Vec<Links>,
}

impl SliceLinks {
    /// Links of a slice without labels, which stands before the first slice.
    pub(super) fn empty(columns: usize, rows: usize) -> Self {
        let words = words(columns);
        Self { words, links: vec![Links::ALL; words * (rows + 2)] }
    }

    /// Links of row `i`, counted from the row above the first.
    fn row(&self, i: usize) -> &[Links] {
        &self.links[i * self.words..][..self.words]
    }

    /// Computes the links of row `y`, which has just been decoded; the row below the last has no labels.
    pub(super) fn learn(&mut self, y: usize, row: &[u32], around: &Around<'_>) {
        let links = &mut self.links[(y + 1) * self.words..][..self.words];
        for (k, links) in links.iter_mut().enumerate() {
            let from = BORDER + 64 * k;
            let voxels = sixty_four(row, from);
            *links = Links {
                left: equal_64(voxels, sixty_four(row, from - 1)),
                up: equal_64(voxels, sixty_four(around.up, from)),
                back: equal_64(voxels, sixty_four(around.back, from)),
            };
        }
    }

    /// Calls `met` with the labels of voxels of row `y`, whose links are computed already, and of their left, upper and back neighbours
    /// with other labels. It does not report every place, but it reports each pair that touches there, unless an earlier call reported it.
    ///
    /// Where both voxels equal their neighbours one step further on, the pair occurs there too and is left out; this skips two thirds in
    /// cortex.
    #[inline]
    pub(super) fn unlike(
        &self,
        before: &Self,
        y: usize,
        row: &[u32],
        around: &Around<'_>,
        mut met: impl FnMut(u32, u32),
    ) {
        let (above, links, back) = (self.row(y), self.row(y + 1), before.row(y + 1));
        let mut last = Links::ALL;
        for (k, &now) in links.iter().enumerate() {
            let Links { left, up, back: behind } = now;
            let pair = |word: u64, before: u64| word & (word << 1 | before >> 63);
            let at_left = !left & !pair(up, last.up) & !pair(behind, last.back);
            let at_up = !up & !(left & above[k].left) & !(behind & above[k].back);
            let at_back = !behind & !(left & back[k].left) & !(up & back[k].up);
            last = now;
            let neighbours = [(at_left, &row[BORDER - 1..]), (at_up, &around.up[BORDER..])];
            for (unlike, labels) in neighbours.into_iter().chain([(at_back, &around.back[BORDER..])]) {
                let mut rest = unlike;
                while rest != 0 {
                    let x = 64 * k + rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    met(row[BORDER + x], labels[x]);
                }
            }
        }
    }

    /// Marks the voxels of row `y` that are even. `self` is the slice being decoded, `before` the previous slice.
    pub(super) fn even(&self, before: &Self, y: usize, even: &mut [u64]) {
        let (above, here, below) = (self.row(y), before.row(y + 1), before.row(y + 2));
        let left = |k: usize| above[k].left & here[k].left;
        for (k, even) in even.iter_mut().enumerate() {
            let next = if k + 1 < self.words { left(k + 1) } else { 0 };
            let three = left(k) & (left(k) >> 1 | next << 63);
            *even = three & here[k].up & below[k].up & above[k].back;
        }
    }
}

/// The 64 labels of a row from index `from` on; rows are padded to whole words.
#[inline]
fn sixty_four(row: &[u32], from: usize) -> &[Labels16; 4] {
    const NONE: [Labels16; 4] = [[[0; 4]; 4]; 4];
    bytemuck::cast_slice(&row[from..from + 64]).first_chunk().unwrap_or(&NONE)
}

/// A mask whose bit i is set where both rows have the same label at i.
#[inline]
fn equal_64(a: &[Labels16; 4], b: &[Labels16; 4]) -> u64 {
    (0..4).fold(0, |bits, i| bits | u64::from(equal_mask(&a[i], &b[i])) << (16 * i))
}

/// Index of the first bit from `from` on that is not set, or the number of bits.
#[inline]
pub(super) fn end_of_ones(bits: &[u64], from: usize) -> usize {
    let mut zeros = !bits[from / 64] >> (from % 64) << (from % 64);
    let mut k = from / 64;
    while zeros == 0 {
        k += 1;
        match bits.get(k) {
            Some(&next) => zeros = !next,
            None => return 64 * k,
        }
    }
    64 * k + zeros.trailing_zeros() as usize
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::slices::Slices;
    use super::*;

    /// Even voxels are exactly those whose eight neighbours have one label according to a naive loop.
    #[test]
    fn even_voxels_are_those_of_even_neighbours() {
        let label =
            |x: i32, y: i32, z: i32| ((x + 3 * z) / 9 + (y + z) / 7 + i32::from(x * y % 37 == 36)) as u32;
        for (columns, rows) in [(1, 1), (63, 5), (64, 9), (65, 12), (130, 20)] {
            let at = |x: i32, y: i32, z: i32| {
                let inside = (0..columns as i32).contains(&x) && (0..rows as i32).contains(&y) && z >= 0;
                if inside { label(x, y, z) } else { 0 }
            };
            let mut slices = Slices::new(columns, rows);
            let mut links = [0; 2].map(|_| SliceLinks::empty(columns, rows));
            let mut found = 0;
            for z in 0..7 {
                slices.begin();
                links.swap(0, 1);
                let [now, before] = &mut links;
                let mut three = slices.three();
                for y in 0..rows {
                    let mut even = vec![0; words(columns)];
                    now.even(before, y, &mut even);
                    let (row, around) = three.row(y);
                    for x in 0..columns {
                        let [x, y] = [x as i32, y as i32];
                        let eight = [
                            at(x - 1, y - 1, z),
                            at(x, y - 1, z),
                            at(x + 1, y - 1, z),
                            at(x, y - 1, z - 1),
                            at(x - 1, y, z - 1),
                            at(x, y, z - 1),
                            at(x + 1, y, z - 1),
                            at(x, y + 1, z - 1),
                        ];
                        let is_even = even[x as usize / 64] >> (x % 64) & 1 != 0;
                        assert_eq!(is_even, eight.iter().all(|&v| v == eight[0]), "{x} {y} {z}: {eight:?}");
                        found += u32::from(is_even && eight[0] != 0);
                    }
                    (0..columns).for_each(|x| row[BORDER + x] = at(x as i32, y as i32, z));
                    now.learn(y, row, &around);
                }
                let (row, around) = three.row(rows);
                now.learn(rows, row, &around);
            }
            assert!(found > 0 || columns == 1);
        }
    }

    /// Every pair that touches is reported, though not at every place.
    #[test]
    fn unlike_neighbours_are_met() {
        let (columns, rows) = (131, 17);
        for (n, label) in [
            (0, (|x, y, z| (x / 9 + y / 5 * 20 + z / 3 * 100) as u32) as fn(usize, usize, usize) -> u32),
            (1, |x, y, z| ((x * 7 + y * 13 + z * 29) % 11 / 3) as u32),
            (2, |x, y, z| (x + columns_of(y) + z) as u32 / 40),
        ] {
            let mut slices = Slices::new(columns, rows);
            let mut links = [0; 2].map(|_| SliceLinks::empty(columns, rows));
            let (mut met, mut places, mut expected, mut all) = (BTreeSet::new(), 0, BTreeSet::new(), 0);
            for z in 0..6 {
                slices.begin();
                links.swap(0, 1);
                let [now, before] = &mut links;
                let mut three = slices.three();
                for y in 0..rows {
                    let (row, around) = three.row(y);
                    (0..columns).for_each(|x| row[BORDER + x] = label(x, y, z));
                    now.learn(y, row, &around);
                    now.unlike(before, y, row, &around, |a, b| {
                        met.insert((a.min(b), a.max(b)));
                        places += 1;
                    });
                    for x in 0..columns {
                        let here = label(x, y, z);
                        let left = if x > 0 { label(x - 1, y, z) } else { 0 };
                        let up = if y > 0 { label(x, y - 1, z) } else { 0 };
                        let back = if z > 0 { label(x, y, z - 1) } else { 0 };
                        for other in [left, up, back].into_iter().filter(|&v| v != here) {
                            expected.insert((here.min(other), here.max(other)));
                            all += 1;
                        }
                    }
                }
            }
            // The border behind a row is reported too, as background.
            met.retain(|&(a, _)| a > 0);
            expected.retain(|&(a, _)| a > 0);
            assert!(met == expected && places < all, "{n}: {places} of {all}");
        }
    }

    fn columns_of(y: usize) -> usize {
        3 * y % 8
    }

    #[test]
    fn ones_end_where_they_end() {
        let bits = [u64::MAX << 3, u64::MAX, 0b111];
        assert_eq!([3, 60, 64, 130, 131].map(|from| end_of_ones(&bits, from)), [131, 131, 131, 131, 131]);
        assert_eq!(end_of_ones(&bits, 2), 2);
        assert_eq!(end_of_ones(&[u64::MAX; 2], 5), 128);
    }
}
