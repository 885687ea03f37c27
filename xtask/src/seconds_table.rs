//! The table at the end of `cargo xtask test`: time and result of each part.

use std::fmt::Write;

use crate::part::{Outcome, Row};

/// Formats the table. `elapsed_seconds` is the wall time of all parts together, some of which run in parallel.
pub(crate) fn table(rows: &[Row], elapsed_seconds: f64) -> String {
    let mut text = format!(
        "{:<16}{:>10}{:>10}{:>8}{:>9}{:>9}  result\n",
        "part", "seconds", "CPU s", "cap", "passed", "failed"
    );
    let cpu = |s: Option<f64>| s.map_or_else(|| "–".into(), |s| format!("{s:.1}"));
    for row in rows {
        let result = match &row.outcome {
            Outcome::Passed => "passed".into(),
            Outcome::Failed(what) => format!("FAILED: {what}"),
            Outcome::LeftOut(why) => format!("left out: {why}"),
        };
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{:<16}{:>10.1}{:>10}{:>8}{:>9}{:>9}  {result}",
            row.name,
            row.seconds,
            cpu(row.cpu_seconds),
            row.cap_seconds,
            row.counts.passed,
            row.counts.failed,
        );
    }
    let sum = |f: fn(&Row) -> u64| rows.iter().map(f).sum::<u64>();
    let _ = writeln!(
        text,
        "{:<16}{:>10.1}{:>10}{:>8}{:>9}{:>9}",
        "together",
        elapsed_seconds,
        cpu(rows.iter().map(|r| r.cpu_seconds).sum()),
        "",
        sum(|r| r.counts.passed),
        sum(|r| r.counts.failed),
    );
    text
}
