//! `pumice compress`

use std::sync::Arc;

use pumice_session::{CompressRequest, Job, compress_file, peak_rss_bytes};
use serde::Serialize;

use super::open_options;
use crate::Answer;
use crate::args::{Compress, CompressionLevel};
use crate::failure::{Failure, say};
use crate::json_report::{declare_report, write_report};
use crate::progress::Bar;

/// The report that `--json` writes.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    outcome: pumice_session::CompressOutcome,
    peak_rss_bytes: Option<u64>,
}

pub(crate) fn run(args: &Compress, job: &Arc<Job>) -> Result<Answer, Failure> {
    let reading = open_options(&args.reading);
    declare_report(&reading.outputs, args.json.as_deref())?;
    let bar = Bar::follow("compressing", job);
    let outcome = compress_file(
        &CompressRequest {
            inputs: args.inputs.clone(),
            time_steps: args.time_steps,
            output: args.out.clone(),
            reading,
            level: match args.level {
                CompressionLevel::Fast => pumice_session::CompressionLevel::Fast,
                CompressionLevel::Default => pumice_session::CompressionLevel::Default,
                CompressionLevel::Small => pumice_session::CompressionLevel::Small,
            },
            threads: args.threads.map(usize::from),
            memory_limit_bytes: args.memory_limit,
            types: args.types.clone(),
            table: args.table.clone(),
        },
        job,
    )?;
    drop(bar);
    let percent = |bytes: u64| 100.0 * bytes as f64 / outcome.bytes_raw.max(1) as f64;
    // With `--json -` a program reads standard output as JSON, so nothing else is printed there.
    if args.json.as_deref() != Some(std::path::Path::new("-")) {
        let steps = outcome.time_steps.map_or_else(String::new, |n| format!("{n} time steps, "));
        say(format_args!(
            "{}: {steps}{} labels, {} boxes, {:.1} MB on disk ({:.2} % of 4 bytes a voxel), {:.1} MB in memory without the hierarchy for rays ({:.2} %), {:.1} s ({:.1} CPU s)",
            args.out.display(),
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
    if let Some(to) = &args.json {
        write_report(to, &Report { outcome, peak_rss_bytes: peak_rss_bytes() })?;
    }
    Ok(Answer::Yes)
}
