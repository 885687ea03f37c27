//! Files that never are in memory as a whole: of a volume, of some of its chunks, and of parts that are joined.

use std::path::PathBuf;

use pumice_core::{
    ChunkGrid, ChunkSet, CompressOptions, Outputs, PartSource, VoxelRegion, WrittenVolume,
    compress_series_parts, compress_to_file, merge_parts,
};
use pumice_session::{PartRequest, SessionError, describing};
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::{IntoException as _, input};
use crate::job::{Job, job_of};
use crate::series::{Frames, with_frames};
use crate::volume::{Given, ReadAs, Source, level_of, parsed, reading, with_source};
use crate::waiting::released;

fn set_of(chunks: &str) -> PyResult<ChunkSet> {
    chunks.parse().map_err(|e| input(&format_args!("chunks: {e}")))
}

/// Number of chunks of a volume of `dims` voxels.
#[pyfunction]
pub(crate) fn chunk_count(dims: [u32; 3]) -> u64 {
    ChunkGrid::new(dims).chunks()
}

/// First voxel of these chunks along x, y and z, and the one after the last, chunk after chunk.
#[pyfunction]
pub(crate) fn chunk_regions(dims: [u32; 3], chunks: &str) -> PyResult<Vec<VoxelRegion>> {
    let (grid, chunks) = (ChunkGrid::new(dims), set_of(chunks)?);
    chunks.check(&grid).map_err(|e| input(&e))?;
    Ok(chunks.iter().filter_map(|number| grid.region(number)).collect())
}

/// Compresses some chunks of a file or of a series of files, or of the blocks of one or several frames that are of these chunks alone, into a part;
/// returns the reader's warnings. `source_name` and `fingerprint` tell blocks from those of other sources; files say that themselves.
#[pyfunction]
#[pyo3(signature = (frames, out, *, chunks, time_steps=None, source_name, fingerprint, memory_limit=None, threads=0, read_as, job=None))]
#[allow(clippy::too_many_arguments, reason = "the keywords of the façade")]
pub(crate) fn compress_part(
    py: Python<'_>,
    frames: Frames,
    out: PathBuf,
    chunks: &str,
    time_steps: Option<String>,
    source_name: String,
    fingerprint: String,
    memory_limit: Option<u64>,
    threads: usize,
    read_as: ReadAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<Vec<String>> {
    let job = job_of(job);
    let (chunks, reading) = (set_of(chunks)?, reading(read_as, &job)?);
    let frames = match frames {
        Frames::Files(inputs) => {
            let request = PartRequest {
                inputs,
                time_steps: parsed("time_steps", time_steps)?,
                output: out,
                chunks,
                reading,
                threads: (threads > 0).then_some(threads),
                memory_limit_bytes: memory_limit,
            };
            return Ok(released(py, &job, || pumice_session::compress_part_file(&request, &job))?.warnings);
        }
        Frames::Blocks(frames) => frames,
    };
    let options = CompressOptions { threads, memory_limit_bytes: memory_limit, ..CompressOptions::default() };
    let from = PartSource { name: source_name, fingerprint, reading: reading.to_string() };
    with_frames(py, frames, &job, |source| {
        Ok(compress_series_parts(source, &[(chunks, &out)], &from, None, &options, &job)?)
    })?;
    Ok(reading.warnings.list())
}

/// Compresses a file, or blocks, into a `.pumice` file, which never is in memory as a whole; returns what was written as JSON text, and the
/// warnings of the reader with what of the table does not fit.
#[pyfunction]
#[pyo3(signature = (source, out, *, level="default", given=None, memory_limit=None, threads=0, read_as, job=None))]
#[allow(clippy::too_many_arguments, reason = "the keywords of the façade")]
pub(crate) fn compress_file(
    py: Python<'_>,
    source: Source,
    out: PathBuf,
    level: &str,
    given: Option<Given>,
    memory_limit: Option<u64>,
    threads: usize,
    read_as: ReadAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<(String, Vec<String>)> {
    let job = job_of(job);
    let (level, reading) = (level_of(level)?, reading(read_as, &job)?);
    let (types, table) = given.as_ref().map_or(Ok((None, None)), Given::parts)?;
    let options =
        CompressOptions { threads, memory_limit_bytes: memory_limit, types, ..CompressOptions::default() };
    reading.outputs.declare(&out).map_err(|e| SessionError::from(e).into_exception())?;
    let (written, notes) = with_source(py, source, &reading, &job, |source| {
        let table = table.map(|table| (table, Vec::new()));
        let (written, fit) = describing(table, |describe| {
            Ok(compress_to_file(source, &out, level, &options, describe, &job)?)
        })?;
        Ok((written, fit.map_or_else(Vec::new, |fit| fit.notes)))
    })?;
    Ok((told(&written), [reading.warnings.list(), notes].concat()))
}

/// What was written as JSON text.
fn told(written: &WrittenVolume) -> String {
    let mut told = json!({
        "dims": written.dims,
        "labels": written.labels,
        "boxes": written.boxes,
        "bytes_disk": written.bytes_disk,
    });
    if written.frames > 1 {
        told["time_steps"] = written.frames.into();
    }
    told.to_string()
}

/// Joins parts to one part.
#[pyfunction]
#[pyo3(signature = (parts, out, *, memory_limit=None, threads=0, job=None))]
pub(crate) fn merge_into_part(
    py: Python<'_>,
    parts: Vec<PathBuf>,
    out: PathBuf,
    memory_limit: Option<u64>,
    threads: usize,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<()> {
    let job = job_of(job);
    let options = CompressOptions { threads, memory_limit_bytes: memory_limit, ..CompressOptions::default() };
    released(py, &job, || {
        let outputs = Outputs::default();
        outputs.declare(&out)?;
        parts.iter().try_for_each(|part| outputs.check_input(part))?;
        pumice_core::merge_into_part(&parts, &out, &options, &job)?;
        Ok::<_, SessionError>(())
    })
}

/// Joins parts to the volume's file; returns what was written as JSON text, and what of the table does not fit.
#[pyfunction]
#[pyo3(signature = (parts, out, *, level="default", given=None, memory_limit=None, threads=0, job=None))]
#[allow(clippy::too_many_arguments, reason = "the keywords of the façade")]
pub(crate) fn merge(
    py: Python<'_>,
    parts: Vec<PathBuf>,
    out: PathBuf,
    level: &str,
    given: Option<Given>,
    memory_limit: Option<u64>,
    threads: usize,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<(String, Vec<String>)> {
    let job = job_of(job);
    let level = level_of(level)?;
    let (types, table) = given.as_ref().map_or(Ok((None, None)), Given::parts)?;
    let options =
        CompressOptions { threads, memory_limit_bytes: memory_limit, types, ..CompressOptions::default() };
    let (written, notes) = released(py, &job, || {
        let outputs = Outputs::default();
        outputs.declare(&out)?;
        parts.iter().try_for_each(|part| outputs.check_input(part))?;
        let table = table.map(|table| (table, Vec::new()));
        let (written, fit) =
            describing(table, |describe| Ok(merge_parts(&parts, &out, level, &options, describe, &job)?))?;
        Ok::<_, SessionError>((written, fit.map_or_else(Vec::new, |fit| fit.notes)))
    })?;
    Ok((told(&written), notes))
}
