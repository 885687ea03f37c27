//! Structural similarity: Wang, Bovik, Sheikh, Simoncelli 2004, *Image Quality Assessment: From Error Visibility to Structural
//! Similarity*.

use super::gaussian::{Border, Plane, gaussian, normalised};
use crate::image::Image;

/// Radius of the 11 × 11 window (section III.C).
const RADIUS: usize = 5;
/// Standard deviation of the window in pixels (section III.C).
const SIGMA: f64 = 1.5;
/// (K₁ L)² and (K₂ L)² with K₁ = 0.01, K₂ = 0.03 and dynamic range L = 1 (eqs. 7 and 10).
const C1: f64 = 0.0001;
const C2: f64 = 0.0009;

/// Mean of the SSIM index (eq. 13) over all windows that lie wholly within the picture, averaged over the three channels of two
/// display pictures ([`super::display`]); 1 where they are equal.
///
/// A picture with fewer than 11 pixels across or down has no such window: there the picture is mirrored at its border and every
/// pixel has a window.
pub fn ssim(a_display: &Image, b_display: &Image) -> f64 {
    (0..3).map(|c| ssim_of_channel(&channel(a_display, c), &channel(b_display, c))).sum::<f64>() / 3.0
}

fn channel(picture: &Image, c: usize) -> Plane {
    let values = picture.pixels.iter().map(|p| f64::from(p[c])).collect();
    Plane { width: picture.width, height: picture.height, values }
}

fn ssim_of_channel(a: &Plane, b: &Plane) -> f64 {
    let window = normalised(&gaussian(RADIUS, SIGMA));
    let mean = |p: &Plane| p.filtered(&window, &window, Border::Mirror);
    let (mu_a, mu_b) = (mean(a), mean(b));
    let (aa, bb, ab) =
        (mean(&a.zip(a, |x, y| x * y)), mean(&b.zip(b, |x, y| x * y)), mean(&a.zip(b, |x, y| x * y)));

    let whole = a.width > 2 * RADIUS && a.height > 2 * RADIUS;
    let margin = if whole { RADIUS } else { 0 };
    let (mut sum, mut windows) = (0.0, 0);
    for y in margin..a.height - margin {
        for x in margin..a.width - margin {
            let i = y * a.width + x;
            let (ma, mb) = (mu_a.values[i], mu_b.values[i]);
            let (var_a, var_b, cov) =
                (aa.values[i] - ma * ma, bb.values[i] - mb * mb, ab.values[i] - ma * mb);
            sum +=
                (2.0 * ma * mb + C1) * (2.0 * cov + C2) / ((ma * ma + mb * mb + C1) * (var_a + var_b + C2));
            windows += 1;
        }
    }
    sum / f64::from(windows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_pictures_compare_by_their_means_alone() {
        let flat = |v: f32, n| Image::new(n, n, vec![[v; 3]; n * n]);
        for n in [1, 5, 11, 20] {
            // Eq. 6 with no variance: (2·½·¼ + C₁) / (¼ + 1/16 + C₁).
            let expected = (0.25 + C1) / (0.3125 + C1);
            assert!((ssim(&flat(0.5, n), &flat(0.25, n)) - expected).abs() < 1e-12, "{n}");
            assert_eq!(ssim(&flat(0.5, n), &flat(0.5, n)), 1.0, "{n}");
        }
    }
}
