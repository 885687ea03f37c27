//! The legend: a swatch and a name for each label, in the upper left corner.
//!
//! ```text
//! ■ axon            text of 3 mm, lines 1.4 times as far apart; a swatch is as high as capitals
//! ■ 98340797        a label without a name has its id
//!   and 23 more     what does not fit, or is beyond the wished number
//! ```
//! Layout as in the add-on for Blender (`legend.py`). Names that are too long for the picture end with `…`.

use super::ink::Ink;
use super::mark::Mark;
use super::paper::{MARGIN_MM, Paper, TEXT_MM};
use super::text;

/// Of the size of the text: side of a swatch, its distance to the text, distance between lines.
const SWATCH: f64 = 0.7;
const GAP: f64 = 0.5;
const LINE: f64 = 1.4;

/// A line of the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct LegendRow {
    /// Name of the label.
    pub name: String,
    /// Its scene-linear colour.
    pub color: [f32; 3],
}

/// The marks of a legend of these labels, of which there are `more` beyond them.
///
/// # Errors
/// One line: the picture has no room for a label.
pub fn legend_marks(paper: &Paper, rows: &[LegendRow], more: usize) -> Result<Vec<Mark>, String> {
    let [margin, size] = [MARGIN_MM, TEXT_MM].map(|mm| paper.px(mm));
    let too_small = || paper.has_no_room();
    let room_for = ((paper.height - 2.0 * margin - SWATCH * size) / (LINE * size)).floor() + 1.0;
    let lines = if room_for >= 1.0 { room_for as usize } else { return Err(too_small()) };
    // The last line says how many labels have none.
    let shown = if rows.len() + usize::from(more > 0) <= lines { rows.len() } else { lines - 1 };
    let left_out = rows.len() - shown + more;
    if shown == 0 {
        return Err(too_small());
    }
    let text_x = margin + (SWATCH + GAP) * size;
    let room = paper.width - margin - text_x;
    let mut marks = Vec::new();
    for (i, row) in rows[..shown].iter().enumerate() {
        let top = (margin + LINE * size * i as f64).round();
        let side = (SWATCH * size).round();
        marks.push(Mark::rectangle([margin.round(), top], [side, side], Ink::Color(row.color)));
        let name = fitting(&row.name, size, room)?.ok_or_else(too_small)?;
        marks.extend(text::line(&name, size, [text_x, top + side], Ink::Legend)?);
    }
    if left_out > 0 {
        let baseline = (margin + LINE * size * shown as f64).round() + (SWATCH * size).round();
        let said = fitting(&format!("and {left_out} more"), size, room)?.ok_or_else(too_small)?;
        marks.extend(text::line(&said, size, [text_x, baseline], Ink::Legend)?);
    }
    Ok(marks)
}

/// How far marks reach from the upper left corner of the picture: pixels across and down.
pub fn reach_of(marks: &[Mark]) -> [f64; 2] {
    marks.iter().fold([0.0; 2], |[across, down], mark| {
        let rows = mark.coverage.len() / mark.width.max(1);
        let (right, bottom) = (mark.left + mark.width as i64, mark.top + rows as i64);
        [f64::max(across, right as f64), f64::max(down, bottom as f64)]
    })
}

/// The longest beginning of a name that fits, with `…` if it is not all of it; `None` if not even one character does.
fn fitting(name: &str, size: f64, room: f64) -> Result<Option<String>, String> {
    // A thousand characters are wider than any picture's 65,536 pixels at a readable size; a name may be megabytes, whose glyphs take seconds.
    let ends: Vec<usize> = name.char_indices().map(|(at, _)| at).skip(1).take(1000).collect();
    if ends.len() < 1000 && text::width_of(name, size)? <= room {
        return Ok(Some(name.to_owned()));
    }
    let cut = |end: usize| format!("{}…", name[..end].trim_end());
    let (mut low, mut high) = (0, ends.len());
    // The width rises with the length, to a kerning pair.
    while low < high {
        let middle = (low + high).div_ceil(2);
        if text::width_of(&cut(ends[middle - 1]), size)? <= room { low = middle } else { high = middle - 1 }
    }
    Ok((low > 0).then(|| cut(ends[low - 1])))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Paper = Paper { width: 960.0, height: 540.0, dpi: 300.0 };

    fn rows(n: usize) -> Vec<LegendRow> {
        (0..n)
            .map(|i| LegendRow { name: format!("label {i}"), color: [i as f32 / 100.0, 0.5, 0.25] })
            .collect()
    }

    /// Swatches have the colour of their label; text is black or white.
    fn swatches(marks: &[Mark]) -> Vec<&Mark> {
        marks.iter().filter(|m| m.ink != Ink::Legend).collect()
    }

    #[test]
    fn each_row_has_the_color_of_its_label_below_the_row_before() {
        let marks = legend_marks(&PAPER, &rows(5), 0).unwrap();
        let found = swatches(&marks);
        assert_eq!(
            found.iter().map(|m| m.ink).collect::<Vec<_>>(),
            rows(5).iter().map(|r| Ink::Color(r.color)).collect::<Vec<_>>()
        );
        for (i, swatch) in found.iter().enumerate() {
            // 3 mm at 300 dpi are 35.4 pixels: swatches of 25, 49.6 apart, 47 from the sides.
            assert_eq!((swatch.left, swatch.width, swatch.coverage.len()), (47, 25, 625));
            assert!((swatch.top as f64 - 47.24 - 49.6 * i as f64).abs() <= 1.0, "{}", swatch.top);
            assert!(swatch.coverage.iter().all(|c| *c == 1.0));
        }
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let text_marks = |n: usize, more: usize| {
            let marks = legend_marks(&PAPER, &rows(n), more).unwrap();
            (swatches(&marks).len(), marks.len() - swatches(&marks).len())
        };
        // 540 pixels have room for nine lines of 49.6.
        let letters = |said: &str| said.chars().filter(|c| *c != ' ').count();
        assert_eq!(text_marks(9, 0), (9, 9 * 6));
        assert_eq!(text_marks(9, 4), (8, 8 * 6 + letters("and 5 more")));
        assert_eq!(text_marks(30, 100), (8, 8 * 6 + letters("and 122 more")));
        assert_eq!(text_marks(2, 23), (2, 2 * 6 + letters("and 23 more")));
        for small in [Paper { height: 60.0, ..PAPER }, Paper { width: 80.0, ..PAPER }] {
            assert!(legend_marks(&small, &rows(3), 0).unwrap_err().contains("no room"), "{small:?}");
        }
    }

    #[test]
    fn a_legend_reaches_to_the_end_of_its_longest_name_and_its_last_line() {
        let [across, down] = reach_of(&legend_marks(&PAPER, &rows(5), 0).unwrap());
        // Four lines of 49.6 pixels, 47.2 from the top, then capitals of 0.7 · 35.4 and what letters have below the baseline.
        let last = 47.24 + 4.0 * 49.6 + 24.8;
        assert!((last - 1.0..last + 10.0).contains(&down), "{down}");
        let text_x = 47.24 + 1.2 * 35.43;
        let width = text::width_of("label 4", 35.43).unwrap();
        assert!((across - text_x - width).abs() < 8.0, "{across}");
        assert_eq!(reach_of(&[]), [0.0; 2]);
    }

    /// The longest beginning, found by trying each.
    #[test]
    fn a_cut_name_is_as_long_as_fits_and_ends_in_an_ellipsis() {
        let name = "right hippocampus, anterior part and what lies beside it";
        let whole = text::width_of(name, 30.0).unwrap();
        // Also one in which the longest beginning ends in a space.
        let to_space = text::width_of("right …", 30.0).unwrap();
        for room in [80.0, to_space, 200.0, 333.0, whole - 0.01] {
            let fits = |cut: &String| text::width_of(cut, 30.0).unwrap() <= room;
            let cuts = name.char_indices().skip(1).map(|(at, _)| format!("{}…", name[..at].trim_end()));
            let expected = cuts.filter(fits).last();
            let found = fitting(name, 30.0, room).unwrap();
            assert_eq!(found, expected, "{room}");
            assert!(found.is_some_and(|cut| !cut.contains(" …")), "{room}");
        }
        assert_eq!(fitting(name, 30.0, whole), Ok(Some(name.to_owned())));
        assert_eq!(fitting(name, 30.0, 1.0), Ok(None));
    }

    #[test]
    fn long_names_end_within_the_picture() {
        let long = LegendRow { name: "W".repeat(5_000_000), color: [1.0; 3] };
        let marks = legend_marks(&PAPER, &[long], 0).unwrap();
        let right = marks.iter().map(|m| m.left + m.width as i64).max().unwrap();
        assert!((850..=914).contains(&right), "{right}");
        assert!(marks.len() > 10 && fitting("short", 35.4, 500.0) == Ok(Some("short".into())));
    }
}
