//! A direction in a word of 32 bits: the sphere, laid on an octahedron and unfolded into a square.
//!
//! Cigolle et al. 2014, *A Survey of Efficient Representations for Independent Unit Vectors* (JCGT 3.2), §3.3:
//!
//! ```text
//! bits  0..16   x, a whole number from −32767 to 32767, over 32767
//! bits 16..32   y
//! word  8000 8000   FLAT: no direction, but the surface's own (−32768 stands in no other word)
//!
//!      y                 upper half: (x, y, z) / (|x| + |y| + |z|), z left out
//!    ╱ │ ╲               lower half: folded outward, (1 − |y|, 1 − |x|) with the signs of x and y
//!  ╱───┼───╲ x
//!   ╲  │  ╱
//! ```
//! A direction is off by less than 7·10⁻⁵ rad, as a test has it: 256 times less than what 8 bits of a picture can show.

/// No direction, but the surface's own.
pub const FLAT: u32 = 0x8000_8000;

const MOST: f64 = 32767.0;

/// The word of a direction of length 1.
pub fn encode(n: [f64; 3]) -> u32 {
    let sum = n[0].abs() + n[1].abs() + n[2].abs();
    let (x, y) = (n[0] / sum, n[1] / sum);
    let folded = |u: f64, v: f64| (1.0 - v.abs()).copysign(u);
    let (x, y) = if n[2] < 0.0 { (folded(x, y), folded(y, x)) } else { (x, y) };
    let part = |v: f64| u32::from((v.clamp(-1.0, 1.0) * MOST).round() as i16 as u16);
    part(x) | part(y) << 16
}

/// The direction of a word, of a length from 1/√3 to 1; of [`FLAT`] a meaningless one.
#[inline]
pub fn decode(word: u32) -> [f32; 3] {
    let part = |bits: u32| f32::from(bits as u16 as i16) / MOST as f32;
    let (x, y) = (part(word), part(word >> 16));
    let z = 1.0 - x.abs() - y.abs();
    // Below, what is missing to 1 is folded back.
    let missing = (-z).max(0.0);
    let back = |v: f32| if v >= 0.0 { v - missing } else { v + missing };
    [back(x), back(y), z]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angle between a direction and what comes back of it.
    fn error(n: [f64; 3]) -> f64 {
        let length = n.iter().map(|v| v * v).sum::<f64>().sqrt();
        let n = n.map(|v| v / length);
        let back = decode(encode(n)).map(f64::from);
        let cross = [0, 1, 2].map(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            n[j] * back[k] - n[k] * back[j]
        });
        let dot = n.iter().zip(back).map(|(a, b)| a * b).sum::<f64>();
        cross.iter().map(|v| v * v).sum::<f64>().sqrt().atan2(dot)
    }

    #[test]
    fn directions_come_back() {
        let mut worst = 0.0f64;
        for i in 0..200_000 {
            // Spiral over the whole sphere.
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 200_000.0;
            let (s, c) = (f64::from(i) * 2.399_963).sin_cos();
            let r = (1.0 - z * z).sqrt();
            worst = worst.max(error([r * c, r * s, z]));
        }
        assert!(worst < 7e-5 && worst > 2e-5, "{worst}");
        // Axes, and the edges of the fold, exactly or nearly.
        for n in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]] {
            assert!(error(n) < 1e-12, "{n:?}");
        }
        for n in [[1.0, 1.0, -0.0], [-1.0, 1.0, 1e-9], [-1.0, -1.0, -1e-9], [1e-9, -1e-9, -1.0]] {
            assert!(error(n) < 7e-5 && encode(n) != FLAT, "{n:?}");
        }
    }
}
