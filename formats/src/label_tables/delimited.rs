//! Tables with a delimiter: CSV and TSV, as spreadsheets, data frames, BIDS (`dseg.tsv`) and 3D Slicer write them.
//!
//! ```text
//! id,name,type,color,depth         a header line, in any order of columns; module `delimited_columns` says which names mean what
//! 3,"PV, basket",axon,#ff8000,41.5
//! 17,glia,,,                       an empty cell says nothing
//! ```
//! The delimiter is the tab, comma or semicolon that the first line has most of. A first line that begins with a number is no header; its
//! columns then are an id, up to two texts (name, type) and a colour, as `#rrggbb` or three numbers. Spaces around a cell do not count.

use std::path::Path;

use csv::StringRecord;
use pumice_core::{AnnotationTable, NumericColumn};

use super::cells::{bytes_of_color, check_once, hex_color, id, quoted};
use super::delimited_columns::{Layout, OtherColumn};
use super::text::check_rows;
use super::{LabelTableFile, LabelTableFormat, checked, wrong_cell};
use crate::error::{FormatError, Result};

/// The delimiter of a text: the one that its first line has most of, outside of quotes; a comma where it has none.
fn delimiter_of(text: &str) -> u8 {
    let line = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let (mut counts, mut is_quoted) = ([(b'\t', 0u32), (b',', 0), (b';', 0)], false);
    for byte in line.bytes() {
        is_quoted ^= byte == b'"';
        counts
            .iter_mut()
            .filter(|(delimiter, _)| *delimiter == byte && !is_quoted)
            .for_each(|(_, n)| *n += 1);
    }
    // Of equal counts the last one is taken.
    let (delimiter, count) = counts.into_iter().rev().max_by_key(|&(_, count)| count).unwrap_or((b',', 0));
    if count == 0 { b',' } else { delimiter }
}

/// Reads the rows of a table.
pub(super) fn read(path: &Path, text: &str) -> Result<LabelTableFile> {
    let delimiter = delimiter_of(text);
    check_quotes(path, text, delimiter)?;
    let format = if delimiter == b'\t' { LabelTableFormat::Tsv } else { LabelTableFormat::Csv };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());

    // The first line says what the columns are; without a header it is a row itself.
    let mut record = StringRecord::new();
    let damaged = |e: csv::Error| FormatError::damaged(path, e.to_string());
    if !reader.read_record(&mut record).map_err(damaged)? {
        return Err(FormatError::damaged(path, "expected a table of labels, got no rows"));
    }
    let line_of = |record: &StringRecord| line_of(text, record);
    let (layout, is_header) = Layout::of_first_line(path, line_of(&record), &record)?;
    let mut rows = Rows::new(path, layout);
    if !is_header {
        rows.push(line_of(&record), &record)?;
    }
    while reader.read_record(&mut record).map_err(damaged)? {
        rows.push(line_of(&record), &record)?;
    }
    rows.finish(format)
}

/// Line in which a record begins. The crate says where it began to look for it, which is before the line breaks that it passes over: empty
/// lines, and the second character of a Windows line break.
fn line_of(text: &str, record: &StringRecord) -> u64 {
    record.position().map_or(1, |place| {
        let rest = text.as_bytes().get(place.byte() as usize..).unwrap_or_default();
        let breaks = rest.iter().take_while(|b| matches!(b, b'\n' | b'\r'));
        place.line() + breaks.filter(|&&b| b == b'\n').count() as u64
    })
}

/// Refuses a text that ends within quotes: it is truncated, or a quote is missing and its cell swallows the rest. The crate reads such a
/// text to its end without a word.
fn check_quotes(path: &Path, text: &str, delimiter: u8) -> Result<()> {
    let (mut line, mut field, mut opened) = (1, 1, None);
    let mut at_start = true;
    for byte in text.bytes() {
        match (byte, opened) {
            // A quote opens at the start of a field. Two within quotes stand for one: the first closes, the second opens again.
            (b'"', None) if at_start => opened = Some((line, field)),
            (b'"', Some(_)) => {
                opened = None;
                at_start = true;
                continue;
            }
            (b'\n', None) => field = 1,
            (other, None) if other == delimiter => field += 1,
            _ => {}
        }
        line += u64::from(byte == b'\n');
        at_start = opened.is_none() && (byte == delimiter || byte == b'\n');
    }
    match opened {
        Some((line, field)) => {
            Err(wrong_cell(path, line, field, "expected a closing quote, got the end of the file"))
        }
        None => Ok(()),
    }
}

/// Rows that are read so far.
struct Rows<'a> {
    path: &'a Path,
    layout: Layout,
    lines: Vec<u64>,
    ids: Vec<u64>,
    names: Vec<String>,
    types: Vec<String>,
    hex_colors: Vec<Option<[f32; 3]>>,
    /// Red, green and blue in the file's own range; NaN where the row has none.
    channels: Vec<[f64; 3]>,
}

impl<'a> Rows<'a> {
    fn new(path: &'a Path, layout: Layout) -> Self {
        Self {
            path,
            layout,
            lines: Vec::new(),
            ids: Vec::new(),
            names: Vec::new(),
            types: Vec::new(),
            hex_colors: Vec::new(),
            channels: Vec::new(),
        }
    }

    fn push(&mut self, line: u64, record: &StringRecord) -> Result<()> {
        check_rows(self.path, self.ids.len())?;
        let (path, layout) = (self.path, &mut self.layout);
        if record.len() != layout.fields {
            let (expected, got) = (layout.fields, record.len());
            let what = format!("expected {expected} fields as in the first line, got {got}");
            return Err(wrong_cell(path, line, got.min(expected) + 1, what));
        }
        let cell = |column: usize| record.get(column).unwrap_or_default();
        let text = |column: Option<usize>| column.map(cell).unwrap_or_default().to_owned();
        let wrong = |column: usize, what: String| wrong_cell(path, line, column + 1, what);

        self.ids.push(id(cell(layout.id)).map_err(|what| wrong(layout.id, what))?);
        self.lines.push(line);
        self.names.push(text(layout.name));
        self.types.push(text(layout.kind));
        let color = layout.color.map(|c| hex_color(cell(c)).map_err(|what| wrong(c, what))).transpose()?;
        self.hex_colors.push(color.flatten());
        let mut channels = [f64::NAN; 3];
        for (value, &column) in channels.iter_mut().zip(layout.channels.iter().flatten()) {
            match cell(column) {
                "" => {}
                text => *value = channel(text).map_err(|what| wrong(column, what))?,
            }
        }
        if channels.iter().any(|v| v.is_nan()) != channels.iter().all(|v| v.is_nan()) {
            let at = layout.channels.map_or(0, |columns| columns[0]);
            return Err(wrong(at, "expected red, green and blue or none of them, got some".into()));
        }
        self.channels.push(channels);
        layout.others.iter_mut().for_each(|other| other.push(line, cell(other.column)));
        Ok(())
    }

    fn finish(self, format: LabelTableFormat) -> Result<LabelTableFile> {
        if self.ids.is_empty() {
            return Err(FormatError::damaged(
                self.path,
                "expected a row a label behind the header, got none",
            ));
        }
        check_once(self.path, &self.ids, &self.lines, self.layout.id + 1)?;
        let channels = colors_of(&self.channels);
        let colors =
            self.hex_colors.into_iter().zip(channels).map(|(hex, channels)| hex.or(channels)).collect();
        let mut notes = Vec::new();
        let mut columns = Vec::new();
        for other in self.layout.others {
            match other.finish(self.path)? {
                Ok(column) => columns.push(column),
                Err(note) => notes.extend(note),
            }
        }
        let table = AnnotationTable::new(self.ids, self.names, self.types, colors, columns);
        Ok(LabelTableFile { table: checked(self.path, table)?, format, notes })
    }
}

/// A channel of a colour: from 0 to 1 or from 0 to 255.
fn channel(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v| (0.0..=255.0).contains(v))
        .ok_or_else(|| format!("expected a colour from 0 to 1 or from 0 to 255, got {}", quoted(text)))
}

/// Colours from 0 to 1 where no channel of the table is above 1, else from 0 to 255.
fn colors_of(channels: &[[f64; 3]]) -> Vec<Option<[f32; 3]>> {
    let most = if channels.iter().flatten().any(|&v| v > 1.0) { 255.0 } else { 1.0 };
    channels.iter().map(|c| (!c[0].is_nan()).then(|| c.map(|v| (v / most) as f32))).collect()
}

/// Headers of the columns that each written table has.
const FIXED: [&str; 4] = ["id", "name", "type", "color"];

/// Writes all rows of a table.
pub(super) fn write(path: &Path, table: &AnnotationTable, delimiter: u8) -> Result<(String, Vec<String>)> {
    let order: Vec<usize> = (0..table.len()).collect();
    Ok((write_rows(path, table, &order, delimiter)?, lost(table)))
}

/// Writes id, name, type and colour, then the columns of numbers, of these rows in this order.
pub(super) fn write_rows(
    path: &Path,
    table: &AnnotationTable,
    order: &[usize],
    delimiter: u8,
) -> Result<String> {
    let failed = |what: String| FormatError::option(path, what);
    let mut writer = csv::WriterBuilder::new().delimiter(delimiter).from_writer(Vec::new());
    let columns: Vec<&NumericColumn> =
        table.columns().iter().filter(|c| !FIXED.contains(&c.name.as_str())).collect();
    let header = FIXED.into_iter().chain(columns.iter().map(|c| c.name.as_str()));
    writer.write_record(header).map_err(|e| failed(e.to_string()))?;
    for &row in order {
        let (id, color) = (table.ids()[row], table.colors_srgb()[row].map(bytes_of_color));
        let color = color.map_or_else(String::new, |[r, g, b]| format!("#{r:02x}{g:02x}{b:02x}"));
        let fixed = [id.to_string(), table.names()[row].clone(), table.types()[row].clone(), color];
        let numbers = columns.iter().map(|c| number_text(c.values[row]));
        writer.write_record(fixed.into_iter().chain(numbers)).map_err(|e| failed(e.to_string()))?;
    }
    let bytes = writer.into_inner().map_err(|e| failed(e.to_string()))?;
    String::from_utf8(bytes).map_err(|e| failed(e.to_string()))
}

/// What a reader of the written table does not get back.
fn lost(table: &AnnotationTable) -> Vec<String> {
    let clashing = table.columns().iter().filter(|c| FIXED.contains(&c.name.as_str()));
    let mut notes: Vec<String> = clashing
        .map(|c| format!("left out: the numbers {}, whose name another column has", c.name))
        .collect();
    let texts = table.names().iter().chain(table.types());
    let spaced = texts.filter(|text| text.trim() != text.as_str()).count();
    if spaced > 0 {
        notes.push(format!(
            "{spaced} names or types begin or end with a space, which readers of tables may drop"
        ));
    }
    notes
}

/// A number in the fewest digits that give it back exactly; empty for NaN.
fn number_text(value: f64) -> String {
    match value {
        v if v.is_nan() => String::new(),
        v if v == 0.0 || (1e-5..1e16).contains(&v.abs()) => v.to_string(),
        v => format!("{v:e}"),
    }
}

/// Makes the columns of a table without a header from its first row.
pub(super) fn without_header(path: &Path, line: u64, record: &StringRecord) -> Result<Layout> {
    let mut layout = Layout { fields: record.len(), ..Layout::default() };
    let is_number = |column: usize| record.get(column).is_some_and(|cell| cell.parse::<f64>().is_ok());
    let is_color = |column: usize| record.get(column).is_some_and(|cell| cell.starts_with('#'));
    let mut at = 1;
    for text in [&mut layout.name, &mut layout.kind] {
        if at < record.len() && !is_number(at) && !is_color(at) {
            *text = Some(at);
            at += 1;
        }
    }
    match record.len() - at {
        0 => {}
        1 if is_color(at) => layout.color = Some(at),
        3 | 4 if (at..record.len()).all(is_number) => layout.channels = Some([at, at + 1, at + 2]),
        _ => {
            let got = quoted(record.get(at).unwrap_or_default());
            let what = format!(
                "expected a header line that names the columns, or an id, a name, a type and a colour; got {got}"
            );
            return Err(wrong_cell(path, line, at + 1, what));
        }
    }
    if record.len() - at == 4 {
        layout.others.push(OtherColumn::left_out(at + 3, "the opacity of the colours"));
    }
    Ok(layout)
}
