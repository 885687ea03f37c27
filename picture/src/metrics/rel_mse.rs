//! Relative mean squared error.

use crate::image::Image;

/// Keeps pixels near black from deciding the mean: a reference of 0.1 counts half of what pure relative error would make of it.
/// The form is that of Rousselle, Knaus, Zwicker 2011, *Adaptive Sampling and Reconstruction using Greedy Error Minimization*;
/// 0.01 is the constant of most renderer comparisons since.
pub const EPSILON: f64 = 0.01;

/// Mean over pixels and channels of (a − b)² / (b² + 0.01), scene-linear; `b` is the reference.
pub fn rel_mse(a: &Image, b: &Image) -> f64 {
    let sum: f64 = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .flat_map(|(a, b)| a.iter().zip(b))
        .map(|(&a, &b)| {
            let (a, b) = (f64::from(a), f64::from(b));
            (a - b).powi(2) / (b * b + EPSILON)
        })
        .sum();
    sum / (3 * a.pixels.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let a = Image::new(2, 1, vec![[1.0, 0.0, 3.0], [0.0; 3]]);
        let b = Image::new(2, 1, vec![[1.0, 0.1, 2.0], [0.0; 3]]);
        // Channel 1: 0.01 / 0.02; channel 2: 1 / 4.01; six values.
        let expected = (0.5 + 1.0 / 4.01) / 6.0;
        // 0.1 is not exact in f32: 1.5e-8 relative.
        assert!((rel_mse(&a, &b) - expected).abs() < 1e-7);
        assert_ne!(rel_mse(&a, &b), rel_mse(&b, &a), "the reference is the second picture");
    }
}
