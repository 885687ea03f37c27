//! What the formats of one label a line have in common (ITK-SNAP, FreeSurfer, 3D Slicer): an id, a name and a colour in bytes.

use std::path::Path;

use pumice_core::{AnnotationTable, NumericColumn};

use super::cells::{self, bytes_of_color, check_once, color_of_bytes};
use super::text::check_rows;
use super::{LabelTableFile, LabelTableFormat, checked, without_numbers, without_types, wrong_cell};
use crate::error::{FormatError, Result};

/// Rows as they are read.
pub(super) struct Lines<'a> {
    path: &'a Path,
    numbers: Vec<u64>,
    ids: Vec<u64>,
    names: Vec<String>,
    colors: Vec<[f32; 3]>,
}

impl<'a> Lines<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path, numbers: Vec::new(), ids: Vec::new(), names: Vec::new(), colors: Vec::new() }
    }

    /// Adds the label of a line, with the fields of its id and its colour; `color_at` is the number of the first colour's field.
    pub(super) fn push(
        &mut self,
        line: u64,
        id: &str,
        name: String,
        color: [&str; 3],
        color_at: usize,
    ) -> Result<()> {
        check_rows(self.path, self.ids.len())?;
        self.ids.push(cells::id(id).map_err(|what| wrong_cell(self.path, line, 1, what))?);
        let mut bytes = [0; 3];
        for (i, (byte, text)) in bytes.iter_mut().zip(color).enumerate() {
            *byte = cells::byte(text).map_err(|what| wrong_cell(self.path, line, color_at + i, what))?;
        }
        self.numbers.push(line);
        self.names.push(name);
        self.colors.push(color_of_bytes(bytes));
        Ok(())
    }

    /// The table of all lines.
    pub(super) fn finish(self, format: LabelTableFormat, notes: Vec<String>) -> Result<LabelTableFile> {
        if self.ids.is_empty() {
            return Err(FormatError::damaged(self.path, "expected a label a line, got none"));
        }
        check_once(self.path, &self.ids, &self.numbers, 1)?;
        let types = vec![String::new(); self.ids.len()];
        let colors = self.colors.into_iter().map(Some).collect();
        let table = AnnotationTable::new(self.ids, self.names, types, colors, Vec::<NumericColumn>::new());
        Ok(LabelTableFile { table: checked(self.path, table)?, format, notes })
    }
}

/// What a format of lines can write of names.
pub(super) struct Names {
    /// Characters that a name cannot have there.
    pub(super) forbidden: fn(char) -> bool,
    /// What is written in place of each.
    pub(super) instead: char,
    /// What the replaced characters are, for the user.
    pub(super) what: &'static str,
}

/// A row as it is written.
pub(super) struct WrittenLine {
    pub(super) id: u64,
    pub(super) name: String,
    pub(super) color: [u8; 3],
}

/// The rows of a table as lines with a name and a colour each, the background (`background`, black) first, and what is lost.
///
/// # Errors
/// For a label without a colour: these formats have no other way to say that it has none.
pub(super) fn written(
    path: &Path,
    table: &AnnotationTable,
    background: &str,
    names: &Names,
) -> Result<(Vec<WrittenLine>, Vec<String>)> {
    let mut lines = Vec::with_capacity(table.len() + 1);
    if table.ids().first() != Some(&0) {
        lines.push(WrittenLine { id: 0, name: background.to_owned(), color: [0; 3] });
    }
    let (mut unnamed, mut replaced) = (0u64, 0u64);
    for (row, &id) in table.ids().iter().enumerate() {
        let Some(color) = table.colors_srgb()[row] else {
            let what = format!("label {id} has no colour, and this format needs one for each label");
            return Err(FormatError::option(path, what));
        };
        let name = match table.names()[row].as_str() {
            "" => {
                unnamed += 1;
                format!("Label {id}")
            }
            name => name.to_owned(),
        };
        if table.names()[row].contains(names.forbidden) {
            replaced += 1;
        }
        let name = name.replace(names.forbidden, &names.instead.to_string());
        lines.push(WrittenLine { id, name, color: bytes_of_color(color) });
    }
    let mut notes: Vec<String> = without_types(table).into_iter().chain(without_numbers(table)).collect();
    if unnamed > 0 {
        notes.push(format!("{unnamed} labels have no name and are called Label and their id"));
    }
    if replaced > 0 {
        let (what, instead) = (names.what, names.instead);
        notes.push(format!("{what} in the names of {replaced} labels are written as {instead:?}"));
    }
    Ok((lines, notes))
}
