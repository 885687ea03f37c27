//! The twenty near neighbours of a voxel, and which of them have a label: what is asked for each voxel that lies in no run.
//!
//! ```text
//!            two slices before        slice before                  this slice
//! y − 2                                                                   15
//! y − 1                               8  9 10 17                       0  1  2  3
//! y                    16             4  5  6  7                  14  19  ●
//! y + 1                              11 12 13 18
//!                                    x from x − 1 on                      x
//! ```
//! The numbers are those of bits. The first 17 make contexts.

use super::slices::{Around, BORDER};
use super::sse2::{Sixteen, equal};

/// Their labels: rows of four, of the bits from 0, 4, 8 and 11 on; and those of bits 14, 15, 16, 19.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    rows: Sixteen,
    others: [u32; 4],
}

/// How many there are, and how many sets of those that make contexts.
pub(super) const NEIGHBOURS: usize = 20;
pub(super) const CONTEXTS: usize = 1 << 17;

/// Those that are asked for first: above, and in the slice before.
pub(super) const FIRST: u32 = 1 << 1 | 1 << 5;

impl Near {
    /// Of voxel `x`.
    #[inline(always)]
    pub(super) fn of(row: &[u32], around: &Around<'_>, x: usize) -> Self {
        let at = BORDER + x;
        let four = |row: &[u32]| row[at - 1..].first_chunk::<4>().copied().unwrap_or([0; 4]);
        Self {
            rows: [four(around.up), four(around.back), four(around.back_up), four(around.back_down)],
            others: [row[at - 2], around.up_2[at], around.back_2[at], row[at - 1]],
        }
    }

    /// Which of them have a label, a bit of each.
    #[inline(always)]
    pub(super) fn having(&self, label: u32) -> u32 {
        let rows = equal(&self.rows, &[[label; 4]; 4]);
        // The last of the third and of the fourth row make no context.
        let rows = rows & 0x7FF | rows >> 1 & 0x3800 | (rows & 0x800) << 6 | (rows & 0x8000) << 3;
        let [a, b, c, d] = self.others.map(|v| u32::from(v == label));
        rows | a << 14 | b << 15 | c << 16 | d << 19
    }

    /// Their labels in the order of their bits.
    pub(super) fn in_order(&self) -> [u32; NEIGHBOURS] {
        let [[a, b, c, d], [e, f, g, h], [i, j, k, r], [l, m, n, s]] = self.rows;
        let [o, p, q, t] = self.others;
        [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_those_of_the_labels_in_order() {
        for seed in 0..500u32 {
            let label = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9E37_79B1).rotate_left(seed % 32) % 3;
            let near = Near {
                rows: std::array::from_fn(|i| std::array::from_fn(|j| label(4 * i + j))),
                others: std::array::from_fn(|i| label(16 + i)),
            };
            let naive = near.in_order().iter().enumerate().fold(0, |m, (i, &v)| m | u32::from(v == 1) << i);
            assert_eq!(near.having(1), naive, "{near:?}");
        }
    }
}
