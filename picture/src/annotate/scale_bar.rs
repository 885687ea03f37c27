//! The scale bar: a bar in a corner, with its length as text above it.
//!
//! Layout, words and the choice of a round length are those of the add-on for Blender (`scale_bar.py`).

use pumice_core::Unit;

use super::ink::Ink;
use super::mark::Mark;
use super::paper::{MARGIN_MM, Paper, TEXT_MM};
use super::settings::Corner;
use super::text;

const THICKNESS_MM: f64 = 0.7;
const GAP_MM: f64 = 0.8;

/// Metres in each unit that is written, with its name, rising.
const UNITS: [(&str, f64); 4] = [("nm", 1e-9), ("µm", 1e-6), ("mm", 1e-3), ("m", 1.0)];

/// Metres in a unit; `None` where the volume states none.
pub fn meters_of(unit: Unit) -> Option<f64> {
    Some(match unit {
        Unit::Nanometre => 1e-9,
        Unit::Micrometre => 1e-6,
        Unit::Millimetre => 1e-3,
        Unit::Metre => 1.0,
        Unit::Unknown => return None,
    })
}

/// The greatest 1, 2 or 5 times a power of ten that is at most `most`, which is above 0 and finite.
pub fn round_length(most: f64) -> f64 {
    let power = 10f64.powf(most.log10().floor());
    // A hair of slack: 0.25 · 20 is not 5 in every rounding.
    let fits = |step: f64| step * power <= most * (1.0 + 1e-9);
    [5.0, 2.0].into_iter().find(|step| fits(*step)).unwrap_or(1.0) * power
}

/// A length in the unit in which it has the fewest digits before its point.
pub fn length_text(length: f64, unit: Unit) -> String {
    let Some(meters) = meters_of(unit) else { return format!("{} units", six_digits(length)) };
    let fitting = UNITS.iter().rev().find(|(_, size)| length * meters >= size * (1.0 - 1e-9));
    let (name, size) = fitting.unwrap_or(&UNITS[0]);
    format!("{} {name}", six_digits(length * meters / size))
}

/// A number with at most six significant digits, without trailing zeros.
fn six_digits(value: f64) -> String {
    let digits = (5.0 - value.abs().log10().floor()).clamp(0.0, 17.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// The marks of a bar of `length` pixels in a corner that says `said`.
///
/// # Errors
/// One line: the bar does not fit the picture.
pub fn scale_bar_marks(paper: &Paper, corner: Corner, length: f64, said: &str) -> Result<Vec<Mark>, String> {
    let [margin, thickness, gap, size] = [MARGIN_MM, THICKNESS_MM, GAP_MM, TEXT_MM].map(|mm| paper.px(mm));
    let room = paper.width - 2.0 * margin;
    if room < 1.0 {
        return Err(paper.has_no_room());
    }
    let fits = (1.0..=room).contains(&length);
    if !fits {
        return Err(format!(
            "it would be {length:.1} pixels long; expected 1 to {room:.0} of the picture's {:.0}",
            paper.width
        ));
    }
    let thickness = thickness.round().max(1.0);
    // Its upper and lower sides lie between pixels; its ends are where its length has them.
    let top = match corner.is_upper() {
        true => margin + text::CAPITAL * size + gap,
        false => paper.height - margin - thickness,
    };
    let top = top.round();
    let width = text::width_of(said, size)?;
    let left_of = |wide: f64| if corner.is_left() { margin } else { paper.width - margin - wide };
    if width > room || top - gap - text::CAPITAL * size < 0.0 || top + thickness > paper.height {
        return Err(format!(
            "its text {said:?} does not fit a picture of {:.0} × {:.0} pixels at {:.0} dpi; a lower number of dpi makes it smaller",
            paper.width, paper.height, paper.dpi
        ));
    }
    let mut marks = vec![Mark::rectangle([left_of(length), top], [length, thickness], Ink::ScaleBar)];
    marks.extend(text::line(said, size, [left_of(width), top - gap], Ink::ScaleBar)?);
    Ok(marks)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Paper = Paper { width: 960.0, height: 540.0, dpi: 300.0 };

    fn marks(corner: Corner, length: f64, said: &str) -> Result<Vec<Mark>, String> {
        scale_bar_marks(&PAPER, corner, length, said)
    }

    /// Bar and text keep the margin of 4 mm, 47.2 pixels, to both sides of their corner, and the text is above the bar.
    #[test]
    fn the_bar_is_in_its_corner() {
        const MARGIN: f64 = 47.24;
        for corner in [Corner::LowerRight, Corner::LowerLeft, Corner::UpperRight, Corner::UpperLeft] {
            let made = marks(corner, 411.81, "10 µm").unwrap();
            let bottom = |mark: &Mark| mark.top + (mark.coverage.len() / mark.width) as i64;
            let left = made.iter().map(|mark| mark.left).min().unwrap() as f64;
            let right = made.iter().map(|mark| mark.left + mark.width as i64).max().unwrap() as f64;
            let [upper, lower] = [made.iter().map(|m| m.top).min(), made.iter().map(bottom).max()];
            let ends = if corner.is_left() { left - MARGIN } else { 960.0 - right - MARGIN };
            let [upper, lower] = [upper.unwrap() as f64, lower.unwrap() as f64];
            let above = if corner.is_upper() { upper - MARGIN } else { 540.0 - lower - MARGIN };
            // Sides lie between pixels, half a pixel off, and a round letter is a row of pixels higher than its capitals.
            assert!(ends.abs() <= 1.0 && above.abs() <= 2.0, "{corner}: {ends} and {above} off");
            assert!(made[1..].iter().all(|text| bottom(text) <= made[0].top), "{corner}");
            // The text begins, or ends, where the bar does.
            let side = |mark: &Mark| if corner.is_left() { mark.left } else { mark.left + mark.width as i64 };
            let of_text = made[1..].iter().map(side);
            let nearest = if corner.is_left() { of_text.min() } else { of_text.max() }.unwrap();
            assert!((nearest - side(&made[0])).abs() <= 3, "{corner}: {nearest}");
        }
    }

    #[test]
    fn the_bar_is_as_long_as_asked_to_a_thousandth_of_a_pixel() {
        for length in [1.0, 37.3, 200.0, 411.81] {
            let bar = marks(Corner::default(), length, "10 µm").unwrap().remove(0);
            let rows = bar.coverage.chunks(bar.width);
            assert_eq!(rows.len(), 8, "0.7 mm at 300 dpi");
            for row in rows {
                let sum: f64 = row.iter().copied().map(f64::from).sum();
                assert!((sum - length).abs() < 1e-3, "{sum} for {length}");
            }
            // 4 mm at 300 dpi from the right side.
            let end = bar.left + bar.width as i64;
            assert!((end as f64 - (960.0 - 47.24)).abs() <= 1.0, "{end}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_in_one_line() {
        for (length, said) in [
            (900.0, "900.0 pixels long"),
            (0.5, "0.5 pixels"),
            (f64::NAN, "pixels"),
            (f64::INFINITY, "pixels"),
        ] {
            let error = marks(Corner::default(), length, "1 m").unwrap_err();
            assert!(error.contains(said) && !error.contains('\n'), "{error}");
        }
        let narrow = Paper { width: 200.0, ..PAPER };
        let told = |paper, corner| scale_bar_marks(paper, corner, 20.0, "10 µm (middle)").unwrap_err();
        assert!(told(&narrow, Corner::LowerRight).contains("does not fit"));
        let low = Paper { height: 70.0, ..PAPER };
        for corner in [Corner::LowerLeft, Corner::UpperLeft] {
            assert!(told(&low, corner).contains("does not fit"), "{corner}");
        }
    }

    #[test]
    fn lengths_are_round_and_said_in_the_unit_of_fewest_digits() {
        for (most, expected) in
            [(0.25 * 20.0, 5.0), (4.99, 2.0), (1.0, 1.0), (0.99, 0.5), (19.9, 10.0), (3e-7, 2e-7)]
        {
            assert!((round_length(most) / expected - 1.0).abs() < 1e-12, "{most}");
        }
        for (length, unit, said) in [
            (10.0, Unit::Micrometre, "10 µm"),
            (2000.0, Unit::Nanometre, "2 µm"),
            (0.5, Unit::Micrometre, "500 nm"),
            (0.05, Unit::Nanometre, "0.05 nm"),
            (2500.0, Unit::Millimetre, "2.5 m"),
            (12.5, Unit::Unknown, "12.5 units"),
            (200.0, Unit::Unknown, "200 units"),
        ] {
            assert_eq!(length_text(length, unit), said);
        }
    }
}
