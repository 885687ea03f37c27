//! The input file. Readers take paths, so each input is written to a file, in memory if the system has a folder in memory.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Folder for the files: `PUMICE_FUZZ_SCRATCH`, which `cargo xtask fuzz` makes and removes, or the system's temporary one.
static FOLDER: LazyLock<PathBuf> =
    LazyLock::new(|| std::env::var_os("PUMICE_FUZZ_SCRATCH").map_or_else(std::env::temp_dir, PathBuf::from));

/// Path of this process's input file; `extension` begins with a dot or is empty.
pub fn path(extension: &str) -> PathBuf {
    FOLDER.join(format!("pumice-fuzz-{}{extension}", std::process::id()))
}

/// Writes an input to the file.
///
/// # Panics
/// When it cannot be written, because then no input would be tested.
pub fn put(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
