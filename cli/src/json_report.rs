//! JSON reports: one object, to a file or to standard output.

use std::path::Path;

use serde::Serialize;

use crate::failure::{Failure, say};

/// Writes `report` to `to`, `-` being standard output.
pub(crate) fn write_report(to: &Path, report: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(report)?;
    if to == Path::new("-") {
        return say(text);
    }
    std::fs::write(to, text + "\n").map_err(|e| Failure::new(format_args!("{}: {e}", to.display())))
}
