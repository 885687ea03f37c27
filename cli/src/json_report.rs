//! JSON reports: one object, written to a file or to standard output.

use std::path::Path;

use serde::Serialize;

use crate::failure::{Failure, print};

/// Writes `report` to the file `to`, or to standard output if `to` is `-`.
pub(crate) fn write_report(to: &Path, report: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(report)?;
    if to == Path::new("-") {
        return print(&text);
    }
    std::fs::write(to, text + "\n").map_err(|e| Failure::new(format_args!("{}: {e}", to.display())))
}
