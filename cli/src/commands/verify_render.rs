//! `pumice verify-render`

use std::sync::Arc;

use pumice_picture::agreement::counted;
use pumice_session::figure::FigureFlags;
use pumice_session::render_file::RenderOverrides;
use pumice_session::verify_render::{Verdict, VerifiedRender};
use pumice_session::{DetailLevel, Job, VerifyRenderRequest, verify_render};

use super::open_options;
use crate::Answer;
use crate::args::VerifyRender;
use crate::failure::{Failure, say};
use crate::json_report::{declare_report, write_report};
use crate::progress::Bar;

pub(crate) fn run(args: &VerifyRender, job: &Arc<Job>) -> Result<Answer, Failure> {
    let request = VerifyRenderRequest {
        input: args.input.clone(),
        blender: args.with_blender.clone(),
        control: args.control.clone(),
        page: args.out.clone(),
        backend: args.backend.clone(),
        spp: args.spp,
        seconds: args.time,
        level: args.lod.as_deref().map(|lod| match lod {
            "16" => DetailLevel::Boxes,
            "4" => DetailLevel::Cells,
            _ => DetailLevel::Voxels,
        }),
        memory_limit: args.memory_limit,
        overrides: RenderOverrides {
            layer_files: Vec::new(),
            size: args.size,
            labels: args.labels.clone(),
            bounces: args.bounces,
            figure: FigureFlags { pick: args.pick, ..FigureFlags::default() },
            ..RenderOverrides::default()
        },
        reading: open_options(&args.reading, job),
        command: std::env::args().collect::<Vec<_>>().join(" "),
    };
    declare_report(&request.reading.outputs, args.json.as_deref())?;
    let mut opening = Some(Bar::follow("opening", job));
    let mut comparing = None;
    let verified = verify_render(&request, job, &mut |progress| {
        opening = None;
        let bar = comparing.get_or_insert_with(|| Bar::manual("comparing"));
        bar.set(1000 * progress.pictures as u64 / progress.next_look as u64, progress.to_string());
    });
    drop((opening, comparing));
    let verified = verified?;
    if args.json.as_deref() != Some(std::path::Path::new("-")) {
        say_result(&verified)?;
    }
    if let Some(to) = &args.json {
        write_report(to, &verified)?;
    }
    match verified.agreement.verdict {
        Verdict::Agrees => Ok(Answer::Yes),
        Verdict::Differs => Ok(Answer::No),
        Verdict::CannotTell => Err(Failure::new(verified.sentence)),
    }
}

fn say_result(verified: &VerifiedRender) -> Result<(), Failure> {
    for note in &verified.notes {
        say(note)?;
    }
    let [ours, theirs] = verified.agreement.pictures;
    say(format_args!(
        "{} by Pumice and {} by Cycles, of {} samples, {} × {} pixels, {} faces ({})",
        counted(ours),
        counted(theirs),
        verified.spp,
        verified.size[0],
        verified.size[1],
        verified.faces,
        verified.surface
    ))?;
    for cost in [&verified.ours, &verified.theirs] {
        say(format_args!(
            "{}: {:.1} s ({:.1} CPU s), {:.0} MB, error {:.2} %",
            cost.name,
            cost.seconds,
            cost.cpu_seconds,
            cost.bytes as f64 / 1e6,
            100.0 * cost.error_estimate
        ))?;
    }
    if verified.agreement.verdict == Verdict::CannotTell { Ok(()) } else { say(&verified.sentence) }
}
