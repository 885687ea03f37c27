//! JSON reports: one object, written to standard output, or to a file that appears complete or not at all.

use std::path::Path;

use pumice_core::{Outputs, write_text};
use serde::Serialize;

use crate::failure::{Failure, print};

/// Writes `report` to the file `to`, or to standard output if `to` is `-`.
pub(crate) fn write_report(to: &Path, report: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(report)?;
    if to == Path::new("-") {
        return print(&text);
    }
    Ok(write_text(to, &(text + "\n"))?)
}

/// Declares the file of a report as an output, before the work: it must be none of the files that the work reads or writes.
pub(crate) fn declare_report(outputs: &Outputs, to: Option<&Path>) -> Result<(), Failure> {
    match to {
        Some(to) if to != Path::new("-") => Ok(outputs.declare(to)?),
        _ => Ok(()),
    }
}
