//! Tables of labels of other programs: ids with names, types, colours and numbers, read as [`AnnotationTable`] and written.
//!
//! ```text
//! read:   file ─► text (UTF-8, bounded) ─► format, by content ─► its module ─► rows, each id once ─► AnnotationTable
//! write:  AnnotationTable ─► format, by name or the file's name ─► its module ─► text ─► file, whole or not at all
//! ```
//! A module understands one format. What a format cannot hold, or what the reader does not use, is said in [`LabelTableFile::notes`], and in
//! what [`write_label_table`] returns: a line for each kind of thing.
//!
//! Colours are bytes of sRGB in all formats (fractions of 255 in some); core has them sRGB-encoded from 0 to 1, so a byte survives.

mod cells;
mod color_lines;
mod delimited;
mod delimited_columns;
mod freesurfer;
mod itk_snap;
mod neuroglancer;
mod slicer;
mod text;

use std::path::Path;

use pumice_core::error::one_line;
use pumice_core::{AnnotationTable, write_text};

use crate::error::{FormatError, Result};
use crate::store_files::is_on_server;

/// A format of tables of labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LabelTableFormat {
    /// Comma-separated values with a header line. When read, semicolons may be in place of commas.
    Csv,
    /// Tab-separated values with a header line.
    Tsv,
    /// Label description file of ITK-SNAP.
    ItkSnap,
    /// Colour lookup table of FreeSurfer.
    FreeSurfer,
    /// Colour table of 3D Slicer.
    Slicer,
    /// Segment properties of Neuroglancer: the file `info`, JSON.
    Neuroglancer,
}

impl LabelTableFormat {
    /// All formats.
    pub const ALL: [Self; 6] =
        [Self::Csv, Self::Tsv, Self::ItkSnap, Self::FreeSurfer, Self::Slicer, Self::Neuroglancer];

    /// The name by which callers choose the format.
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Tsv => "tsv",
            Self::ItkSnap => "itk-snap",
            Self::FreeSurfer => "freesurfer",
            Self::Slicer => "slicer",
            Self::Neuroglancer => "neuroglancer",
        }
    }

    /// Whether the format must have a colour for each label.
    pub fn needs_colors(self) -> bool {
        matches!(self, Self::ItkSnap | Self::FreeSurfer | Self::Slicer)
    }

    /// The format with this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// The format that the name of a file to be written stands for: its ending, where `.txt` is ITK-SNAP's format unless the name ends with
    /// `lut.txt`, as FreeSurfer's tables do.
    ///
    /// # Errors
    /// [`FormatError::Unknown`] for other names.
    pub fn of_file_name(path: &Path) -> std::result::Result<Self, FormatError> {
        const ENDINGS: [(&str, LabelTableFormat); 9] = [
            (".csv", LabelTableFormat::Csv),
            (".tsv", LabelTableFormat::Tsv),
            ("lut.txt", LabelTableFormat::FreeSurfer),
            (".lut", LabelTableFormat::FreeSurfer),
            (".ctab", LabelTableFormat::FreeSurfer),
            (".txt", LabelTableFormat::ItkSnap),
            (".label", LabelTableFormat::ItkSnap),
            (".ctbl", LabelTableFormat::Slicer),
            (".json", LabelTableFormat::Neuroglancer),
        ];
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if name == "info" {
            return Ok(Self::Neuroglancer);
        }
        ENDINGS.iter().find(|(ending, _)| name.ends_with(ending)).map(|&(_, format)| format).ok_or_else(|| {
            FormatError::Unknown {
                path: path.to_owned(),
                what: "the ending names no format of label tables: expected .csv, .tsv, .txt (ITK-SNAP), lut.txt, .lut or .ctab \
                       (FreeSurfer), .ctbl (3D Slicer), .json or the name info (Neuroglancer)"
                    .into(),
            }
        })
    }

    /// The table as the text of a file, and what the format cannot hold.
    ///
    /// # Errors
    /// When the format needs what the table lacks; `path` is named in the error.
    pub fn to_text(
        self,
        path: &Path,
        table: &AnnotationTable,
    ) -> std::result::Result<(String, Vec<String>), FormatError> {
        match self {
            Self::Csv => delimited::write(path, table, b','),
            Self::Tsv => delimited::write(path, table, b'\t'),
            Self::ItkSnap => itk_snap::write(path, table),
            Self::FreeSurfer => freesurfer::write(path, table),
            Self::Slicer => slicer::write(path, table),
            Self::Neuroglancer => neuroglancer::write(path, table),
        }
    }
}

/// The rows of a table at these indices, in this order, as CSV; `path` is named in errors.
///
/// # Errors
/// When the text cannot be made.
pub fn csv_of_rows(
    path: &Path,
    table: &AnnotationTable,
    order: &[usize],
) -> std::result::Result<String, FormatError> {
    delimited::write_rows(path, table, order, b',')
}

/// A table of labels as a file has it.
#[derive(Clone, Debug)]
pub struct LabelTableFile {
    /// The table.
    pub table: AnnotationTable,
    /// The file's format.
    pub format: LabelTableFormat,
    /// What the file has and the table has not, a line each.
    pub notes: Vec<String>,
}

/// Reads a table of labels, whose format its content decides. For Neuroglancer, `path` may be the folder with the file `info`.
///
/// # Errors
/// One line that says what is wrong with the file, and in which line and column.
pub fn read_label_table(path: &Path) -> std::result::Result<LabelTableFile, FormatError> {
    let inside;
    let path = match path.is_dir() || is_on_server(path) {
        true => {
            inside = path.join("info");
            inside.as_path()
        }
        false => path,
    };
    let text = text::read(path)?;
    if text.trim().is_empty() {
        return Err(FormatError::damaged(path, "expected a table of labels, got an empty file"));
    }
    if neuroglancer::recognises(&text) {
        neuroglancer::read(path, &text)
    } else if slicer::recognises(path, &text) {
        slicer::read(path, &text)
    } else if itk_snap::recognises(&text) {
        itk_snap::read(path, &text)
    } else if freesurfer::recognises(&text) {
        freesurfer::read(path, &text)
    } else {
        delimited::read(path, &text)
    }
}

/// Writes a table of labels; returns what the format cannot hold, a line each.
///
/// # Errors
/// When the format needs what the table lacks, such as colours, or the file cannot be written. The file is then unchanged.
pub fn write_label_table(
    path: &Path,
    format: LabelTableFormat,
    table: &AnnotationTable,
) -> pumice_core::Result<Vec<String>> {
    let (text, notes) = format.to_text(path, table)?;
    write_text(path, &text)?;
    Ok(notes)
}

/// Makes an error about a cell: its line, and the number of the field in that line, both from 1.
fn wrong_cell(path: &Path, line: u64, column: usize, what: impl Into<String>) -> FormatError {
    FormatError::Cell { path: path.to_owned(), line, column: column as u64, what: what.into() }
}

/// Makes a line that names columns of numbers which a format cannot hold; nothing without any.
fn without_numbers(table: &AnnotationTable) -> Option<String> {
    let names: Vec<&str> = table.columns().iter().map(|c| c.name.as_str()).collect();
    (!names.is_empty()).then(|| format!("left out: the columns {}", one_line(&names.join(", "))))
}

/// Makes a line that counts types which a format cannot hold; nothing without any.
fn without_types(table: &AnnotationTable) -> Option<String> {
    let typed = table.types().iter().filter(|t| !t.is_empty()).count();
    (typed > 0).then(|| format!("left out: the types of {typed} labels"))
}

/// Checks the table that a reader has made.
fn checked(path: &Path, table: pumice_core::Result<AnnotationTable>) -> Result<AnnotationTable> {
    table.map_err(|e| FormatError::damaged(path, one_line(&e.to_string())))
}
