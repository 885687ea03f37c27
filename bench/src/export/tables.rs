//! Writes the measurements as CSV, and as a Markdown page that says what they include and whether the bar holds.

use std::path::Path;

use pumice_session::error::Result;
use serde::Serialize;

use super::{ExportFigures, WrittenRow};
use crate::files::write_results;
use crate::table::{Row, Table};
use crate::timing::Took;

/// The bar: a `.usdc` of 10⁶ boxes.
const BAR_BOXES: u64 = 1_000_000;
/// Wall seconds of the whole export, from the `.pumice` file to the synced one.
const BAR_SECONDS: f64 = 2.0;
/// Peak of memory.
const BAR_BYTES: u64 = 300_000_000;

/// A file beside what Pumice took for the same.
#[derive(Serialize)]
struct Beside<'a> {
    row: &'a WrittenRow,
    ours: Option<&'a WrittenRow>,
}

impl Row for Beside<'_> {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let row = self.row;
        let over = |of: fn(&WrittenRow) -> f64| match self.ours {
            Some(ours) if ours.writer != row.writer => format!("{:.2}", of(row) / of(ours)),
            _ => String::new(),
        };
        let megabytes = |bytes: u64| format!("{:.0}", bytes as f64 / 1e6);
        let peak = |row: &WrittenRow| row.peak_rss_bytes.map_or(f64::NAN, |bytes| bytes as f64);
        let took = |took: Took| format!("{} ({})", seconds(took.seconds), seconds(took.cpu_seconds));
        vec![
            ("volume", row.volume.clone()),
            ("form", row.form.clone()),
            ("file", format!(".{}", row.format)),
            ("writer", row.writer.clone()),
            ("bytes", row.bytes.to_string()),
            ("find, s (CPU)", row.prepare.map_or(String::new(), took)),
            ("write, s (CPU)", took(row.write)),
            ("peak, MB", row.peak_rss_bytes.map_or(String::new(), megabytes)),
            ("CPU of writing, over ours", over(|row| row.write.cpu_seconds)),
            ("peak, over ours", over(peak)),
        ]
    }
}

/// Seconds to a millisecond, below 0.01 s to 10 µs: opening, writing and syncing a file take longer than that.
fn seconds(value: f64) -> String {
    if value < 0.01 { format!("{value:.5}") } else { format!("{value:.3}") }
}

impl ExportFigures {
    /// Rows that the bar speaks of, with whether it holds.
    fn barred(&self) -> impl Iterator<Item = (&WrittenRow, bool)> {
        let of_bar = |row: &&WrittenRow| {
            let boxes = row.boxes.max(row.faces / 6);
            let is_generated = row.form == "instances" || row.form == "boxes";
            row.prepare.is_some() && row.format == "usdc" && boxes == BAR_BOXES && is_generated
        };
        self.written.iter().filter(of_bar).map(|row| {
            let seconds = row.prepare.map_or(0.0, |t| t.seconds) + row.write.seconds;
            (row, seconds <= BAR_SECONDS && row.peak_rss_bytes.is_some_and(|bytes| bytes <= BAR_BYTES))
        })
    }

    /// Whether 10⁶ boxes, each once, meet the bar, where they were measured. The surface of as many has six times the elements.
    pub fn holds(&self) -> bool {
        self.barred().all(|(row, holds)| holds || row.form != "instances")
    }
}

/// Writes `export.csv`, `export-import.csv` and `export.md` into `folder`; `machine` describes the machine.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_export(folder: &Path, machine: &str, figures: &ExportFigures) -> Result<()> {
    let ours = |row: &WrittenRow| {
        let same = |a: &&WrittenRow| (&a.volume, &a.form, &a.format) == (&row.volume, &row.form, &row.format);
        figures.written.iter().filter(same).find(|row| row.prepare.is_some())
    };
    let rows: Vec<Beside<'_>> = figures.written.iter().map(|row| Beside { row, ours: ours(row) }).collect();
    let (written, imported) = (Table::of(&rows), Table::of(&figures.imported));
    let mut files = vec![("export.csv".into(), written.csv())];
    if !figures.imported.is_empty() {
        files.push(("export-import.csv".into(), imported.csv()));
    }
    let mut page = format!("# export\n\n{machine}\n\n{WRITING}\n\n{}", written.markdown());
    for (row, holds) in figures.barred() {
        let seconds = row.prepare.map_or(0.0, |t| t.seconds) + row.write.seconds;
        page += &format!(
            "\nThe bar for 10⁶ boxes as a `.usdc`, {BAR_SECONDS} s and {} MB, {} in the form `{}`: {seconds:.2} s, {:.0} MB.\n",
            BAR_BYTES / 1_000_000,
            if holds { "holds" } else { "is missed" },
            row.form,
            row.peak_rss_bytes.unwrap_or(0) as f64 / 1e6
        );
    }
    if !figures.imported.is_empty() {
        page += &format!("\n## Import into Blender\n\n{IMPORTING}\n\n{}", imported.markdown());
    }
    if !figures.left_out.is_empty() {
        page += &format!("\nLeft out: {}.\n", figures.left_out.join("; "));
    }
    files.push(("export.md".into(), page));
    write_results(folder, files)
}

const WRITING: &str = "\
Each measurement is a process of its own. Times are wall seconds, with CPU seconds of all threads in brackets, the least of the rounds; \
peaks are of the whole process. `find` is opening the `.pumice` file and finding its boxes or its visible faces, `write` is all from there \
to a file that is synced to the disk: making the arrays, compressing and writing them. The other writers get the same arrays as those of \
Pumice's `.usdc`, in memory as numpy arrays (usd-core) and as vectors of their own types (openusd) before the clock starts; their time is \
making the stage from them, writing and syncing it, without materials and notes. What they wrote is read back and compared. Cubes have 4³ \
voxels of 1000 labels and touch nothing: `instances` has a box for each, `boxes` its six faces.";

const IMPORTING: &str = "\
The import is the operator alone, without adding up what it made. The first sample is of 320 × 180 pixels on the CPU, with all that Cycles \
does before it. Peaks include Blender itself.";
