//! One interface for every renderer: the caller never knows which backend draws.

use std::time::Duration;

use crate::LoadedScene;
use pumice_core::Job;
use pumice_picture::{Image, Picture};

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
    /// The device that renders failed in a way that the renderer could not overcome: its memory is full, or it was lost. Another
    /// backend may still draw the scene.
    #[error("{0}")]
    Device(String),
    /// The picture was begun anew by other means and has no samples yet: there is nothing to hand over, but going on will do.
    #[error("the picture was begun anew")]
    Restarted,
    /// The job was cancelled.
    #[error("cancelled")]
    Cancelled,
}

/// How far a picture has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Samples in every pixel so far; of those that do not rest, where pixels may ([`pumice_scene::Adaptive`]).
    pub spp: u32,
    /// Mean over pixels of the samples that each has: `spp`, or less where pixels rest.
    pub mean_spp: f64,
    /// Estimated relative error of the picture as it stands ([`pumice_picture::FilmBuffer::error_estimate`]), infinite until it can be known.
    pub error_estimate: f64,
    /// Every pixel rests: further samples change nothing.
    pub all_rest: bool,
}

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Position of the instance in the scene's list.
    pub instance: u32,
    /// Dense label index.
    pub label: u32,
    /// Lowest voxel of the element that was hit.
    pub voxel: [u32; 3],
    /// Distance along the view axis in world units.
    pub depth: f64,
}

/// How often a renderer has made each kind of its data: what proves that a camera move costs a camera and a colour edit colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rebuilt {
    /// Camera rays.
    pub camera: u64,
    /// Film: its memory and filter table.
    pub film: u64,
    /// Sky, suns and lamps, and the choice among them; and once more what of the scene shines, for aiming at it.
    pub lights: u64,
    /// Tables of materials. Instances that look alike share them.
    pub materials: u64,
    /// Acceleration structures: of the boxes of a volume that are drawn, of the triangles of a mesh. Instances share them.
    pub acceleration: u64,
    /// Hierarchies over all instances and meshes, where a scene has one.
    pub top_level: u64,
}

/// A renderer of scenes.
pub trait Renderer: Send {
    /// Name as in `--backend`.
    fn name(&self) -> &'static str;

    /// Makes the renderer show `scene`, for which it builds what the scene needs ([`LoadedScene::needs`]). It compares with the scene shown before ([`crate::ScenePlan`]) and makes anew only what
    /// differs; the picture restarts.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the field at fault; the renderer keeps its former scene.
    fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError>;

    /// Adds samples to every pixel that does not rest for about `slice`, at least one sample, but never more than `spp_limit` in all.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`] soon after `job` is cancelled.
    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError>;

    /// The colours so far: the mean of all samples.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set; [`RenderError::Device`] here and below.
    fn color(&mut self) -> Result<Image, RenderError>;

    /// Part of the samples so far that met a surface, where the film is transparent.
    ///
    /// # Errors
    /// As [`Renderer::color`].
    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError>;

    /// Variance of those colours, once it is known: from four samples on.
    ///
    /// # Errors
    /// As [`Renderer::color`].
    fn variance(&mut self) -> Result<Option<Image>, RenderError>;

    /// The picture so far, with its passes; provenance is the caller's to add.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set.
    fn picture(&mut self) -> Result<Picture, RenderError>;

    /// What is under the middle of a pixel, counted from the upper left; nothing there, a mesh (which has no label), or outside of the
    /// film: `None`.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set.
    fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError>;

    /// How often each kind of data was made since the renderer was.
    fn rebuilt(&self) -> Rebuilt;

    /// Bytes by part, the volumes as they lie in the caller's memory not counted; `acceleration` is among them once a scene was
    /// set. A renderer with memory of its own counts that memory.
    fn bytes(&self) -> Vec<(&'static str, u64)>;

    /// What whoever looks at the picture should be told since the last call, a line each: failures that were overcome, at a price.
    fn notices(&mut self) -> Vec<String> {
        Vec::new()
    }
}
