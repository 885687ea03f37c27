//! The label volume that the project ships. `pumice demo` draws it, and `pumice bench` measures it unless another is given.

use std::path::{Path, PathBuf};

use crate::error::{Result, SessionError};

/// File name of the shipped volume, in `data/`.
pub const SHIPPED_VOLUME: &str = "connectomics_32x32x40nm.nrrd";

/// The path of the shipped volume: in the source tree that this program was built from, otherwise below the current folder.
///
/// # Errors
/// When the file is in neither place.
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
