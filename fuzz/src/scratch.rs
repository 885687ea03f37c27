//! Readers take paths; so each input goes through a file, in memory where the system has such a folder.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Folder for the files: `PUMICE_FUZZ_SCRATCH`, which `cargo xtask fuzz` makes and removes, or the system's temporary one.
static FOLDER: LazyLock<PathBuf> =
    LazyLock::new(|| std::env::var_os("PUMICE_FUZZ_SCRATCH").map_or_else(std::env::temp_dir, PathBuf::from));

/// Path of this process's own file; `extension` keeps its dot, or is empty.
pub fn path(extension: &str) -> PathBuf {
    FOLDER.join(format!("pumice-fuzz-{}{extension}", std::process::id()))
}

/// Writes the input.
///
/// # Panics
/// When it cannot be written: then no input would be tested.
pub fn put(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
