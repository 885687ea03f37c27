//! Mesh files of others, as [`MeshData`]. By content, whatever the name says.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use pumice_core::MeshData;

use crate::error::{FormatError, Result};
use crate::ply::{is_ply, read_ply};

/// Reads a triangle mesh: PLY, as text or binary.
///
/// # Errors
/// One line that says what is wrong with the file.
pub fn open_mesh(path: &Path) -> Result<MeshData> {
    // A device or a pipe may never end.
    if !std::fs::metadata(path).map_err(FormatError::io(path))?.is_file() {
        return Err(FormatError::Unknown { path: path.to_owned(), what: "expected a mesh file".into() });
    }
    let mut head = Vec::new();
    let file = File::open(path).map_err(FormatError::io(path))?;
    file.take(16).read_to_end(&mut head).map_err(FormatError::io(path))?;
    if is_ply(&head) {
        return read_ply(path);
    }
    Err(FormatError::Unknown {
        path: path.to_owned(),
        what: "this is no mesh that can be read; PLY files (.ply) can".into(),
    })
}
