//! Colour lookup tables of FreeSurfer (`FreeSurferColorLUT.txt`, `.ctab`).
//!
//! ```text
//! #No. Label Name:                R   G   B   A
//! 0   Unknown                     0   0   0   0
//! 2   Left-Cerebral-White-Matter  245 245 245 0
//! ```
//! Fields are separated by white space, so names have none. Colours are bytes; the last one is transparency, which FreeSurfer has 0
//! everywhere. It may be absent and is not read. Lines may have a number of a tissue type behind it, which is not read either.

use std::fmt::Write as _;
use std::path::Path;

use pumice_core::AnnotationTable;

use super::cells::byte;
use super::color_lines::{Lines, Names, written};
use super::text::data_lines;
use super::{LabelTableFile, LabelTableFormat, wrong_cell};
use crate::error::Result;

/// Whether the text has the header of such a table, or its first label has an id, a name without spaces and quotes, and three colours.
pub(super) fn recognises(text: &str) -> bool {
    let says_so = text
        .lines()
        .take_while(|line| line.starts_with('#') || line.trim().is_empty())
        .any(|line| line.starts_with("#No."));
    let looks_so = data_lines(text).next().is_some_and(|(_, line)| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [id, name, r, g, b, ..] = fields[..] else { return false };
        let is_whole = |text: &str| text.parse::<i64>().is_ok();
        is_whole(id) && !name.contains('"') && [r, g, b].into_iter().all(is_whole)
    });
    says_so || looks_so
}

pub(super) fn read(path: &Path, text: &str) -> Result<LabelTableFile> {
    let mut lines = Lines::new(path);
    let (mut transparent, mut further) = (0u64, 0u64);
    for (number, line) in data_lines(text) {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [id, name, r, g, b, ref rest @ ..] = fields[..] else {
            let what = format!(
                "expected an id, a name without spaces and three colours, got {} fields",
                fields.len()
            );
            return Err(wrong_cell(path, number, fields.len() + 1, what));
        };
        if let Some(transparency) = rest.first() {
            let got = byte(transparency).map_err(|what| wrong_cell(path, number, 6, what))?;
            transparent += u64::from(got != 0);
        }
        further += u64::from(rest.len() > 1);
        lines.push(number, id, name.to_owned(), [r, g, b], 3)?;
    }
    let mut notes = Vec::new();
    if transparent > 0 {
        notes.push(format!("left out: transparency, which is not 0 for {transparent} labels"));
    }
    if further > 0 {
        notes.push(format!("left out: what {further} lines have behind the colour"));
    }
    lines.finish(LabelTableFormat::FreeSurfer, notes)
}

pub(super) fn write(path: &Path, table: &AnnotationTable) -> Result<(String, Vec<String>)> {
    let names = Names { forbidden: char::is_whitespace, instead: '_', what: "spaces" };
    let (lines, notes) = written(path, table, "Unknown", &names)?;
    let width = lines.iter().map(|line| line.name.chars().count()).max().unwrap_or(0).min(60);
    let mut text = format!("#No. {:<width$} R   G   B   A\n", "Label Name:");
    for line in &lines {
        let [r, g, b] = line.color;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:<4} {:<width$} {r:<3} {g:<3} {b:<3} 0", line.id, line.name);
    }
    Ok((text, notes))
}
