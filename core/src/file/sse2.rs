//! Compares sixteen labels with sixteen others by SSE2 instructions. This is the most frequent operation of the voxel decoder.

/// Sixteen labels, as four vectors of four.
pub(super) type Labels16 = [[u32; 4]; 4];

/// A mask whose bit i is set where `a` and `b` have the same label at i. SSE2, which every x86-64 processor has, takes eight instructions;
/// the compiled scalar form takes forty.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn equal_mask(a: &Labels16, b: &Labels16) -> u32 {
    use std::arch::x86_64::{_mm_cmpeq_epi32, _mm_movemask_epi8, _mm_packs_epi16, _mm_packs_epi32};
    let four = |i: usize| (bytemuck::cast(a[i]), bytemuck::cast(b[i]));
    let pairs = [four(0), four(1), four(2), four(3)];
    // SAFETY: SSE2 is part of x86-64.
    #[allow(unsafe_code)]
    let bits = unsafe {
        let [a, b, c, d] = pairs.map(|(a, b)| _mm_cmpeq_epi32(a, b));
        _mm_movemask_epi8(_mm_packs_epi16(_mm_packs_epi32(a, b), _mm_packs_epi32(c, d)))
    };
    bits as u32
}

#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
pub(super) fn equal_mask(a: &Labels16, b: &Labels16) -> u32 {
    equal_mask_scalar(a, b)
}

#[cfg(any(test, not(target_arch = "x86_64")))]
fn equal_mask_scalar(a: &Labels16, b: &Labels16) -> u32 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.enumerate().fold(0, |bits, (i, (a, b))| bits | u32::from(a == b) << i)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_scalar() {
        for seed in 0..1000u32 {
            let label = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9E37_79B1).rotate_left(seed % 32);
            // Labels that differ in one bit only, for each of the 32 bits.
            let sixteen = |from: usize| -> Labels16 {
                std::array::from_fn(|i| std::array::from_fn(|j| (label(from + 4 * i + j) & 1) << (seed % 32)))
            };
            let (a, b) = (sixteen(0), sixteen(16));
            assert_eq!(equal_mask(&a, &b), equal_mask_scalar(&a, &b), "{a:?} {b:?}");
            assert_eq!(equal_mask(&a, &a), 0xFFFF);
        }
    }
}
