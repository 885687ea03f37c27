//! Files of a bench: its temporary folder and its results.

use std::path::{Path, PathBuf};

use pumice_session::error::{Result, SessionError, io};
use pumice_session::shipped_volume;

/// An empty temporary folder, which is removed when the value is dropped.
pub(crate) fn scratch() -> Result<tempfile::TempDir> {
    let folder = std::env::temp_dir();
    tempfile::tempdir_in(&folder).map_err(io(folder))
}

/// A file's name without its folder.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Name of a table whose pictures a backend draws: `types`, `types_vulkan-compute`.
pub(crate) fn of_backend(table: &str, backend: &str) -> String {
    match backend {
        "cpu" => table.to_owned(),
        other => format!("{table}_{}", other.replace(':', "_")),
    }
}

/// Writes files, given as names and texts, into `folder`, which is created if missing.
pub(crate) fn write_results(folder: &Path, files: impl IntoIterator<Item = (String, String)>) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(io(folder))?;
    for (name, text) in files {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(io(path))?;
    }
    Ok(())
}

/// The given volumes; if there are none, the one that the project ships.
pub(crate) fn volumes_or_shipped(volumes: &[PathBuf]) -> Result<Vec<PathBuf>> {
    Ok(if volumes.is_empty() { vec![shipped_volume()?] } else { volumes.to_vec() })
}

/// Checks that numbers of samples increase.
pub(crate) fn rising(spp: &[u32]) -> Result<()> {
    match spp.is_sorted_by(|a, b| a < b) {
        true => Ok(()),
        false => Err(SessionError::Caller("--spp: expected numbers in increasing order".into())),
    }
}
