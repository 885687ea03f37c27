//! Compression of a time series: volumes of one size, frame after frame, into one file whose frames share nodes and leaves.
//!
//! ```text
//! frame 0 ─► parts ─┐                      ┌─► chunk 0: boxes of frame 0, 1, 2 … over the nodes and leaves of this chunk
//! frame 1 ─► parts ─┼─► by chunk and frame ┼─► chunk 1: …
//! …                 ┘                      └─► one table of labels for all frames
//! ```
//! What stands still from one frame to the next has equal boxes, whose nodes are stored once. A volume in memory is one frame
//! ([`crate::Series::frame`]).

use std::path::Path;

use crate::compress::{
    checked, checked_chunks, make_parts, reading_share, store_over, write_parts, write_volume,
};
use crate::store::StoredParts;
use crate::{
    BlockSource, ChunkGrid, ChunkSet, CompressOptions, CompressedVolume, CompressionLevel, Error, Job,
    KeptRecords, LabelNote, PartSource, Result, VolumeInfo, WrittenVolume,
};

/// Delivers the frames of a time series, one after another.
pub trait SeriesSource: Send {
    /// Number of frames, at least 1.
    fn frames(&self) -> u32;

    /// Where a frame comes from, for messages: a file, or a time step of one.
    fn name(&self, frame: u32) -> String;

    /// Opens the next frame. The one before is read to its end.
    ///
    /// # Errors
    /// Those of the source.
    fn next_frame(&mut self) -> Result<Box<dyn BlockSource + '_>>;
}

/// Compresses a time series into one `.pumice` file, which appears under its name once all of it is on disk. Memory is bounded as in
/// [`crate::compress_to_file`], but for 12 bytes for each box of all frames of the densest chunk. A series of one frame gives the file that
/// its volume alone gives.
///
/// All frames must have the same size, label type, matrix and unit. Names of labels are those of the first frame that has them.
///
/// # Errors
/// As [`crate::compress_to_file`]; [`Error::Caller`] where a frame differs from the first.
pub fn compress_series_to_file(
    source: &mut dyn SeriesSource,
    path: &Path,
    level: CompressionLevel,
    options: &CompressOptions,
    describe: &mut (dyn FnMut(&mut CompressedVolume) -> Result<()> + Send),
    job: &Job,
) -> Result<WrittenVolume> {
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    let (info, parts) = parts_of(
        source,
        (|info: &VolumeInfo| Ok(info.voxels()), reading_share(level)),
        None,
        options,
        &folder,
        job,
    )?;
    write_volume(path, level, info, parts, options, &folder, describe, job)
}

/// Compresses some chunks of a time series, at all frames, into files that [`crate::merge_parts`] joins with those of the others, as
/// [`crate::compress_parts`] does. Each frame of `source` describes the whole volume and delivers the voxels of these chunks alone. With `kept`,
/// each frame is kept once it is read, and what is there already is not read again.
///
/// # Errors
/// As [`compress_series_to_file`] and [`crate::compress_parts`].
pub fn compress_series_parts(
    source: &mut dyn SeriesSource,
    parts: &[(ChunkSet, &Path)],
    from: &PartSource,
    kept: Option<&mut KeptRecords>,
    options: &CompressOptions,
    job: &Job,
) -> Result<Vec<WrittenVolume>> {
    let folder = options.temp_folder.clone().unwrap_or_else(std::env::temp_dir);
    let expected = |info: &VolumeInfo| checked_chunks(parts, &ChunkGrid::new(info.dims));
    let share = reading_share(CompressionLevel::Default);
    let (info, stored) = parts_of(source, (expected, share), kept, options, &folder, job)?;
    write_parts(parts, info, stored, from, options, &folder, job)
}

/// Reads all blocks of all frames; returns what the frames have in common, and what their chunks have. `expected`
/// says how many voxels the blocks of a frame have; reading takes this share of the job's time. Of a frame that is `kept`, only the description
/// is read.
fn parts_of(
    source: &mut dyn SeriesSource,
    (expected, share): (impl Fn(&VolumeInfo) -> Result<u64>, f64),
    mut kept: Option<&mut KeptRecords>,
    options: &CompressOptions,
    folder: &Path,
    job: &Job,
) -> Result<(VolumeInfo, StoredParts)> {
    let frames = source.frames();
    let (mut first, mut store, mut voxels) = (None::<VolumeInfo>, None, 0);
    for frame in 0..frames {
        job.check()?;
        let mut blocks = source.next_frame()?;
        let mut info = checked(blocks.info().clone())?;
        let notes = std::mem::take(&mut info.notes);
        match &mut first {
            None => {
                voxels = expected(&info)?;
                job.begin_share(voxels.saturating_mul(frames.into()), share);
                store = Some(store_over(kept.as_deref(), info.dims, frames, options, folder)?);
                first = Some(VolumeInfo { notes, ..info });
            }
            Some(first) => {
                if let Some(what) = difference(first, &info) {
                    drop(blocks);
                    let (this, other) = (source.name(frame), source.name(0));
                    return Err(Error::Caller(format!("{this}: {what}, as {other} has")));
                }
                join_notes(&mut first.notes, notes);
            }
        }
        if kept.as_ref().is_some_and(|kept| frame < kept.frames()) {
            job.advance(voxels);
        } else if let Some(store) = &store {
            if frame > 0 {
                store.next_frame()?;
            }
            let (threads, limit) = (options.thread_count(), options.memory_limit_bytes);
            make_parts(blocks.as_mut(), voxels, store, threads, limit, job)?;
            if let Some(kept) = &mut kept {
                kept.keep(store, 0, frame + 1)?;
            }
        }
    }
    let (Some(mut info), Some(store)) = (first, store) else {
        return Err(Error::Caller("a time series: expected at least one frame, got none".into()));
    };
    info.notes.shrink_to_fit();
    Ok((info, store.into_parts()?))
}

/// What a frame has that differs from the first.
fn difference(first: &VolumeInfo, this: &VolumeInfo) -> Option<String> {
    let named =
        |what: &str, expected: String, got: String| Some(format!("{what}: expected {expected}, got {got}"));
    if this.dims != first.dims {
        let text = |[x, y, z]: [u32; 3]| format!("{x} × {y} × {z}");
        return named("voxels", text(first.dims), text(this.dims));
    }
    if this.label_type != first.label_type {
        let [expected, got] = [first, this].map(|info| format!("{:?}", info.label_type).to_lowercase());
        return named("label type", expected, got);
    }
    if this.spacing() != first.spacing() {
        return named("spacing", format!("{:?}", first.spacing()), format!("{:?}", this.spacing()));
    }
    if this.world_from_index != first.world_from_index {
        let text = |info: &VolumeInfo| format!("{:?}", info.world_from_index.to_cols_array());
        return named("place in the world", text(first), text(this));
    }
    if this.unit != first.unit || this.frame != first.frame {
        let text = |info: &VolumeInfo| format!("{:?}, {:?}", info.unit, info.frame);
        return named("unit and axes of the world", text(first), text(this));
    }
    None
}

/// Adds the notes of labels that have none yet; both come by rising id.
fn join_notes(notes: &mut Vec<LabelNote>, more: Vec<LabelNote>) {
    let known = notes.len();
    for note in more {
        if notes[..known].binary_search_by_key(&note.id, |n| n.id).is_err() {
            notes.push(note);
        }
    }
    notes.sort_by_key(|n| n.id);
}
