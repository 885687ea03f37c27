//! `pumice export`

use std::sync::Arc;

use pumice_session::{ExportRequest, ExportSize, Form, Job, Merging, Reader, export_file};

use super::open_options;
use crate::Answer;
use crate::args::selectors::{all_but_ids, ids};
use crate::args::{Export, FormArg, ReaderArg};
use crate::failure::{Failure, say, warn};
use crate::json_report::{declare_report, write_report};
use crate::progress::Bar;

pub(crate) fn run(args: &Export, job: &Arc<Job>) -> Result<Answer, Failure> {
    let asked = args.lod.as_ref().map_or(args.form.as_slice(), std::slice::from_ref);
    let mut forms: Vec<Form> = Vec::new();
    for form in asked {
        let form = match form {
            FormArg::Instances => Form::Instances,
            FormArg::Boxes => Form::Boxes,
            FormArg::Cells4 => Form::Cells,
            FormArg::Voxels => Form::Voxels,
            FormArg::Smooth => Form::Smooth,
        };
        if !forms.contains(&form) {
            forms.push(form);
        }
    }
    let request = ExportRequest {
        input: args.input.clone(),
        out: args.out.clone(),
        forms,
        merging: if args.plain { Merging::Plain } else { Merging::Merged },
        limit_bytes: args.limit,
        reader: match args.reader {
            ReaderArg::Specification => Reader::Specification,
            ReaderArg::Blender => Reader::Blender,
        },
        labels: ids(&args.labels),
        selected: all_but_ids(&args.labels),
        region: args.region,
        reading: open_options(&args.reading, job),
    };
    declare_report(&request.reading.outputs, args.json.as_deref())?;
    let is_quiet = args.json.as_deref() == Some(std::path::Path::new("-"));
    let bar = Bar::follow("exporting", job);
    let mut said = Ok(());
    let mut tell = |size: ExportSize| {
        if !is_quiet {
            let (what, mb) = (counted(size), size.bytes as f64 / 1e6);
            said = bar.out_of_the_way(|| say(format_args!("{what}, about {mb:.2} MB to write")));
        }
    };
    let exported = export_file(&request, &mut tell, job);
    drop(bar);
    let exported = exported?;
    said?;
    if let Some(note) = request.reader.note() {
        warn(note)?;
    }
    if !exported.left_out.is_empty() {
        warn(format_args!("left out: {}", exported.left_out.join(", ")))?;
    }
    if !is_quiet {
        say(format_args!(
            "{}: {:.1} MB, {:.1} s ({:.1} CPU s)",
            args.out.display(),
            exported.bytes as f64 / 1e6,
            exported.seconds,
            exported.cpu_seconds
        ))?;
    }
    if let Some(to) = &args.json {
        write_report(to, &exported)?;
    }
    Ok(Answer::Yes)
}

fn counted(size: ExportSize) -> String {
    match (size.faces, size.boxes) {
        (faces, 0) => format!("{faces} faces"),
        (0, boxes) => format!("{boxes} boxes"),
        (faces, boxes) => format!("{boxes} boxes and {faces} faces"),
    }
}
