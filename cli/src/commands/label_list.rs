//! The labels of a volume as `pumice info --labels` prints them: text in columns, or CSV.

use std::path::Path;
use std::sync::Arc;

use pumice_core::Numbers;
use pumice_core::error::excerpt;
use pumice_session::{Job, LabelRows, OpenOptions, Residence, open_volume, parse_query};

use crate::args::LabelList;
use crate::failure::{self, Failure, say, warn};
use crate::progress::Bar;

/// Headers of the columns, and whether their cells stand right.
const HEADERS: [(&str, bool); 8] = [
    ("id", true),
    ("name", false),
    ("type", false),
    ("voxels", true),
    ("low", true),
    ("high", true),
    ("centre", true),
    ("color", false),
];

/// Most characters of a name in the columns; as CSV it is whole.
const MOST_NAME_CHARS: usize = 120;

/// Prints the labels that `list` asks for.
pub(crate) fn print(
    path: &Path,
    list: &LabelList,
    reading: &OpenOptions,
    job: &Arc<Job>,
) -> Result<(), Failure> {
    let query = parse_query(list.query.as_deref().unwrap_or("*"))?;
    let bar = Bar::follow("reading", job);
    let volume = open_volume(path, reading, Residence::Mapped, job)?;
    let rows = LabelRows::of(&volume);
    drop(bar);
    let chosen = rows.sorted(&query, &list.sort)?;
    rows.lacked(&query).iter().try_for_each(|line| warn(format_args!("warning: {line}")))?;
    if list.csv {
        return failure::print(rows.csv(path, &chosen)?.trim_end_matches('\n'));
    }

    let numbers = rows.numbers();
    let number = |name: &str, row: usize| match numbers.iter().find(|(known, _)| *known == name) {
        Some((_, Numbers::Whole(values))) => values[row].to_string(),
        Some((_, Numbers::Real(values))) if !values[row].is_nan() => short(values[row]),
        _ => "-".to_owned(),
    };
    let three =
        |stem: &str, row: usize| ["x", "y", "z"].map(|axis| number(&format!("{stem}_{axis}"), row)).join(",");
    let cells = |row: usize| {
        let color = rows.colors_srgb()[row].map(|c| c.map(|v| (v * 255.0).round() as u8));
        [
            rows.ids()[row].to_string(),
            excerpt(rows.names()[row], MOST_NAME_CHARS),
            excerpt(rows.types()[row], MOST_NAME_CHARS),
            number("voxels", row),
            three("low", row),
            three("high", row),
            three("centre", row),
            color.map_or_else(|| "-".to_owned(), |[r, g, b]| format!("#{r:02x}{g:02x}{b:02x}")),
        ]
    };
    let lines: Vec<[String; 8]> = std::iter::once(HEADERS.map(|(header, _)| header.to_owned()))
        .chain(chosen.into_iter().map(cells))
        .collect();
    aligned(&lines).into_iter().try_for_each(say)
}

/// A number with at most two digits behind the point.
fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        short => short.to_owned(),
    }
}

/// Lines of cells as text, each column as wide as its widest cell.
fn aligned(lines: &[[String; 8]]) -> Vec<String> {
    let mut widths = [0; 8];
    for line in lines {
        widths.iter_mut().zip(line).for_each(|(width, cell)| *width = (*width).max(cell.chars().count()));
    }
    let one = |line: &[String; 8]| {
        let cells = line.iter().zip(widths).zip(HEADERS).map(|((cell, width), (_, is_right))| {
            if is_right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    lines.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_and_numbers_short() {
        let cells = |texts: [&str; 8]| texts.map(str::to_owned);
        let lines = aligned(&[
            cells(["id", "name", "type", "voxels", "low", "high", "centre", "color"]),
            cells(["12345", "ä", "", "7", "0,0,0", "1,1,1", "1,1,1", "-"]),
        ]);
        assert_eq!(lines[0], "   id  name  type  voxels    low   high  centre  color");
        assert_eq!(lines[1], "12345  ä                7  0,0,0  1,1,1   1,1,1  -");
        assert_eq!([19.0, -0.126, -0.001, 1e6].map(short), ["19", "-0.13", "0", "1000000"]);
    }
}
