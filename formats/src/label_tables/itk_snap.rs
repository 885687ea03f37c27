//! Label description files of ITK-SNAP (*Segmentation › Save Label Descriptions*).
//!
//! ```text
//! ################################################
//! # ITK-SnAP Label Description File
//! # File format:
//! # IDX   -R-  -G-  -B-  -A--  VIS MSH  LABEL
//! ################################################
//!     0     0    0    0        0  0  0    "Clear Label"
//!     1   255    0    0        1  1  1    "Left lobe"
//! ```
//! Colours are bytes, opacity is a number from 0 to 1, and two flags say whether slices and surfaces show the label. The name is what lies
//! between the first quote of a line and the last. Opacity and flags are not read; they are written as 1.

use std::fmt::Write as _;
use std::path::Path;

use pumice_core::AnnotationTable;

use super::cells::quoted;
use super::color_lines::{Lines, Names, written};
use super::text::data_lines;
use super::{LabelTableFile, LabelTableFormat, wrong_cell};
use crate::error::Result;

const HEADER: &str = "\
################################################
# ITK-SnAP Label Description File
# File format:
# IDX   -R-  -G-  -B-  -A--  VIS MSH  LABEL
# Fields:
#    IDX:   Zero-based index
#    -R-:   Red color component (0..255)
#    -G-:   Green color component (0..255)
#    -B-:   Blue color component (0..255)
#    -A-:   Label transparency (0.00 .. 1.00)
#    VIS:   Label visibility (0 or 1)
#    MSH:   Label mesh visibility (0 or 1)
#  LABEL:   Label description
################################################
";

/// Largest id that ITK-SNAP has: its labels are numbers of 16 bits.
const MOST_ID: u64 = 65_535;

/// Fields before the name.
const FIELDS: usize = 7;

/// Whether the text is such a file: it says so, or its first label has seven numbers and a quoted name.
pub(super) fn recognises(text: &str) -> bool {
    let says_so = text
        .lines()
        .take_while(|line| line.starts_with('#') || line.trim().is_empty())
        .any(|line| line.to_ascii_lowercase().contains("itk-snap label description"));
    let looks_so = data_lines(text).next().is_some_and(|(_, line)| {
        let (numbers, name) = line.split_once('"').unwrap_or((line, ""));
        name.ends_with('"')
            && numbers.split_whitespace().count() == FIELDS
            && numbers.split_whitespace().all(|field| field.parse::<f64>().is_ok())
    });
    says_so || looks_so
}

pub(super) fn read(path: &Path, text: &str) -> Result<LabelTableFile> {
    let mut lines = Lines::new(path);
    let mut hidden = 0u64;
    for (number, line) in data_lines(text) {
        let (front, name) = line.split_once('"').unwrap_or((line, ""));
        let fields: Vec<&str> = front.split_whitespace().collect();
        let [id, r, g, b, opacity, shown, meshed] = fields[..] else {
            let what = format!("expected {FIELDS} numbers before the name, got {}", fields.len());
            return Err(wrong_cell(path, number, fields.len().min(FIELDS) + 1, what));
        };
        let Some(name) = name.strip_suffix('"') else {
            let what = format!("expected a name in quotes, got {}", quoted(&line[front.len()..]));
            return Err(wrong_cell(path, number, FIELDS + 1, what));
        };
        for (column, field) in [(5, opacity), (6, shown), (7, meshed)] {
            super::cells::number(field).map_err(|what| wrong_cell(path, number, column, what))?;
        }
        lines.push(number, id, name.trim().to_owned(), [r, g, b], 2)?;
        hidden += u64::from(id != "0" && (opacity.parse() != Ok(1.0) || shown != "1" || meshed != "1"));
    }
    let note = (hidden > 0)
        .then(|| format!("left out: opacity and visibility, which are not 1 for {hidden} labels"));
    lines.finish(LabelTableFormat::ItkSnap, note.into_iter().collect())
}

pub(super) fn write(path: &Path, table: &AnnotationTable) -> Result<(String, Vec<String>)> {
    let names =
        Names { forbidden: char::is_control, instead: ' ', what: "line breaks and control characters" };
    let (lines, mut notes) = written(path, table, "Clear Label", &names)?;
    let mut text = HEADER.to_owned();
    for line in &lines {
        let ([r, g, b], shown) = (line.color, u8::from(line.id != 0));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:>5} {r:>5} {g:>4} {b:>4} {shown:>8} {shown:>2} {shown:>2}    \"{}\"",
            line.id, line.name
        );
    }
    let large = lines.iter().filter(|line| line.id > MOST_ID).count();
    if large > 0 {
        notes.push(format!("ITK-SNAP cannot read {large} of the ids: its largest is {MOST_ID}"));
    }
    Ok((text, notes))
}
