//! `pumice bench`

use std::collections::BTreeMap;
use std::path::PathBuf;

use pumice_session::demo::shipped_volume;
use pumice_session::{
    Case, ConvergenceOptions, DetailOptions, ExtremesOptions, Job, NeedsOptions, PaperOptions, PeersOptions,
    SavingsOptions, SessionError, measure_convergence, measure_detail, measure_extremes, measure_needs,
    measure_paper, measure_peers, measure_stability, write_convergence, write_detail, write_extremes,
    write_needs, write_paper, write_peers,
};

use crate::Answer;
use crate::args::{Bench, BenchKind, Convergence, Extremes, LodBench, Needs, Paper, Peers, Stability};
use crate::failure::{Failure, say};
use crate::json_report::write_report;

pub(crate) fn run(args: &Bench, job: &Job) -> Result<Answer, Failure> {
    match &args.what {
        BenchKind::Convergence(a) => convergence(a, job),
        BenchKind::Stability(a) => stability(a, job),
        BenchKind::Needs(a) => needs(a, job),
        BenchKind::Peers(a) => peers(a, job),
        BenchKind::Extremes(a) => extremes(a, job),
        BenchKind::Lod(a) => lod(a, job),
        BenchKind::Paper(a) => paper(a, job),
    }
}

fn rising(spp: &[u32]) -> Result<(), Failure> {
    match spp.is_sorted_by(|a, b| a < b) {
        true => Ok(()),
        false => Err(SessionError::Caller("--spp: expected rising numbers".into()).into()),
    }
}

fn volumes_or_shipped(volumes: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    Ok(if volumes.is_empty() { vec![shipped_volume()?] } else { volumes.to_vec() })
}

/// Measures, and says what begins, with `named` in front; whoever listens may have gone by then.
fn watched<T>(
    named: &str,
    measure: impl FnOnce(&mut dyn FnMut(&str)) -> Result<T, SessionError>,
) -> Result<T, Failure> {
    let mut closed = None;
    let measured = measure(&mut |line| {
        if closed.is_none() {
            closed = say(format_args!("{named}{line}")).err();
        }
    })?;
    closed.map_or(Ok(measured), Err)
}

fn convergence(args: &Convergence, job: &Job) -> Result<Answer, Failure> {
    rising(&args.spp)?;
    let volume = match &args.volume {
        Some(path) => path.clone(),
        None => shipped_volume()?,
    };
    let mut scenes = Vec::new();
    for &bounces in &args.bounces {
        let options = ConvergenceOptions {
            volume: volume.clone(),
            cycles: args.cycles.clone(),
            pick: args.pick as usize,
            size: args.size,
            spp: args.spp.clone(),
            repeats: args.repeats,
            bounces,
            reference_spp: args.reference_spp,
        };
        let scene =
            watched(&format!("{bounces} bounces: "), |watch| measure_convergence(&options, job, watch))?;
        if let Some(ratio) = scene.cpu_ratio_at_equal_error() {
            say(format_args!(
                "{bounces} bounces: {:.0} % of Cycles' CPU seconds at equal error",
                100.0 * ratio
            ))?;
        }
        scenes.push(scene);
    }
    write_convergence(&args.out, &machine(), &scenes)?;
    say(format_args!("{}", args.out.join("convergence.md").display()))?;
    Ok(Answer::Yes)
}

/// What the figures were measured on.
fn machine() -> String {
    format!(
        "Pumice {}; {}, {} cores, {} {}.",
        env!("CARGO_PKG_VERSION"),
        processor(),
        std::thread::available_parallelism().map_or(1, usize::from),
        std::env::consts::OS,
        std::env::consts::ARCH
    )
}

fn needs(args: &Needs, job: &Job) -> Result<Answer, Failure> {
    let volumes = volumes_or_shipped(&args.volumes)?;
    let mut scenes = Vec::new();
    for volume in volumes {
        let how = SavingsOptions { rounds: args.rounds, side: args.side };
        let options = NeedsOptions { volume, backend: args.backend.clone(), show: args.show as usize, how };
        let measured = watched("", |watch| measure_needs(&options, job, watch))?;
        for scene in &measured {
            say(format_args!("{}: {}", scene.volume, scene.scene))?;
            for line in scene.savings.lines() {
                say(format_args!("    {line}"))?;
            }
        }
        scenes.extend(measured);
    }
    let build = if cfg!(debug_assertions) { "development build" } else { "release build" };
    write_needs(&args.out, &format!("{}; {build}.", machine().trim_end_matches('.')), &scenes)?;
    say(format_args!("{}", args.out.join("needs.md").display()))?;
    Ok(if scenes.iter().all(|s| s.savings.holds()) { Answer::Yes } else { Answer::No })
}

fn peers(args: &Peers, job: &Job) -> Result<Answer, Failure> {
    let volumes = volumes_or_shipped(&args.volumes)?;
    let mut tables = Vec::new();
    for volume in volumes {
        let named = format!("{}: ", volume.display());
        let options = PeersOptions { volume, python: args.python.clone(), without: args.without.clone() };
        tables.push(watched(&named, |watch| measure_peers(&options, job, watch))?);
    }
    write_peers(&args.out, &machine(), &tables)?;
    say(format_args!("{}", args.out.join("peers.md").display()))?;
    Ok(Answer::Yes)
}

fn extremes(args: &Extremes, job: &Job) -> Result<Answer, Failure> {
    let options = ExtremesOptions {
        cases: args.cases.clone(),
        reduced: args.reduced,
        memory_limit_bytes: args.memory_limit,
    };
    let cases = watched("", |watch| measure_extremes(&options, job, watch))?;
    write_extremes(&args.out, &machine(), &cases)?;
    for case in cases.iter().filter(|c| !c.holds()) {
        say(format_args!("{}: beyond its bound", case.name))?;
    }
    say(format_args!("{}", args.out.join("extremes.md").display()))?;
    Ok(if cases.iter().all(|c| c.holds()) { Answer::Yes } else { Answer::No })
}

fn lod(args: &LodBench, job: &Job) -> Result<Answer, Failure> {
    rising(&args.spp)?;
    let volumes = volumes_or_shipped(&args.volumes)?;
    let mut tables = Vec::new();
    for volume in volumes {
        let named = format!("{}: ", volume.display());
        let options = DetailOptions {
            volume,
            pick: args.pick as usize,
            sizes: args.sizes.clone(),
            spp: args.spp.clone(),
            repeats: args.repeats,
            reference_spp: args.reference_spp,
        };
        tables.extend(watched(&named, |watch| measure_detail(&options, job, watch))?);
    }
    write_detail(&args.out, &machine(), &tables)?;
    say(format_args!("{}", args.out.join("lod.md").display()))?;
    Ok(Answer::Yes)
}

fn paper(args: &Paper, job: &Job) -> Result<Answer, Failure> {
    let volumes = volumes_or_shipped(&args.volumes)?;
    let mut tables = Vec::new();
    for volume in volumes {
        let named = format!("{}: ", volume.display());
        let options =
            PaperOptions { volume, types: args.types, show: args.show, side: args.side, rounds: args.rounds };
        tables.push(watched(&named, |watch| measure_paper(&options, job, watch))?);
    }
    write_paper(&args.out, &machine(), &tables)?;
    say(format_args!("{}", args.out.join("paper.md").display()))?;
    Ok(Answer::Yes)
}

/// The processor's name, where the system tells it in a file.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
    line.map_or_else(|| "an unnamed processor".into(), |(_, name)| name.trim().to_owned())
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
        for (why, count) in processor_only(&all.cases) {
            say(format_args!("{count} cases are of the processor only: {why}"))?;
        }
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

/// Why cases were not asked of the backend, and how many for each reason.
fn processor_only(cases: &[Case]) -> BTreeMap<&'static str, usize> {
    let mut reasons = BTreeMap::new();
    cases.iter().filter_map(|c| c.processor_only).for_each(|why| *reasons.entry(why).or_default() += 1);
    reasons
}

fn line(case: &Case) -> Result<(), Failure> {
    let mark = if case.holds() { "ok    " } else { "MISSED" };
    let beside = match (&case.beside, case.processor_only) {
        (None, None) => String::new(),
        (None, Some(_)) => "; processor only".into(),
        (Some(_), _) => format!("; beside the processor's: {}", case.beside_text()),
    };
    say(format_args!(
        "{mark} {:52} {:>8.1e} of {:.1e}  {}{beside}",
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
