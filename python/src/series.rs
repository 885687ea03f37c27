//! Compression of a time series into one file.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use pumice_core::{
    BlockSource, CompressOptions, Error as CoreError, SeriesSource, VolumeInfo, compress_series_to_file,
};
use pumice_formats::{TimeSteps, open_series};
use pumice_session::{SessionError, describing};
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::input;
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
/// fit.
#[pyfunction]
#[pyo3(signature = (frames, out, *, time_steps=None, level="default", given=None, memory_limit=None, threads=0, read_as, job=None))]
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
    read_as: ReadAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<(String, Vec<String>)> {
    let job = job_of(job);
    let (level, reading) = (level_of(level)?, reading(read_as)?);
    let steps: Option<TimeSteps> = parsed("time_steps", time_steps)?;
    let (types, table) = given.as_ref().map_or(Ok((None, None)), Given::parts)?;
    let options =
        CompressOptions { threads, memory_limit_bytes: memory_limit, types, ..CompressOptions::default() };
    let write = |source: &mut dyn SeriesSource| {
        let table = table.map(|table| (table, Vec::new()));
        let (written, fit) = describing(table, |describe| {
            Ok(compress_series_to_file(source, &out, level, &options, describe, &job)?)
        })?;
        Ok((written, fit.map_or_else(Vec::new, |fit| fit.notes)))
    };
    let (written, notes) = match frames {
        Frames::Files(files) => released(py, &job, || {
            reading.outputs.declare(&out)?;
            match open_series(&files, steps, &reading)? {
                Some(mut series) => write(&mut series),
                None => Err(SessionError::Caller(
                    "source: expected a time series, got one volume: `time_steps` chooses those of a file"
                        .into(),
                )),
            }
        })?,
        Frames::Blocks(frames) => {
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
            let result = released(py, &job, || {
                reading.outputs.declare(&out)?;
                write(&mut source)
            });
            match raised.into_inner().unwrap_or_else(PoisonError::into_inner) {
                Some(error) => return Err(error),
                None => result?,
            }
        }
    };
    let told = json!({
        "dims": written.dims,
        "time_steps": written.frames,
        "labels": written.labels,
        "boxes": written.boxes,
        "bytes_disk": written.bytes_disk,
    });
    Ok((told.to_string(), [reading.warnings.list(), notes].concat()))
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
