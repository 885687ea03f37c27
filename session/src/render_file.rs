//! Renders a volume, a scene, or an earlier picture again, to a picture file.
//!
//! ```text
//! request ─► prepare: scene, volumes, meshes ─► overrides ─► render_scene: picture, figures ─► picture_format: a file
//!                └─ an earlier picture: again, provenance
//! ```

mod again;
mod blank;
mod hashed_files;
pub(crate) mod open_scene;
mod overrides;
mod picture_format;
mod prepare;
mod provenance;
mod refusals;
mod render_scene;
mod request;
mod time_steps;
mod turntable;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use open_scene::OpenedScene;
use picture_format::check_folder;
use prepare::{Prepared, prepare};
use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_picture::{Annotations, Passes};
use pumice_scene::Show;
use pumice_transport::LoadedScene;
use refusals::check_options;

use crate::annotations::lay_out;
use crate::backend::make_renderer;
use crate::denoise::{DenoiserName, Filter};
use crate::error::{Result, SessionError};
use crate::measure::Stopwatch;
use crate::progressive::{CurvePoint, Stop};
use crate::savings::{OpeningSaved, Savings, SavingsOptions, measure_opening, measure_savings};

pub use overrides::set_width;
pub use picture_format::PictureFormat;
pub use provenance::hash_text;
pub(crate) use provenance::sky_hash_text;
pub use pumice_picture::PicturePaths;
pub use render_scene::{PageFigures, RenderFigures, Rendered, render_and_denoise, render_scene};
pub(crate) use render_scene::{bytes_of_film, check_memory, report, sampled};
pub use request::{RenderOverrides, RenderRequest, Subject};
pub use time_steps::render_time_steps;
pub use turntable::{NumberedPicture, render_turntable};

/// What a request means, checked and opened.
struct Ready {
    format: PictureFormat,
    passes: Passes,
    scene: LoadedScene,
    stop: Stop,
    backend: String,
    annotations: Annotations,
    denoise: Option<Filter>,
    notices: Vec<String>,
    opening_seconds: [f64; 2],
}

impl Ready {
    /// Checks a request, opens what it needs, and writes the scene where that is wanted. `pictures` are the files that it makes.
    fn new(request: &RenderRequest, pictures: &[PathBuf], job: &Job) -> Result<Self> {
        // A wrong file extension, pass, backend or denoiser is reported before the work, not after it.
        let format = PictureFormat::of(&request.out)?;
        let passes = Passes::parse(&request.passes).map_err(|e| SessionError::Caller(format!("--{e}")))?;
        check_options(request, format)?;
        check_folder(&request.out)?;
        pictures
            .iter()
            .chain(&request.save_scene)
            .try_for_each(|out| request.reading.outputs.declare(out))?;
        make_renderer(&request.backend)?;
        let denoise = request.denoise.as_ref().map(DenoiserName::filter).transpose()?;

        let clock = Stopwatch::start();
        let Prepared {
            opened: OpenedScene { mut scene, volumes, meshes },
            stop,
            backend,
            annotations,
            denoise,
            notices,
        } = prepare(request, denoise, job)?;
        let opening_seconds = [clock.seconds(), clock.cpu_seconds()];
        // Named passes are added to the scene; `all` means those that the scene asks for and those that every picture has.
        if request.passes != ["all"] {
            scene.film.passes = scene.film.passes.or(passes);
        }
        if let Some(path) = &request.save_scene {
            scene.save(path).map_err(|source| SessionError::Scene { path: path.clone(), source })?;
        }
        let scene = LoadedScene::new(scene, volumes, meshes)?;
        Ok(Self { format, passes, scene, stop, backend, annotations, denoise, notices, opening_seconds })
    }
}

/// Carries out `request`. After every slice it calls `watch` with the limits in force and the progress.
///
/// # Errors
/// One line that says what is wrong with the input, the scene or the output; nothing is written then.
pub fn render_file(
    request: &RenderRequest,
    job: &Job,
    watch: &mut (dyn FnMut(&Stop, &CurvePoint) + Send),
) -> Result<Rendered> {
    let Ready { format, passes, scene, stop, backend, annotations, denoise, notices, opening_seconds } =
        Ready::new(request, std::slice::from_ref(&request.out), job)?;
    let laid_out = lay_out(&scene, &annotations)?;
    let mut rendered = in_pool(request.threads, || -> Result<Rendered> {
        let mut rendered =
            render_and_denoise(&scene, &backend, &stop, denoise, job, &mut |point| watch(&stop, point))?;
        laid_out.apply(&mut rendered);
        rendered.figures.opening_seconds = Some(opening_seconds);
        rendered.figures.notices.extend(notices);
        let source = match &request.subject {
            Subject::File(path) => path,
            Subject::Again(picture) => picture,
        };
        rendered.figures.notices.extend(blank::notice(&scene, &rendered.picture, source));
        if request.explain {
            // Measure on the backend that drew the picture: `auto` may have fallen back to another.
            let drew = if backend == "auto" { rendered.figures.backend.clone() } else { backend.clone() };
            let (opening, whole) = measure_openings(&scene, job)?;
            let measured = measure_savings(&whole, &drew, &SavingsOptions::QUICK, job, &mut |_| {})?;
            rendered.figures.savings = Some(Savings { opening, ..measured });
        }
        Ok(rendered)
    })?;
    if let (Subject::Again(_), Some(whole)) = (&request.subject, stop.spp)
        && rendered.figures.spp < whole
    {
        let spp = rendered.figures.spp;
        rendered.figures.notices.push(format!(
            "--time ended the picture at {spp} of {whole} samples a pixel: it is not the same picture"
        ));
    }
    format.write(&request.out, &rendered.picture, &passes, request.paths)?;
    Ok(rendered)
}

/// Measures what reading only the visible labels saved; also returns the scene with volumes that have all labels.
fn measure_openings(loaded: &LoadedScene, job: &Job) -> Result<(Vec<OpeningSaved>, LoadedScene)> {
    let (scene, volumes) = (loaded.scene(), loaded.volumes());
    let mut saved = Vec::new();
    // By file, and the time step of it.
    let mut whole: BTreeMap<(&Path, Option<u32>), Arc<CompressedVolume>> = BTreeMap::new();
    for (instance, volume) in scene.instances.iter().zip(volumes) {
        let (path, time) = (instance.source.as_path(), volume.frame().map(|of| of.number));
        if volume.is_whole() || whole.contains_key(&(path, time)) {
            continue;
        }
        let of_file = scene.instances.iter().filter(|i| i.source == path && i.reading == instance.reading);
        let shows: Vec<&Show> = of_file.map(|i| &i.style.show).collect();
        // Only `.pumice` files are read in part, and they leave nothing but the time step to the caller.
        let reading = OpenOptions { time, ..OpenOptions::default() };
        let (one, volume) = measure_opening(path, &shows, &reading, SavingsOptions::QUICK.rounds, job)?;
        saved.push(one);
        whole.insert((path, time), volume);
    }
    let volumes = scene.instances.iter().zip(volumes).map(|(instance, volume)| {
        let of_file = (instance.source.as_path(), volume.frame().map(|of| of.number));
        Arc::clone(whole.get(&of_file).unwrap_or(volume))
    });
    let all_labels = LoadedScene::new(scene.clone(), volumes.collect(), loaded.meshes().to_vec())?;
    Ok((saved, all_labels))
}

/// Runs `work` in a pool of `threads` threads; without a number, in that of the process.
fn in_pool<T: Send>(threads: Option<usize>, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let Some(threads) = threads else { return work() };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| SessionError::Caller(format!("--threads {threads}: {e}")))?
        .install(work)
}
