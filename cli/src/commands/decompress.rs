//! `pumice decompress`

use std::sync::Arc;

use pumice_session::{Job, OpenOptions, decompress_file};

use crate::Answer;
use crate::args::Decompress;
use crate::failure::Failure;
use crate::progress::Bar;

pub(crate) fn run(args: &Decompress, job: &Arc<Job>) -> Result<Answer, Failure> {
    let _bar = Bar::follow("writing", job);
    let reading = OpenOptions { time: args.time_step, ..OpenOptions::default() };
    decompress_file(&args.file, &args.out, &reading, job)?;
    Ok(Answer::Yes)
}
