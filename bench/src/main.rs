//! `pumice bench` as a separate program: `cargo run --release -p pumice-bench -- NAME`.
#![forbid(unsafe_code)]

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser;
use pumice_bench::{Bench, BenchError, Outcome};
use pumice_core::Job;
use pumice_core::error::one_line;
use pumice_session::{exit_code, interrupt};

/// Measure, and print a table
#[derive(Debug, Parser)]
#[command(name = "pumice-bench", version, max_term_width = 100, disable_help_subcommand = true)]
struct Cli {
    #[command(flatten)]
    bench: Bench,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let job = Arc::new(Job::new());
    let watched = job.clone();
    let handler = ctrlc::set_handler(move || interrupt(&watched));
    if let Err(error) = handler {
        return ExitCode::from(refused(format_args!("Ctrl-C cannot be handled here: {error}")));
    }
    exit_code(match cli.bench.run(&job, &mut io::stdout()) {
        Ok(Outcome::Holds) => 0,
        Ok(Outcome::Missed) => 1,
        Err(BenchError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => 0,
        Err(error) => refused(error),
    })
}

/// Says on standard error, in one line, why the bench ends; the exit code. (Where standard error takes no line, the code alone tells.)
fn refused(why: impl Display) -> u8 {
    let _ = writeln!(io::stderr(), "pumice-bench: {}", one_line(&why.to_string()));
    2
}
