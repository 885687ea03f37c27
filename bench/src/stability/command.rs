//! `pumice bench stability`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use pumice_core::Job;
use pumice_session::SessionError;
use pumice_session::error::io;

use super::{Case, Stability, measure_stability};
use crate::console::{BenchResult, Console, Outcome};

/// Extreme cases, each with its error against an exact oracle or a closed form, and a bar
///
/// Rays of every kind against whole-number arithmetic; volumes far away, tiny, huge, squeezed; suns, materials and depths of which
/// the picture is known; what must be refused. Rays are the processor's in any case; pictures are drawn by the backend and, where that
/// is another than cpu, held beside the processor's of the same samples. Exit code 1 when a bar is missed, more of a picture is apart
/// from the processor's than roundings explain, or a pixel is not a number from 0 on.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// What draws the pictures: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    #[arg(long, value_name = "NAME", default_value = "auto")]
    backend: String,
    /// Fewer rays: seconds instead of a minute
    #[arg(long)]
    reduced: bool,
    /// Write the table as Markdown
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write a report as JSON; `-` for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let to_stdout = flags.json.as_deref() == Some(Path::new("-"));
    let mut failed = None;
    let mut watch = |case: &Case| {
        if !to_stdout && failed.is_none() {
            failed = print_case(case, console).err();
        }
    };
    let all = measure_stability(&flags.backend, flags.reduced, job, &mut watch)?;
    if let Some(error) = failed {
        return Err(error);
    }
    if !to_stdout {
        print_summary(&all, console)?;
    }
    if let Some(path) = &flags.out {
        std::fs::write(path, all.markdown()).map_err(io(path))?;
    }
    if let Some(to) = &flags.json {
        let text = serde_json::to_string_pretty(&all)
            .map_err(|e| SessionError::Caller(format!("the report as JSON: {e}")))?;
        match to_stdout {
            true => console.line(text)?,
            false => std::fs::write(to, text + "\n").map_err(io(to))?,
        }
    }
    Ok(Outcome::of(all.holds()))
}

fn print_summary(all: &Stability, console: &mut Console<'_>) -> BenchResult<()> {
    let missed = all.cases.iter().filter(|c| !c.holds()).count();
    console.line(format_args!(
        "{} cases, {missed} bars missed; {} rays judged; {} pixels by {} on {}, {} of them not a number from 0 on",
        all.cases.len(),
        all.rays,
        all.pixels,
        all.backend,
        all.device,
        all.bad_pixels
    ))?;
    for (why, count) in processor_only(&all.cases) {
        console.line(format_args!("{count} cases are of the processor only: {why}"))?;
    }
    Ok(())
}

/// Why cases were not asked of the backend, and how many for each reason.
fn processor_only(cases: &[Case]) -> BTreeMap<&'static str, usize> {
    let mut reasons = BTreeMap::new();
    cases.iter().filter_map(|c| c.processor_only).for_each(|why| *reasons.entry(why).or_default() += 1);
    reasons
}

fn print_case(case: &Case, console: &mut Console<'_>) -> BenchResult<()> {
    let mark = if case.holds() { "ok    " } else { "MISSED" };
    let beside = match (&case.beside, case.processor_only) {
        (None, None) => String::new(),
        (None, Some(_)) => "; processor only".into(),
        (Some(_), _) => format!("; beside the processor's: {}", case.beside_text()),
    };
    console.line(format_args!(
        "{mark} {:52} {:>8.1e} of {:.1e}  {}{beside}",
        format!("{}: {}", case.group, case.name),
        case.error,
        case.bar,
        case.unit
    ))?;
    match &case.note {
        Some(note) if !case.holds() => console.line(format_args!("       {note}")),
        _ => Ok(()),
    }
}
