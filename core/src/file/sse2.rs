//! Sixteen labels compared with sixteen others, a bit of each: what decoding voxels does more often than anything else.

/// Sixteen labels, four by four as they lie in memory.
pub(super) type Sixteen = [[u32; 4]; 4];

/// Which of them are the same. Every x86-64 processor does it in eight steps, of which the compiler makes forty of its own accord.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn equal(a: &Sixteen, b: &Sixteen) -> u32 {
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
pub(super) fn equal(a: &Sixteen, b: &Sixteen) -> u32 {
    equal_plainly(a, b)
}

#[cfg(any(test, not(target_arch = "x86_64")))]
fn equal_plainly(a: &Sixteen, b: &Sixteen) -> u32 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.enumerate().fold(0, |bits, (i, (a, b))| bits | u32::from(a == b) << i)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_is_as_it_is_told_plainly() {
        for seed in 0..1000u32 {
            let label = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9E37_79B1).rotate_left(seed % 32);
            // Two labels that differ in one bit, in each of the 32 places.
            let sixteen = |from: usize| -> Sixteen {
                std::array::from_fn(|i| std::array::from_fn(|j| (label(from + 4 * i + j) & 1) << (seed % 32)))
            };
            let (a, b) = (sixteen(0), sixteen(16));
            assert_eq!(equal(&a, &b), equal_plainly(&a, &b), "{a:?} {b:?}");
            assert_eq!(equal(&a, &a), 0xFFFF);
        }
    }
}
