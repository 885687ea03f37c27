//! `pumice compress`

use std::path::Path;
use std::sync::Arc;

use pumice_session::{
    CompressOutcome, CompressRequest, Job, KeptParts, PartOutcome, PartRequest, compress_file,
    compress_part_file, compress_resumable, peak_rss_bytes,
};
use serde::Serialize;

use super::open_options;
use crate::Answer;
use crate::args::{Compress, CompressionLevel};
use crate::failure::{Failure, say};
use crate::json_report::{declare_report, write_report};
use crate::progress::Bar;

/// The report that `--json` writes.
#[derive(Serialize)]
struct Report<T> {
    #[serde(flatten)]
    outcome: T,
    peak_rss_bytes: Option<u64>,
}

/// The level that a flag names.
pub(crate) fn level_of(level: CompressionLevel) -> pumice_session::CompressionLevel {
    match level {
        CompressionLevel::Fast => pumice_session::CompressionLevel::Fast,
        CompressionLevel::Default => pumice_session::CompressionLevel::Default,
        CompressionLevel::Small => pumice_session::CompressionLevel::Small,
    }
}

pub(crate) fn run(args: &Compress, job: &Arc<Job>) -> Result<Answer, Failure> {
    let reading = open_options(&args.reading, job);
    declare_report(&reading.outputs, args.json.as_deref())?;
    let threads = args.threads.map(usize::from);
    let bar = Bar::follow_whole("compressing", job);
    if let Some(chunks) = &args.chunks {
        let outcome = compress_part_file(
            &PartRequest {
                inputs: args.inputs.clone(),
                time_steps: args.time_steps,
                output: args.out.clone(),
                chunks: chunks.clone(),
                reading,
                threads,
                memory_limit_bytes: args.memory_limit,
            },
            job,
        )?;
        drop(bar);
        return report_part(&args.out, args.json.as_deref(), outcome);
    }
    let request = CompressRequest {
        inputs: args.inputs.clone(),
        time_steps: args.time_steps,
        output: args.out.clone(),
        reading,
        level: level_of(args.level.unwrap_or(CompressionLevel::Default)),
        threads,
        memory_limit_bytes: args.memory_limit,
        types: args.types.clone(),
        table: args.table.clone(),
    };
    let outcome = match (args.resume, args.restart) {
        (true, _) => compress_resumable(&request, KeptParts::GoOn, job)?,
        (_, true) => compress_resumable(&request, KeptParts::Remove, job)?,
        _ => compress_file(&request, job)?,
    };
    drop(bar);
    report(&args.out, args.json.as_deref(), outcome)
}

/// Says what a part holds.
pub(crate) fn report_part(out: &Path, json: Option<&Path>, outcome: PartOutcome) -> Result<Answer, Failure> {
    if json != Some(Path::new("-")) {
        let steps = outcome.time_steps.map_or_else(String::new, |n| format!("{n} time steps, "));
        say(format_args!(
            "{}: {steps}chunks {} of {}, {} labels, {} boxes, {:.1} MB, {:.1} s ({:.1} CPU s)",
            out.display(),
            outcome.chunks,
            outcome.of,
            outcome.labels,
            outcome.boxes,
            outcome.bytes_disk as f64 / 1e6,
            outcome.seconds,
            outcome.cpu_seconds,
        ))?;
    }
    if let Some(to) = json {
        write_report(to, &Report { outcome, peak_rss_bytes: peak_rss_bytes() })?;
    }
    Ok(Answer::Yes)
}

/// Says what a volume's file holds.
pub(crate) fn report(out: &Path, json: Option<&Path>, outcome: CompressOutcome) -> Result<Answer, Failure> {
    let percent = |bytes: u64| 100.0 * bytes as f64 / outcome.bytes_raw.max(1) as f64;
    // With `--json -` a program reads standard output as JSON, so nothing else is printed there.
    if json != Some(Path::new("-")) {
        let steps = outcome.time_steps.map_or_else(String::new, |n| format!("{n} time steps, "));
        say(format_args!(
            "{}: {steps}{} labels, {} boxes, {:.1} MB on disk ({:.2} % of 4 bytes a voxel), {:.1} MB in memory without the hierarchy for rays ({:.2} %), {:.1} s ({:.1} CPU s)",
            out.display(),
            outcome.labels,
            outcome.boxes,
            outcome.bytes_disk as f64 / 1e6,
            percent(outcome.bytes_disk),
            outcome.bytes_volume as f64 / 1e6,
            percent(outcome.bytes_volume),
            outcome.seconds,
            outcome.cpu_seconds,
        ))?;
        if let Some(fit) = &outcome.table {
            say(format_args!(
                "table: {} of {} labels have a row, {} columns of numbers",
                fit.labels_with_row, outcome.labels, fit.columns
            ))?;
            fit.notes.iter().try_for_each(|note| say(format_args!("note: {note}")))?;
        }
    }
    if let Some(to) = json {
        write_report(to, &Report { outcome, peak_rss_bytes: peak_rss_bytes() })?;
    }
    Ok(Answer::Yes)
}
