//! The picture formats that Pumice writes.

use std::path::Path;

use pumice_picture::{Passes, Picture, PicturePaths, write_exr_as, write_png_as};

use crate::error::{Result, SessionError};

/// Picture formats that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// OpenEXR: scene-linear, with passes.
    Exr,
    /// PNG: 8-bit display values.
    Png,
}

impl PictureFormat {
    /// The format that the extension of `path` names.
    ///
    /// # Errors
    /// When the extension is neither `.exr` nor `.png`.
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

    /// Writes a picture with the options of its scene's film: half floats, view transform, background. `paths` says what the file tells of
    /// where its sources are.
    ///
    /// # Errors
    /// When the file cannot be written; the name is then unchanged.
    pub fn write(self, path: &Path, picture: &Picture, passes: &Passes, paths: PicturePaths) -> Result<()> {
        let film = picture.provenance.as_ref().map(|p| p.scene.film);
        match self {
            Self::Exr => write_exr_as(path, picture, passes, film.is_some_and(|f| f.half), paths)?,
            Self::Png => {
                let view = film.map(|f| f.view_transform).unwrap_or_default();
                write_png_as(path, picture, view, film.and_then(|f| f.background), paths)?;
            }
        }
        Ok(())
    }
}

/// Checks that the folder of an output file exists.
pub(super) fn check_folder(out: &Path) -> Result<()> {
    match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => Err(SessionError::Caller(
            format!("{}: the folder {} does not exist", out.display(), folder.display()),
        )),
        _ => Ok(()),
    }
}
