//! All metrics of two pictures at once.

use serde::Serialize;

use super::display::display_from_linear;
use super::flip::{flip_map, mean_flip};
use super::psnr::psnr;
use super::rel_mse::rel_mse;
use super::significance::{Significance, Variance, significance};
use super::ssim::ssim;
use crate::image::Image;

/// The difference of a picture from its reference by every metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// [`super::rel_mse`], scene-linear.
    pub rel_mse: f64,
    /// [`super::psnr`] in dB; infinite (`null` in JSON) where the pictures are equal on a screen.
    pub psnr: f64,
    /// [`super::ssim`].
    pub ssim: f64,
    /// Mean of [`super::flip`].
    pub flip: f64,
    /// [`super::significance`](mod@super::significance), where both pictures' variances are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[serde(rename = "chance")]
    pub significance: Option<Significance>,
}

/// Why two pictures cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompareError {
    /// They differ in size, or are empty.
    #[error("the pictures cannot be compared: {picture} is {}×{} pixels, the reference {}×{}", got[0], got[1], expected[0], expected[1])]
    Size {
        /// Which picture: `the picture` or one of the variances.
        picture: &'static str,
        /// Width and height of the reference.
        expected: [usize; 2],
        /// Width and height of that picture.
        got: [usize; 2],
    },
    /// A pixel is infinite or NaN: this is a fault of the renderer, and a mean over it would be meaningless.
    #[error("{picture} has the value {value} at pixel ({x}, {y}): expected finite numbers")]
    NotFinite {
        /// Which picture.
        picture: &'static str,
        /// Column.
        x: usize,
        /// Row from the top.
        y: usize,
        /// The value.
        value: f32,
    },
    /// The caller cancelled the comparison.
    #[error("cancelled")]
    Cancelled,
}

/// Compares the scene-linear picture `a` with its reference `b`; with both pictures' variances also by chance.
///
/// # Errors
/// When sizes differ, there are no pixels, or a value is not finite; when `cancelled` says so, asked before each metric.
pub fn compare(
    a: &Image,
    b: &Image,
    variances: Option<(Variance<'_>, Variance<'_>)>,
    cancelled: &dyn Fn() -> bool,
) -> Result<Comparison, CompareError> {
    let size = |p: &Image| [p.width, p.height];
    let mut pictures = vec![("the picture", a), ("the reference", b)];
    if let Some((va, vb)) = variances {
        pictures.extend([("the picture's variance", va.of_mean), ("the reference's variance", vb.of_mean)]);
    }
    for (picture, image) in pictures {
        if size(image) != size(b) || image.pixels.is_empty() {
            return Err(CompareError::Size { picture, expected: size(b), got: size(image) });
        }
        let fault = image
            .pixels
            .iter()
            .enumerate()
            .find_map(|(i, p)| p.iter().find(|v| !v.is_finite()).map(|v| (i, *v)));
        if let Some((i, value)) = fault {
            return Err(CompareError::NotFinite { picture, x: i % image.width, y: i / image.width, value });
        }
    }

    let go_on = || if cancelled() { Err(CompareError::Cancelled) } else { Ok(()) };
    go_on()?;
    let (a_display, b_display) = (display_from_linear(a), display_from_linear(b));
    let (rel_mse, psnr) = (rel_mse(a, b), psnr(&a_display, &b_display));
    go_on()?;
    let ssim = ssim(&a_display, &b_display);
    go_on()?;
    let flip = mean_flip(&flip_map(&a_display, &b_display));
    go_on()?;
    Ok(Comparison {
        rel_mse,
        psnr,
        ssim,
        flip,
        significance: variances.map(|(va, vb)| significance(a, b, va, vb)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_compared_is_named() {
        let a = Image::new(2, 1, vec![[0.5; 3]; 2]);
        let b = Image::new(1, 2, vec![[0.5; 3]; 2]);
        let said = compare(&a, &b, None, &|| false).unwrap_err().to_string();
        assert_eq!(said, "the pictures cannot be compared: the picture is 2×1 pixels, the reference 1×2");
        let mut c = a.clone();
        c.pixels[1][2] = f32::NAN;
        let said = compare(&a, &c, None, &|| false).unwrap_err().to_string();
        assert_eq!(said, "the reference has the value NaN at pixel (1, 0): expected finite numbers");
        let nothing = Image::new(0, 0, vec![]);
        assert!(compare(&nothing, &nothing, None, &|| false).is_err());
        assert_eq!(compare(&a, &a, None, &|| true), Err(CompareError::Cancelled));
    }

    #[test]
    fn report_has_the_promised_keys() {
        let a = Image::new(2, 1, vec![[0.5; 3]; 2]);
        let json = serde_json::to_value(compare(&a, &a, None, &|| false).unwrap()).unwrap();
        assert_eq!(json, serde_json::json!({ "rel_mse": 0.0, "psnr": null, "ssim": 1.0, "flip": 0.0 }));
    }
}
