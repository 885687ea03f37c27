//! `pumice bench`

use pumice_session::{Case, Job, SessionError, measure_stability};

use crate::Answer;
use crate::args::{Bench, BenchKind, Stability};
use crate::failure::{Failure, say};
use crate::json_report::write_report;

pub(crate) fn run(args: &Bench, job: &Job) -> Result<Answer, Failure> {
    match &args.what {
        BenchKind::Stability(a) => stability(a, job),
    }
}

fn stability(args: &Stability, job: &Job) -> Result<Answer, Failure> {
    let quiet = args.json.as_deref() == Some(std::path::Path::new("-"));
    let mut closed = None;
    let mut watch = |case: &Case| {
        if !quiet && closed.is_none() {
            closed = line(case).err();
        }
    };
    let all = measure_stability(&args.backend, args.reduced, job, &mut watch)?;
    if let Some(failure) = closed {
        return Err(failure);
    }
    if !quiet {
        let missed = all.cases.iter().filter(|c| !c.holds()).count();
        say(format_args!(
            "{} cases, {missed} bars missed; {} rays judged; {} pixels by {} on {}, {} of them not a number from 0 on",
            all.cases.len(),
            all.rays,
            all.pixels,
            all.backend,
            all.device,
            all.bad_pixels
        ))?;
    }
    if let Some(path) = &args.out {
        std::fs::write(path, all.markdown())
            .map_err(|source| SessionError::Io { path: path.clone(), source })?;
    }
    if let Some(to) = &args.json {
        write_report(to, &all)?;
    }
    Ok(if all.holds() { Answer::Yes } else { Answer::No })
}

fn line(case: &Case) -> Result<(), Failure> {
    let mark = if case.holds() { "ok    " } else { "MISSED" };
    say(format_args!(
        "{mark} {:52} {:>8.1e} of {:.1e}  {}",
        format!("{}: {}", case.group, case.name),
        case.error,
        case.bar,
        case.unit
    ))?;
    match &case.note {
        Some(note) if !case.holds() => say(format_args!("       {note}")),
        _ => Ok(()),
    }
}
