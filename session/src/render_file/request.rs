//! The request that `render_file` carries out.

use std::path::PathBuf;

use pumice_formats::{OpenOptions, TimeSteps};
use pumice_picture::{Annotations, PicturePaths};
use pumice_scene::{Lod, Mode, ViewTransform};

use crate::denoise::DenoiserName;
use crate::figure::FigureFlags;
use crate::progressive::Stop;

/// The subject of a render.
#[derive(Clone, Debug)]
pub enum Subject {
    /// A `.pumice` file, any label volume, a scene (`.json`), or a state of Neuroglancer (`.json`, or a link in place of a path).
    File(PathBuf),
    /// An earlier picture, rendered again from the scene that it carries, with as many samples; of the limits only the seconds count.
    Again(PathBuf),
}

/// Values that override those of the scene or, for a volume, the defaults.
#[derive(Clone, Debug, Default)]
pub struct RenderOverrides {
    /// Pixels across and down.
    pub size: Option<[u32; 2]>,
    /// Pixels across alone; the picture keeps its shape.
    pub width: Option<u32>,
    /// Bounces of light.
    pub bounces: Option<u32>,
    /// Which light the picture shows.
    pub mode: Option<Mode>,
    /// Level of detail.
    pub lod: Option<Lod>,
    /// Seed of every random number.
    pub seed: Option<u64>,
    /// Time step of all volumes that have several: the file's or those of the scene. It takes precedence over what the scene says.
    pub time_step: Option<u32>,
    /// Labels to show, by id: of a `.pumice` file, others are not read.
    pub labels: Option<Vec<u64>>,
    /// Whether the background is transparent.
    pub transparent: bool,
    /// Whether colours are written as half floats.
    pub half: bool,
    /// View transform of a PNG.
    pub view_transform: Option<ViewTransform>,
    /// Pixels rest once their estimated relative error is below this.
    pub noise_threshold: Option<f32>,
    /// Samples that every pixel gets before it may rest.
    pub min_spp: Option<u32>,
    /// Copies of the layers of a state of Neuroglancer, by name, to be read in place of what the state says.
    pub layer_files: Vec<(String, PathBuf)>,
    /// Flags of a figure. What only volumes take is refused for a scene.
    pub figure: FigureFlags,
}

/// A request to render a file.
#[derive(Clone, Debug)]
pub struct RenderRequest {
    /// What to render.
    pub subject: Subject,
    /// Time steps to render, each into a picture of its own ([`super::render_time_steps`]).
    pub time_steps: Option<TimeSteps>,
    /// Where the picture goes: `.exr` or `.png`.
    pub out: PathBuf,
    /// Backend by name.
    pub backend: String,
    /// Limits at which rendering stops.
    pub stop: Stop,
    /// The denoiser that the picture goes through; an earlier picture goes through its own.
    pub denoise: Option<DenoiserName>,
    /// Names of passes, or `all` or `none`.
    pub passes: Vec<String>,
    /// Values that override the scene's.
    pub overrides: RenderOverrides,
    /// What is drawn over the picture; an earlier picture has its own.
    pub annotations: Annotations,
    /// How to read volumes; takes precedence over what the scene says of it.
    pub reading: OpenOptions,
    /// Files to render an earlier picture from, in place of those that it names, in the order of [`pumice_scene::Scene::paths`]; none for
    /// those that it names.
    pub sources: Vec<PathBuf>,
    /// What the picture tells of where its files are.
    pub paths: PicturePaths,
    /// Threads; `None` takes all cores.
    pub threads: Option<usize>,
    /// Bytes that the volumes may hold while they are drawn, from disk then; without a limit they are in memory.
    pub memory_limit_bytes: Option<u64>,
    /// Where to write the scene, if anywhere.
    pub save_scene: Option<PathBuf>,
    /// Whether to measure what leaving out unneeded parts saves.
    pub explain: bool,
}
