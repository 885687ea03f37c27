//! `pumice bench stability`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use pumice_core::Job;
use pumice_session::SessionError;
use pumice_session::error::io;

use super::{Case, Stability, measure_stability};
use crate::console::{BenchResult, Console, Outcome};

/// Extreme cases, each with its error against an exact oracle or a closed form, and a limit of the error
///
/// Rays of every kind against whole-number arithmetic; volumes far away, tiny, huge, squeezed; suns, materials and path depths with a
/// known picture; scenes that must be refused. Rays are always traced on the CPU. Pictures are rendered by the backend and, if that is
/// not cpu, compared with the CPU's pictures of the same samples. Exit code 1 if an error is above its limit, a picture differs from the
/// CPU's by more than rounding explains, or a pixel is not finite or negative.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Backend that renders the pictures: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    #[arg(long, value_name = "NAME", default_value = "auto")]
    backend: String,
    /// Trace fewer rays, and have 512 lamps in a crowd instead of 100,000, which takes seconds instead of a minute
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
        "{} cases, {missed} above their limit; {} rays checked; {} pixels by {} on {}, {} of them not finite or negative",
        all.cases.len(),
        all.rays,
        all.pixels,
        all.backend,
        all.device,
        all.bad_pixels
    ))?;
    for (why, count) in processor_only(&all.cases) {
        console.line(format_args!("{count} cases test only the CPU: {why}"))?;
    }
    Ok(())
}

/// Counts the cases that test only the CPU, by reason.
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
