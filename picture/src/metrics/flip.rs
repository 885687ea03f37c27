//! LDR-FLIP: the difference that a person sees when flipping between two pictures. Andersson, Nilsson, Akenine-Möller, Oskarsson,
//! Åström, Fairchild 2020, *FLIP: A Difference Evaluator for Alternating Images* (sections named below are this paper's).
//!
//! ```text
//! display RGB ─► YCxCz ─► eye's contrast filter ─► RGB, clamped ─► L*a*b*, Hunt ─► HyAB ─► [0, 1] = ΔEc
//!            └─► Y ─► edge and point filters ─► largest difference of their strengths ─► [0, 1] = ΔEf
//! ΔE = ΔEc ^ (1 − ΔEf)
//! ```
//! Pictures are viewed at [`PIXELS_PER_DEGREE`]. Beyond the border lies the nearest pixel.

use std::f64::consts::PI;

use super::display::linear_from_srgb;
use super::gaussian::{Border, Plane, gaussian, normalised};
use crate::image::Image;

/// Pixels in one degree of the observer's field: 0.7 m from a 0.7 m wide screen of 3840 pixels (the paper's default).
pub const PIXELS_PER_DEGREE: f64 = 0.7 * 3840.0 / 0.7 * PI / 180.0;

/// Exponent q_c and the knee (p_c, p_t) of the error's remapping (section 4.1).
const COLOR_EXPONENT: f64 = 0.7;
const KNEE_AT: f64 = 0.4;
const KNEE_TO: f64 = 0.95;
/// Width in degrees of the features that an eye detects, w (section 4.2).
const FEATURE_WIDTH_DEG: f64 = 0.082;
/// Exponent q_f of the feature difference (section 4.2).
const FEATURE_EXPONENT: f64 = 0.5;

/// FLIP of every pixel of two display pictures ([`super::display`]): 0 no difference, 1 the greatest.
pub fn flip_map(test_display: &Image, reference_display: &Image) -> Vec<f64> {
    let space = ColorSpace::new();
    let [test, reference] = [test_display, reference_display].map(|p| space.ycxcz_from_display(p));

    let [seen_test, seen_reference] = [&test, &reference].map(|p| space.hunt_lab_as_seen(p));
    let limit = space.greatest_color_error();
    let features = feature_difference(&test[0], &reference[0]);
    (0..test_display.pixels.len())
        .map(|i| {
            let color = remapped(hyab(seen_test[i], seen_reference[i]).powf(COLOR_EXPONENT), limit);
            color.powf(1.0 - features[i])
        })
        .collect()
}

/// Mean of [`flip_map`] over pixels.
pub fn mean_flip(map: &[f64]) -> f64 {
    map.iter().sum::<f64>() / map.len() as f64
}

/// Squeezes the error so that [0, p_c·limit] fills [0, p_t] and the rest fills [p_t, 1] (section 4.1).
fn remapped(error: f64, limit: f64) -> f64 {
    let knee = KNEE_AT * limit;
    if error < knee {
        KNEE_TO / knee * error
    } else {
        KNEE_TO + (error - knee) / (limit - knee) * (1.0 - KNEE_TO)
    }
}

/// City-block distance in lightness plus Euclidean distance in colour (Abasi et al. 2020; section 4.1).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// sRGB's primaries as matrices, and its white.
struct ColorSpace {
    xyz_from_rgb: [[f64; 3]; 3],
    rgb_from_xyz: [[f64; 3]; 3],
    white: [f64; 3],
}

impl ColorSpace {
    /// From the chromaticities of Rec. 709 and D65: each column is a primary's XYZ, scaled so that RGB (1, 1, 1) is white of Y = 1.
    fn new() -> Self {
        let xyz = |[x, y]: [f64; 2]| [x / y, 1.0, (1.0 - x - y) / y];
        let primaries = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]].map(xyz);
        let white = xyz([0.3127, 0.3290]);
        let unscaled: [[f64; 3]; 3] = std::array::from_fn(|r| std::array::from_fn(|c| primaries[c][r]));
        let scale = times(&inverse(&unscaled), white);
        let xyz_from_rgb = unscaled.map(|row| std::array::from_fn(|c| row[c] * scale[c]));
        Self { xyz_from_rgb, rgb_from_xyz: inverse(&xyz_from_rgb), white }
    }

    fn ycxcz_from_display(&self, picture: &Image) -> [Plane; 3] {
        let mut planes = [0; 3].map(|_| Plane {
            width: picture.width,
            height: picture.height,
            values: Vec::with_capacity(picture.pixels.len()),
        });
        for pixel in &picture.pixels {
            let rgb = pixel.map(|v| linear_from_srgb(f64::from(v)));
            let xyz = times(&self.xyz_from_rgb, rgb);
            let [x, y, z]: [f64; 3] = std::array::from_fn(|c| xyz[c] / self.white[c]);
            // Section 4.1: a linear opponent space.
            let ycxcz = [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)];
            planes.iter_mut().zip(ycxcz).for_each(|(p, v)| p.values.push(v));
        }
        planes
    }

    fn rgb_from_ycxcz(&self, [luma, cx, cz]: [f64; 3]) -> [f64; 3] {
        let y = (luma + 16.0) / 116.0;
        let relative = [y + cx / 500.0, y, y - cz / 200.0];
        times(&self.rgb_from_xyz, std::array::from_fn(|c| relative[c] * self.white[c]))
    }

    /// What the eye resolves of a picture, in L*a*b* with the Hunt effect: colour counts less where it is dark (section 4.1).
    fn hunt_lab_as_seen(&self, [luma, cx, cz]: &[Plane; 3]) -> Vec<[f64; 3]> {
        let luma = contrast_filtered(luma, &[(1.0, 0.0047)]);
        let cx = contrast_filtered(cx, &[(1.0, 0.0053)]);
        let cz = contrast_filtered(cz, &[(34.1, 0.04), (13.5, 0.025)]);
        (0..luma.values.len())
            .map(|i| {
                let rgb = self.rgb_from_ycxcz([luma.values[i], cx.values[i], cz.values[i]]);
                self.hunt_lab(rgb.map(|v| v.clamp(0.0, 1.0)))
            })
            .collect()
    }

    fn hunt_lab(&self, rgb: [f64; 3]) -> [f64; 3] {
        let xyz = times(&self.xyz_from_rgb, rgb);
        let [x, y, z]: [f64; 3] = std::array::from_fn(|c| lab_curve(xyz[c] / self.white[c]));
        let lightness = 116.0 * y - 16.0;
        let hunt = 0.01 * lightness;
        [lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z)]
    }

    /// The largest error that two colours of the screen can have: between green and blue (section 4.1).
    fn greatest_color_error(&self) -> f64 {
        hyab(self.hunt_lab([0.0, 1.0, 0.0]), self.hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT)
    }
}

/// CIE 1976 L*a*b*: a cube root with a straight piece near black.
fn lab_curve(t: f64) -> f64 {
    const DELTA: f64 = 6.0 / 29.0;
    if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}

/// Filters one channel with the eye's contrast sensitivity, given as a sum of Gaussians with weight a and width b (section 4.1,
/// table 1): a √(π/b) exp(−π² d² / b), d in degrees.
fn contrast_filtered(plane: &Plane, terms: &[(f64, f64)]) -> Plane {
    // Three standard deviations of the widest Gaussian of the table, for all channels.
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as usize;
    let kernels: Vec<(f64, Vec<f64>)> = terms
        .iter()
        .map(|&(a, b)| {
            let sigma_px = (b / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE;
            (a * (PI / b).sqrt(), gaussian(radius, sigma_px))
        })
        .collect();
    let total: f64 = kernels.iter().map(|(weight, k)| weight * k.iter().sum::<f64>().powi(2)).sum();

    let mut result =
        Plane { width: plane.width, height: plane.height, values: vec![0.0; plane.values.len()] };
    for (weight, kernel) in kernels {
        let term = plane.filtered(&kernel, &kernel, Border::Clamp);
        result = result.zip(&term, |sum, v| sum + v * weight / total);
    }
    result
}

/// The largest difference in the strength of edges and of points, in [0, 1] (section 4.2).
fn feature_difference(test_luma: &Plane, reference_luma: &Plane) -> Vec<f64> {
    let sigma_px = 0.5 * FEATURE_WIDTH_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma_px).ceil() as usize;
    let smooth = normalised(&gaussian(radius, sigma_px));
    // First and second derivative of the Gaussian; positive weights sum to 1 and negative ones to −1, so that a unit step or a
    // unit dot answers with at most 1 (section 4.2).
    let offsets = || -(radius as isize)..=radius as isize;
    let edge: Vec<f64> = offsets().zip(&smooth).map(|(d, g)| -(d as f64) * g).collect();
    let point: Vec<f64> =
        offsets().zip(&smooth).map(|(d, g)| ((d as f64 / sigma_px).powi(2) - 1.0) * g).collect();

    let strengths = |luma: &Plane| {
        let y = Plane { values: luma.values.iter().map(|v| (v + 16.0) / 116.0).collect(), ..*luma };
        [&edge, &point].map(|derivative| {
            let derivative = balanced(derivative);
            let across = y.filtered(&derivative, &smooth, Border::Clamp);
            let down = y.filtered(&smooth, &derivative, Border::Clamp);
            across.zip(&down, f64::hypot)
        })
    };
    let ([edge_t, point_t], [edge_r, point_r]) = (strengths(test_luma), strengths(reference_luma));
    (0..test_luma.values.len())
        .map(|i| {
            let edges = (edge_t.values[i] - edge_r.values[i]).abs();
            let points = (point_t.values[i] - point_r.values[i]).abs();
            (edges.max(points) / 2f64.sqrt()).powf(FEATURE_EXPONENT).min(1.0)
        })
        .collect()
}

/// The kernel with its positive weights scaled to sum 1 and its negative ones to sum −1.
fn balanced(kernel: &[f64]) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|k| **k > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|k| **k < 0.0).sum::<f64>();
    kernel.iter().map(|&k| if k > 0.0 { k / positive } else { k / negative }).collect()
}

fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Inverse by cofactors.
fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * cofactor(0, c)).sum();
    std::array::from_fn(|r| std::array::from_fn(|c| cofactor(c, r) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_are_srgbs() {
        let space = ColorSpace::new();
        // IEC 61966-2-1 prints four decimals.
        let expected = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        for (row, expected) in space.xyz_from_rgb.iter().zip(expected) {
            for (v, e) in row.iter().zip(expected) {
                assert!((v - e).abs() < 5e-5, "{v} {e}");
            }
        }
        let there_and_back = times(&space.rgb_from_xyz, times(&space.xyz_from_rgb, [0.2, 0.5, 0.9]));
        assert!(there_and_back.iter().zip([0.2, 0.5, 0.9]).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn equal_pictures_differ_by_nothing_and_opposite_ones_by_much() {
        let flat = |v: [f32; 3]| Image::new(9, 7, vec![v; 63]);
        assert!(flip_map(&flat([0.3, 0.6, 0.1]), &flat([0.3, 0.6, 0.1])).iter().all(|&v| v == 0.0));
        // Green against blue is the greatest colour error by definition: exactly 1 up to rounding.
        let map = flip_map(&flat([0.0, 1.0, 0.0]), &flat([0.0, 0.0, 1.0]));
        assert!(map.iter().all(|&v| (v - 1.0).abs() < 1e-9), "{map:?}");
    }
}
