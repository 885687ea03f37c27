//! Converts scene-linear values to display values, and back.

use crate::image::Image;

/// The sRGB encoding of a linear value in [0, 1] (IEC 61966-2-1).
pub fn srgb_from_linear(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear value of an sRGB-encoded one in [0, 1] (IEC 61966-2-1).
pub fn linear_from_srgb(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// A scene-linear picture as a screen shows it: clamped to [0, 1], sRGB-encoded.
#[must_use]
pub fn display_from_linear(picture: &Image) -> Image {
    picture.map(|p| p.map(|v| srgb_from_linear(f64::from(v).clamp(0.0, 1.0)) as f32))
}

/// The scene-linear picture that a screen shows as this sRGB-encoded one.
#[must_use]
pub fn linear_from_display(encoded: &Image) -> Image {
    encoded.map(|p| p.map(|v| linear_from_srgb(f64::from(v).clamp(0.0, 1.0)) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_curves_are_inverse_and_meet_the_ends() {
        assert_eq!((srgb_from_linear(0.0), srgb_from_linear(1.0) as f32), (0.0, 1.0));
        for i in 0..=1000 {
            let v = f64::from(i) / 1000.0;
            // The standard's two rounded thresholds leave a step of 4e-8 at the joint of the pieces.
            assert!((linear_from_srgb(srgb_from_linear(v)) - v).abs() < 1e-7, "{v}");
        }
        // Middle grey, a value that every table of the curve lists: linear 0.2140 ↔ encoded 0.5.
        assert!((linear_from_srgb(0.5) - 0.214_041).abs() < 1e-6);
    }
}
