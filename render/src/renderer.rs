//! One interface for every renderer: the caller never knows which backend draws.

use std::sync::Arc;
use std::time::Duration;

use pumice_core::{CompressedVolume, Job};
use pumice_scene::Scene;

use crate::picture::Picture;

/// Why a renderer could not go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The scene asks for something impossible; the text names the field.
    #[error("{0}")]
    Scene(String),
    /// A file that the scene names could not be read.
    #[error("{0}")]
    Source(String),
    /// The job was cancelled.
    #[error("cancelled")]
    Cancelled,
}

/// How far a picture has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Samples in every pixel so far.
    pub spp: u32,
    /// Estimated relative error of the picture as it stands (`pumice_render::error_estimate`), infinite until it can be known.
    pub error_estimate: f64,
}

/// A renderer of scenes.
pub trait Renderer: Send {
    /// Name as in `--backend`.
    fn name(&self) -> &'static str;

    /// Makes the renderer show `scene`; `volumes[i]` belongs to `scene.instances[i]`. Only what differs from the scene shown
    /// before is rebuilt; the picture restarts.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the field at fault; the renderer keeps its former scene.
    fn set_scene(&mut self, scene: &Scene, volumes: &[Arc<CompressedVolume>]) -> Result<(), RenderError>;

    /// Adds samples to every pixel for about `slice`, at least one sample, but never more than `spp_limit` in all.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`] soon after `job` is cancelled.
    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError>;

    /// The picture as it stands, all passes, without provenance; `None` before the first scene.
    fn picture(&self) -> Option<Picture>;

    /// What was built for the scene.
    fn report(&self) -> RenderReport;
}

/// What a renderer built for its scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RenderReport {
    /// Heap bytes of the acceleration structures.
    pub acceleration_bytes: u64,
    /// Whether the last scene needed new acceleration structures; a camera, a light or a colour does not.
    pub geometry_built: bool,
    /// What the scene needs and what was left out, a line each.
    pub explanation: Vec<String>,
}
