//! Inks: the colours of marks, and the choice between black and white text.
//!
//! A swatch has the colour of its label. The text of a legend, and a scale bar with its text, are black or white, each annotation as a whole:
//! whichever has the greater contrast on average with what lies below it.
//!
//! ```text
//! contrast of luminances (WCAG 2.2, "contrast ratio") = (lighter + 0.05) / (darker + 0.05)
//! of black: (L + 0.05) / 0.05      of white: 1.05 / (L + 0.05)      equal at L + 0.05 = √(0.05 · 1.05), L = 0.179
//! black where the mean of log(L + 0.05) over the covered pixels is at least that of the middle
//! ```
//! Luminance is that of the scene-linear colour, clamped to what a screen shows. View transforms keep a middle grey (0.18) about where it is, so
//! one choice serves all of them, and PNG and EXR agree. Where the picture is transparent, the background of its film lies below, or white paper.

use crate::metrics::display::linear_from_srgb;
use crate::picture::Picture;

/// Added to luminances by WCAG 2.2: stray light on a screen.
const FLARE: f64 = 0.05;
/// Luminance of the Rec. 709 primaries.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// What a mark is drawn in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ink {
    /// This scene-linear Rec. 709 colour.
    Color([f32; 3]),
    /// Black or white: the text of the legend.
    Legend,
    /// Black or white: the scale bar and its text.
    ScaleBar,
}

/// The inks of a picture's annotations; by default black.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Inks {
    legend: [f32; 3],
    scale_bar: [f32; 3],
}

impl Inks {
    /// The inks that read best over a picture. `background` lies behind a transparent one, as display values; white without it.
    pub(crate) fn over(picture: &Picture, background: Option<[f32; 3]>) -> Self {
        let behind = background.map_or(1.0, |srgb| luminance(srgb.map(|c| linear_from_srgb(f64::from(c)))));
        let below = |i: usize| {
            let own = picture.color.pixels.get(i).map_or(0.0, |pixel| luminance(pixel.map(f64::from)));
            let alpha = picture.alpha.as_ref().and_then(|alpha| alpha.get(i)).map_or(1.0, |a| f64::from(*a));
            let sum = own + (1.0 - alpha) * behind;
            if sum.is_nan() { 0.0 } else { sum.clamp(0.0, 1.0) }
        };
        let of = |ink: Ink| {
            let (mut sum, mut area) = (0.0, 0.0);
            for mark in picture.marks.iter().filter(|mark| mark.ink == ink) {
                mark.for_each_pixel(picture.color.width, picture.color.height, |i, coverage| {
                    sum += f64::from(coverage) * (below(i) + FLARE).ln();
                    area += f64::from(coverage);
                });
            }
            let middle = (FLARE * (1.0 + FLARE)).ln() / 2.0;
            if sum < middle * area { [1.0; 3] } else { [0.0; 3] }
        };
        Self { legend: of(Ink::Legend), scale_bar: of(Ink::ScaleBar) }
    }

    /// The scene-linear colour of an ink.
    pub(crate) fn color(&self, ink: Ink) -> [f32; 3] {
        match ink {
            Ink::Color(color) => color,
            Ink::Legend => self.legend,
            Ink::ScaleBar => self.scale_bar,
        }
    }
}

fn luminance(color: [f64; 3]) -> f64 {
    color.iter().zip(LUMINANCE).map(|(c, weight)| c * weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::annotate::mark::{Mark, drawn_over};
    use crate::image::Image;

    const BLACK: [f32; 3] = [0.0; 3];
    const WHITE: [f32; 3] = [1.0; 3];

    /// A picture of 4 × 1 pixels with a legend over its left half and a scale bar over its right half.
    fn marked(pixels: [[f32; 3]; 4], alpha: Option<[f32; 4]>) -> Picture {
        let mut picture = Picture::of(Image::new(4, 1, pixels.to_vec()));
        picture.alpha = alpha.map(Vec::from);
        picture.marks = vec![
            Mark::rectangle([0.0, 0.0], [2.0, 1.0], Ink::Legend),
            Mark::rectangle([2.0, 0.0], [2.0, 1.0], Ink::ScaleBar),
        ];
        picture
    }

    fn inks(picture: &Picture, background: Option<[f32; 3]>) -> [[f32; 3]; 2] {
        let inks = Inks::over(picture, background);
        [inks.color(Ink::Legend), inks.color(Ink::ScaleBar)]
    }

    /// The oracle is the table of contrast ratios: of a grey of 0.17, white 4.77 and black 4.4; of 0.19, white 4.375 and black 4.8.
    #[test]
    fn the_ink_is_the_one_of_greater_contrast() {
        for (below, expected) in [(0.0, WHITE), (0.17, WHITE), (0.19, BLACK), (0.8, BLACK), (50.0, BLACK)] {
            let picture = marked([[below; 3]; 4], None);
            assert_eq!(inks(&picture, None), [expected; 2], "{below}");
        }
        // Green is lighter than blue of the same radiance.
        assert_eq!(inks(&marked([[0.0, 0.8, 0.0]; 4], None), None), [BLACK; 2]);
        assert_eq!(inks(&marked([[0.0, 0.0, 0.8]; 4], None), None), [WHITE; 2]);
    }

    #[test]
    fn each_annotation_is_judged_by_itself_and_as_a_whole() {
        let (dark, light) = ([0.02; 3], [0.7; 3]);
        assert_eq!(inks(&marked([dark, dark, light, light], None), None), [WHITE, BLACK]);
        // Two greys read as √(0.07 · 0.76) − 0.05 = 0.181 and √(0.07 · 0.74) − 0.05 = 0.178.
        assert_eq!(inks(&marked([dark, [0.71; 3], dark, [0.69; 3]], None), None), [BLACK, WHITE]);
    }

    #[test]
    fn transparent_pictures_are_judged_over_their_background_or_white_paper() {
        let clear = marked([[0.0; 3]; 4], Some([0.0; 4]));
        assert_eq!(inks(&clear, None), [BLACK; 2]);
        assert_eq!(inks(&clear, Some([0.0; 3])), [WHITE; 2]);
        // A display value of 0.5 is 0.214 in linear light, one of 0.4 is 0.133.
        assert_eq!(inks(&clear, Some([0.5; 3])), [BLACK; 2]);
        assert_eq!(inks(&clear, Some([0.4; 3])), [WHITE; 2]);
        assert_eq!(inks(&marked([[0.0; 3]; 4], Some([1.0; 4])), None), [WHITE; 2]);
    }

    #[test]
    fn pixels_that_are_no_numbers_count_as_black() {
        assert_eq!(inks(&marked([[f32::NAN; 3]; 4], None), None), [WHITE; 2]);
        assert_eq!(inks(&marked([[f32::INFINITY; 3]; 4], None), None), [BLACK; 2]);
    }

    #[test]
    fn files_have_the_ink() {
        let picture = marked([[0.01; 3]; 4], None);
        assert_eq!(drawn_over(&picture).expect("memory").0.pixels, vec![WHITE; 4]);
    }
}
