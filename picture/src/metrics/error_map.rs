//! A map that shows where two pictures differ.

use super::display::display_from_linear;
use super::flip::flip_map;
use crate::image::Image;

/// Colours of errors 0, ¼, ½, ¾, 1 (sRGB-encoded): black over violet and orange to a pale yellow, lightness rising evenly, so that
/// it reads the same in grey and for colour-blind eyes.
const RAMP: [[f64; 3]; 5] =
    [[0.0, 0.0, 0.0], [0.30, 0.07, 0.48], [0.72, 0.20, 0.42], [0.98, 0.55, 0.26], [0.99, 0.98, 0.78]];

/// FLIP of every pixel of two scene-linear pictures as a colour, sRGB-encoded: black where no difference is visible.
#[must_use]
pub fn error_map(a: &Image, b: &Image) -> Image {
    let map = flip_map(&display_from_linear(a), &display_from_linear(b));
    let pixels = map.iter().map(|&error| color_of(error)).collect();
    Image::new(a.width, a.height, pixels)
}

fn color_of(error: f64) -> [f32; 3] {
    let at = error.clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let left = (at as usize).min(RAMP.len() - 2);
    std::array::from_fn(|c| {
        let (from, to) = (RAMP[left][c], RAMP[left + 1][c]);
        (from + (to - from) * (at - left as f64)) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::display::linear_from_srgb;

    #[test]
    fn larger_errors_are_lighter() {
        let luminance = |e: f64| {
            let c = color_of(e).map(|v| linear_from_srgb(f64::from(v)));
            0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
        };
        assert_eq!(color_of(0.0), [0.0; 3]);
        assert!((1..=100).all(|i| luminance(f64::from(i) / 100.0) > luminance(f64::from(i - 1) / 100.0)));
    }
}
