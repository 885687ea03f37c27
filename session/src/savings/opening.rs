//! What it saves to read only the labels that are shown out of a volume's file.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_scene::Show;
use serde::Serialize;

use super::{Both, in_turn};
use crate::error::Result;
use crate::measure::Stopwatch;
use crate::open::{Residence, open_chosen};

/// What reading only the labels that are shown saves of one file.
#[derive(Clone, Debug, Serialize)]
pub struct OpeningSaved {
    /// The file, without its folder.
    pub file: String,
    /// Labels that are read, and all.
    pub labels: [u64; 2],
    /// Milliseconds of opening: labels that are shown alone, all of them.
    pub ms: Both,
    /// Bytes of the volume in memory, likewise.
    pub bytes: [u64; 2],
}

impl OpeningSaved {
    /// The saving in one line of words.
    pub fn line(&self) -> String {
        let ([shown, all], [without, with], saved) = (self.labels, self.bytes, self.ms.saved);
        format!(
            "saved by reading {shown} of {all} labels of {}: {} of {with} bytes; {:.2} ms ({:.2} to {:.2}) of opening of {:.2} ms",
            self.file,
            with as i64 - without as i64,
            saved.median,
            saved.low,
            saved.high,
            self.ms.with.median
        )
    }
}

/// Opens a file both ways, in turn; returns the whole volume too.
///
/// # Errors
/// As [`open_chosen`].
pub fn measure_opening(
    path: &Path,
    shows: &[&Show],
    reading: &OpenOptions,
    rounds: u32,
    job: &Job,
) -> Result<(OpeningSaved, Arc<CompressedVolume>)> {
    let open = |shows: &[&Show]| -> Result<(Arc<CompressedVolume>, f64)> {
        let clock = Stopwatch::start();
        let volume = open_chosen(path, shows, reading, Residence::Copied, job)?;
        Ok((volume, 1e3 * clock.cpu_seconds()))
    };
    // Once before: neither way is the first to find the file on the disk.
    let (part, (whole, _)) = (open(shows)?.0, open(&[&Show::All])?);
    let [without, with] =
        in_turn(rounds, job, |all, _| Ok(open(if all { &[&Show::All] } else { shows })?.1))?;
    let bytes = [&part, &whole].map(|v| v.resident_parts().into_iter().map(|(_, bytes)| bytes).sum());
    let held = (0..whole.labels().len() as u32).filter(|&label| part.holds(label)).count();
    let saved = OpeningSaved {
        file: path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
        labels: [held, whole.labels().len()].map(|n| n as u64),
        ms: Both::of(without, with),
        bytes,
    };
    Ok((saved, whole))
}
