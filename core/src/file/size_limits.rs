//! Limits on what the sections of a file decode to, so that a small file with right checksums cannot ask for much more memory than a volume
//! of its size needs: zstd yields up to 32,768 times its input.
//!
//! ```text
//! INFO      at most 16 MiB, or 256 times its bytes in the file
//! others    at most 64 bytes a voxel of the volume (LCOL: times its columns; of a time series: times its frames), and 4 KiB
//! together  what is free, where the system says how much
//! ```
//! **Why 64.** A voxel that is a label, a box, a node and a run of its own has 8 bytes in each of LIDS, LVOX, RUNS, BOXS and OCCU, 24 in
//! NODE, and at most 3 contacts of 5 bytes in LCON. **Why 256.** JSON of names compresses 5 to 20 times, because each has an id of its own.

use super::format_error::{FormatError, Stop};
use super::layout::{Entry, Layout};
use crate::VolumeInfo;
use crate::reserve::check_room;

const MOST_INFO_BYTES: u64 = 16 << 20;
const MOST_INFO_EXPANSION: u64 = 256;
const MOST_BYTES_A_VOXEL: u64 = 64;
/// For volumes of few voxels, whose tables have a header or a dictionary.
const ALWAYS_ALLOWED_BYTES: u64 = 4096;

fn within(entry: &Entry, most: u64) -> Result<(), FormatError> {
    if entry.decoded <= most {
        return Ok(());
    }
    let what = format!("decoded size: expected at most {most} for this volume, got {}", entry.decoded);
    Err(FormatError { section: entry.name, at: entry.offset, what })
}

/// Checks the declared size of `INFO`, before it is decoded.
pub(super) fn check_info(entry: &Entry) -> Result<(), FormatError> {
    within(entry, MOST_INFO_BYTES.max(entry.stored.saturating_mul(MOST_INFO_EXPANSION)))
}

/// Checks the declared sizes of all sections of a volume with `columns` columns of numbers, before more than `INFO` is decoded.
pub(super) fn check_sections(
    layout: &Layout,
    volume: &VolumeInfo,
    columns: usize,
) -> Result<(), FormatError> {
    let voxels = volume.voxels().saturating_mul(layout.frames.into());
    let most = voxels.saturating_mul(MOST_BYTES_A_VOXEL).saturating_add(ALWAYS_ALLOWED_BYTES);
    for entry in layout.entries.iter().filter(|e| e.name != *b"INFO") {
        let times = if entry.name == *b"LCOL" { columns.max(1) as u64 } else { 1 };
        within(entry, most.saturating_mul(times))?;
    }
    Ok(())
}

/// Checks that there is memory for the sections that are going to be decoded.
pub(super) fn check_memory<'a>(entries: impl Iterator<Item = &'a Entry>) -> Result<(), Stop> {
    let bytes = entries.fold(0u64, |sum, entry| sum.saturating_add(entry.decoded));
    check_room("the decoded file", bytes).map_err(|e| Stop::Core(e.into()))
}
