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
    let verified =
        verify_file(&args.file, &args.inputs, args.time_steps, &open_options(&args.reading, job), job)?;
    let input = args.inputs.iter().map(|input| input.display().to_string()).collect::<Vec<_>>().join(", ");
    drop(bar);
    match verified.found {
        Verification::Same { .. } => {
            say(format_args!("{} holds {input} exactly", args.file.display()))?;
            Ok(Answer::Yes)
        }
        _ => {
            say(format_args!("{} is not {input}: {verified}", args.file.display()))?;
            Ok(Answer::No)
        }
    }
}
