//! The project's own errands: `cargo xtask test` makes ready what the tests need and runs them, `cargo xtask fuzz` looks for inputs
//! that a reader cannot bear.
#![forbid(unsafe_code)]

mod closing_lines;
mod cpu_seconds;
mod fuzz;
mod part;
mod python_env;
mod seconds_table;
mod share;
mod shared_data;
mod test_command;

use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask test [--full] [--only PART]... [--share K] [--list]
       cargo xtask fuzz [TARGET]... [--seconds N]
       cargo xtask fuzz TARGET --input FILE

test: makes ready what the tests need and runs them, part by part; prints a table of seconds at the end.

  --full        run everything, also what takes hours (tests marked `ignore = \"full: …\"` in Rust, `full` in Python)
  --only PART   run this part alone (may be given more than once; build and python-env run where the part needs them)
  --share K     the K-th share of the full set beside the ordinary tests, instead of today's
  --list        name the parts and their caps in seconds

fuzz: gives inputs led by coverage to one reader after the other (needs a C++ compiler); stops at the first finding.

  --seconds N   how long each target runs (default 60); what it learns is kept in target/fuzz for the next run
  --input FILE  run one input, say a finding, alone

Environment: PUMICE_SHARED_DATA is the folder of volumes that may not be shipped (default: ../shared/data).
Exit codes: 0 all passed; 1 a part failed, ran no test, or hit its cap; 2 bad usage.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.split_first() {
        Some((command, rest)) if command == "test" => match test_command::Options::parse(rest) {
            Ok(options) => test_command::run(&options),
            Err(what) => {
                eprintln!("xtask: {what}\n\n{HELP}");
                ExitCode::from(2)
            }
        },
        Some((command, rest)) if command == "fuzz" => match fuzz::Options::parse(rest) {
            Ok(options) => fuzz::run(&options),
            Err(what) => {
                eprintln!("xtask: {what}\n\n{HELP}");
                ExitCode::from(2)
            }
        },
        Some((flag, [])) if flag == "--help" || flag == "-h" => {
            println!("{HELP}");
            ExitCode::SUCCESS
        }
        _ => {
            eprintln!("{HELP}");
            ExitCode::from(2)
        }
    }
}
