//! Writes a scene to a file of any format: finds what is drawn, says how much it is, and writes it.

use std::path::Path;

use pumice_core::Job;
use pumice_transport::LoadedScene;

use crate::usd::{write_usda, write_usdc};
use crate::whole_file::write_whole;
use crate::{Budget, FileFormat, Form, Merging, Result, scene_stage::stage_of_scene};

/// What is written of a scene, and how much of it at most.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportOptions {
    /// Forms of the volumes; the first is the one that programs show.
    pub forms: Vec<Form>,
    /// Whether neighbouring faces become one.
    pub merging: Merging,
    /// Bytes that the file may take, as estimated while its faces are found.
    pub limit_bytes: u64,
}

/// What an export has found and is about to write, or has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExportSize {
    /// Faces of all forms together.
    pub faces: u64,
    /// Boxes of the form [`Form::Instances`].
    pub boxes: u64,
    /// Bytes of the file: an estimate before it is written.
    pub bytes: u64,
}

/// Writes a scene to `path`, whose ending chooses the format. The file appears complete or not at all. `tell` hears how much it is before
/// writing begins.
///
/// # Errors
/// Those of [`FileFormat::of`]; [`pumice_core::Error::Caller`] where nothing is asked for or nothing is drawn;
/// [`pumice_core::Error::Limit`] where the file would take more bytes than allowed, as soon as that is found;
/// [`pumice_core::Error::Io`] with the file's name where it cannot be written; [`pumice_core::Error::Cancelled`].
pub fn export_scene(
    scene: &LoadedScene,
    options: &ExportOptions,
    path: &Path,
    tell: &mut dyn FnMut(ExportSize),
    job: &Job,
) -> Result<ExportSize> {
    let format = FileFormat::of(path)?;
    let mut budget = Budget::new(options.limit_bytes, format.face_bytes());
    let size = |budget: &Budget, bytes| ExportSize { faces: budget.faces(), boxes: budget.boxes(), bytes };
    let bytes = match format {
        FileFormat::Usda | FileFormat::Usdc => {
            let stage = stage_of_scene(scene, options, &mut budget, job)?;
            tell(size(&budget, budget.bytes()));
            write_whole(path, job, |mut out| match format {
                FileFormat::Usda => write_usda(&stage, &mut out),
                FileFormat::Usdc => write_usdc(&stage, &mut out),
            })?
        }
    };
    Ok(size(&budget, bytes))
}
