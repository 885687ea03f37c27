//! Reads foreign mesh files as [`MeshData`]. The content decides the format, not the file's name.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use pumice_core::MeshData;

use crate::error::{FormatError, Result};
use crate::ply::{is_ply, read_ply};

/// Reads a triangle mesh from a PLY file, text or binary.
///
/// # Errors
/// One line that says what is wrong with the file.
pub fn open_mesh(path: &Path) -> Result<MeshData> {
    // Devices and pipes are refused, because they may never end.
    if !std::fs::metadata(path).map_err(FormatError::io(path))?.is_file() {
        return Err(FormatError::Unknown {
            path: path.to_owned(),
            what: "expected a mesh file, got something that is not a file".into(),
        });
    }
    let mut head = Vec::new();
    let file = File::open(path).map_err(FormatError::io(path))?;
    file.take(16).read_to_end(&mut head).map_err(FormatError::io(path))?;
    if is_ply(&head) {
        return read_ply(path);
    }
    Err(FormatError::Unknown {
        path: path.to_owned(),
        what: "expected a PLY mesh (.ply), got another format".into(),
    })
}
