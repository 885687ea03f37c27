//! View transforms: from scene-linear light to display values.
//!
//! ```text
//! standard   clamp to [0, 1] ─► the sRGB curve                                                          exact
//! filmic     curve(log2 linear), channel by channel                                                     like Blender's *Filmic*
//! agx        mix ─► curve(log2) ─► power ─► mix ─► root                                                 like Blender's *AgX*
//! ```
//! The last two are **approximations**, fitted to the results of Blender 5.0.1 for 24,513 colours (`tests/view_transforms`); Blender itself
//! uses 3D tables. In steps of an 8 bit channel they are off by
//!
//! | | greys, most | ordinary colours: mean, 99 %, most | saturated colours: mean, 99 %, most |
//! |---|---|---|---|
//! | filmic | 0.1 | 0.00, 0.0, 0.1 | 0.46, 9.5, 174 |
//! | agx | 0.7 | 0.25, 2.1, 7.5 | 1.21, 8.3, 26 |
//!
//! where *ordinary* colours have channels within a factor of five of one another, and *saturated* ones are any. Filmic's 174 occurs where
//! Blender turns light that is bright in only one channel to white, which a curve per channel cannot do.
//!
//! The **form** of both is that of Troy Sobotka, the author of both transforms: a logarithm of base 2 between two limits, a curve, and for
//! AgX a mixing of channels before and its inverse after. The numbers come from a least-squares fit (`tests/view_transforms/fit.py`), not
//! from anyone's tables.

use pumice_scene::ViewTransform;

use crate::metrics::display::srgb_from_linear;

/// Distance between the knots of a curve in stops.
const STEP_STOPS: f64 = 0.5;

/// A curve of the base 2 logarithm: its lowest knot, and the knots.
struct Curve {
    low_stops: f64,
    knots: &'static [f64],
}

const FILMIC: Curve = Curve {
    low_stops: -12.5,
    knots: &[
        0.00001, 0.00177, 0.00418, 0.00719, 0.01102, 0.01586, 0.02199, 0.0297, 0.03939, 0.05151, 0.0666,
        0.08526, 0.10816, 0.136, 0.16944, 0.20902, 0.25509, 0.30762, 0.36616, 0.42968, 0.49662, 0.56422,
        0.63102, 0.69496, 0.75416, 0.80724, 0.85337, 0.89227, 0.9241, 0.94938, 0.96881, 0.98316, 0.99319,
        0.99953, 1.0,
    ],
};

const AGX: Curve = Curve {
    low_stops: -11.75,
    knots: &[
        0.00001, 0.00042, 0.00107, 0.00227, 0.00429, 0.00751, 0.01252, 0.02014, 0.03159, 0.04819, 0.06804,
        0.09124, 0.11853, 0.15076, 0.18891, 0.2341, 0.28738, 0.34941, 0.41987, 0.49532, 0.56809, 0.63464,
        0.6942, 0.74684, 0.79306, 0.8335, 0.86884, 0.8998, 0.92689, 0.95091, 0.97148, 0.99122, 1.0,
    ],
};

/// Mixes channels before AgX's curve; rows add up to 1, so that greys stay grey.
const AGX_BEFORE: [[f64; 3]; 3] =
    [[0.6167, 0.2976, 0.0857], [0.1075, 0.7812, 0.1113], [0.0857, 0.1734, 0.7409]];

/// Mixes channels after AgX's curve; rows add up to 1, so that greys stay grey.
const AGX_AFTER: [[f64; 3]; 3] =
    [[1.6449, -0.5168, -0.1281], [-0.1667, 1.1938, -0.0271], [-0.1547, -0.2357, 1.3904]];

/// Exponent to which display values are raised while channels are mixed after AgX's curve.
const AGX_POWER: f64 = 2.1288;

impl Curve {
    /// The curve at a linear value, from 0 to 1: Catmull-Rom between knots, extended in a straight line at the ends; 0 for NaN.
    fn at(&self, linear: f64) -> f64 {
        let k = |i: usize| self.knots[i];
        let last = self.knots.len() - 1;
        // If one argument is NaN, `max` returns the other.
        let place =
            ((linear.max(f64::MIN_POSITIVE).log2() - self.low_stops) / STEP_STOPS).clamp(0.0, last as f64);
        let i = (place as usize).min(last - 1);
        let u = place - i as f64;
        let (b, c) = (k(i), k(i + 1));
        let a = if i == 0 { 2.0 * b - c } else { k(i - 1) };
        let d = if i + 1 == last { 2.0 * c - b } else { k(i + 2) };
        let bend = 2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a);
        (b + 0.5 * u * (c - a + u * bend)).clamp(0.0, 1.0)
    }
}

fn mixed(by: &[[f64; 3]; 3], color: [f64; 3]) -> [f64; 3] {
    by.map(|row| row[0] * color[0] + row[1] * color[1] + row[2] * color[2])
}

/// The display value of a scene-linear colour for an sRGB screen, each channel 0 to 1; NaN becomes 0.
pub fn shown(view: ViewTransform, linear: [f32; 3]) -> [f64; 3] {
    // The upper bound is beyond the curves' ends, and keeps infinities from becoming NaN when they are mixed.
    let linear = linear.map(|c| if c.is_nan() { 0.0 } else { f64::from(c).clamp(0.0, 1e9) });
    match view {
        ViewTransform::Standard => linear.map(|c| srgb_from_linear(c.min(1.0))),
        ViewTransform::Filmic => linear.map(|c| FILMIC.at(c)),
        ViewTransform::Agx => {
            let curved = mixed(&AGX_BEFORE, linear).map(|c| AGX.at(c).powf(AGX_POWER));
            mixed(&AGX_AFTER, curved).map(|c| c.max(0.0).powf(1.0 / AGX_POWER).min(1.0))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const APPROXIMATE: [ViewTransform; 2] = [ViewTransform::Filmic, ViewTransform::Agx];

    #[test]
    fn matrices_keep_greys() {
        for row in AGX_BEFORE.iter().chain(&AGX_AFTER) {
            // Four digits each.
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1.1e-4, "{row:?}");
        }
    }

    /// Roundings of a dozen operations on numbers up to 2, each 2⁻⁵³.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn brighter_is_never_darker_and_all_is_within_the_screen() {
        for view in APPROXIMATE {
            let greys = (0..4000).map(|i| (f64::from(i) / 100.0 - 20.0).exp2() as f32);
            let shown: Vec<f64> = greys.map(|g| shown(view, [g; 3])[1]).collect();
            // A fortieth of a step of 8 bits: Filmic's last half stop overshoots white by less.
            let falls = shown.windows(2).filter(|w| w[1] < w[0] - 1e-4).count();
            assert!(falls == 0 && shown[0] < 1e-4 && shown[3999] > 1.0 - ROUNDING, "{view:?}: {falls}");
        }
    }

    #[test]
    fn no_value_is_anything_but_a_number() {
        let odd = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            -1.0,
            0.0,
            -0.0,
            f32::MIN_POSITIVE / 4.0,
            f32::MAX,
            1.0,
        ];
        for view in [ViewTransform::Standard, ViewTransform::Filmic, ViewTransform::Agx] {
            for (r, g, b) in odd.iter().flat_map(|r| odd.iter().flat_map(move |g| odd.map(|b| (*r, *g, b)))) {
                let got = shown(view, [r, g, b]);
                assert!(got.iter().all(|c| (0.0..=1.0).contains(c)), "{view:?} of {r} {g} {b}: {got:?}");
            }
            let white = shown(view, [f32::INFINITY; 3]);
            assert!(
                shown(view, [f32::NAN; 3])[0] < 1e-4 && white.iter().all(|c| *c > 1.0 - ROUNDING),
                "{white:?}"
            );
        }
    }
}
