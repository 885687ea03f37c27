//! The request that `render_file` carries out.

use std::path::PathBuf;

use pumice_formats::OpenOptions;
use pumice_scene::{Lod, Mode, ViewTransform};

use crate::figure::FigureFlags;
use crate::progressive::Stop;

/// The subject of a render.
#[derive(Clone, Debug)]
pub enum Subject {
    /// A `.pumice` file, any label volume, or a scene (`.json`).
    File(PathBuf),
    /// An earlier picture, rendered again from the scene that it carries, with as many samples, whatever the limits.
    Again(PathBuf),
}

/// Values that override those of the scene or, for a volume, the defaults.
#[derive(Clone, Debug, Default)]
pub struct RenderOverrides {
    /// Pixels across and down.
    pub size: Option<[u32; 2]>,
    /// Bounces of light.
    pub bounces: Option<u32>,
    /// Which light the picture shows.
    pub mode: Option<Mode>,
    /// Level of detail.
    pub lod: Option<Lod>,
    /// Seed of every random number.
    pub seed: Option<u64>,
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
    /// Flags of a figure. What only volumes take is refused for a scene.
    pub figure: FigureFlags,
}

/// A request to render a file.
#[derive(Clone, Debug)]
pub struct RenderRequest {
    /// What to render.
    pub subject: Subject,
    /// Where the picture goes: `.exr` or `.png`.
    pub out: PathBuf,
    /// Backend by name.
    pub backend: String,
    /// Limits at which rendering stops.
    pub stop: Stop,
    /// Names of passes, or `all` or `none`.
    pub passes: Vec<String>,
    /// Values that override the scene's.
    pub overrides: RenderOverrides,
    /// How to read a volume.
    pub reading: OpenOptions,
    /// Threads; `None` takes all cores.
    pub threads: Option<usize>,
    /// Where to write the scene, if anywhere.
    pub save_scene: Option<PathBuf>,
    /// Whether to measure what leaving out unneeded parts saves.
    pub explain: bool,
}
