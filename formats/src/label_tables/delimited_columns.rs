//! What the columns of a delimited table mean.
//!
//! | meaning | names, in any letters; the first in this order that the table has |
//! |---|---|
//! | id | `id` `label_id` `labelvalue` `segment_id` `root_id` `index` `label` |
//! | name | `name` `label_name` `label` |
//! | type | `type` `cell_type` |
//! | colour `#rrggbb` | `color` `colour` `hex` |
//! | colour in three columns | `r` `g` `b`, `red` `green` `blue`, `color_r` `color_g` `color_b` |
//!
//! The opacity beside three such columns (`a`, `alpha`, `color_a`) is left out, with a note. Every other column whose cells are all numbers or
//! empty is a column of numbers under its own name. The rest is left out, and a note says which column and the first cell that is no number.

use std::path::Path;

use csv::StringRecord;
use pumice_core::NumericColumn;
use pumice_core::error::one_line;

use super::cells::quoted;
use super::delimited::without_header;
use super::wrong_cell;
use crate::error::Result;

const IDS: [&str; 7] = ["id", "label_id", "labelvalue", "segment_id", "root_id", "index", "label"];
const NAMES: [&str; 3] = ["name", "label_name", "label"];
const TYPES: [&str; 2] = ["type", "cell_type"];
const COLORS: [&str; 3] = ["color", "colour", "hex"];
const CHANNELS: [[&str; 3]; 3] =
    [["r", "g", "b"], ["red", "green", "blue"], ["color_r", "color_g", "color_b"]];

/// Opacity beside the [`CHANNELS`] in the same place.
const OPACITIES: [&str; 3] = ["a", "alpha", "color_a"];

/// Whole numbers beyond this are no longer all exact in f64.
const MOST_EXACT: u128 = 1 << 53;

/// Which columns have what, by index from 0.
#[derive(Debug, Default)]
pub(super) struct Layout {
    /// Number of fields of each line.
    pub(super) fields: usize,
    pub(super) id: usize,
    pub(super) name: Option<usize>,
    pub(super) kind: Option<usize>,
    pub(super) color: Option<usize>,
    pub(super) channels: Option<[usize; 3]>,
    pub(super) others: Vec<OtherColumn>,
}

impl Layout {
    /// The columns of a table by its first line, and whether that line is a header.
    pub(super) fn of_first_line(path: &Path, line: u64, record: &StringRecord) -> Result<(Self, bool)> {
        // Negative and fractional ids are wrong, but they are no header.
        if record.get(0).is_some_and(|cell| cell.parse::<f64>().is_ok()) {
            return Ok((without_header(path, line, record)?, false));
        }
        let headers: Vec<String> = record
            .iter()
            .enumerate()
            .map(|(i, cell)| {
                if i == 0 { cell.trim_start_matches('#').trim() } else { cell }.to_ascii_lowercase()
            })
            .collect();
        for (column, header) in record.iter().enumerate() {
            if !header.is_empty() && record.iter().take(column).any(|before| before == header) {
                let what = format!("expected each column once, got {} twice", quoted(header));
                return Err(wrong_cell(path, line, column + 1, what));
            }
        }
        let mut taken = vec![false; headers.len()];
        let mut take = |names: &[&str]| {
            let free = |name: &&str| headers.iter().position(|h| h == *name).filter(|&c| !taken[c]);
            let column = names.iter().find_map(free)?;
            taken[column] = true;
            Some(column)
        };
        let Some(id) = take(&IDS) else {
            let names = record.iter().map(quoted).collect::<Vec<_>>().join(", ");
            let what =
                format!("expected a column id, label or index in the header, got {}", one_line(&names));
            return Err(wrong_cell(path, line, 1, what));
        };
        let (name, kind, color) = (take(&NAMES), take(&TYPES), take(&COLORS));
        let at = |name: &str| headers.iter().position(|h| h == name);
        let triple = |(names, opacity): (&[&str; 3], &str)| {
            let [r, g, b] = names.map(at);
            Some(([r?, g?, b?], at(opacity)))
        };
        // Next to a colour in one column, three more are further numbers.
        let found = if color.is_none() { CHANNELS.iter().zip(OPACITIES).find_map(triple) } else { None };
        let (channels, opacity) = found.map_or((None, None), |(channels, opacity)| (Some(channels), opacity));
        channels.iter().flatten().for_each(|&column| taken[column] = true);
        let others = (0..headers.len()).filter(|&c| !taken[c]).map(|column| {
            let header = record.get(column).unwrap_or_default();
            match header {
                "" => OtherColumn::left_out(column, &format!("column {}, which has no name", column + 1)),
                name if opacity == Some(column) => {
                    OtherColumn::left_out(column, &format!("the column {name}, which is opacity"))
                }
                name => OtherColumn::new(column, name),
            }
        });
        let others = others.collect();
        Ok((Self { fields: headers.len(), id, name, kind, color, channels, others }, true))
    }
}

/// What a column gives: its numbers, or a note why it is left out, which an empty column without a name does not need.
pub(super) type Finished = std::result::Result<NumericColumn, Option<String>>;

/// A column that is none of those with a meaning.
#[derive(Debug)]
pub(super) struct OtherColumn {
    /// Its index, from 0.
    pub(super) column: usize,
    name: String,
    values: Vec<f64>,
    /// Whether its cells matter: a column without a name is only named where it has some.
    has_cells: bool,
    is_left_out: bool,
    /// Line and text of the first cell that is no number.
    text: Option<(u64, String)>,
    /// Likewise of one that is infinite or NaN, and of one that f64 would round.
    infinite: Option<(u64, String)>,
    rounded: Option<(u64, String)>,
}

impl OtherColumn {
    fn new(column: usize, name: &str) -> Self {
        Self {
            column,
            name: name.to_owned(),
            values: Vec::new(),
            has_cells: false,
            is_left_out: false,
            text: None,
            infinite: None,
            rounded: None,
        }
    }

    /// A column that is left out whatever its cells are; `what` names it.
    pub(super) fn left_out(column: usize, what: &str) -> Self {
        Self { is_left_out: true, ..Self::new(column, what) }
    }

    /// Adds the cell of a row.
    pub(super) fn push(&mut self, line: u64, cell: &str) {
        self.has_cells |= !cell.is_empty();
        if self.is_left_out || self.text.is_some() {
            return;
        }
        let value = if cell.is_empty() { Ok(f64::NAN) } else { cell.parse::<f64>() };
        let found = || Some((line, quoted(cell)));
        match value {
            Err(_) => {
                self.text = found();
                self.values = Vec::new();
            }
            Ok(value) => {
                if !cell.is_empty() && !value.is_finite() && self.infinite.is_none() {
                    self.infinite = found();
                }
                // Digits without a point or an exponent are a whole number, which f64 must hold exactly.
                let digits = cell.trim_start_matches(['-', '+']);
                let is_whole = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
                let is_exact = || digits.parse::<u128>().is_ok_and(|whole| whole <= MOST_EXACT);
                if is_whole && !is_exact() && self.rounded.is_none() {
                    self.rounded = found();
                }
                self.values.push(value);
            }
        }
    }

    /// The column of numbers, or a note why there is none.
    ///
    /// # Errors
    /// For a cell that is infinite or not a number in a column of numbers.
    pub(super) fn finish(self, path: &Path) -> Result<Finished> {
        let name = one_line(&self.name);
        if self.is_left_out {
            return Ok(Err(self.has_cells.then(|| format!("left out: {name}"))));
        }
        if let Some((line, cell)) = self.text {
            return Ok(Err(Some(format!(
                "left out: the column {name}, because line {line} has {cell}, which is no number"
            ))));
        }
        if let Some((line, cell)) = self.infinite {
            let what = format!("expected a finite number or an empty cell in {name}, got {cell}");
            return Err(wrong_cell(path, line, self.column + 1, what));
        }
        if let Some((line, cell)) = self.rounded {
            let note = format!(
                "left out: the column {name}, because line {line} has {cell}, which would be rounded (numbers are exact up to 2^53)"
            );
            return Ok(Err(Some(note)));
        }
        Ok(Ok(NumericColumn { name: self.name, values: self.values }))
    }
}
