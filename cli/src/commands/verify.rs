//! `pumice verify`

use std::sync::Arc;

use pumice_session::{Job, Verification, verify_file};

use super::open_options;
use crate::Answer;
use crate::args::Verify;
use crate::failure::{Failure, say};
use crate::progress::Bar;

pub(crate) fn run(args: &Verify, job: &Arc<Job>) -> Result<Answer, Failure> {
    let bar = Bar::follow("verifying", job);
    let difference = verify_file(&args.file, &args.input, &open_options(&args.reading), job)?;
    drop(bar);
    match difference {
        Verification::Same { .. } => {
            say(format_args!("{} holds {} exactly", args.file.display(), args.input.display()))?;
            Ok(Answer::Yes)
        }
        difference => {
            say(format_args!("{} is not {}: {difference}", args.file.display(), args.input.display()))?;
            Ok(Answer::No)
        }
    }
}
