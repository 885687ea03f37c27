//! `pumice render`

use std::collections::BTreeMap;
use std::sync::Arc;

use pumice_session::{
    CurvePoint, Denoiser, Job, NumberedPicture, PageFigures, PicturePaths, RenderFigures, RenderOverrides,
    RenderRequest, Savings, Stop, Subject, render_file, render_time_steps, render_turntable,
};

use super::open_options;
use crate::Answer;
use crate::args::{LodArg, Render, RenderMode, ViewArg};
use crate::failure::{self, Failure, say};
use crate::json_report::{declare_report, write_report};
use crate::progress::Bar;

/// Samples per pixel where no flag limits the picture.
const DEFAULT_SPP: u32 = 64;

pub(crate) fn run(args: &Render, job: &Arc<Job>) -> Result<Answer, Failure> {
    let unlimited =
        args.spp.is_none() && args.time.is_none() && args.error.is_none() && args.noise_threshold.is_none();
    let stop =
        Stop { spp: args.spp.or(unlimited.then_some(DEFAULT_SPP)), seconds: args.time, error: args.error };
    let subject = match (&args.again, &args.input) {
        (Some(picture), _) => Subject::Again(picture.clone()),
        (None, Some(input)) => Subject::File(input.clone()),
        (None, None) => {
            return Err(Failure::new("nothing to render: name a file, a scene or --again PICTURE"));
        }
    };
    let request = RenderRequest {
        subject,
        time_steps: args.time_steps,
        out: args.out.clone(),
        backend: args.backend.clone(),
        stop,
        denoise: args.denoise.clone(),
        passes: args.passes.clone(),
        overrides: RenderOverrides {
            size: args.size,
            width: args.annotate.width()?,
            bounces: args.bounces,
            mode: args.mode.map(|m| match m {
                RenderMode::Path => pumice_session::Mode::Path,
                RenderMode::OneBounce => pumice_session::Mode::OneBounce,
                RenderMode::Ao => pumice_session::Mode::AmbientOcclusion,
            }),
            lod: args.lod.map(|l| match l {
                LodArg::Voxels => pumice_session::Lod::Voxels,
                LodArg::Cells => pumice_session::Lod::Cells,
                LodArg::Boxes => pumice_session::Lod::Boxes,
                LodArg::Auto => pumice_session::Lod::Distance { pixels: 1.0 },
            }),
            seed: args.seed,
            time_step: None,
            labels: args.figure.ids(),
            transparent: args.transparent,
            half: args.half,
            view_transform: args.view_transform.map(|v| match v {
                ViewArg::Standard => pumice_session::ViewTransform::Standard,
                ViewArg::Filmic => pumice_session::ViewTransform::Filmic,
                ViewArg::Agx => pumice_session::ViewTransform::Agx,
            }),
            noise_threshold: args.noise_threshold.map(|t| t as f32),
            min_spp: args.min_spp,
            layer_files: args.layer_file.clone(),
            figure: args.figure.flags(),
        },
        annotations: args.annotate.annotations(),
        reading: open_options(&args.reading, job),
        sources: args.source.clone(),
        paths: if args.no_paths { PicturePaths::None } else { PicturePaths::Relative },
        threads: args.threads.map(usize::from),
        memory_limit_bytes: args.memory_limit,
        save_scene: args.save_scene.clone(),
        explain: args.explain,
    };
    declare_report(&request.reading.outputs, args.json.as_deref())?;

    if args.figure.turntable().is_some() || args.time_steps.is_some() {
        return run_numbered(args, &request, job);
    }
    let mut opening = Some(Bar::follow("opening", job));
    let mut tracing = None;
    let rendered = render_file(&request, job, &mut |stop, point| {
        opening = None;
        show_progress(tracing.get_or_insert_with(|| Bar::manual("path tracing")), stop, point);
    });
    drop((opening, tracing));
    let rendered = rendered?;
    warn(&rendered.figures)?;

    if args.json.as_deref() != Some(std::path::Path::new("-")) {
        let figures = &rendered.figures;
        say(format_args!("{}: {}, by {}", args.out.display(), summary(figures), figures.backend))?;
        if let Some(pages) = &figures.pages {
            say(in_memory(pages))?;
        }
    }
    if args.explain {
        let measured = rendered.figures.savings.iter().flat_map(Savings::lines);
        for line in rendered.explanation.iter().cloned().chain(measured) {
            say(line)?;
        }
    }
    if let Some(to) = &args.json {
        write_report(to, &rendered.figures)?;
    }
    Ok(Answer::Yes)
}

/// One line with what was in memory of volumes that were drawn from disk.
fn in_memory(figures: &PageFigures) -> String {
    let PageFigures { most_bytes, bytes_of_all, pages, loads, .. } = figures;
    format!(
        "{most_bytes} of {bytes_of_all} bytes of the volumes were in memory at once; {loads} loads of {pages} pages"
    )
}

/// Renders the pictures of a turntable or of several time steps.
fn run_numbered(args: &Render, request: &RenderRequest, job: &Arc<Job>) -> Result<Answer, Failure> {
    let mut opening = Some(Bar::follow("opening", job));
    let mut tracing = None;
    let mut watch = |number, stop: &Stop, point: &CurvePoint| {
        opening = None;
        let (of_picture, bar) = tracing.get_or_insert_with(|| (number, bar_of(number)));
        if *of_picture != number {
            (*of_picture, *bar) = (number, bar_of(number));
        }
        show_progress(bar, stop, point);
    };
    let pictures = match request.time_steps {
        Some(_) => render_time_steps(request, job, &mut watch),
        None => render_turntable(request, job, &mut watch),
    };
    drop((opening, tracing));
    let pictures = pictures?;
    pictures.iter().try_for_each(|picture| warn(&picture.figures))?;

    if args.json.as_deref() != Some(std::path::Path::new("-")) {
        for NumberedPicture { picture, figures } in &pictures {
            say(format_args!("{}: {}, by {}", picture.display(), summary(figures), figures.backend))?;
        }
    }
    if let Some(to) = &args.json {
        write_report(to, &BTreeMap::from([("pictures", &pictures)]))?;
    }
    Ok(Answer::Yes)
}

fn bar_of(number: u32) -> Bar {
    Bar::manual(format!("picture {}", number + 1))
}

/// Sets the bar to the progress of the picture towards the limit that it is nearest to.
pub(crate) fn show_progress(bar: &Bar, stop: &Stop, point: &CurvePoint) {
    let mut done = 0f64;
    if let Some(n) = stop.spp {
        done = done.max(f64::from(point.spp) / f64::from(n));
    }
    if let Some(s) = stop.seconds {
        done = done.max(point.seconds / s);
    }
    // The error falls like 1/√time, so the share of the work that is done is (limit / error)².
    if let (Some(bar), Some(e)) = (stop.error, point.error_estimate) {
        done = done.max((bar / e).powi(2));
    }
    let error = point.error_estimate.map_or(String::new(), |e| format!(", error {:.1} %", 100.0 * e));
    bar.set((1000.0 * done) as u64, format!("{} samples{error}, {:.0} s", point.spp, point.seconds));
}

/// One line with the samples, the estimated error and the time of a picture.
pub(crate) fn summary(figures: &RenderFigures) -> String {
    let of = if figures.denoised.is_some() { " before denoising" } else { "" };
    let error = figures
        .error_estimate
        .map_or("error not known".into(), |e| format!("estimated error {:.2} %{of}", 100.0 * e));
    let resting = match figures.mean_spp < f64::from(figures.spp) {
        true => format!(" ({:.1} on average)", figures.mean_spp),
        false => String::new(),
    };
    let denoised = match figures.denoised {
        None => String::new(),
        Some(Denoiser::Statistical) => ", denoised (biased)".into(),
        Some(other) => format!(", denoised by {} (biased)", other.name()),
    };
    let samples = if figures.spp == 1 { "sample" } else { "samples" };
    format!(
        "{} {samples} a pixel{resting}, {error}{denoised}, {:.1} s ({:.1} CPU s)",
        figures.spp, figures.seconds, figures.cpu_seconds
    )
}

/// Prints to standard error each notice of a device that failed and was replaced or restarted.
pub(crate) fn warn(figures: &RenderFigures) -> Result<(), Failure> {
    figures.notices.iter().try_for_each(failure::warn)
}
