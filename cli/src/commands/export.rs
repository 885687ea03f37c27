//! `pumice export`

use std::sync::Arc;

use pumice_session::{ExportRequest, Form, Job, Merging, export_file};

use super::open_options;
use crate::Answer;
use crate::args::{Export, FormArg};
use crate::failure::{Failure, say};
use crate::json_report::write_report;
use crate::progress::Bar;

pub(crate) fn run(args: &Export, job: &Arc<Job>) -> Result<Answer, Failure> {
    let mut forms: Vec<Form> = Vec::new();
    for form in &args.form {
        let form = match form {
            FormArg::Instances => Form::Instances,
            FormArg::Boxes => Form::Boxes,
            FormArg::Cells4 => Form::Cells,
            FormArg::Voxels => Form::Voxels,
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
        most_faces: args.most_faces,
        labels: args.labels.clone(),
        reading: open_options(&args.reading),
    };
    let bar = Bar::follow("exporting", job);
    let exported = export_file(&request, job);
    drop(bar);
    let exported = exported?;
    if !exported.left_out.is_empty() {
        eprintln!("pumice: left out: {}", exported.left_out.join(", "));
    }
    if args.json.as_deref() != Some(std::path::Path::new("-")) {
        say(format_args!(
            "{}: {} faces, {:.1} MB, {:.1} s ({:.1} CPU s)",
            args.out.display(),
            exported.faces,
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
