//! The interface of every renderer; callers do not depend on the backend.

use std::time::Duration;

use crate::LoadedScene;
use pumice_core::{Job, NoMemory};
use pumice_picture::{Guides, Image, Picture};

/// Why a renderer could not continue.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The scene asks for something impossible; the text names the field.
    #[error("{0}")]
    Scene(String),
    /// A file that the scene names could not be read.
    #[error("{0}")]
    Source(String),
    /// The device failed and the renderer could not recover: its memory is full, or the device was lost. Another backend may still draw the
    /// scene.
    #[error("{0}")]
    Device(String),
    /// The memory of this machine is too small for the scene or the picture. No other backend needs less of it.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The picture was restarted by other means and has no samples yet: there is nothing to return, but rendering can continue.
    #[error("the picture was restarted and has no samples yet")]
    Restarted,
    /// The job was cancelled.
    #[error("cancelled")]
    Cancelled,
}

/// The progress of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Samples in every pixel so far; where pixels may rest ([`pumice_scene::Adaptive`]), the samples of those that do not.
    pub spp: u32,
    /// Mean number of samples over all pixels: `spp`, or less where pixels rest.
    pub mean_spp: f64,
    /// Estimated relative error of the picture so far ([`pumice_picture::FilmBuffer::error_estimate`]); infinite until it can be estimated.
    pub error_estimate: f64,
    /// Whether every pixel rests, so that further samples change nothing.
    pub all_rest: bool,
}

/// The voxel under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Position of the instance in the scene's list.
    pub instance: u32,
    /// Dense label index.
    pub label: u32,
    /// Lowest voxel of the element that was hit (larger than a voxel at coarser levels of detail).
    pub voxel: [u32; 3],
    /// Distance along the view axis, in world units.
    pub depth: f64,
}

/// The first surface under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenSurface {
    /// Position of the instance in the scene's list; meshes are counted on after the instances.
    pub instance: u32,
    /// Dense label index; `None` on a mesh.
    pub label: Option<u32>,
    /// Distance of the hit along the view axis, in world units.
    pub depth: f32,
}

/// A frame of fewer pixels than the film, each the first sample of one of the film's.
#[derive(Clone, Debug)]
pub struct CoarseFrame {
    /// Colours, rows from the top.
    pub color: Image,
    /// 1 where the sample hit a surface, else 0; `None` unless the film is transparent.
    pub alpha: Option<Vec<f32>>,
    /// What the denoiser knows of the first surfaces, where it was asked for.
    pub guides: Option<Guides>,
}

/// How often a renderer has built each kind of its data. Tests use it to prove that a camera move rebuilds only the camera, and a colour
/// edit only colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rebuilt {
    /// Camera rays.
    pub camera: u64,
    /// Film: its memory and filter table.
    pub film: u64,
    /// Sky, suns and lamps, and the choice among them; counts once more for the emitters.
    pub lights: u64,
    /// Tables of materials. Instances with the same materials share them.
    pub materials: u64,
    /// Acceleration structures: of the drawn boxes of a volume, of the triangles of a mesh. Instances share them.
    pub acceleration: u64,
    /// Hierarchies over all instances and meshes, for scenes that have one.
    pub top_level: u64,
}

/// A renderer of scenes.
pub trait Renderer: Send {
    /// Name of the backend as in `--backend`.
    fn name(&self) -> &'static str;

    /// Makes the renderer show `scene`, and builds what the scene needs ([`LoadedScene::needs`]). It compares with the scene shown before
    /// ([`crate::ScenePlan`]) and rebuilds only the differences; the picture restarts.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the field at fault, [`RenderError::Memory`] what is too large; the renderer keeps its previous scene.
    fn set_scene(&mut self, scene: &LoadedScene) -> Result<(), RenderError>;

    /// Begins what samples need beside the scene that was set, such as compiling programs, without waiting for it. Returns whether all of it is
    /// there; [`Renderer::advance`] waits for what is not.
    ///
    /// # Errors
    /// [`RenderError::Device`]; [`RenderError::Scene`] before any scene was set.
    fn prepare(&mut self) -> Result<bool, RenderError> {
        Ok(true)
    }

    /// Begins what [`Renderer::picture`] needs beside samples, as [`Renderer::prepare`] does for those, so that it is there once they are.
    ///
    /// # Errors
    /// As [`Renderer::prepare`].
    fn prepare_picture(&mut self) -> Result<(), RenderError> {
        Ok(())
    }

    /// Adds samples to every pixel that does not rest for about the time `slice`: at least one sample, but never more than `spp_limit` in
    /// all.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`] soon after `job` is cancelled.
    fn advance(&mut self, slice: Duration, spp_limit: u32, job: &Job) -> Result<Progress, RenderError>;

    /// Whether this renderer makes [coarse frames](Renderer::coarse_frame) of its film.
    fn has_coarse_frames(&mut self) -> bool {
        false
    }

    /// Adds the first sample to the pixels of the film that a frame of `size` pixels shows, across and down, where they have none, and returns that
    /// frame, with guides if `guided`. The samples stay in the film. `None` where the renderer makes no coarse frames, or has begun a pass over all
    /// pixels since the scene was set.
    ///
    /// # Errors
    /// As [`Renderer::advance`].
    fn coarse_frame(
        &mut self,
        _size: [u32; 2],
        _guided: bool,
        _job: &Job,
    ) -> Result<Option<CoarseFrame>, RenderError> {
        Ok(None)
    }

    /// What the denoiser knows of the first surfaces of the film.
    ///
    /// # Errors
    /// As [`Renderer::picture`]; [`RenderError::Cancelled`] soon after `job` is cancelled, except where guides come from a
    /// finished picture, as here.
    fn guides(&mut self, _job: &Job) -> Result<Option<Guides>, RenderError> {
        Ok(Guides::of(&self.picture()?)?)
    }

    /// The colours so far: the mean of all samples.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set; [`RenderError::Device`] here and in the methods below.
    fn color(&mut self) -> Result<Image, RenderError>;

    /// Share of the samples so far that hit a surface; `None` unless the film is transparent.
    ///
    /// # Errors
    /// As [`Renderer::color`].
    fn alpha(&mut self) -> Result<Option<Vec<f32>>, RenderError>;

    /// Variance of these colours; `None` before it is known, with fewer than four samples.
    ///
    /// # Errors
    /// As [`Renderer::color`].
    fn variance(&mut self) -> Result<Option<Image>, RenderError>;

    /// The colours so far, [denoised](pumice_picture::denoise) on the renderer's own device from what that has in its memory. `None` where the
    /// host is to denoise [`Renderer::picture`]: the renderer has no such device, or its device has failed to, which
    /// [`Renderer::notices`] says.
    ///
    /// # Errors
    /// As [`Renderer::color`]; [`RenderError::Memory`] where the host has none for the picture.
    fn denoised(&mut self) -> Result<Option<Image>, RenderError> {
        Ok(None)
    }

    /// The picture so far, with its passes; the caller adds the provenance.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set.
    fn picture(&mut self) -> Result<Picture, RenderError>;

    /// The voxel under the middle of a pixel, counted from the upper left. `None` where there is nothing or a mesh (which has no label),
    /// and outside of the film.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set.
    fn pick(&mut self, x: u32, y: u32) -> Result<Option<Pick>, RenderError>;

    /// The first surfaces under the middles of all pixels, row by row from the top: the hits of [`Renderer::pick`], and those of meshes too.
    /// What a surface is made of does not matter, so glass and transparent surfaces count.
    ///
    /// # Errors
    /// [`RenderError::Scene`] before any scene was set; [`RenderError::Cancelled`].
    fn seen_surfaces(&mut self, job: &Job) -> Result<Vec<Option<SeenSurface>>, RenderError>;

    /// How often each kind of data was built since the renderer was created.
    fn rebuilt(&self) -> Rebuilt;

    /// Memory in bytes by part, without the volumes in the caller's memory; `acceleration` is among the parts once a scene was set. A
    /// renderer with its own device memory counts that memory.
    fn bytes(&self) -> Vec<(&'static str, u64)>;

    /// Messages for the viewer of the picture since the last call, one line each: failures that were overcome at a cost.
    fn notices(&mut self) -> Vec<String> {
        Vec::new()
    }
}
