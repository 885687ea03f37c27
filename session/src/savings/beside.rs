//! Compares a picture with another of the same samples. Every backend draws the same samples, so two pictures differ only by roundings,
//! and by the few paths that roundings send another way. This is a sharper comparison than a statistical test of two independent
//! estimates, because noise hides nothing.

use serde::Serialize;

/// Values that differ by more than this share of the larger of the value and the picture's mean are apart: 1,024 products in f32,
/// the longest of all that are drawn here, may differ by 6.2e-5. Measured on Mesa's llvmpipe: at most 3.7e-6, of rough glass.
pub const ROUNDING: f64 = 1e-4;
/// Share of values that may be apart. A random choice falls the other way with a probability below 2⁻¹⁴
/// (`vulkan-renderer/tests/radiance`), and a pixel of the longest picture here makes 128 × 3 choices: one pixel in 40. With another seed,
/// or an albedo off by 2 %, all values are apart.
const MOST_APART: f64 = 0.05;

/// The difference of a picture from another of the same samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Beside {
    /// Largest difference of a value, as a share of the larger of the value and the picture's mean.
    pub worst: f64,
    /// Share of values that differ by more than roundings.
    pub apart: f64,
}

impl Beside {
    /// The difference of `found` from `expected`.
    pub fn between(found: &[[f32; 3]], expected: &[[f32; 3]]) -> Self {
        let count = expected.as_flattened().len().max(1) as f64;
        let mean = expected.as_flattened().iter().map(|v| f64::from(*v)).sum::<f64>() / count;
        let pairs = found.as_flattened().iter().zip(expected.as_flattened());
        let off = pairs.map(|(&a, &b)| match f64::from(a) - f64::from(b) {
            0.0 => 0.0,
            difference => difference.abs() / f64::from(b).abs().max(mean.abs()),
        });
        // NaN counts as apart.
        let (mut worst, mut apart) = (0.0f64, 0.0);
        for off in off {
            worst = if off <= worst { worst } else { off };
            apart += if off <= ROUNDING { 0.0 } else { 1.0 / count };
        }
        Self { worst, apart }
    }

    /// The larger difference of two pictures of one case, field by field.
    pub fn worse(self, other: Self) -> Self {
        Self { worst: self.worst.max(other.worst), apart: self.apart.max(other.apart) }
    }

    /// Whether at most the allowed share of values is apart.
    pub fn holds(&self) -> bool {
        self.apart <= MOST_APART
    }
}
