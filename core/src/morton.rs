//! Morton codes: three 21-bit coordinates interleaved bit by bit, x lowest.
//!
//! Cells, boxes and chunks are sorted by this code, so that neighbours in space are mostly neighbours in memory. A code shifted right by
//! 3·k bits is the code of the enclosing cube of side 2ᵏ.

/// Bits of one coordinate.
pub const AXIS_BITS: u32 = 21;

/// Spreads 21 bits so that two zero bits follow each, with the usual magic masks.
#[inline]
fn spread(v: u32) -> u64 {
    let mut v = u64::from(v) & 0x1F_FFFF;
    v = (v | v << 32) & 0x001F_0000_0000_FFFF;
    v = (v | v << 16) & 0x001F_0000_FF00_00FF;
    v = (v | v << 8) & 0x100F_00F0_0F00_F00F;
    v = (v | v << 4) & 0x10C3_0C30_C30C_30C3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// The inverse of [`spread`].
#[inline]
fn gather(mut v: u64) -> u32 {
    v &= 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10C3_0C30_C30C_30C3;
    v = (v | v >> 4) & 0x100F_00F0_0F00_F00F;
    v = (v | v >> 8) & 0x001F_0000_FF00_00FF;
    v = (v | v >> 16) & 0x001F_0000_0000_FFFF;
    ((v | v >> 32) & 0x1F_FFFF) as u32
}

/// Morton code of a point; each coordinate must be below 2²¹.
#[inline]
pub fn encode(p: [u32; 3]) -> u64 {
    debug_assert!(p.iter().all(|&c| c >> AXIS_BITS == 0));
    spread(p[0]) | spread(p[1]) << 1 | spread(p[2]) << 2
}

/// The point that a code stands for.
#[inline]
pub fn decode(code: u64) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Morton code bit by bit, from the definition.
    fn naive(p: [u32; 3]) -> u64 {
        (0..63).map(|b| u64::from(p[b % 3] >> (b / 3) & 1) << b).sum()
    }

    #[test]
    fn matches_naive() {
        let max = (1 << AXIS_BITS) - 1;
        let mut s = 1u64;
        for i in 0..2000u32 {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let r = |shift: u32| (s >> shift) as u32 & max;
            let p = if i == 0 { [max; 3] } else { [r(1), r(20), r(41)] };
            assert_eq!(encode(p), naive(p), "{p:?}");
            assert_eq!(decode(encode(p)), p);
        }
    }
}
