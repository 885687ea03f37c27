//! Colour tables of 3D Slicer (`.ctbl`, `.txt`).
//!
//! ```text
//! # Color table file Segmentation-label_ColorTable.ctbl
//! # 4 values
//! 0 Background 0 0 0 0
//! 1 connective_tissue 111 184 210 255
//! ```
//! Fields are separated by spaces, and `_` stands for a space in a name, in both directions. Colours and opacity are numbers from 0 to 255,
//! or from 0 to 1 in a file that has none above 1, as Slicer wrote them before version 4.3. What follows the opacity is a comment. Opacity is
//! not read, and written as 255. (Slicer's tables with commas are read as CSV, also those with the ending `.ctbl`.)

use std::fmt::Write as _;
use std::path::Path;

use pumice_core::AnnotationTable;

use super::cells::{check_once, id, number};
use super::color_lines::{Names, written};
use super::text::{check_rows, data_lines};
use super::{LabelTableFile, LabelTableFormat, checked, wrong_cell};
use crate::error::{FormatError, Result};

/// Whether the text says that it is a colour table of 3D Slicer, or the file's name does.
pub(super) fn recognises(path: &Path, text: &str) -> bool {
    let says_so =
        |line: &str| line.starts_with("# Color table file") || line.starts_with("# Color procedural file");
    text.lines().take_while(|line| line.starts_with('#')).any(says_so)
        || (path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ctbl")) && !is_delimited(text))
}

/// Whether the first line has cells between commas or semicolons, as the tables that Slicer writes from version 5.8 on whatever their ending is.
fn is_delimited(text: &str) -> bool {
    data_lines(text)
        .next()
        .is_some_and(|(_, line)| line.contains([',', ';']) && line.split_whitespace().count() < 6)
}

pub(super) fn read(path: &Path, text: &str) -> Result<LabelTableFile> {
    if text.lines().take_while(|line| line.starts_with('#')).any(|l| l.starts_with("# Color procedural file"))
    {
        return Err(FormatError::unsupported(
            path,
            "a continuous colour scale of 3D Slicer has no labels",
            "save a colour table with one row a label",
        ));
    }
    let (mut lines, mut ids, mut names) = (Vec::new(), Vec::new(), Vec::new());
    let mut colors: Vec<[f64; 4]> = Vec::new();
    for (at, line) in data_lines(text) {
        check_rows(path, ids.len())?;
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [label, name, r, g, b, opacity, ..] = fields[..] else {
            let what =
                format!("expected an id, a name, three colours and an opacity, got {} fields", fields.len());
            return Err(wrong_cell(path, at, fields.len() + 1, what));
        };
        ids.push(id(label).map_err(|what| wrong_cell(path, at, 1, what))?);
        let mut color = [0.0; 4];
        for (i, (value, text)) in color.iter_mut().zip([r, g, b, opacity]).enumerate() {
            let in_range = |v: f64| match (0.0..=255.0).contains(&v) {
                true => Ok(v),
                false => Err(format!("expected a colour from 0 to 255, got {v}")),
            };
            *value = number(text).and_then(in_range).map_err(|what| wrong_cell(path, at, 3 + i, what))?;
        }
        lines.push(at);
        names.push(name.replace('_', " "));
        colors.push(color);
    }
    if ids.is_empty() {
        return Err(FormatError::damaged(path, "expected a label a line, got none"));
    }
    check_once(path, &ids, &lines, 1)?;
    let most = if colors.iter().flatten().any(|&channel| channel > 1.0) { 255.0 } else { 1.0 };
    let faint = ids.iter().zip(&colors).filter(|(id, color)| **id != 0 && color[3] != most).count();
    let note = (faint > 0).then(|| format!("left out: opacity, which is not {most} for {faint} labels"));
    let types = vec![String::new(); ids.len()];
    let color = |[r, g, b, _]: [f64; 4]| Some([r, g, b].map(|channel| (channel / most) as f32));
    let table = AnnotationTable::new(ids, names, types, colors.into_iter().map(color).collect(), Vec::new());
    Ok(LabelTableFile {
        table: checked(path, table)?,
        format: LabelTableFormat::Slicer,
        notes: note.into_iter().collect(),
    })
}

pub(super) fn write(path: &Path, table: &AnnotationTable) -> Result<(String, Vec<String>)> {
    let names = Names { forbidden: |c| c.is_whitespace() && c != ' ', instead: ' ', what: "line breaks" };
    let (lines, mut notes) = written(path, table, "Background", &names)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut text =
        format!("# Color table file {}\n# {} values\n", name.replace(char::is_control, " "), lines.len());
    for line in &lines {
        let ([r, g, b], opacity) = (line.color, if line.id == 0 { 0 } else { 255 });
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} {} {r} {g} {b} {opacity}", line.id, line.name.replace(' ', "_"));
    }
    let underscores = table.names().iter().filter(|name| name.contains('_')).count();
    if underscores > 0 {
        notes.push(format!("3D Slicer reads the underscores in the names of {underscores} labels as spaces"));
    }
    Ok((text, notes))
}
