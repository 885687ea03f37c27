//! Measures what reading only the visible labels of a volume's file saves.

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

/// What reading only the visible labels of one file saves.
#[derive(Clone, Debug, Serialize)]
pub struct OpeningSaved {
    /// The file, without its folder.
    pub file: String,
    /// Number of labels that are read, and of all labels.
    pub labels: [u64; 2],
    /// Milliseconds of opening the visible labels only, and all labels.
    pub ms: Both,
    /// Bytes of the volume in memory with the visible labels only, and with all labels.
    pub bytes: [u64; 2],
}

impl OpeningSaved {
    /// The saving as one line of text.
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

/// Measures opening a file both ways, in turn; also returns the whole volume.
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
    // Open both ways once before measuring, so that neither way has to load the file into the disk cache.
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
