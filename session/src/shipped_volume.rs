//! The label volume that the project ships: what `pumice demo` draws, and what `pumice bench` measures unless it is given another.

use std::path::{Path, PathBuf};

use crate::error::{Result, SessionError};

/// Its file name, below `data/`.
pub const SHIPPED_VOLUME: &str = "connectomics_32x32x40nm.nrrd";

/// Where the shipped volume is: in the source tree that this program was built from, else below the current folder.
///
/// # Errors
/// When it is in neither place.
pub fn shipped_volume() -> Result<PathBuf> {
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data");
    for folder in [built_from.as_path(), Path::new("data")] {
        let path = folder.join(SHIPPED_VOLUME);
        if path.is_file() {
            return Ok(path.canonicalize().unwrap_or(path));
        }
    }
    Err(SessionError::Caller(format!(
        "data/{SHIPPED_VOLUME} is neither in the source tree that pumice was built from nor below this folder: name a volume with --volume"
    )))
}
