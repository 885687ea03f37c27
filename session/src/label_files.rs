//! Tables of labels as files: reading one for a volume, and writing the labels of a volume as one.

use std::path::{Path, PathBuf};

use pumice_core::{AnnotationFit, AnnotationTable, CompressedVolume, Job, LabelQuery};
use pumice_formats::{LabelTableFormat, OpenOptions, read_label_table, write_label_table};
use serde::Serialize;

use crate::error::{Result, SessionError};
use crate::label_rows::LabelRows;
use crate::open::{Residence, open_volume};

/// Number of ids that a line about several names.
const NAMED_IDS: usize = 5;

/// How a table fits the volume that it annotates, in numbers and in lines for people.
#[derive(Clone, Debug, Serialize)]
pub struct TableFit {
    /// Rows of the table, without that of the background.
    pub rows: u64,
    /// Labels that have a row.
    pub labels_with_row: u64,
    /// Labels that have none.
    pub labels_without_row: u64,
    /// Rows for which the volume has no label.
    pub rows_without_label: u64,
    /// Columns of numbers that the volume has now.
    pub columns: u64,
    /// What does not fit, and what the table's reader left out, a line each; empty where everything fits.
    pub notes: Vec<String>,
}

/// Gives names, types and numbers to the labels of a volume without boxes.
pub type Describe<'d> = &'d mut (dyn FnMut(&mut CompressedVolume) -> pumice_core::Result<()> + Send);

/// Calls `write` with the function that gives a volume's labels what a table says ([`annotate`]); returns how the table fits, too.
///
/// # Errors
/// Those of `write` and of [`annotate`].
pub fn describing<T>(
    table: Option<(&AnnotationTable, Vec<String>)>,
    write: impl FnOnce(Describe<'_>) -> Result<T>,
) -> Result<(T, Option<TableFit>)> {
    let (mut fit, mut failure, mut table) = (None, None, table);
    let mut describe = |volume: &mut CompressedVolume| {
        let Some((table, notes)) = table.take() else { return Ok(()) };
        match annotate(volume, table, notes) {
            Ok(of_table) => {
                fit = Some(of_table);
                Ok(())
            }
            Err(error) => {
                // The error itself is returned below.
                failure = Some(error);
                Err(pumice_core::Error::Cancelled)
            }
        }
    };
    let written = write(&mut describe);
    match failure {
        Some(error) => Err(error),
        None => Ok((written?, fit)),
    }
}

/// Gives the labels of a volume what a table has for them. `notes` are those of the table's reader.
///
/// # Errors
/// As [`CompressedVolume::annotate`].
pub fn annotate(
    volume: &mut CompressedVolume,
    table: &AnnotationTable,
    mut notes: Vec<String>,
) -> Result<TableFit> {
    let fit: AnnotationFit = volume.annotate(table)?;
    let rows = fit.labels_with_row + fit.ids_without_label.len() as u64;
    if !fit.columns_left_out.is_empty() {
        let columns = fit.columns_left_out.join(", ");
        notes.push(format!("left out: the columns {columns}, which the volume itself determines"));
    }
    if !fit.ids_without_label.is_empty() {
        let (n, ids) = (fit.ids_without_label.len(), listed(&fit.ids_without_label));
        notes.push(format!("{n} of {rows} rows of the table have ids that the volume lacks: {ids}"));
    }
    if !fit.labels_without_row.is_empty() {
        let (n, all) = (fit.labels_without_row.len(), volume.labels().len());
        let ids = listed(&fit.labels_without_row);
        notes.push(format!("{n} of {all} labels of the volume have no row in the table: {ids}"));
    }
    Ok(TableFit {
        rows,
        labels_with_row: fit.labels_with_row,
        labels_without_row: fit.labels_without_row.len() as u64,
        rows_without_label: fit.ids_without_label.len() as u64,
        columns: volume.labels().columns().len() as u64,
        notes,
    })
}

/// The first ids of a list.
fn listed(ids: &[u64]) -> String {
    let first: Vec<String> = ids.iter().take(NAMED_IDS).map(u64::to_string).collect();
    first.join(", ") + if ids.len() > NAMED_IDS { ", …" } else { "" }
}

/// A table that is read from a file, and the lines of its reader.
///
/// # Errors
/// One line that says what is wrong with the file, and where.
pub fn read_table(path: &Path) -> Result<(AnnotationTable, Vec<String>)> {
    let read = read_label_table(path)?;
    Ok((read.table, read.notes))
}

/// What [`write_labels`] writes.
#[derive(Clone, Debug)]
pub struct TableRequest {
    /// A `.pumice` file or any label volume.
    pub input: PathBuf,
    /// The table to write.
    pub out: PathBuf,
    /// Its format; `None` for the one that the name of `out` stands for.
    pub format: Option<LabelTableFormat>,
    /// Labels to write, as a query line.
    pub query: String,
    /// How to read the volume.
    pub reading: OpenOptions,
}

/// What [`write_labels`] wrote.
#[derive(Clone, Debug, Serialize)]
pub struct TableOutcome {
    /// Name of the format.
    pub format: &'static str,
    /// Number of labels in the table.
    pub labels: u64,
    /// What the format does not hold, a line each.
    pub notes: Vec<String>,
    /// Warnings of the reader about the volume, one line each.
    pub warnings: Vec<String>,
}

/// Writes the labels of a volume as a table. In formats that need a colour for each label, those without one get an automatic one.
///
/// # Errors
/// When the volume, the query or the output's name is wrong, or the file cannot be written; the output is then unchanged.
pub fn write_labels(request: &TableRequest, job: &Job) -> Result<TableOutcome> {
    // Mistakes in the request show before the volume is read.
    let query = parse_query(&request.query)?;
    let format = request.format.map_or_else(|| LabelTableFormat::of_file_name(&request.out), Ok)?;
    request.reading.outputs.declare(&request.out)?;
    let volume = open_volume(&request.input, &request.reading, Residence::Mapped, job)?;
    let mut rows = LabelRows::of(&volume);
    let chosen = rows.sorted(&query, "id")?;
    let mut notes = rows.lacked(&query);
    if format.needs_colors() {
        let filled = rows.fill_colors();
        if filled > 0 {
            notes.push(format!(
                "{filled} of {} labels have no colour and get an automatic one",
                rows.ids().len()
            ));
        }
    }
    let table = rows.table(&chosen)?;
    notes.extend(write_label_table(&request.out, format, &table)?);
    let warnings = request.reading.warnings.list();
    Ok(TableOutcome { format: format.name(), labels: table.len() as u64, notes, warnings })
}

/// Parses a query line.
///
/// # Errors
/// [`SessionError::Caller`] with the place of the fault in the line.
pub fn parse_query(line: &str) -> Result<LabelQuery> {
    LabelQuery::parse(line).map_err(|e| SessionError::Caller(e.to_string()))
}
