//! `pumice demo`

use std::sync::Arc;

use pumice_session::{Job, Stop, shipped_volume};

use crate::Answer;
use crate::args::Demo;
use crate::demo::{self, DemoOptions, DemoStage};
use crate::failure::{Failure, say};
use crate::progress::Bar;

pub(crate) fn run(args: &Demo, job: &Arc<Job>) -> Result<Answer, Failure> {
    let options = DemoOptions {
        volume: match &args.volume {
            Some(path) => path.clone(),
            None => shipped_volume()?,
        },
        out: args.out.clone(),
        stop: Stop { spp: None, seconds: Some(args.time), error: Some(args.error) },
        size: args.size,
    };
    say(format_args!("reading {}", options.volume.display()))?;
    let mut bar: Option<Bar> = None;
    let mut rendering = false;
    let outcome = demo::run(&options, job, &mut |stage| match stage {
        DemoStage::Compress => bar = Some(Bar::follow("compressing", job)),
        DemoStage::Verify => {
            bar = None;
            bar = Some(Bar::follow("verifying", job));
        }
        DemoStage::Render(point) => {
            if !rendering {
                rendering = true;
                bar = None;
                bar = Some(Bar::manual("path tracing"));
            }
            if let Some(bar) = &bar {
                super::render::show_progress(bar, &options.stop, &point);
            }
        }
        DemoStage::Write => bar = None,
    })?;
    drop(bar);
    let figures = &outcome.figures;
    super::render::warn(figures)?;
    say(format_args!(
        "compressed {:.1} MB to {:.2} MB in memory ({:.2} %), every voxel verified",
        outcome.bytes_raw as f64 / 1e6,
        outcome.bytes_resident as f64 / 1e6,
        100.0 * outcome.bytes_resident as f64 / outcome.bytes_raw as f64
    ))?;
    say(format_args!(
        "path traced by {} on {}: {}",
        figures.backend,
        figures.device,
        super::render::summary(figures)
    ))?;
    say(format_args!("see {} and picture.png beside it", outcome.report.display()))?;
    Ok(Answer::Yes)
}
