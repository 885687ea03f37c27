//! `pumice merge`

use std::sync::Arc;

use pumice_core::Outputs;
use pumice_session::{Job, MergeRequest, merge_files, merge_part_files};

use super::compress::{level_of, report, report_part};
use crate::Answer;
use crate::args::Merge;
use crate::failure::Failure;
use crate::json_report::declare_report;
use crate::progress::Bar;

pub(crate) fn run(args: &Merge, job: &Arc<Job>) -> Result<Answer, Failure> {
    let outputs = Outputs::default();
    declare_report(&outputs, args.json.as_deref())?;
    let bar = Bar::follow_whole("merging", job);
    let request = MergeRequest {
        parts: args.parts.clone(),
        output: args.out.clone(),
        level: level_of(args.level),
        threads: args.threads.map(usize::from),
        memory_limit_bytes: args.memory_limit,
        types: args.types.clone(),
        table: args.table.clone(),
    };
    if args.part {
        let outcome = merge_part_files(&request, &outputs, job)?;
        drop(bar);
        return report_part(&args.out, args.json.as_deref(), outcome);
    }
    let outcome = merge_files(&request, &outputs, job)?;
    drop(bar);
    report(&args.out, args.json.as_deref(), outcome)
}
