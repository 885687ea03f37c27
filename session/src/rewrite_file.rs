//! Writes a `.pumice` file anew: at another level, or with what a table says of its labels.

use std::path::Path;

use pumice_core::{CompressedVolume, Job, WrittenVolume};
use pumice_formats::{OpenOptions, is_pattern};

use crate::compress_file::{CompressOutcome, CompressRequest, LabelsGiven};
use crate::error::{Result, SessionError, io};
use crate::measure::Stopwatch;
use crate::open::{Kind, kind_of};

/// Opens the input of a compression if it is a `.pumice` file, which is written anew; `None` for all other inputs. `given` has the names of options
/// of compressing that have no effect then, and whether each is given.
///
/// # Errors
/// When the file cannot be read; for a time series; for an option that is given, or one of other inputs.
pub fn open_to_rewrite(
    input: &Path,
    reading: &OpenOptions,
    given: &[(&str, bool)],
    job: &Job,
) -> Result<Option<CompressedVolume>> {
    if is_pattern(input) {
        return Ok(None);
    }
    let refuse = |what: String| Err(SessionError::Caller(format!("{}: {what}", input.display())));
    match (kind_of(input, reading)?, given.iter().find(|(_, is_given)| *is_given)) {
        (Kind::Foreign, _) => Ok(None),
        (Kind::Series, _) => {
            refuse("a file of a time series is not written anew: compress what it was made of".into())
        }
        (_, Some((option, _))) => refuse(format!(
            "{option}: a .pumice file is opened whole and written anew, at a level and with a table alone"
        )),
        (_, None) => Ok(Some(CompressedVolume::open(input, job)?)),
    }
}

/// Writes the only input of a request anew, as the request says, if it is a `.pumice` file. The bytes are those of compressing its source so.
///
/// # Errors
/// As [`open_to_rewrite`]; when the output cannot be written.
pub(crate) fn rewrite_file(
    request: &CompressRequest,
    labels: &LabelsGiven,
    job: &Job,
) -> Result<Option<CompressOutcome>> {
    let clock = Stopwatch::start();
    let [input] = &request.inputs[..] else { return Ok(None) };
    let given = [
        ("--time-steps", request.time_steps.is_some()),
        ("--types", request.types.is_some()),
        ("--memory-limit", request.memory_limit_bytes.is_some()),
    ];
    let Some(mut volume) = open_to_rewrite(input, &request.reading, &given, job)? else {
        return Ok(None);
    };
    let ((), fit) = labels.describing(|describe| Ok(describe(&mut volume)?))?;
    volume.save(&request.output, request.level, job)?;
    let bytes_disk = std::fs::metadata(&request.output).map_err(io(&request.output))?.len();
    let written = WrittenVolume {
        dims: volume.info().dims,
        labels: volume.labels().len() as u64,
        frames: 1,
        boxes: volume.boxes().len() as u64,
        bytes_volume: volume.resident_parts().iter().map(|(_, bytes)| bytes).sum(),
        bytes_disk,
    };
    Ok(Some(CompressOutcome::of(&written, &clock, Vec::new(), fit)))
}
