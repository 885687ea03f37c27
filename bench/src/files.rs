//! Files of a bench: a scratch folder while it measures, its results afterwards.

use std::path::{Path, PathBuf};

use pumice_session::error::{Result, SessionError, io};
use pumice_session::shipped_volume;

/// An empty folder that goes away with its value.
pub(crate) fn scratch() -> Result<tempfile::TempDir> {
    let folder = std::env::temp_dir();
    tempfile::tempdir_in(&folder).map_err(io(folder))
}

/// A file's name without its folder.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Writes files by their names into `folder`, made if absent.
pub(crate) fn write_results(folder: &Path, files: impl IntoIterator<Item = (String, String)>) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(io(folder))?;
    for (name, text) in files {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(io(path))?;
    }
    Ok(())
}

/// The volumes that are named, or the one that the project ships.
pub(crate) fn volumes_or_shipped(volumes: &[PathBuf]) -> Result<Vec<PathBuf>> {
    Ok(if volumes.is_empty() { vec![shipped_volume()?] } else { volumes.to_vec() })
}

/// Refuses numbers of samples that do not rise.
pub(crate) fn rising(spp: &[u32]) -> Result<()> {
    match spp.is_sorted_by(|a, b| a < b) {
        true => Ok(()),
        false => Err(SessionError::Caller("--spp: expected rising numbers".into())),
    }
}
