//! `pumice bench denoise`: the error of pictures in real light with and without a denoiser, against CPU seconds.
//!
//! ```text
//! six scenes of real light ─┬─► reference: many samples, four seeds ─────────────────────────────┐
//!                           └─► 1, 4, 16, 64 samples ─┬─► as they are ──────────────────────────┤
//!                                                     ├─► Pumice's denoiser ────────────────────┼─► relMSE, FLIP ─► CSV, Markdown, SVG
//!                                                     └─► Open Image Denoise, where it is there ┘
//! ```
//! All three see the same picture, Open Image Denoise with base colour and normal. The seconds are those of the samples and, where there is
//! one, of the denoiser. The reference's own noise is subtracted from relMSE, not from FLIP, which knows no such part.

mod tables;
mod viewport;

use std::path::PathBuf;
use std::sync::Arc;

use clap::{Args, ValueEnum};
use pumice_core::{CompressedVolume, Job};
use pumice_picture::denoise::denoised;
use pumice_picture::film::variance_known;
use pumice_picture::metrics::compare;
use pumice_picture::{Guides, Image, Picture};
use pumice_scene::Scene;
use pumice_session::backend::{FallbackRenderer, make_renderer};
use pumice_session::error::{Result, SessionError};
use pumice_session::progressive::{Stop, render_until};
use pumice_session::values::size;
use pumice_session::{Oidn, open_meshes};
use pumice_transport::{LoadedScene, RenderError, Renderer};

use crate::console::{BenchResult, Console, Outcome};
use crate::convergence::real_light::{Figure, LightScene, each_scene, volumes_or_those_of_real_light};
use crate::files::{rising, scratch};
use crate::machine;
use crate::mean_picture::MeanPicture;
use crate::timing::{Took, clocked};

/// Pictures that make up the reference, each with its own seed.
const BATCHES: u32 = 4;
/// Seed of the measured pictures, and the first one of the reference's.
const SEED: u64 = 7;
const REFERENCE_SEED: u64 = 1007;

/// relMSE and FLIP against CPU seconds, as rendered and denoised, beside Open Image Denoise if --oidn names its library
///
/// Renders six scenes in the light that artists use. Writes denoise.csv, denoise.md and an SVG for each scene; with --viewport instead how
/// soon a live picture is close to the converged one after the camera moved, as viewport.csv and viewport.md.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Label volumes; the shipped ones by default
    #[arg(value_name = "FILE")]
    volumes: Vec<PathBuf>,
    /// Library of Open Image Denoise
    #[arg(long, value_name = "LIBRARY")]
    oidn: Option<PathBuf>,
    /// Only these scenes
    #[arg(long, value_name = "NAME,…", value_enum, value_delimiter = ',')]
    only: Option<Vec<LightScene>>,
    /// Number of labels, the longest ones
    #[arg(long, value_name = "N", default_value = "30", value_parser = clap::value_parser!(u32).range(1..))]
    pick: u32,
    /// Picture size in pixels [default: 480x270; 1920x1080 with --viewport]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Measure a live picture after a camera move instead
    #[arg(long, conflicts_with_all = ["oidn", "spp"])]
    viewport: bool,
    /// Samples per pixel, in increasing order
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,4,16,64", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Vec<u32>,
    /// Samples per pixel of the reference [default: 4096; 256 with --viewport]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..))]
    reference_spp: Option<u32>,
    /// Bounces of light
    #[arg(long, value_name = "N", default_value = "8")]
    bounces: u32,
    /// Backend that draws and denoises what is measured; the processor always draws the reference
    #[arg(long, value_name = "NAME", default_value = "cpu")]
    backend: String,
    /// Folder for the results, created if missing
    #[arg(long, value_name = "DIR", default_value = "pumice-denoise")]
    out: PathBuf,
}

/// What a picture went through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Through {
    /// No filter: the mean of the samples.
    Nothing,
    /// Pumice's denoiser.
    Pumice,
    /// Open Image Denoise.
    Oidn,
}

impl Through {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "none",
            Self::Pumice => "Pumice",
            Self::Oidn => "Open Image Denoise",
        }
    }
}

/// The error of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Denoised {
    /// Name of the scene.
    pub scene: &'static str,
    /// Samples per pixel.
    pub spp: u32,
    /// What it went through.
    pub through: Through,
    /// CPU seconds of the samples.
    pub render_cpu_seconds: f64,
    /// CPU seconds of the denoiser.
    pub denoise_cpu_seconds: f64,
    /// relMSE against the reference, less the part of the reference's own noise.
    pub rel_mse: f64,
    /// FLIP against the reference.
    pub flip: f64,
}

impl Flags {
    fn size(&self) -> [u32; 2] {
        self.size.unwrap_or(if self.viewport { [1920, 1080] } else { [480, 270] })
    }

    fn reference_spp(&self) -> u32 {
        self.reference_spp.unwrap_or(if self.viewport { 256 } else { 4096 })
    }
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    rising(&flags.spp)?;
    let volumes = volumes_or_those_of_real_light(&flags.volumes)?;
    let scenes = flags.only.clone().unwrap_or_else(|| LightScene::value_variants().to_vec());
    let figure = Figure { size: flags.size(), pick: flags.pick as usize, bounces: flags.bounces };
    // Asked before the work, not after it.
    let oidn = flags.oidn.as_deref().map(|library| Oidn::find(Some(library))).transpose()?;
    let mut drawn_by = DrawnBy::new(&flags.backend)?;
    let temporary = scratch()?;
    if flags.viewport {
        let rows = console.watch("", |watch| {
            let mut rows = Vec::new();
            each_scene(&scenes, &volumes, figure, temporary.path(), job, &mut |name, scene, volume| {
                watch(name);
                let mut renderer = make_renderer("cpu")?;
                let moved = viewport::moved(scene);
                let reference =
                    drawn(&mut renderer, &moved, volume, REFERENCE_SEED, flags.reference_spp(), job)?.0;
                drop(renderer);
                rows.extend(viewport::watched(name, scene, volume, &reference.color, &mut drawn_by, job)?);
                Ok(())
            })?;
            Ok::<_, SessionError>(rows)
        })?;
        tables::write_viewport(
            &flags.out,
            &drawn_by.described(),
            flags.size(),
            flags.reference_spp(),
            &rows,
        )?;
        console.line(flags.out.join("viewport.md").display())?;
        return Ok(Outcome::Holds);
    }
    let results = console.watch("", |watch| {
        let mut results = Vec::new();
        each_scene(&scenes, &volumes, figure, temporary.path(), job, &mut |name, scene, volume| {
            watch(name);
            results.extend(measured(flags, name, scene, volume, oidn, &mut drawn_by, job)?);
            Ok(())
        })?;
        Ok::<_, SessionError>(results)
    })?;
    let version = oidn.map(|oidn| oidn.denoiser().name());
    tables::write(&flags.out, &drawn_by.described(), version.as_deref(), flags.size(), &results)?;
    console.line(flags.out.join("denoise.md").display())?;
    Ok(Outcome::Holds)
}

/// What drew and denoised the pictures that are measured.
pub(super) struct DrawnBy {
    backend: String,
    device: String,
    /// Failures of the device that were overcome; after one the pictures may have come from elsewhere.
    notices: Vec<String>,
}

impl DrawnBy {
    /// # Errors
    /// Where this machine has no such backend.
    fn new(backend: &str) -> Result<Self> {
        make_renderer(backend)?;
        Ok(Self { backend: backend.to_owned(), device: String::new(), notices: Vec::new() })
    }

    /// Remembers the device of the pictures just drawn, and what it said.
    fn remember(&mut self, device: &str, notices: impl IntoIterator<Item = String>) {
        device.clone_into(&mut self.device);
        self.notices.extend(notices);
    }

    /// The machine with backend and device, and a line for each notice.
    fn described(&self) -> String {
        let drawn = format!(
            "{}\n\nDrawn and denoised by {} on {}.",
            machine::description(),
            self.backend,
            self.device
        );
        self.notices.iter().fold(drawn, |text, notice| format!("{text}\n{notice}"))
    }
}

/// A picture of a scene, and the time of its samples.
fn drawn(
    renderer: &mut FallbackRenderer,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    seed: u64,
    spp: u32,
    job: &Job,
) -> Result<(Picture, Took)> {
    let mut scene = scene.clone();
    scene.settings.seed = seed;
    let meshes = open_meshes(&scene)?;
    renderer.set_scene(&LoadedScene::new(scene, vec![Arc::clone(volume)], meshes)?)?;
    let stop = Stop { spp: Some(spp), ..Stop::default() };
    let (_, took) = clocked(|| Ok(render_until(renderer, &stop, job, &mut |_| {})?))?;
    Ok((renderer.picture()?, took))
}

/// Measures one scene.
fn measured(
    flags: &Flags,
    name: &'static str,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    oidn: Option<&Oidn>,
    drawn_by: &mut DrawnBy,
    job: &Job,
) -> Result<Vec<Denoised>> {
    let mut renderer = make_renderer("cpu")?;
    let each = flags.reference_spp().div_ceil(BATCHES);
    let batches: Vec<Image> = (0..u64::from(BATCHES))
        .map(|batch| Ok(drawn(&mut renderer, scene, volume, REFERENCE_SEED + batch, each, job)?.0.color))
        .collect::<Result<_>>()?;
    let mut renderer = make_renderer(&flags.backend)?;
    let reference = MeanPicture::of(&batches);
    let (expected, own) = (reference.image(flags.size()), reference.own_rel_mse());

    let mut results = Vec::new();
    for &spp in &flags.spp {
        let (picture, took) = drawn(&mut renderer, scene, volume, SEED, spp, job)?;
        let mut judge = |through: Through, image: &Image, denoise_cpu_seconds: f64| -> Result<()> {
            let found = compare(image, &expected, None, &|| job.is_cancelled())
                .map_err(|e| SessionError::Caller(format!("{name}: {e}")))?;
            results.push(Denoised {
                scene: name,
                spp,
                through,
                render_cpu_seconds: took.cpu_seconds,
                denoise_cpu_seconds,
                rel_mse: found.rel_mse - own,
                flip: found.flip,
            });
            Ok(())
        };
        judge(Through::Nothing, &picture.color, 0.0)?;
        // A device that denoises a picture first finds its first surfaces, and may compile; the processor has them with the picture.
        filtered(&mut renderer, name, &picture)?;
        let (ours, took) = clocked(|| filtered(&mut renderer, name, &picture))?;
        judge(Through::Pumice, &ours, took.cpu_seconds)?;
        if let Some(oidn) = oidn {
            let (theirs, took) = clocked(|| oidn.denoised(&picture))?;
            judge(Through::Oidn, &theirs, took.cpu_seconds)?;
        }
    }
    let notices = renderer.notices();
    drawn_by.remember(renderer.device(), notices);
    Ok(results)
}

/// The picture that `renderer` has just drawn through Pumice's denoiser, on the renderer's own device where it can.
fn filtered(renderer: &mut FallbackRenderer, name: &str, picture: &Picture) -> Result<Image> {
    if let Some(smooth) = renderer.denoised()? {
        return Ok(smooth);
    }
    let guides = Guides::of(picture).map_err(RenderError::from)?;
    let guides =
        guides.ok_or_else(|| SessionError::Caller(format!("{name}: expected first surfaces, got none")))?;
    let variance = picture.variance.as_ref().map(variance_known);
    Ok(denoised(&picture.color, variance, &guides).map_err(RenderError::from)?)
}
