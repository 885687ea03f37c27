//! `pumice bench`

use std::io;

use pumice_bench::{Bench, BenchError, Outcome};
use pumice_session::Job;

use crate::Answer;
use crate::failure::Failure;

pub(crate) fn run(bench: &Bench, job: &Job) -> Result<Answer, Failure> {
    match bench.run(job, &mut io::stdout()) {
        Ok(Outcome::Holds) => Ok(Answer::Yes),
        Ok(Outcome::Missed) => Ok(Answer::No),
        Err(BenchError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => Err(Failure::StdoutClosed),
        Err(error) => Err(error.into()),
    }
}
