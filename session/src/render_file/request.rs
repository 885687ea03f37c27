//! What `render_file` is asked for.

use std::path::PathBuf;

use pumice_formats::OpenOptions;
use pumice_scene::{Lod, Mode, ViewTransform};

use crate::progressive::Stop;

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
