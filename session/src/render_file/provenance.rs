//! Content hashes of volumes and meshes as pictures carry them, and the check that a picture's hashes match its files.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, MeshData};
use pumice_picture::Provenance;

use crate::error::{Result, SessionError};

/// The content hash of a volume as 32 hexadecimal digits, as pictures carry it.
pub fn hash_text(volume: &CompressedVolume) -> String {
    format!("{:032x}", volume.content_hash())
}

/// The content hash of a mesh as 32 hexadecimal digits.
pub(super) fn mesh_hash_text(mesh: &MeshData) -> String {
    format!("{:032x}", mesh.content_hash())
}

/// Checks that the volumes and meshes are exactly those that a picture was made from: only then is it rendered again.
pub(super) fn check_hashes(
    picture: &Path,
    made: &Provenance,
    volumes: &[Arc<CompressedVolume>],
    meshes: &[Arc<MeshData>],
) -> Result<()> {
    let check = |what: &str, source: &Path, expected: &str, got: String| {
        if got == expected {
            return Ok(());
        }
        let (picture, source) = (picture.display(), source.display());
        Err(SessionError::Caller(format!(
            "{picture}: made from a {what} with the hash {expected}, but {source} now has {got}"
        )))
    };
    for ((instance, expected), volume) in made.scene.instances.iter().zip(&made.volume_hashes).zip(volumes) {
        check("volume", &instance.source, expected, hash_text(volume))?;
    }
    for ((mesh, expected), data) in made.scene.meshes.iter().zip(&made.mesh_hashes).zip(meshes) {
        check("mesh", &mesh.source, expected, mesh_hash_text(data))?;
    }
    Ok(())
}
