//! Compression of a time series into one file.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use pumice_core::{
    BlockSource, CompressOptions, Error as CoreError, SeriesSource, VolumeInfo, compress_series_to_file,
};
use pumice_formats::{TimeSteps, open_series};
use pumice_session::{
    CompressRequest, KeptParts, LabelsGiven, SessionError, compress_resumable_with, describing,
};
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::{IntoException as _, input};
use crate::job::{Job, job_of};
use crate::volume::{Blocks, BlocksOfPython, Given, ReadAs, level_of, parsed, reading};
use crate::waiting::released;

/// Where the frames come from.
#[derive(FromPyObject)]
pub(crate) enum Frames {
    /// Files, of which one may have several time steps or stand for several by `{t}` in its name.
    Files(Vec<PathBuf>),
    /// A frame each.
    Blocks(Vec<Blocks>),
}

/// Compresses a time series into one file; returns what was written as JSON text, and the warnings of the reader with what of the table does not
/// fit. With `resume` or `restart` finished chunks are kept in a folder, as by the command.
#[pyfunction]
#[pyo3(signature = (frames, out, *, time_steps=None, level="default", given=None, memory_limit=None, threads=0, resume=false, restart=false, read_as, job=None))]
#[allow(clippy::too_many_arguments, reason = "the keywords of the façade")]
pub(crate) fn compress_series(
    py: Python<'_>,
    frames: Frames,
    out: PathBuf,
    time_steps: Option<String>,
    level: &str,
    given: Option<Given>,
    memory_limit: Option<u64>,
    threads: usize,
    resume: bool,
    restart: bool,
    read_as: ReadAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<(String, Vec<String>)> {
    let job = job_of(job);
    let (level, reading) = (level_of(level)?, reading(read_as, &job)?);
    let steps: Option<TimeSteps> = parsed("time_steps", time_steps)?;
    let (types, table) = given.as_ref().map_or(Ok((None, None)), Given::parts)?;
    let options =
        CompressOptions { threads, memory_limit_bytes: memory_limit, types, ..CompressOptions::default() };
    let kept = match (resume, restart) {
        (true, true) => return Err(input(&"resume, restart: give one of them")),
        (true, false) => Some(KeptParts::GoOn),
        (false, true) => Some(KeptParts::Remove),
        (false, false) => None,
    };
    if let Some(kept) = kept {
        let Frames::Files(inputs) = frames else {
            return Err(input(&"resume, restart: only files take them, no arrays"));
        };
        let request = CompressRequest {
            inputs,
            time_steps: steps,
            output: out,
            reading,
            level,
            threads: (threads > 0).then_some(threads),
            memory_limit_bytes: memory_limit,
            types: None,
            table: None,
        };
        let labels = || Ok(LabelsGiven::new(options.types, table.cloned()));
        let outcome = released(py, &job, || compress_resumable_with(&request, labels, kept, &job))?;
        let notes = outcome.table.map_or_else(Vec::new, |fit| fit.notes);
        let told = told(
            outcome.dims,
            outcome.time_steps.unwrap_or(1),
            outcome.labels,
            outcome.boxes,
            outcome.bytes_disk,
        );
        return Ok((told, [outcome.warnings, notes].concat()));
    }
    let write = |source: &mut dyn SeriesSource| {
        let table = table.map(|table| (table, Vec::new()));
        let (written, fit) = describing(table, |describe| {
            Ok(compress_series_to_file(source, &out, level, &options, describe, &job)?)
        })?;
        Ok((written, fit.map_or_else(Vec::new, |fit| fit.notes)))
    };
    reading.outputs.declare(&out).map_err(|e| SessionError::from(e).into_exception())?;
    let (written, notes) = match frames {
        Frames::Files(files) => released(py, &job, || match open_series(&files, steps, &reading)? {
            Some(mut series) => write(&mut series),
            None => Err(SessionError::Caller(
                "source: expected a time series, got one volume: `time_steps` chooses those of a file".into(),
            )),
        })?,
        Frames::Blocks(frames) => with_frames(py, frames, &job, write)?,
    };
    let told = told(written.dims, written.frames, written.labels, written.boxes, written.bytes_disk);
    Ok((told, [reading.warnings.list(), notes].concat()))
}

/// What was written as JSON text.
fn told(dims: [u32; 3], time_steps: u32, labels: u64, boxes: u64, bytes_disk: u64) -> String {
    json!({ "dims": dims, "time_steps": time_steps, "labels": labels, "boxes": boxes, "bytes_disk": bytes_disk })
        .to_string()
}

/// Runs `work` on frames whose blocks Python functions deliver, with the interpreter released except while blocks are fetched.
pub(crate) fn with_frames<T: Send>(
    py: Python<'_>,
    frames: Vec<Blocks>,
    job: &Arc<pumice_core::Job>,
    work: impl FnOnce(&mut dyn SeriesSource) -> Result<T, SessionError> + Send,
) -> PyResult<T> {
    let infos: Vec<VolumeInfo> = frames
        .iter()
        .map(|frame| serde_json::from_str(&frame.info).map_err(|e| input(&format_args!("info: {e}"))))
        .collect::<PyResult<_>>()?;
    let raised = Mutex::new(None);
    let mut source = FramesOfPython {
        frames: infos.len() as u32,
        left: infos.into_iter().zip(frames).collect::<Vec<_>>().into_iter(),
        raised: &raised,
    };
    let result = released(py, job, || work(&mut source));
    match raised.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(error) => Err(error),
        None => result,
    }
}

/// Frames whose blocks Python functions deliver.
struct FramesOfPython<'a> {
    frames: u32,
    left: std::vec::IntoIter<(VolumeInfo, Blocks)>,
    raised: &'a Mutex<Option<PyErr>>,
}

impl SeriesSource for FramesOfPython<'_> {
    fn frames(&self) -> u32 {
        self.frames
    }

    fn name(&self, frame: u32) -> String {
        format!("time step {frame}")
    }

    fn next_frame(&mut self) -> Result<Box<dyn BlockSource + '_>, CoreError> {
        let (info, blocks) =
            self.left.next().ok_or_else(|| CoreError::Caller("there are no more time steps".into()))?;
        Ok(Box::new(BlocksOfPython { info, next: blocks.next, raised: self.raised }))
    }
}
