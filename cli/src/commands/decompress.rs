//! `pumice decompress`

use std::sync::Arc;

use pumice_session::{Job, decompress_file};

use crate::Answer;
use crate::args::Decompress;
use crate::failure::Failure;
use crate::progress::Bar;

pub(crate) fn run(args: &Decompress, job: &Arc<Job>) -> Result<Answer, Failure> {
    let _bar = Bar::follow("writing", job);
    decompress_file(&args.file, &args.out, job)?;
    Ok(Answer::Yes)
}
