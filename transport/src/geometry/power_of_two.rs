//! Scaling by powers of two, which is exact.

use glam::DVec3;

/// Smallest scaled direction component whose reciprocal is finite in f64.
pub const SMALLEST: f64 = f64::MIN_POSITIVE;

/// Range of largest components that one step can scale: 2ᵏ and 2⁻ᵏ must be normal numbers.
pub const MODERATE: std::ops::Range<f64> = f64::from_bits(23 << 52)..f64::from_bits(2023 << 52);

/// The vector times 2⁻ᵏ with its largest component within [1, 2), and k. `None` for zero and for vectors that are not finite.
pub fn scaled(v: DVec3) -> Option<(DVec3, i32)> {
    let largest = v.abs().max_element();
    // A sum that is NaN is in no range.
    if !(largest >= MODERATE.start && v.abs().element_sum() < MODERATE.end) {
        return scaled_extreme(v);
    }
    let k = exponent(largest);
    Some((v * exp2(-k), k))
}

/// [`scaled`] of any vector, in more steps.
#[cold]
pub fn scaled_extreme(v: DVec3) -> Option<(DVec3, i32)> {
    let largest = v.abs().max_element();
    if !v.is_finite() || largest == 0.0 {
        return None;
    }
    // A subnormal length is scaled up first, because its exponent field is 0.
    let (v, largest, lift) =
        if largest < SMALLEST { (v * exp2(600), largest * exp2(600), 600) } else { (v, largest, 0) };
    let k = exponent(largest);
    // In two steps: 2⁻ᵏ itself may not be representable.
    let half = k / 2;
    let v = v * exp2(-half) * exp2(half - k);
    Some((v, k - lift))
}

/// The exponent k of a normal number in [2ᵏ, 2ᵏ⁺¹).
#[inline(always)]
pub fn exponent(v: f64) -> i32 {
    (v.to_bits() >> 52) as i32 - 1023
}

/// 2ᵏ, with k clamped to the exponents of normal numbers.
#[inline(always)]
pub fn exp2(k: i32) -> f64 {
    f64::from_bits(((k.clamp(-1022, 1023) + 1023) as u64) << 52)
}
