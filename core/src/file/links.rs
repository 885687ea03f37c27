//! Which voxels have the label of a neighbour, 64 of a row in a word: what is even is found by words and not by voxels.
//!
//! ```text
//! links of a voxel      left ──●   up │   back ╱       a bit of each, set where both have one label
//!                                     ●       ●
//!
//! even, of the rows that are known before a row's voxels are          slice before     this slice
//! (their links are): all eight of these have one label                    · ● ·          ● ● ●
//!                                                                         ● ● ●            ?
//!                                                                         · ● ·
//! ```
//! Seven links join the eight, and so 64 voxels take some ten operations. The links of a row are made when its voxels are known. What
//! is outside of a slice counts as label 0.

use super::slices::{Around, BORDER};

/// Links of 64 voxels, the first in bit 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Links {
    left: u64,
    up: u64,
    back: u64,
}

impl Links {
    const ALL: Self = Self { left: u64::MAX, up: u64::MAX, back: u64::MAX };
}

/// Links of a slice's voxels, and of those one outside: above, to the right and below.
#[derive(Clone, Debug)]
pub(super) struct SliceLinks {
    /// Words of a row: the voxel behind the last one has a bit.
    words: usize,
    /// Rows from the one above the first to the one below the last.
    links: Vec<Links>,
}

/// Words for a row of this many voxels.
pub(super) fn words(columns: usize) -> usize {
    columns / 64 + 1
}

impl SliceLinks {
    /// Of a slice without labels, in front of another.
    pub(super) fn empty(columns: usize, rows: usize) -> Self {
        let words = words(columns);
        Self { words, links: vec![Links::ALL; words * (rows + 2)] }
    }

    /// Links of row `y`, which is -1 + 1 for the row above the first.
    fn row(&self, y_and_1: usize) -> &[Links] {
        &self.links[y_and_1 * self.words..][..self.words]
    }

    /// Takes in row `y`, known now; the row below the last is one without labels.
    pub(super) fn learn(&mut self, y: usize, row: &[u32], around: &Around<'_>) {
        let links = &mut self.links[(y + 1) * self.words..][..self.words];
        for (k, links) in links.iter_mut().enumerate() {
            let from = BORDER + 64 * k;
            let voxels = sixty_four(row, from);
            *links = Links {
                left: equal(voxels, sixty_four(row, from - 1)),
                up: equal(voxels, sixty_four(around.up, from)),
                back: equal(voxels, sixty_four(around.back, from)),
            };
        }
    }

    /// The voxels of row `y` that are even, this being the slice under way.
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

/// A row's voxels from a place on: rows are as long as all their words.
#[inline]
fn sixty_four(row: &[u32], from: usize) -> &[u32; 64] {
    row[from..].first_chunk().unwrap_or(&[0; 64])
}

/// Bit i is set where both have one label at i.
#[inline]
fn equal(a: &[u32; 64], b: &[u32; 64]) -> u64 {
    let mut equal = [0u8; 64];
    for (equal, (a, b)) in equal.iter_mut().zip(a.iter().zip(b)) {
        *equal = u8::from(a == b);
    }
    let mut bits = 0;
    for (i, eight) in equal.as_chunks::<8>().0.iter().enumerate() {
        // Eight bytes of 0 or 1 to eight bits: the product moves byte k's bit to bit 56 + k, without carries.
        bits |= (u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * i);
    }
    bits
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

    #[test]
    fn ones_end_where_they_end() {
        let bits = [u64::MAX << 3, u64::MAX, 0b111];
        assert_eq!([3, 60, 64, 130, 131].map(|from| end_of_ones(&bits, from)), [131, 131, 131, 131, 131]);
        assert_eq!(end_of_ones(&bits, 2), 2);
        assert_eq!(end_of_ones(&[u64::MAX; 2], 5), 128);
    }
}
