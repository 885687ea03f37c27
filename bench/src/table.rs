//! Tables of measurements, as Markdown and as CSV.

use std::path::{Path, PathBuf};

use clap::Args;
use pumice_session::error::Result;
use serde::Serialize;

use crate::console::{BenchResult, Console};
use crate::files::write_results;
use crate::machine;

/// Measurements that form one row of a table.
pub trait Row: Serialize {
    /// Pairs of column name and cell text. All rows of a table have the same columns.
    fn cells(&self) -> Vec<(&'static str, String)>;
}

/// A table of text with named columns.
#[derive(Clone, Debug, Default)]
pub struct Table {
    columns: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table of these rows, with the columns of the first row.
    pub fn of<R: Row>(rows: &[R]) -> Self {
        Self::of_cells(rows.iter().map(Row::cells))
    }

    /// A table of rows of (column name, cell text), as [`Row::cells`] gives them.
    pub(crate) fn of_cells(rows: impl IntoIterator<Item = Vec<(&'static str, String)>>) -> Self {
        let mut table = Self::default();
        for row in rows {
            let (columns, cells): (Vec<&'static str>, Vec<String>) = row.into_iter().unzip();
            if table.rows.is_empty() {
                table.columns = columns;
            } else {
                debug_assert_eq!(table.columns, columns);
            }
            table.rows.push(cells);
        }
        table
    }

    /// A table with these columns; each row has as many cells.
    pub(crate) fn new(columns: &[&'static str], rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        let table = Self { columns: columns.to_vec(), rows: rows.into_iter().collect() };
        debug_assert!(table.rows.iter().all(|row| row.len() == table.columns.len()));
        table
    }

    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
        let rule = self.columns.iter().map(|_| "---").collect();
        let rows: String = self.rows.iter().map(|r| line(r.iter().map(String::as_str).collect())).collect();
        line(self.columns.clone()) + &line(rule) + &rows
    }

    /// Comma-separated values, quoted where they must be (RFC 4180).
    pub fn csv(&self) -> String {
        let line = |cells: Vec<&str>| cells.into_iter().map(csv_cell).collect::<Vec<_>>().join(",") + "\n";
        let rows: String = self.rows.iter().map(|r| line(r.iter().map(String::as_str).collect())).collect();
        line(self.columns.clone()) + &rows
    }
}

/// A value as a CSV cell, quoted if it must be.
pub(crate) fn csv_cell(value: &str) -> String {
    match value.contains([',', '"', '\n']) {
        true => quoted(value),
        false => value.to_owned(),
    }
}

/// A value in quotes.
pub(crate) fn quoted(value: &str) -> String {
    format!("\"{}\"", value.replace('"', "\"\""))
}

/// Flags of a bench that writes one table: its volumes and its output folder.
#[derive(Debug, Args)]
pub(crate) struct TableFlags {
    /// Label volumes or, where nothing is compressed anew, .pumice files
    #[arg(value_name = "VOLUME", required = true)]
    pub(crate) volumes: Vec<PathBuf>,
    /// Also write NAME.md and NAME.csv into this folder, created if missing
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

impl TableFlags {
    /// Prints the Markdown page of the bench `name`, and writes its files if `--out` is given.
    pub(crate) fn show<R: Row>(&self, name: &str, rows: &[R], console: &mut Console<'_>) -> BenchResult<()> {
        let table = Table::of(rows);
        let page = page(name, &table);
        console.line(page.trim_end())?;
        if let Some(folder) = &self.out {
            write(folder, name, page, &table)?;
        }
        Ok(())
    }
}

fn page(name: &str, table: &Table) -> String {
    format!("# {name}\n\n{}\n\n{}", machine::description(), table.markdown())
}

fn write(folder: &Path, name: &str, page: String, table: &Table) -> Result<()> {
    write_results(folder, [(format!("{name}.md"), page), (format!("{name}.csv"), table.csv())])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Megabytes {
        volume: &'static str,
        mb: f64,
    }

    impl Row for Megabytes {
        fn cells(&self) -> Vec<(&'static str, String)> {
            vec![("volume", self.volume.into()), ("MB", format!("{:.1}", self.mb))]
        }
    }

    #[test]
    fn both_ways() {
        let table = Table::of(&[Megabytes { volume: "a, \"b\"", mb: 1.5 }]);
        assert_eq!(table.markdown(), "| volume | MB |\n| --- | --- |\n| a, \"b\" | 1.5 |\n");
        assert_eq!(table.csv(), "volume,MB\n\"a, \"\"b\"\"\",1.5\n");
    }
}
