//! From a volume, a scene or a former picture to a new picture.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_formats::OpenOptions;
use pumice_picture::{
    Passes, Picture, Provenance, read_provenance, write_exr, write_exr_half, write_png_shown,
};
use pumice_scene::{Adaptive, Lod, Mode, Scene, Show, ViewTransform};
use pumice_transport::{LoadedScene, RenderError, Renderer};
use serde::Serialize;

use crate::backend::make_renderer;
use crate::error::{Result, SessionError};
use crate::figure::{FigureOptions, compose};
use crate::measure::{Stopwatch, peak_rss_bytes};
use crate::open::{Residence, open_chosen, open_meshes, open_shown};
use crate::progressive::{CurvePoint, Stop, render_until};
use crate::savings::{OpeningSaved, Savings, SavingsOptions, measure_opening, measure_savings};
use crate::selection::select_labels;

/// Samples that every pixel gets before it may rest, where nobody says.
const DEFAULT_MIN_SPP: u32 = 16;

/// What is to be rendered.
#[derive(Clone, Debug)]
pub enum Subject {
    /// A `.pumice` file, any label volume, or a scene (`.json`).
    File(PathBuf),
    /// What a picture says it was made from; its samples are rendered again, whatever the stopping rule.
    Again(PathBuf),
}

/// Wishes that override the scene's own; for a volume, the defaults.
#[derive(Clone, Debug, Default)]
pub struct RenderOverrides {
    /// Pixels across and down.
    pub size: Option<[u32; 2]>,
    /// Bounces of light.
    pub bounces: Option<u32>,
    /// Which light is counted.
    pub mode: Option<Mode>,
    /// Level of detail.
    pub lod: Option<Lod>,
    /// Seed of every random number.
    pub seed: Option<u64>,
    /// Labels to show, by id.
    pub labels: Option<Vec<u64>>,
    /// Number of labels to choose for a figure.
    pub pick: Option<usize>,
    /// What camera rays do not meet is transparent.
    pub transparent: bool,
    /// Colours are written in half floats.
    pub half: bool,
    /// How a PNG shows them.
    pub view_transform: Option<ViewTransform>,
    /// Pixels rest once their estimated relative error is below this.
    pub noise_threshold: Option<f32>,
    /// Samples that every pixel gets before it may rest.
    pub min_spp: Option<u32>,
    /// Degrees around and above, for volumes only.
    pub view_deg: Option<[f64; 2]>,
}

/// A whole request.
#[derive(Clone, Debug)]
pub struct RenderRequest {
    /// What.
    pub subject: Subject,
    /// Where the picture goes: `.exr` or `.png`.
    pub out: PathBuf,
    /// Backend by name.
    pub backend: String,
    /// When it is done.
    pub stop: Stop,
    /// Passes by name.
    pub passes: Vec<String>,
    /// Wishes.
    pub overrides: RenderOverrides,
    /// How to read a volume.
    pub reading: OpenOptions,
    /// Threads; `None` takes all cores.
    pub threads: Option<usize>,
    /// Where to write the scene, if anywhere.
    pub save_scene: Option<PathBuf>,
    /// Measure what it saves to leave out what the scene does not need.
    pub explain: bool,
}

/// What a picture cost and how good it is: the JSON report.
#[derive(Clone, Debug, Serialize)]
pub struct RenderFigures {
    /// Backend that drew it.
    pub backend: String,
    /// What it drew on.
    pub device: String,
    /// What went wrong with a device and was overcome, a line each.
    pub notices: Vec<String>,
    /// Wall seconds of rendering.
    pub seconds: f64,
    /// CPU seconds of rendering.
    pub cpu_seconds: f64,
    /// Wall and CPU seconds of opening the volumes and meshes, where that was part of the work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opening_seconds: Option<[f64; 2]>,
    /// Bytes of the volumes in memory by part: of the labels that were read, and each volume once.
    pub volume_bytes: BTreeMap<&'static str, u64>,
    /// Wall and CPU seconds of building the acceleration structures and tables.
    pub prepare_seconds: [f64; 2],
    /// Largest memory of the process so far; absent where the system does not tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_rss_bytes: Option<u64>,
    /// Bytes of the acceleration structures.
    pub acceleration_bytes: u64,
    /// Bytes of the renderer by part, `acceleration` among them: on a graphics processor all that lies on it, the volume's parts
    /// too; on the CPU what it holds beside the volume.
    pub bytes: BTreeMap<&'static str, u64>,
    /// Samples a pixel; of those that did not rest.
    pub spp: u32,
    /// Mean over pixels of the samples that each has.
    pub mean_spp: f64,
    /// Estimated relative error, where known.
    pub error_estimate: Option<f64>,
    /// Error against run time.
    pub curve: Vec<CurvePoint>,
    /// What leaving out saves, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub savings: Option<Savings>,
}

/// A rendered picture, its figures, and what was needed for it.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// With provenance.
    pub picture: Picture,
    /// Figures.
    pub figures: RenderFigures,
    /// What the scene needs and what was left out, a line each.
    pub explanation: Vec<String>,
}

/// Does what `request` says; `watch` hears of every slice together with the stopping rule in force.
///
/// # Errors
/// One line of what is wrong with the input, the scene or the output; nothing is written then.
pub fn render_file(
    request: &RenderRequest,
    job: &Job,
    watch: &mut (dyn FnMut(&Stop, &CurvePoint) + Send),
) -> Result<Rendered> {
    // A wrong ending, pass or backend is known before the work, not after it.
    let format = PictureFormat::of(&request.out)?;
    let passes = Passes::parse(&request.passes).map_err(|e| SessionError::Caller(format!("--{e}")))?;
    if request.overrides.half && format == PictureFormat::Png {
        let out = request.out.display();
        return Err(SessionError::Caller(format!(
            "--half: {out} has 8 bits a channel; half floats go into an .exr"
        )));
    }
    check_folder(&request.out)?;
    make_renderer(&request.backend)?;

    let clock = Stopwatch::start();
    let Prepared { mut scene, volumes, meshes, stop, backend } = prepare(request, job)?;
    let opening_seconds = [clock.seconds(), clock.cpu_seconds()];
    // Passes that are named are made; `all` means those that the scene asks for, and what every picture has.
    if request.passes != ["all"] {
        scene.film.passes = scene.film.passes.or(passes);
    }
    if let Some(path) = &request.save_scene {
        scene.save(path).map_err(|source| SessionError::Scene { path: path.clone(), source })?;
    }
    let scene = LoadedScene::new(scene, volumes, meshes)?;
    let mut render = || -> Result<Rendered> {
        let mut rendered = render_scene(&scene, &backend, &stop, job, &mut |point| watch(&stop, point))?;
        rendered.figures.opening_seconds = Some(opening_seconds);
        if request.explain {
            // By what drew: `auto` may have gone on with another way.
            let drew = if backend == "auto" { rendered.figures.backend.clone() } else { backend.clone() };
            let (opening, whole) = measure_openings(&scene, &request.reading, job)?;
            let measured = measure_savings(&whole, &drew, &SavingsOptions::QUICK, job, &mut |_| {})?;
            rendered.figures.savings = Some(Savings { opening, ..measured });
        }
        Ok(rendered)
    };
    let rendered = match request.threads {
        None => render()?,
        Some(threads) => in_pool(threads, render)?,
    };
    format.write(&request.out, &rendered.picture, &passes)?;
    Ok(rendered)
}

/// What it saved to read only the labels that are shown; the same scene of volumes with all labels.
fn measure_openings(
    loaded: &LoadedScene,
    reading: &OpenOptions,
    job: &Job,
) -> Result<(Vec<OpeningSaved>, LoadedScene)> {
    let (scene, volumes) = (loaded.scene(), loaded.volumes());
    let mut saved = Vec::new();
    let mut whole: BTreeMap<&Path, Arc<CompressedVolume>> = BTreeMap::new();
    for (instance, volume) in scene.instances.iter().zip(volumes) {
        let path = instance.source.as_path();
        if volume.is_whole() || whole.contains_key(path) {
            continue;
        }
        let of_file = scene.instances.iter().filter(|i| i.source == path);
        let shows: Vec<&Show> = of_file.map(|i| &i.style.show).collect();
        let (one, volume) = measure_opening(path, &shows, reading, SavingsOptions::QUICK.rounds, job)?;
        saved.push(one);
        whole.insert(path, volume);
    }
    let volumes = scene
        .instances
        .iter()
        .zip(volumes)
        .map(|(instance, volume)| Arc::clone(whole.get(instance.source.as_path()).unwrap_or(volume)));
    let all_labels = LoadedScene::new(scene.clone(), volumes.collect(), loaded.meshes().to_vec())?;
    Ok((saved, all_labels))
}

struct Prepared {
    scene: Scene,
    volumes: Vec<Arc<CompressedVolume>>,
    meshes: Vec<Arc<MeshData>>,
    stop: Stop,
    backend: String,
}

/// Reads the subject and makes a scene with its volumes of it.
fn prepare(request: &RenderRequest, job: &Job) -> Result<Prepared> {
    let instead = request.overrides.labels.clone().map(Show::Only);
    let open_all =
        |scene: &Scene| open_shown(scene, instead.as_ref(), &request.reading, Residence::Mapped, job);
    let (mut scene, volumes, meshes, stop, backend) = match &request.subject {
        Subject::Again(picture) => {
            let made = read_provenance(picture)?.ok_or_else(|| {
                let picture = picture.display();
                SessionError::Caller(format!("{picture}: this picture does not say how it was made"))
            })?;
            let volumes = open_all(&made.scene)?;
            let meshes = open_meshes(&made.scene)?;
            check_hashes(picture, &made, &volumes, &meshes)?;
            let backend = match request.backend.as_str() {
                "auto" => {
                    make_renderer(&made.backend).map_err(|e| {
                        let picture = picture.display();
                        SessionError::Caller(format!(
                            "{picture}: it was drawn by a backend that is not here: {e}; name another one for a picture like it"
                        ))
                    })?;
                    made.backend
                }
                named => named.to_owned(),
            };
            (made.scene, volumes, meshes, Stop { spp: Some(made.spp), ..Stop::default() }, backend)
        }
        Subject::File(path) if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) => {
            let scene =
                Scene::load(path).map_err(|source| SessionError::Scene { path: path.clone(), source })?;
            let (volumes, meshes) = (open_all(&scene)?, open_meshes(&scene)?);
            (scene, volumes, meshes, request.stop, request.backend.clone())
        }
        Subject::File(path) => {
            // Labels that are chosen by their shape are chosen among all.
            let shows = instead.as_ref().unwrap_or(&Show::All);
            let volume = open_chosen(path, &[shows], &request.reading, Residence::Mapped, job)?;
            let options = FigureOptions {
                size: request.overrides.size.unwrap_or([960, 540]),
                labels: request.overrides.pick.map(|n| select_labels(&volume, n)),
                view_deg: request.overrides.view_deg.unwrap_or(FigureOptions::DEFAULT_VIEW_DEG),
            };
            let options = match &request.overrides.labels {
                None => options,
                Some(ids) => FigureOptions { labels: Some(dense_labels(&volume, ids)?), ..options },
            };
            let absolute = path.canonicalize().map_err(crate::error::io(path))?;
            let scene = compose(&volume, absolute, &options);
            (scene, vec![volume], Vec::new(), request.stop, request.backend.clone())
        }
    };
    apply(&request.overrides, &mut scene, &volumes)?;
    let path = match &request.subject {
        Subject::File(path) | Subject::Again(path) => path.clone(),
    };
    scene.validate().map_err(|source| SessionError::Scene { path, source })?;
    Ok(Prepared { scene, volumes, meshes, stop, backend })
}

/// A picture is made again only from the very volumes and meshes that it was made from.
fn check_hashes(
    picture: &Path,
    made: &Provenance,
    volumes: &[Arc<CompressedVolume>],
    meshes: &[Arc<MeshData>],
) -> Result<()> {
    let check = |what: &str, source: &Path, expected: &str, got: String| {
        if got == expected {
            return Ok(());
        }
        let (picture, source) = (picture.display(), source.display());
        Err(SessionError::Caller(format!(
            "{picture}: made from a {what} with the hash {expected}, but {source} now has {got}"
        )))
    };
    for ((instance, expected), volume) in made.scene.instances.iter().zip(&made.volume_hashes).zip(volumes) {
        check("volume", &instance.source, expected, hash_text(volume))?;
    }
    for ((mesh, expected), data) in made.scene.meshes.iter().zip(&made.mesh_hashes).zip(meshes) {
        check("mesh", &mesh.source, expected, mesh_hash_text(data))?;
    }
    Ok(())
}

fn dense_labels(volume: &CompressedVolume, ids: &[u64]) -> Result<Vec<u32>> {
    let dense = |&id: &u64| {
        let index = volume.labels().index_of(id);
        index.ok_or_else(|| SessionError::Caller(format!("--labels: the volume has no label {id}")))
    };
    ids.iter().map(dense).collect()
}

fn apply(wishes: &RenderOverrides, scene: &mut Scene, volumes: &[Arc<CompressedVolume>]) -> Result<()> {
    if let Some([width, height]) = wishes.size {
        (scene.film.width, scene.film.height) = (width, height);
    }
    if let Some(bounces) = wishes.bounces {
        scene.settings.bounces = bounces;
    }
    if let Some(mode) = wishes.mode {
        scene.settings.mode = mode;
    }
    if let Some(lod) = wishes.lod {
        scene.settings.lod = lod;
    }
    if let Some(seed) = wishes.seed {
        scene.settings.seed = seed;
    }
    scene.film.transparent |= wishes.transparent;
    scene.film.half |= wishes.half;
    if let Some(view) = wishes.view_transform {
        scene.film.view_transform = view;
    }
    match (&mut scene.settings.adaptive, wishes.noise_threshold) {
        (Some(rule), Some(threshold)) => rule.threshold = threshold,
        (none, Some(threshold)) => *none = Some(Adaptive { threshold, min_spp: DEFAULT_MIN_SPP }),
        (_, None) => {}
    }
    match (&mut scene.settings.adaptive, wishes.min_spp) {
        (Some(rule), Some(min_spp)) => rule.min_spp = min_spp,
        (None, Some(_)) => {
            let what =
                "--min-spp: no pixel rests without --noise-threshold, or a scene with settings.adaptive";
            return Err(SessionError::Caller(what.into()));
        }
        (_, None) => {}
    }
    if let Some(ids) = &wishes.labels {
        // With several volumes, each shows those of the labels that it has.
        for (instance, volume) in scene.instances.iter_mut().zip(volumes) {
            let held = ids.iter().copied().filter(|&id| volume.labels().index_of(id).is_some());
            instance.style.show = Show::Only(held.collect());
        }
        for &id in ids {
            if !volumes.iter().any(|v| v.labels().index_of(id).is_some()) {
                return Err(SessionError::Caller(format!("--labels: no volume has a label {id}")));
            }
        }
    }
    Ok(())
}

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| SessionError::Caller(format!("--threads {threads}: {e}")))?
        .install(work)
}

/// Renders a scene whose volumes and meshes are open.
///
/// # Errors
/// What the renderer reports.
pub fn render_scene(
    loaded: &LoadedScene,
    backend: &str,
    stop: &Stop,
    job: &Job,
    watch: &mut dyn FnMut(&CurvePoint),
) -> Result<Rendered> {
    let clock = Stopwatch::start();
    let mut renderer = make_renderer(backend)?;
    renderer.set_scene(loaded)?;
    let prepare_seconds = [clock.seconds(), clock.cpu_seconds()];
    let (curve, mut picture) = loop {
        let curve = render_until(&mut renderer, stop, job, watch)?;
        match renderer.picture() {
            // The device failed at the last moment: another one draws it again.
            Err(RenderError::Restarted) => {}
            picture => break (curve, picture?),
        }
    };
    let notices = renderer.notices();
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
        mesh_hashes: meshes.iter().map(|m| mesh_hash_text(m)).collect(),
        spp: last.spp,
        error_estimate: last.error_estimate,
    });
    Ok(Rendered {
        picture,
        figures: RenderFigures {
            backend,
            device: renderer.device().to_owned(),
            notices,
            seconds: last.seconds,
            cpu_seconds: last.cpu_seconds,
            opening_seconds: None,
            volume_bytes: volume_bytes(volumes),
            prepare_seconds,
            peak_rss_bytes: peak_rss_bytes(),
            acceleration_bytes,
            bytes,
            spp: last.spp,
            mean_spp: last.mean_spp,
            error_estimate: last.error_estimate,
            curve,
            savings: None,
        },
        explanation,
    })
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

/// Content hash of a volume as pictures carry it.
pub fn hash_text(volume: &CompressedVolume) -> String {
    format!("{:032x}", volume.content_hash())
}

/// The content hash of a mesh as 32 hexadecimal digits.
fn mesh_hash_text(mesh: &MeshData) -> String {
    format!("{:032x}", mesh.content_hash())
}

/// Picture formats that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Scene-linear, with passes.
    Exr,
    /// 8 bit sRGB.
    Png,
}

impl PictureFormat {
    /// By the path's ending.
    ///
    /// # Errors
    /// When it is neither `.exr` nor `.png`.
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(SessionError::Caller(format!(
                "{}: expected a name that ends in .exr or .png",
                path.display()
            ))),
        }
    }

    /// Writes a picture as its scene's film says: colours in half floats, by which view transform.
    ///
    /// # Errors
    /// When the file cannot be written; nothing new is under its name then.
    pub fn write(self, path: &Path, picture: &Picture, passes: &Passes) -> Result<()> {
        let film = picture.provenance.as_ref().map(|p| p.scene.film);
        match self {
            Self::Exr if film.is_some_and(|f| f.half) => write_exr_half(path, picture, passes)?,
            Self::Exr => write_exr(path, picture, passes)?,
            Self::Png => write_png_shown(path, picture, film.map(|f| f.view_transform).unwrap_or_default())?,
        }
        Ok(())
    }
}

/// Whether the folder that a file is to be written to is there.
fn check_folder(out: &Path) -> Result<()> {
    match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => Err(SessionError::Caller(
            format!("{}: the folder {} does not exist", out.display(), folder.display()),
        )),
        _ => Ok(()),
    }
}
