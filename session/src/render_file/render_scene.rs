//! Renders a scene whose volumes and meshes are open, and reports the cost.

use std::collections::BTreeMap;
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job, Residency};
use pumice_picture::{Annotations, Denoiser, Picture, Provenance, film_memory};
use pumice_transport::scene_plan::sums_of;
use pumice_transport::{LoadedScene, RenderError, Renderer};
use serde::Serialize;

use super::provenance::{hash_text, labels_hash_text, mesh_hash_text, sky_hash_text};
use crate::backend::{FallbackRenderer, make_renderer};
use crate::denoise::Filter;
use crate::error::Result;
use crate::measure::{Stopwatch, peak_rss_bytes};
use crate::progressive::{CurvePoint, Stop, Watch, render_watched};
use crate::savings::Savings;

/// Cost and estimated error of a picture: the JSON report.
#[derive(Clone, Debug, Serialize)]
pub struct RenderFigures {
    /// Backend that drew it.
    pub backend: String,
    /// Name of the device that drew it.
    pub device: String,
    /// Device failures after which rendering continued, what is drawn otherwise than wished, and why an earlier picture is not finished, one
    /// line each.
    pub notices: Vec<String>,
    /// Wall seconds of rendering.
    pub seconds: f64,
    /// CPU seconds of rendering.
    pub cpu_seconds: f64,
    /// Wall and CPU seconds of opening the volumes and meshes, where that was part of the work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opening_seconds: Option<[f64; 2]>,
    /// Bytes of the volumes in memory by part. Only labels that were read count, and each volume counts once.
    pub volume_bytes: BTreeMap<&'static str, u64>,
    /// What was in memory of volumes that were drawn from disk; absent where all was in memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pages: Option<PageFigures>,
    /// Wall and CPU seconds of building the acceleration structures and tables.
    pub prepare_seconds: [f64; 2],
    /// Largest resident set of the process so far; absent where the system does not report it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_rss_bytes: Option<u64>,
    /// Bytes of the acceleration structures.
    pub acceleration_bytes: u64,
    /// Bytes of the renderer by part, including `acceleration`: on a graphics processor everything in its memory, also the parts of
    /// the volumes; on the CPU everything except the volumes.
    pub bytes: BTreeMap<&'static str, u64>,
    /// Samples of each pixel that did not rest.
    pub spp: u32,
    /// Mean over pixels of the samples that each has.
    pub mean_spp: f64,
    /// Estimated relative error of the mean of the samples, where known.
    pub error_estimate: Option<f64>,
    /// The filter that the picture went through, which makes it biased; absent where it is the mean of its samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub denoised: Option<Denoiser>,
    /// Wall and CPU seconds of that filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub denoise_seconds: Option<[f64; 2]>,
    /// Error against run time.
    pub curve: Vec<CurvePoint>,
    /// Measured savings of what is left out, if they were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub savings: Option<Savings>,
}

/// What was in memory of volumes that were drawn from disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PageFigures {
    /// The limit in bytes.
    pub limit_bytes: u64,
    /// The most bytes that were in memory at once.
    pub most_bytes: u64,
    /// Bytes that all of the volumes would take.
    pub bytes_of_all: u64,
    /// Pages that there are.
    pub pages: u64,
    /// Loads of pages, each time again, for the picture.
    pub loads: u64,
}

/// Loads a page on average, beyond which a picture says that a higher limit would make it faster.
const MANY_LOADS: u64 = 4;

impl PageFigures {
    /// Of the volumes of a scene, which share one memory, since they were opened.
    pub fn of(volumes: &[Arc<CompressedVolume>]) -> Option<Self> {
        Some(Self::of_memory(volumes.iter().find_map(|volume| volume.pages())?.memory()))
    }

    /// Of all volumes that share a memory.
    pub fn of_memory(memory: &Residency) -> Self {
        let counts = memory.counts();
        Self {
            limit_bytes: counts.limit_bytes,
            most_bytes: counts.most_held_bytes,
            bytes_of_all: counts.bytes_of_all,
            pages: counts.parts,
            loads: counts.loads,
        }
    }

    /// The same with the loads of one picture, before which there were those of `before`.
    fn since(self, before: Option<Self>) -> Self {
        Self { loads: self.loads - before.map_or(0, |before| before.loads.min(self.loads)), ..self }
    }

    /// What the limit cost, where it cost much.
    fn notice(&self) -> Option<String> {
        let Self { limit_bytes, bytes_of_all, pages, loads, .. } = self;
        (*loads > MANY_LOADS * pages).then(|| {
            format!(
                "memory limit: {pages} pages were loaded {loads} times within {limit_bytes} bytes; the picture is the same with more, and sooner done (all take {bytes_of_all})"
            )
        })
    }
}

/// A rendered picture, its figures, and what was needed for it.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The picture, with provenance.
    pub picture: Picture,
    /// Its cost and error.
    pub figures: RenderFigures,
    /// What the scene needs and what was left out, one line each.
    pub explanation: Vec<String>,
}

impl Rendered {
    /// A picture that was read from a file, with the figures that it carries; seconds that no file carries are NaN.
    pub fn of_file(picture: Picture) -> Self {
        let made = picture.provenance.as_ref();
        let samples = picture.samples.as_ref().filter(|of| !of.is_empty());
        let mean = samples.map(|of| of.iter().copied().map(f64::from).sum::<f64>() / of.len() as f64);
        let figures = RenderFigures {
            backend: made.map(|m| m.backend.clone()).unwrap_or_default(),
            device: String::new(),
            notices: Vec::new(),
            seconds: f64::NAN,
            cpu_seconds: f64::NAN,
            opening_seconds: None,
            volume_bytes: BTreeMap::new(),
            pages: None,
            prepare_seconds: [f64::NAN; 2],
            peak_rss_bytes: None,
            acceleration_bytes: 0,
            bytes: BTreeMap::new(),
            spp: made.map_or(0, |m| m.spp),
            mean_spp: mean.unwrap_or(f64::NAN),
            error_estimate: made.and_then(|m| m.error_estimate),
            denoised: made.and_then(|m| m.denoised),
            denoise_seconds: None,
            curve: Vec::new(),
            savings: None,
        };
        Self { picture, figures, explanation: Vec::new() }
    }

    /// A picture that is being rendered, as far as `point` tells. It has no provenance, and no figures of what was built.
    pub(crate) fn so_far(picture: Picture, backend: &str, point: &CurvePoint) -> Self {
        let rest = Self::of_file(picture);
        let figures = RenderFigures {
            backend: backend.into(),
            seconds: point.seconds,
            cpu_seconds: point.cpu_seconds,
            spp: point.spp,
            mean_spp: point.mean_spp,
            error_estimate: point.error_estimate,
            curve: vec![*point],
            ..rest.figures
        };
        Self { figures, ..rest }
    }
}

/// Renders a scene whose volumes and meshes are open.
///
/// # Errors
/// Any error of the renderer.
pub fn render_scene(
    loaded: &LoadedScene,
    backend: &str,
    stop: &Stop,
    job: &Job,
    watch: &mut dyn FnMut(&CurvePoint),
) -> Result<Rendered> {
    render_and_denoise(loaded, backend, stop, None, job, watch)
}

/// As [`render_scene`]; then the picture goes through the filter `denoise`, if any: through Pumice's own on the device that drew it if that can.
///
/// # Errors
/// Any error of the renderer, and those of [`Rendered::denoise`].
pub fn render_and_denoise(
    loaded: &LoadedScene,
    backend: &str,
    stop: &Stop,
    denoise: Option<Filter>,
    job: &Job,
    watch: &mut dyn FnMut(&CurvePoint),
) -> Result<Rendered> {
    let (clock, pages_before) = (Stopwatch::start(), PageFigures::of(loaded.volumes()));
    let mut renderer = make_renderer(backend)?;
    check_memory(&renderer, loaded)?;
    renderer.set_scene(loaded)?;
    let sky_hash = sky_hash_text(loaded.scene())?;
    let prepare_seconds = [clock.seconds(), clock.cpu_seconds()];
    let (curve, picture) = sampled(&mut renderer, stop, job, &mut |_, point| {
        watch(point);
        Ok(())
    })?;
    let mut rendered = report(&mut renderer, loaded, pages_before, prepare_seconds, curve, picture, sky_hash);
    if let Some(filter) = denoise {
        rendered.denoise_with(&mut renderer, filter)?;
    }
    Ok(rendered)
}

/// Checks that there is memory for a scene's film and picture, before anything is built for them. A film that the renderer has already may
/// be used again, and does not count.
///
/// # Errors
/// [`RenderError::Memory`].
pub(crate) fn check_memory(renderer: &dyn Renderer, loaded: &LoadedScene) -> Result<()> {
    let scene = loaded.scene();
    film_memory::check(&scene.film, sums_of(scene), scene.settings.adaptive, bytes_of_film(renderer))
        .map_err(|e| RenderError::from(e).into())
}

/// Bytes of the film that a renderer has.
pub(crate) fn bytes_of_film(renderer: &dyn Renderer) -> u64 {
    renderer.bytes().iter().find(|(part, _)| *part == "film").map_or(0, |(_, bytes)| *bytes)
}

/// Renders the scene that a renderer shows until `stop` is met.
///
/// # Errors
/// Any error of the renderer, or of `watch`.
pub(crate) fn sampled(
    renderer: &mut FallbackRenderer,
    stop: &Stop,
    job: &Job,
    watch: &mut Watch<'_>,
) -> Result<(Vec<CurvePoint>, Picture)> {
    loop {
        renderer.prepare_picture()?;
        let curve = render_watched(renderer, stop, job, watch)?;
        match renderer.picture() {
            // The device failed when the finished picture was read: another one draws it again.
            Err(RenderError::Restarted) => {}
            picture => return Ok((curve, picture?)),
        }
    }
}

/// A picture with its provenance, and what it took. `sky_hash` is that of [`sky_hash_text`] when the scene was set, and `pages_before` tells
/// of loads before the picture.
pub(crate) fn report(
    renderer: &mut FallbackRenderer,
    loaded: &LoadedScene,
    pages_before: Option<PageFigures>,
    prepare_seconds: [f64; 2],
    curve: Vec<CurvePoint>,
    mut picture: Picture,
    sky_hash: Option<String>,
) -> Rendered {
    let pages = PageFigures::of(loaded.volumes()).map(|pages| pages.since(pages_before));
    let mut notices = renderer.notices();
    notices.extend(pages.and_then(|pages| pages.notice()));
    let bytes: BTreeMap<_, _> = renderer.bytes().into_iter().collect();
    let acceleration_bytes = bytes.get("acceleration").copied().unwrap_or_default();
    let last = curve.last().copied().unwrap_or(CurvePoint {
        seconds: 0.0,
        cpu_seconds: 0.0,
        spp: 0,
        mean_spp: 0.0,
        error_estimate: None,
    });
    let (scene, volumes, meshes) = (loaded.scene(), loaded.volumes(), loaded.meshes());
    let explanation = loaded.needs().explain();
    let backend = renderer.name().to_string();
    picture.provenance = Some(Provenance {
        version: env!("CARGO_PKG_VERSION").into(),
        backend: backend.clone(),
        scene: scene.clone(),
        volume_hashes: volumes.iter().map(|v| hash_text(v)).collect(),
        label_hashes: scene
            .instances
            .iter()
            .zip(volumes)
            .map(|(instance, volume)| labels_hash_text(&instance.style.show, volume))
            .collect(),
        mesh_hashes: meshes.iter().map(|m| mesh_hash_text(m)).collect(),
        sky_hash,
        spp: last.spp,
        error_estimate: last.error_estimate,
        denoised: None,
        annotations: Annotations::default(),
    });
    Rendered {
        picture,
        figures: RenderFigures {
            backend,
            device: renderer.device().to_owned(),
            notices,
            seconds: last.seconds,
            cpu_seconds: last.cpu_seconds,
            opening_seconds: None,
            volume_bytes: volume_bytes(volumes),
            pages,
            prepare_seconds,
            peak_rss_bytes: peak_rss_bytes(),
            acceleration_bytes,
            bytes,
            spp: last.spp,
            mean_spp: last.mean_spp,
            error_estimate: last.error_estimate,
            denoised: None,
            denoise_seconds: None,
            curve,
            savings: None,
        },
        explanation,
    }
}

/// Bytes in memory by part, each volume once.
fn volume_bytes(volumes: &[Arc<CompressedVolume>]) -> BTreeMap<&'static str, u64> {
    let mut bytes = BTreeMap::new();
    for (i, volume) in volumes.iter().enumerate() {
        if volumes[..i].iter().any(|v| Arc::ptr_eq(v, volume)) {
            continue;
        }
        for (part, more) in volume.resident_parts() {
            *bytes.entry(part).or_default() += more;
        }
    }
    bytes
}
