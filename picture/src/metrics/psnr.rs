//! Peak signal-to-noise ratio.

use crate::image::Image;

/// 10 log₁₀(1 / MSE) in dB over pixels and channels of two display pictures ([`super::display`]), so the peak is 1. Infinite
/// where they are equal.
pub fn psnr(a_display: &Image, b_display: &Image) -> f64 {
    let sum: f64 = a_display
        .pixels
        .iter()
        .zip(&b_display.pixels)
        .flat_map(|(a, b)| a.iter().zip(b))
        .map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2))
        .sum();
    -10.0 * (sum / (3 * a_display.pixels.len()) as f64).log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let a = Image::new(1, 1, vec![[0.5; 3]]);
        let b = Image::new(1, 1, vec![[0.25; 3]]);
        assert!((psnr(&a, &b) - 12.041_199_826_559_248).abs() < 1e-12); // 20 log₁₀ 4
        assert_eq!(psnr(&a, &a), f64::INFINITY);
    }
}
