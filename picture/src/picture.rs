//! A finished picture with its passes and its provenance, as renderers return it and files hold it.

use pumice_core::TargetError;
use pumice_scene::{Pass, Scene};
use serde::{Deserialize, Serialize};

use crate::annotate::{Annotations, Mark};
use crate::cryptomatte::Matte;
use crate::denoise::Denoiser;
use crate::image::Image;
use crate::picture_labels::InstanceLabels;

/// Everything that is needed to render the picture again, and to judge its quality.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of Pumice that made it.
    pub version: String,
    /// Backend that made it.
    pub backend: String,
    /// The whole scene, settings and seed included.
    pub scene: Scene,
    /// Content hash of each instance's volume, 32 hexadecimal digits, in the order of the scene's instances.
    pub volume_hashes: Vec<String>,
    /// XXH3-128 of ids, names and types of the labels that each instance shows, in the same form and order; empty in pictures that say nothing
    /// of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub label_hashes: Vec<String>,
    /// Content hash of each mesh, in the order of the scene's meshes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mesh_hashes: Vec<String>,
    /// XXH3-128 of the bytes of the sky's picture, 32 hexadecimal digits; `None` where the scene has no such picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sky_hash: Option<String>,
    /// Samples per pixel.
    pub spp: u32,
    /// Estimated relative error of the mean of the samples, where known.
    pub error_estimate: Option<f64>,
    /// The filter that the colour went through, which makes it biased; `None` where it is the mean of its samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoised: Option<Denoiser>,
    /// What is drawn over the picture.
    #[serde(default, skip_serializing_if = "Annotations::is_empty")]
    pub annotations: Annotations,
}

/// A picture with its passes. Row 0 is the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Scene-linear Rec. 709 radiance: the mean of all samples, or what a denoiser made of it.
    pub color: Image,
    /// The mean of all samples, where the colour is denoised.
    pub noisy: Option<Image>,
    /// Variance of that mean, per channel; `None` if it is not known.
    pub variance: Option<Image>,
    /// Distance along the view axis to the first surface, of the sample nearest the pixel's centre; infinite where there is none.
    pub depth: Option<Vec<f32>>,
    /// Label of that surface: dense index + 1, 0 where there is none.
    pub label: Option<Vec<u32>>,
    /// Id of the instance that the label belongs to, 0 where there is none; only where the scene has several instances.
    pub instance: Option<Vec<u32>>,
    /// The labels of the label pass, by instance.
    pub labels: Vec<InstanceLabels>,
    /// Base colour of the first surface at the pixel's centre. If the film asks for the pass: the mean over samples of the
    /// diffuse, glossy and transmission colours together.
    pub albedo: Option<Image>,
    /// Unit normal of the first surface towards the camera, world space; the mean over samples where the film asks for it.
    pub normal: Option<Image>,
    /// Share of the samples that hit a surface, if the film is transparent; the colour is premultiplied with it. It includes caught
    /// shadows, unless they have a pass of their own.
    pub alpha: Option<Vec<f32>>,
    /// World position of the first surface at the pixel's centre; 0 where there is none.
    pub position: Option<Image>,
    /// Samples of each pixel, if the film asks for them.
    pub samples: Option<Vec<f32>>,
    /// Passes of light and of caught shadows that the film asks for, in the order of [`Pass::ALL`].
    pub light: Vec<(Pass, Image)>,
    /// Cryptomattes by label and type, if the film asks for them.
    pub mattes: Vec<Matte>,
    /// What files of the picture show over its colour; empty in a picture that was read, whose colour has it.
    pub marks: Vec<Mark>,
    /// Pixels per inch on paper, which files state.
    pub dpi: Option<f64>,
    /// How the picture was made.
    pub provenance: Option<Provenance>,
}

impl Picture {
    /// A colour without passes.
    pub fn of(color: Image) -> Self {
        Self {
            color,
            noisy: None,
            variance: None,
            depth: None,
            label: None,
            instance: None,
            labels: Vec::new(),
            albedo: None,
            normal: None,
            alpha: None,
            position: None,
            samples: None,
            light: Vec::new(),
            mattes: Vec::new(),
            marks: Vec::new(),
            dpi: None,
            provenance: None,
        }
    }
}

/// Why a picture could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The operating system reports an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: std::path::PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is damaged or of another kind than expected.
    #[error("{}: {what}", path.display())]
    File {
        /// The file.
        path: std::path::PathBuf,
        /// Expected and got.
        what: String,
    },
}

impl From<TargetError> for PictureError {
    fn from(error: TargetError) -> Self {
        match error {
            TargetError::Io { path, source } => Self::Io { path, source },
            TargetError::Refused { path, what } => Self::File { path, what },
        }
    }
}
