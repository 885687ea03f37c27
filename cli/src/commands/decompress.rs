//! `pumice decompress`

use std::sync::Arc;

use pumice_session::{Job, decompress_file};

use crate::Answer;
use crate::args::Decompress;
use crate::failure::{Failure, say};
use crate::progress::Bar;

pub(crate) fn run(args: &Decompress, job: &Arc<Job>) -> Result<Answer, Failure> {
    let bar = Bar::follow("writing", job);
    let notes = decompress_file(&args.file, &args.out, args.time_step, &args.how(), job)?;
    drop(bar);
    for note in notes {
        say(format_args!("note: {note}"))?;
    }
    Ok(Answer::Yes)
}
