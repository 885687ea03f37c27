//! Marks: small masks of one ink, and how they are laid over colours.
//!
//! Coverage is mixed in linear light, as a renderer's filter mixes a surface with what is behind it; so a picture with the sRGB curve has the
//! same edges in a PNG and in an EXR.

use std::borrow::Cow;

use pumice_core::NoMemory;
use pumice_core::reserve::reserved;

use super::ink::{Ink, Inks};
use crate::image::Image;
use crate::metrics::display::{linear_from_srgb, srgb_from_linear};
use crate::picture::Picture;

/// A mask of one ink over a rectangle of pixels, which may reach beyond the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Pixels from the picture's left side.
    pub left: i64,
    /// Pixels from its top.
    pub top: i64,
    /// Pixels across; the mask has a multiple of them.
    pub width: usize,
    /// What it is drawn in.
    pub ink: Ink,
    /// Part of each pixel that is covered, 0 to 1, row by row.
    pub coverage: Vec<f32>,
}

impl Mark {
    /// A rectangle from `x` to `x + width` and `y` to `y + height` in pixels; pixels at its edges are covered in part.
    pub(super) fn rectangle([x, y]: [f64; 2], [width, height]: [f64; 2], ink: Ink) -> Self {
        let ([left, top], [right, bottom]) =
            ([x.floor(), y.floor()], [(x + width).ceil(), (y + height).ceil()]);
        let within = |low: f64, high: f64, pixel: f64| (high.min(pixel + 1.0) - low.max(pixel)).max(0.0);
        let (across, down) = ((right - left) as usize, (bottom - top) as usize);
        let row = |j: usize| {
            let vertical = within(y, y + height, top + j as f64);
            (0..across).map(move |i| (vertical * within(x, x + width, left + i as f64)) as f32)
        };
        Self {
            left: left as i64,
            top: top as i64,
            width: across,
            ink,
            coverage: (0..down).flat_map(row).collect(),
        }
    }

    /// Calls `paint` with each pixel of a picture of this size that is covered, and its coverage.
    pub(super) fn for_each_pixel(&self, width: usize, height: usize, mut paint: impl FnMut(usize, f32)) {
        for (row, y) in self.coverage.chunks(self.width.max(1)).zip(self.top..) {
            for (&coverage, x) in row.iter().zip(self.left..) {
                let is_inside = (0..width as i64).contains(&x) && (0..height as i64).contains(&y);
                if is_inside && coverage > 0.0 {
                    paint(y as usize * width + x as usize, coverage.min(1.0));
                }
            }
        }
    }
}

/// A colour and an alpha.
type Drawn<'a> = (Cow<'a, Image>, Option<Cow<'a, [f32]>>);

/// The colour and the alpha of a picture with its marks over them; both premultiplied. Where there are marks, these are copies.
///
/// # Errors
/// [`NoMemory`] where there is none for the copies.
pub(crate) fn drawn_over(picture: &Picture) -> Result<Drawn<'_>, NoMemory> {
    let Image { width, height, pixels } = &picture.color;
    if picture.marks.is_empty() {
        return Ok((Cow::Borrowed(&picture.color), picture.alpha.as_deref().map(Cow::Borrowed)));
    }
    // A PNG of this picture has the same inks, so it is judged before the background that its scene asks for.
    let background = picture.provenance.as_ref().and_then(|made| made.scene.film.background);
    let inks = Inks::over(picture, background);
    let mut color = copied(pixels)?;
    let mut alpha = picture.alpha.as_deref().map(copied).transpose()?;
    for mark in &picture.marks {
        let of_mark = inks.color(mark.ink);
        mark.for_each_pixel(*width, *height, |i, a| {
            color[i] = [0, 1, 2].map(|c| color[i][c] * (1.0 - a) + of_mark[c] * a);
        });
        if let Some(alpha) = &mut alpha {
            // A wrong length is refused where the file is written.
            mark.for_each_pixel(*width, *height, |i, a| {
                alpha.get_mut(i).into_iter().for_each(|to| *to = *to * (1.0 - a) + a);
            });
        }
    }
    Ok((Cow::Owned(Image::new(*width, *height, color)), alpha.map(Cow::Owned)))
}

fn copied<T: Copy>(values: &[T]) -> Result<Vec<T>, NoMemory> {
    let mut copy = reserved(values.len(), "a picture with what is drawn over it")?;
    copy.extend_from_slice(values);
    Ok(copy)
}

/// Lays marks over display values of 8 bits, three or, with straight alpha, four bytes a pixel.
pub(crate) fn over_display(marks: &[Mark], inks: &Inks, bytes: &mut [u8], width: usize, channels: usize) {
    let height = bytes.len() / (channels * width).max(1);
    for mark in marks {
        let color = inks.color(mark.ink);
        mark.for_each_pixel(width, height, |i, coverage| {
            let pixel = &mut bytes[i * channels..][..channels];
            let above = f64::from(coverage);
            let below = (1.0 - above) * pixel.get(3).map_or(1.0, |a| f64::from(*a) / 255.0);
            for (channel, &of_mark) in pixel.iter_mut().zip(&color) {
                let behind = linear_from_srgb(f64::from(*channel) / 255.0);
                let mixed = (f64::from(of_mark) * above + behind * below) / (above + below);
                *channel = (srgb_from_linear(mixed.clamp(0.0, 1.0)) * 255.0).round() as u8;
            }
            if let Some(alpha) = pixel.get_mut(3) {
                *alpha = ((above + below) * 255.0).round() as u8;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_covers_its_area() {
        // 8-bit edges: sums of f32 of a few hundred pixels.
        for ([x, y], [w, h]) in
            [([2.25, 3.5], [10.5, 4.25]), ([0.0, 0.0], [3.0, 2.0]), ([-1.5, 0.75], [0.5, 0.125])]
        {
            let mark = Mark::rectangle([x, y], [w, h], Ink::Color([0.0; 3]));
            let sum: f64 = mark.coverage.iter().copied().map(f64::from).sum();
            assert!((sum - w * h).abs() < 1e-5, "{sum} for {w} × {h}");
            assert!(mark.coverage.iter().all(|c| (0.0..=1.0).contains(c)));
        }
    }

    #[test]
    fn marks_beyond_the_picture_are_cut_and_the_rest_is_untouched() {
        let mut picture = Picture::of(Image::new(4, 3, vec![[0.5, 0.25, 2.0]; 12]));
        picture.alpha = Some(vec![0.5; 12]);
        picture.marks = vec![Mark::rectangle([2.5, -5.0], [100.0, 6.0], Ink::Color([0.0, 1.0, 0.0]))];
        let (color, alpha) = drawn_over(&picture).unwrap();
        let alpha = alpha.unwrap();
        for (i, (pixel, a)) in color.pixels.iter().zip(alpha.iter()).enumerate() {
            let covered = if i / 4 != 0 { 0.0 } else { [0.0, 0.0, 0.5, 1.0][i % 4] };
            assert_eq!(
                *pixel,
                [0.5 * (1.0 - covered), 0.25 * (1.0 - covered) + covered, 2.0 * (1.0 - covered)],
                "{i}"
            );
            assert_eq!(*a, 0.5 + 0.5 * covered);
        }
        assert_eq!(picture.color.pixels[3], [0.5, 0.25, 2.0], "the picture in memory has no marks");
    }

    /// Full coverage gives the colour itself, over an opaque and over an empty film; half of white over black is half of the light.
    #[test]
    fn display_values_are_mixed_in_linear_light() {
        let mark = |coverage, color| Mark {
            left: 0,
            top: 0,
            width: 1,
            ink: Ink::Color(color),
            coverage: vec![coverage],
        };
        let over = |mark: Mark, mut bytes: Vec<u8>| {
            let channels = bytes.len();
            over_display(&[mark], &Inks::default(), &mut bytes, 1, channels);
            bytes
        };
        assert_eq!(over(mark(1.0, [0.0, 0.5, 1.0]), vec![9, 9, 9]), [0, 188, 255]);
        assert_eq!(over(mark(0.5, [1.0; 3]), vec![0, 0, 0]), [188; 3]);
        assert_eq!(over(mark(0.5, [1.0, 0.0, 0.0]), vec![0, 0, 0, 0]), [255, 0, 0, 128]);
        assert_eq!(over(mark(0.0, [1.0; 3]), vec![3, 4, 5, 6]), [3, 4, 5, 6]);
    }
}
