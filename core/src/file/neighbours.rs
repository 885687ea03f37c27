//! The twenty nearest decoded neighbours of a voxel, and a mask of those that have a given label. The coder needs the mask for each voxel
//! outside of a run.
//!
//! ```text
//!            two slices before        slice before                  this slice
//! y − 2                                                                   15
//! y − 1                               8  9 10 17                       0  1  2  3
//! y                    16             4  5  6  7                  14  19  ●
//! y + 1                              11 12 13 18
//!                                    x from x − 1 on                      x
//! ```
//! ● is the voxel. The numbers are bits of the mask; the lowest 17 select a context.

use super::slices::{Around, BORDER};
use super::sse2::{Labels16, equal_mask};

/// The labels of a voxel's neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbours {
    /// Four rows of four labels: bits 0–3, 4–7, 8–10 with 17, and 11–13 with 18.
    rows: Labels16,
    /// Labels of bits 14, 15, 16 and 19.
    others: [u32; 4],
}

/// Number of bits of the mask.
pub(super) const NEIGHBOURS: usize = 20;
/// Number of contexts that the lowest 17 bits select.
pub(super) const CONTEXTS: usize = 1 << 17;

/// The neighbours whose labels the coder tries first: the one above, and the same voxel in the slice before.
pub(super) const FIRST: u32 = 1 << 1 | 1 << 5;

impl Neighbours {
    /// The neighbours of voxel `x` of a row.
    #[inline(always)]
    pub(super) fn of(row: &[u32], around: &Around<'_>, x: usize) -> Self {
        let at = BORDER + x;
        let four = |row: &[u32]| row[at - 1..].first_chunk::<4>().copied().unwrap_or([0; 4]);
        Self {
            rows: [four(around.up), four(around.back), four(around.back_up), four(around.back_down)],
            others: [row[at - 2], around.up_2[at], around.back_2[at], row[at - 1]],
        }
    }

    /// Bit mask of the neighbours that have `label`.
    #[inline(always)]
    pub(super) fn mask_of(&self, label: u32) -> u32 {
        let rows = equal_mask(&self.rows, &[[label; 4]; 4]);
        // The last labels of the third and the fourth row do not belong to the context, so they move to bits 17 and 18.
        let rows = rows & 0x7FF | rows >> 1 & 0x3800 | (rows & 0x800) << 6 | (rows & 0x8000) << 3;
        let [a, b, c, d] = self.others.map(|v| u32::from(v == label));
        rows | a << 14 | b << 15 | c << 16 | d << 19
    }

    /// The labels in the order of their mask bits.
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
            let near = Neighbours {
                rows: std::array::from_fn(|i| std::array::from_fn(|j| label(4 * i + j))),
                others: std::array::from_fn(|i| label(16 + i)),
            };
            let naive = near.in_order().iter().enumerate().fold(0, |m, (i, &v)| m | u32::from(v == 1) << i);
            assert_eq!(near.mask_of(1), naive, "{near:?}");
        }
    }
}
