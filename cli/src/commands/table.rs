//! `pumice table`

use std::sync::Arc;

use pumice_session::{Job, TableRequest, write_labels};

use super::open_options;
use crate::Answer;
use crate::args::Table;
use crate::failure::{Failure, print, say};
use crate::progress::Bar;

pub(crate) fn run(args: &Table, job: &Arc<Job>) -> Result<Answer, Failure> {
    let bar = Bar::follow("reading", job);
    let request = TableRequest {
        input: args.input.clone(),
        out: args.out.clone(),
        format: args.format,
        query: args.query.clone(),
        reading: open_options(&args.reading, job),
    };
    let written = write_labels(&request, job)?;
    drop(bar);
    if args.json {
        print(&serde_json::to_string_pretty(&written)?)?;
        return Ok(Answer::Yes);
    }
    say(format_args!("{}: {} labels, format {}", args.out.display(), written.labels, written.format))?;
    for note in &written.notes {
        say(format_args!("note: {note}"))?;
    }
    Ok(Answer::Yes)
}
