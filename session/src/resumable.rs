//! Compression that keeps what is finished: after an interrupt it goes on, and gives the same file.
//!
//! ```text
//! OUT.pumice.parts/     manifest.json      source, options, how many parts
//!                       000000.part …      a chunk each, at all time steps: whole files under their names, or not there
//!                       000000.read …      where several chunks are read together, how far, and with
//!                       000000.records …   what: until their parts are there
//! all parts there       merged to OUT.pumice, which appears at once; then the folder is removed
//! ```
//! What can be lost is the part that was being made. Where voxels have to be read one after another, the parts of a layer of chunks are made when
//! all of it is read; of what was read, a quarter of a chunk's voxels can be lost, and of a time series one time step.

use std::path::{Path, PathBuf};

use pumice_core::{
    ChunkGrid, ChunkSet, CompressionLevel, Job, KeptRecords, PartSource, read_input, write_text,
};
use serde::{Deserialize, Serialize};

use crate::compress_file::{CompressOutcome, CompressRequest, LabelsGiven};
use crate::error::{Result, SessionError, io};
use crate::measure::Stopwatch;
use crate::part_files::{MergeRequest, merge_with};
use crate::part_input::{PartAt, PartGroup, PartInput, PartWriter};

/// What to do with the parts that an interrupted compression left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeptParts {
    /// Go on with them.
    GoOn,
    /// Remove them and begin anew.
    Remove,
}

/// Name of the file that says what the parts are of.
const MANIFEST: &str = "manifest.json";

/// Largest manifest that is read: its parts are not listed in it.
const MOST_MANIFEST_BYTES: u64 = 1 << 24;

/// What the parts in a folder are of.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Manifest {
    /// What the parts hold.
    about: String,
    source: PartSource,
    /// Time of the last change and length of each of the source's files.
    changes: Vec<(u64, u32, u64)>,
    dims: [u32; 3],
    /// Number of parts.
    parts: usize,
}

/// The folder that keeps the parts of `output` while it is made.
pub fn parts_folder(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".parts");
    name.into()
}

/// Returns an error where an interrupted compression left parts of `output`.
pub(crate) fn check_no_leftovers(output: &Path) -> Result<()> {
    let folder = parts_folder(output);
    if !folder.join(MANIFEST).exists() {
        return Ok(());
    }
    Err(SessionError::Caller(format!(
        "{}: an interrupted compression left its finished parts there: --resume goes on with them, --restart removes them",
        folder.display()
    )))
}

/// Compresses a file into a `.pumice` file, part by part: after an interrupt, the same call goes on with the parts that are there.
///
/// # Errors
/// As [`crate::compress_file()`]; for parts of another source or of one that has changed since. The error says how many parts are kept.
pub fn compress_resumable(request: &CompressRequest, kept: KeptParts, job: &Job) -> Result<CompressOutcome> {
    let (types, table) = (request.types.as_deref(), request.table.as_deref());
    compress_resumable_with(request, || LabelsGiven::read(types, table, &request.reading.outputs), kept, job)
}

/// The same with labels that `labels` gives, whatever files the request names.
///
/// # Errors
/// As [`compress_resumable`].
pub fn compress_resumable_with(
    request: &CompressRequest,
    labels: impl FnOnce() -> Result<LabelsGiven>,
    kept: KeptParts,
    job: &Job,
) -> Result<CompressOutcome> {
    let clock = Stopwatch::start();
    let folder = parts_folder(&request.output);
    let reading = &request.reading;
    // What would be refused at the end is refused before the work.
    reading.outputs.declare(&request.output)?;
    let labels = labels()?;
    let input = PartInput::new(&request.inputs, request.time_steps, reading)?;
    let info = input.info()?;
    let groups = input.groups(&info)?;
    let chunks: usize = groups.iter().map(Vec::len).sum();
    let manifest = Manifest {
        about: "finished parts of an interrupted `pumice compress`, for --resume".into(),
        source: input.source()?,
        changes: input.changes()?,
        dims: info.dims,
        parts: chunks,
    };
    if kept == KeptParts::Remove {
        remove(&folder)?;
    }
    prepare(&folder, &manifest)?;
    let parts: Vec<PathBuf> = (0..chunks).map(|i| folder.join(format!("{i:06}.part"))).collect();
    let done = || parts.iter().filter(|part| part.exists()).count();
    let making = making_share(request.level);
    let missing = |group: &Vec<u64>| {
        let parts = group.iter().map(|&number| (ChunkSet::of([number]), &*parts[number as usize]));
        let parts: Vec<PartAt<'_>> = parts.filter(|(_, part)| !part.exists()).collect();
        let (first, grid) = (group.first().copied().unwrap_or(0), ChunkGrid::new(info.dims));
        let wanted = ChunkSet::of(parts.iter().flat_map(|(chunks, _)| chunks.iter()));
        let kept = KeptRecords::open(&folder, &format!("{first:06}"), &wanted, &grid);
        let kept = kept.map_err(|e| SessionError::Caller(format!("{e}; --restart removes what is there")))?;
        // All parts of these chunks appeared before what was read of them was removed.
        if parts.is_empty() {
            kept.remove()?;
            return Ok(PartGroup { parts, kept: None });
        }
        Ok(PartGroup { parts, kept: (group.len() > 1).then_some(kept) })
    };
    let missing = groups.iter().map(missing).collect::<Result<Vec<_>>>()?;
    let work = || {
        let limits = (request.threads, request.memory_limit_bytes);
        let mut writer = PartWriter::new(&input, (&manifest.source, &info), limits);
        writer.announce(&missing)?;
        let mut before = 0;
        for (group, missing) in groups.iter().zip(missing) {
            job.check()?;
            let at = |parts: usize| making * parts as f64 / chunks as f64;
            // Of a layer some parts may be there, and the rest take their time.
            job.begin_part(at(before + group.len() - missing.parts.len())..at(before + group.len()));
            before += group.len();
            if !missing.parts.is_empty() {
                writer.write(missing, job)?;
            }
        }
        if input.changes()? != manifest.changes {
            let input = input.path().display();
            return Err(SessionError::Caller(format!(
                "{input}: the source changed while it was read; compress it again with --restart"
            )));
        }
        job.begin_part(making..1.0);
        let merge = MergeRequest {
            parts: parts.clone(),
            output: request.output.clone(),
            level: request.level,
            threads: request.threads,
            memory_limit_bytes: request.memory_limit_bytes,
            types: None,
            table: None,
        };
        merge_with(&merge, labels, &clock, job)
    };
    let outcome = work().map_err(|error| {
        SessionError::Caller(format!(
            "{error}; {} of {} parts are kept in {}: --resume goes on with them",
            done(),
            parts.len(),
            folder.display()
        ))
    })?;
    remove(&folder)?;
    let warnings = reading.warnings.list();
    Ok(CompressOutcome { seconds: clock.seconds(), cpu_seconds: clock.cpu_seconds(), warnings, ..outcome })
}

/// The share of the time that making the parts takes; the rest is merging, which codes voxels where the level has them.
fn making_share(level: CompressionLevel) -> f64 {
    match level {
        CompressionLevel::Default | CompressionLevel::Fast => 0.87,
        CompressionLevel::Small => 0.4,
    }
}

/// Makes the folder, or compares what is there with what is to be made, and removes what a killed process left half done.
fn prepare(folder: &Path, manifest: &Manifest) -> Result<()> {
    let file = folder.join(MANIFEST);
    if !folder.exists() {
        std::fs::create_dir(folder).map_err(io(folder))?;
    }
    if !file.exists() {
        // A process that was killed before its manifest was whole has left no parts.
        if let Some(other) = own_files(folder)?.1.first() {
            return Err(foreign(folder, other));
        }
        let text = serde_json::to_string_pretty(manifest)
            .map_err(|e| SessionError::Caller(format!("{}: {e}", file.display())))?;
        return Ok(write_text(&file, &text)?);
    }
    let bytes = read_input(&file, MOST_MANIFEST_BYTES).map_err(io(&file))?;
    let wrong = |what: &str| {
        Err(SessionError::Caller(format!("{}: {what}; --restart removes what is there", folder.display())))
    };
    let Ok(there) = serde_json::from_slice::<Manifest>(&bytes) else {
        return wrong("manifest.json is damaged");
    };
    if there.source.reading != manifest.source.reading || there.dims != manifest.dims {
        return wrong("the parts were made with other options");
    }
    if there.source.fingerprint != manifest.source.fingerprint || there.changes != manifest.changes {
        return wrong("the parts are of another source, or it has changed since");
    }
    if there.parts != manifest.parts {
        return wrong("the parts have other chunks");
    }
    for path in own_files(folder)?.0 {
        if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".pumice-")) {
            std::fs::remove_file(&path).map_err(io(&path))?;
        }
    }
    Ok(())
}

/// Removes the parts, their manifest and the folder; nothing if there is none.
fn remove(folder: &Path) -> Result<()> {
    if !folder.exists() {
        return Ok(());
    }
    let (own, others) = own_files(folder)?;
    if let Some(other) = others.first() {
        return Err(foreign(folder, other));
    }
    // The manifest last: without it, the folder's parts would be taken for somebody else's.
    let manifest = folder.join(MANIFEST);
    for path in
        own.iter().filter(|path| **path != manifest).chain(own.iter().filter(|path| **path == manifest))
    {
        std::fs::remove_file(path).map_err(io(path))?;
    }
    std::fs::remove_dir(folder).map_err(io(folder))
}

/// The files of a folder that a resumable compression makes, and all else that is in it.
fn own_files(folder: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let mut files = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(io(folder))? {
        let path = entry.map_err(io(folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let number =
            [".part", ".read", ".records"].iter().find_map(|end| name.strip_suffix(end)).unwrap_or_default();
        let is_part = number.len() >= 6 && number.bytes().all(|b| b.is_ascii_digit());
        let is_own = is_part || name == MANIFEST || name.starts_with(".pumice-");
        let list: &mut Vec<PathBuf> = if is_own { &mut files.0 } else { &mut files.1 };
        list.push(path);
    }
    Ok(files)
}

fn foreign(folder: &Path, other: &Path) -> SessionError {
    SessionError::Caller(format!(
        "{}: expected a folder of finished parts alone, got {}: move it away",
        folder.display(),
        other.display()
    ))
}
