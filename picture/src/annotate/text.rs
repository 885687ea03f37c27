//! Text: lines of DejaVu Sans, the typeface of Blender's own texts, as marks.
//!
//! The font is in the program, so nothing is looked for on the machine, and text looks the same everywhere. It has Latin, Greek, Cyrillic and
//! some more scripts, from left to right; for a character that it lacks it draws an empty box, and [`missing_characters`] names it.

use ab_glyph::{Font, FontRef, Point, PxScale, ScaleFont, point};

use super::ink::Ink;
use super::mark::Mark;

/// Height of capitals in the size of the text, as of Blender's texts; of DejaVu Sans, in the size of its em: 1493 of 2048.
pub(super) const CAPITAL: f64 = 0.69;
const CAPITAL_OF_EM: f64 = 1493.0 / 2048.0;

fn font() -> Result<FontRef<'static>, String> {
    FontRef::try_from_slice(dejavu::sans::regular()).map_err(|e| format!("the font DejaVu Sans: {e}"))
}

/// Glyphs of a line with the places where they begin, in pixels, and the width of the line.
fn placed(font: &FontRef<'static>, scale: PxScale, line: &str) -> (Vec<(ab_glyph::GlyphId, f32)>, f64) {
    let font = font.as_scaled(scale);
    let (mut glyphs, mut x, mut last) = (Vec::new(), 0.0, None);
    for c in line.chars() {
        let glyph = font.glyph_id(c);
        x += last.map_or(0.0, |last| font.kern(last, glyph));
        glyphs.push((glyph, x));
        x += font.h_advance(glyph);
        last = Some(glyph);
    }
    (glyphs, f64::from(x))
}

/// Size of the em for text of a size, in pixels. The crate scales by the font's height instead.
fn scale_of(font: &FontRef<'static>, size: f64) -> PxScale {
    let em = size * CAPITAL / CAPITAL_OF_EM;
    let per_em = font.units_per_em().map_or(1.0, |units| font.height_unscaled() / units);
    PxScale::from(em as f32 * per_em)
}

/// Width of a line of text of a size, in pixels.
pub(super) fn width_of(line: &str, size: f64) -> Result<f64, String> {
    let font = font()?;
    Ok(placed(&font, scale_of(&font, size), line).1)
}

/// A line of text whose baseline begins at a point.
pub(super) fn line(text: &str, size: f64, [x, baseline]: [f64; 2], ink: Ink) -> Result<Vec<Mark>, String> {
    let font = font()?;
    let scale = scale_of(&font, size);
    let outlined = |(glyph, along): (ab_glyph::GlyphId, f32)| {
        let position: Point = point(x as f32 + along, baseline as f32);
        font.outline_glyph(glyph.with_scale_and_position(scale, position))
    };
    let mark = |glyph: ab_glyph::OutlinedGlyph| {
        let bounds = glyph.px_bounds();
        let (width, height) = (bounds.width().ceil() as usize, bounds.height().ceil() as usize);
        let mut coverage = vec![0.0; width * height];
        glyph.draw(|i, j, c| {
            if let Some(to) = coverage.get_mut(j as usize * width + i as usize) {
                *to = c.clamp(0.0, 1.0);
            }
        });
        Mark { left: bounds.min.x as i64, top: bounds.min.y as i64, width, ink, coverage }
    };
    Ok(placed(&font, scale, text).0.into_iter().filter_map(outlined).map(mark).collect())
}

/// The characters of a text that the font lacks, each once.
///
/// # Errors
/// If the font cannot be read.
pub fn missing_characters(text: &str) -> Result<Vec<char>, String> {
    let font = font()?;
    let mut missing: Vec<char> = text.chars().filter(|&c| font.glyph_id(c).0 == 0).collect();
    missing.sort_unstable();
    missing.dedup();
    Ok(missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows and columns that a line covers, in pixels.
    fn covered(marks: &[Mark]) -> ([f64; 2], [f64; 2]) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for mark in marks {
            for (i, _) in mark.coverage.iter().enumerate().filter(|(_, c)| **c > 0.5) {
                let place = [mark.left + (i % mark.width) as i64, mark.top + (i / mark.width) as i64]
                    .map(|v| v as f64);
                for a in 0..2 {
                    (low[a], high[a]) = (low[a].min(place[a]), high[a].max(place[a] + 1.0));
                }
            }
        }
        (low, high)
    }

    #[test]
    fn capitals_stand_on_the_baseline_and_have_their_height() {
        for size in [20.0, 35.4, 100.0] {
            let (low, high) = covered(&line("H", size, [10.0, 200.0], Ink::Legend).unwrap());
            // Coverage above a half rounds each edge to the nearest pixel.
            assert!((high[1] - 200.0).abs() <= 0.5, "{high:?}");
            assert!((high[1] - low[1] - CAPITAL * size).abs() <= 1.0, "{low:?} {high:?}");
            assert!(low[0] >= 10.0);
        }
    }

    #[test]
    fn a_line_is_as_wide_as_it_says() {
        for text in ["10 µm (middle)", "WAVES", "axon α"] {
            let width = width_of(text, 40.0).unwrap();
            let (low, high) = covered(&line(text, 40.0, [0.0, 50.0], Ink::Legend).unwrap());
            // The bearings of the first and the last glyph are less than a fifth of the size.
            assert!(
                low[0] >= -1.0 && high[0] <= width + 1.0 && width - high[0] < 8.0,
                "{text}: {width} {high:?}"
            );
        }
        assert!(width_of("WWW", 40.0).unwrap() > 2.0 * width_of("iii", 40.0).unwrap());
    }

    #[test]
    fn what_the_font_lacks_is_named() {
        assert_eq!(missing_characters("10 µm, μm, dendrite β Ж").unwrap(), []);
        assert_eq!(missing_characters("漢a漢字").unwrap(), ['字', '漢']);
    }
}
