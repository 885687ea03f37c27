//! Reads foreign mesh files as [`MeshData`]. The content decides the format, not the file's name.

use std::io::Read;
use std::path::Path;

use pumice_core::MeshData;

use crate::error::{FormatError, Result};
use crate::ply::{is_ply, read_ply};
use crate::stream::open_file;

/// Reads a triangle mesh from a PLY file, text or binary.
///
/// # Errors
/// One line that says what is wrong with the file.
pub fn open_mesh(path: &Path) -> Result<MeshData> {
    let mut head = Vec::new();
    open_file(path)?.take(16).read_to_end(&mut head).map_err(FormatError::io(path))?;
    if is_ply(&head) {
        return read_ply(path);
    }
    Err(FormatError::Unknown {
        path: path.to_owned(),
        what: "expected a PLY mesh (.ply), got another format".into(),
    })
}
