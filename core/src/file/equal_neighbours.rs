//! Which voxels have the same label as a neighbour, one bit a voxel: runs of one label are found 64 voxels at a time.
//!
//! ```text
//! links of a voxel      left ──●   up │   back ╱       a bit of each, set where both have one label
//!                                     ●       ●
//!
//! A voxel (?) is even where these eight neighbours, whose             slice before     this slice
//! rows are decoded before its own, all have one label                     · ● ·          ● ● ●
//!                                                                         ● ● ●            ?
//!                                                                         · ● ·
//! ```
//! Seven links join the eight, so 64 voxels take some ten operations. The links of a row are made once its voxels are decoded. Voxels
//! outside of a slice count as label 0.

use super::slices::{Around, BORDER, words};
use super::sse2::{Labels16, equal_mask};

/// Links of 64 voxels, the first voxel in bit 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Links {
    left: u64,
    up: u64,
    back: u64,
}

impl Links {
    const ALL: Self = Self { left: u64::MAX, up: u64::MAX, back: u64::MAX };
}

/// Links of a slice's voxels and of the border one voxel wide above, to the right and below.
#[derive(Clone, Debug)]
pub(super) struct SliceLinks {
    /// Words of a row: the voxel behind the last one has a bit.
    words: usize,
    /// Rows from the one above the first to the one below the last.
    links: Vec<Links>,
}

impl SliceLinks {
    /// Links of a slice without labels, which lies before the first.
    pub(super) fn empty(columns: usize, rows: usize) -> Self {
        let words = words(columns);
        Self { words, links: vec![Links::ALL; words * (rows + 2)] }
    }

    /// Links of a row, counted from the one above the first.
    fn row(&self, i: usize) -> &[Links] {
        &self.links[i * self.words..][..self.words]
    }

    /// Makes the links of row `y`, which is decoded now; the row below the last has no labels.
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

    /// The labels of voxels of row `y`, taken in already, and of those to the left, above and back that have others: not of all, but
    /// each pair that touches there or at a place that was asked for before.
    ///
    /// Where both voxels are as their neighbours one step on, the pair is theirs too: that leaves out two thirds of cortex.
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

    /// Marks the voxels of row `y` that are even. `self` is the slice being decoded, `before` the slice before it.
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

/// The 64 voxels of a row from a place on: rows are padded to whole words.
#[inline]
fn sixty_four(row: &[u32], from: usize) -> &[Labels16; 4] {
    const NONE: [Labels16; 4] = [[[0; 4]; 4]; 4];
    bytemuck::cast_slice(&row[from..from + 64]).first_chunk().unwrap_or(&NONE)
}

/// A mask whose bit i is set where both have one label at i.
#[inline]
fn equal_64(a: &[Labels16; 4], b: &[Labels16; 4]) -> u64 {
    (0..4).fold(0, |bits, i| bits | u64::from(equal_mask(&a[i], &b[i])) << (16 * i))
}

/// The first place from `from` on whose bit is not set, or where the bits end.
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

    /// Even voxels are those whose eight neighbours a naive loop finds to be of one label.
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

    /// Every pair that touches is met, though not at every place.
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
            // The border behind a row is met too, as background.
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
