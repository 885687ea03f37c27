//! The `pumice` command: it parses the arguments, calls `pumice-session` and prints the result.
#![forbid(unsafe_code)]

mod args;
mod commands;
mod demo;
mod failure;
mod json_report;
mod progress;

use std::process::ExitCode;
use std::sync::Arc;

use clap::{CommandFactory, FromArgMatches};
use pumice_session::{Job, exit_code, interrupt, meet_limits, with_threads};

use crate::args::{Cli, Command};
use crate::failure::{Failure, check_warnings, warn};

/// The result of a command that ran without an error: `Yes` (or done) gives exit code 0, `No` gives 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    Yes,
    No,
}

fn main() -> ExitCode {
    meet_limits();
    let cli = match parse() {
        Ok(cli) => cli,
        Err(error) => return ExitCode::from(usage(&error)),
    };

    // A cancelled command ends with one line.
    let job = Arc::new(Job::new());
    let watched = job.clone();
    let handler = ctrlc::set_handler(move || interrupt(&watched));
    if let Err(error) = handler {
        return ExitCode::from(bad(&format_args!("Ctrl-C cannot be handled here: {error}")));
    }

    let run = || match cli.command {
        Command::Demo(a) => commands::demo::run(&a, &job),
        Command::Compress(a) => commands::compress::run(&a, &job),
        Command::Merge(a) => commands::merge::run(&a, &job),
        Command::Info(a) => commands::info::run(&a, &job),
        Command::Table(a) => commands::table::run(&a, &job),
        Command::Verify(a) => commands::verify::run(&a, &job),
        Command::Decompress(a) => commands::decompress::run(&a, &job),
        Command::Render(a) => commands::render::run(&a, &job),
        Command::VerifyRender(a) => commands::verify_render::run(&a, &job),
        Command::Export(a) => commands::export::run(&a, &job),
        Command::Compare(a) => commands::compare::run(&a, &job),
        Command::Pick(a) => commands::pick::run(&a, &job),
        Command::Devices(a) => commands::devices::run(&a),
        Command::Bench(a) => commands::bench::run(&a, &job),
    };
    let outcome = with_threads(run).unwrap_or_else(|e| Err(e.into()));
    exit_code(match outcome {
        Ok(Answer::Yes) | Err(Failure::StdoutClosed) => match check_warnings() {
            Ok(()) => 0,
            Err(lost) => bad(&lost),
        },
        Ok(Answer::No) => 1,
        Err(failure @ Failure::Bad(_)) => bad(&failure),
    })
}

/// Says why the command stops; the exit code. Where standard error is closed too, the exit code alone says that it does.
fn bad(why: &dyn std::fmt::Display) -> u8 {
    let _ = warn(why);
    2
}

/// The arguments. A negative number is a value, which its option judges.
fn parse() -> Result<Cli, clap::Error> {
    fn with_negative(command: clap::Command) -> clap::Command {
        command
            .mut_args(|arg| {
                let takes_values = arg.get_action().takes_values();
                if takes_values { arg.allow_negative_numbers(true) } else { arg }
            })
            .mut_subcommands(with_negative)
    }
    Cli::from_arg_matches(&with_negative(Cli::command()).try_get_matches()?)
}

/// Help and version go to standard output with exit code 0; bad usage is one line on standard error with exit code 2.
fn usage(error: &clap::Error) -> u8 {
    use clap::error::ErrorKind::{DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion};
    match error.kind() {
        DisplayHelp | DisplayVersion => {
            // A reader that has seen enough (`pumice --help | head`) is no error of the command; a full disk is.
            match error.print() {
                Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
                    bad(&format_args!("standard output: {e}"))
                }
                _ => 0,
            }
        }
        DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            2
        }
        _ => {
            let text = error.to_string();
            let what = text
                .split("\n\nUsage:")
                .next()
                .unwrap_or(&text)
                .split("\n\nFor more")
                .next()
                .unwrap_or(&text);
            let what = what.strip_prefix("error: ").unwrap_or(what);
            // A tip that would make a value of an option a file.
            let what = match what.split_once("tip: to pass '") {
                Some((before, tip))
                    if tip.starts_with('-') && tip[1..].starts_with(|c: char| c.is_ascii_digit()) =>
                {
                    let value = tip.split('\'').next().unwrap_or(tip);
                    &format!(
                        "{}; a value that begins with a minus sign follows a = (--option={value})",
                        before.trim()
                    )
                }
                _ => what,
            };
            let line =
                what.split('\n').map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ");
            bad(&format_args!("{line} (see pumice --help)"))
        }
    }
}
