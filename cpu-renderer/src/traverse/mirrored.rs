//! Masks of 4³ parts in a ray's order: counted from the top along the axes on which the ray moves down.
//!
//! [`flipped`](pumice_core::leaves::flipped) mirrors axis by axis, in about thirty operations each, with branches. A mask of 64 bits is 16
//! nibbles, though: mirroring y and z permutes them, and mirroring x replaces each nibble by another. With instructions that permute and
//! look up 16 bytes at once:
//!
//! ```text
//! byte y/2 + 2z holds the nibbles of an even and of an odd y
//! 1. move bytes to their places: y/2 and z mirrored
//! 2. look up the lower nibble of each byte, mirrored along x; put it into the upper half where y is mirrored
//! 3. the same for its upper nibble, put into the other half
//! ```

/// The axes along which a ray moves down: bit a for axis a.
#[derive(Clone, Copy, Debug)]
pub(super) struct Octant(u8);

impl Octant {
    #[inline(always)]
    pub(super) fn new(is_down: impl Fn(usize) -> bool) -> Self {
        Self(u8::from(is_down(0)) | u8::from(is_down(1)) << 1 | u8::from(is_down(2)) << 2)
    }

    /// XOR constant that converts a part's number to the one in the ray's order, and back.
    #[inline(always)]
    pub(super) fn mirror(self) -> u32 {
        let [x, y, z] = [0, 1, 2].map(|a| u32::from(self.0 >> a & 1));
        x * 3 + y * 12 + z * 48
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use wide::mirrored;

#[cfg(target_arch = "x86_64")]
mod wide {
    use std::arch::x86_64::{
        _mm_and_si128, _mm_cvtsi64_si128, _mm_cvtsi128_si64, _mm_loadu_si128, _mm_or_si128, _mm_set1_epi8,
        _mm_shuffle_epi8, _mm_srli_epi64,
    };

    use super::Octant;

    /// Tables for the three steps of an octant.
    #[repr(C)]
    struct Steps {
        bytes: [u8; 16],
        lower: [u8; 16],
        upper: [u8; 16],
    }

    const STEPS: [Steps; 8] = {
        let mut all = [const { Steps { bytes: [0; 16], lower: [0; 16], upper: [0; 16] } }; 8];
        let mut octant = 0;
        while octant < 8 {
            let (down_x, down_y, down_z) = (octant & 1 != 0, octant & 2 != 0, octant & 4 != 0);
            let mut i = 0;
            while i < 16 {
                all[octant].bytes[i] = i as u8 ^ if down_y { 1 } else { 0 } ^ if down_z { 6 } else { 0 };
                let nibble = if down_x { (i as u8).reverse_bits() >> 4 } else { i as u8 };
                let (lower, upper) = if down_y { (4, 0) } else { (0, 4) };
                all[octant].lower[i] = nibble << lower;
                all[octant].upper[i] = nibble << upper;
                i += 1;
            }
            octant += 1;
        }
        all
    };

    /// Same result as [`flipped`](pumice_core::leaves::flipped) for the octant's mirror.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(in super::super) fn mirrored(mask: u64, octant: Octant) -> u64 {
        let Steps { bytes, lower, upper } = &STEPS[usize::from(octant.0 & 7)];
        // SAFETY: 16 bytes are read from arrays of 16.
        #[allow(unsafe_code)]
        let [bytes, lower, upper] =
            [bytes, lower, upper].map(|of| unsafe { _mm_loadu_si128(of.as_ptr().cast()) });
        let nibble = _mm_set1_epi8(15);
        let moved = _mm_shuffle_epi8(_mm_cvtsi64_si128(mask as i64), bytes);
        let lower = _mm_shuffle_epi8(lower, _mm_and_si128(moved, nibble));
        let upper = _mm_shuffle_epi8(upper, _mm_and_si128(_mm_srli_epi64::<4>(moved), nibble));
        _mm_cvtsi128_si64(_mm_or_si128(lower, upper)) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::super::f64x4::each_way;
    use super::super::ray_box_mask::RayBoxMask;
    use super::*;

    /// Part by part: the part with a number has, counted in the ray's order, the mirrored number.
    fn each_part_comes_to_its_place(by: impl RayBoxMask) {
        for o in 0..8u8 {
            let octant = Octant::new(|a| o >> a & 1 != 0);
            for part in 0..64u32 {
                assert_eq!(by.mirrored(1 << part, octant), 1u64 << (part ^ octant.mirror()), "{part}, {o}");
            }
            // Bits are independent of each other.
            let mask = 0x0123_4567_89AB_CDEF_u64;
            let expected = (0..64).filter(|part| mask >> part & 1 != 0);
            let expected = expected.fold(0, |all, part| all | 1u64 << (part ^ octant.mirror()));
            assert_eq!(by.mirrored(mask, octant), expected);
        }
    }

    #[test]
    fn each_part_comes_to_its_place_by_all_ways() {
        each_way!(each_part_comes_to_its_place);
    }
}
