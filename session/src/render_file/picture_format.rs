//! Picture formats that can be written.

use std::path::Path;

use pumice_picture::{Passes, Picture, write_exr, write_exr_half, write_png_shown};

use crate::error::{Result, SessionError};

/// Picture formats that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Scene-linear, with passes.
    Exr,
    /// 8 bit sRGB.
    Png,
}

impl PictureFormat {
    /// By the path's ending.
    ///
    /// # Errors
    /// When it is neither `.exr` nor `.png`.
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

    /// Writes a picture as its scene's film says: colours in half floats, by which view transform.
    ///
    /// # Errors
    /// When the file cannot be written; nothing new is under its name then.
    pub fn write(self, path: &Path, picture: &Picture, passes: &Passes) -> Result<()> {
        let film = picture.provenance.as_ref().map(|p| p.scene.film);
        match self {
            Self::Exr if film.is_some_and(|f| f.half) => write_exr_half(path, picture, passes)?,
            Self::Exr => write_exr(path, picture, passes)?,
            Self::Png => write_png_shown(path, picture, film.map(|f| f.view_transform).unwrap_or_default())?,
        }
        Ok(())
    }
}

/// Whether the folder that a file is to be written to is there.
pub(super) fn check_folder(out: &Path) -> Result<()> {
    match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => Err(SessionError::Caller(
            format!("{}: the folder {} does not exist", out.display(), folder.display()),
        )),
        _ => Ok(()),
    }
}
