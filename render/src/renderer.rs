//! One interface for every renderer: the caller never knows which backend draws.

use std::sync::Arc;
use std::time::Duration;

use pumice_core::{CompressedVolume, Job};
use pumice_scene::Scene;

use crate::Picture;

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

    /// The picture so far, with its first-surface passes; provenance is the caller's to add.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set.
    fn picture(&self) -> Result<Picture, RenderError>;

    /// Heap bytes by part, the volumes not counted; `acceleration` is among them once a scene was set.
    fn bytes(&self) -> Vec<(&'static str, u64)>;
}
