//! Content hashes of volumes, meshes and skies as pictures carry them, and the check that a picture's hashes match its files.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, MeshData};
use pumice_picture::Provenance;
use pumice_scene::{Environment, Scene};

use super::hashed_files::hash_of_file_once;
use crate::error::{Result, SessionError, io};

/// The content hash of a volume as 32 hexadecimal digits, as pictures carry it.
pub fn hash_text(volume: &CompressedVolume) -> String {
    format!("{:032x}", volume.content_hash())
}

/// The content hash of a mesh as 32 hexadecimal digits.
pub(super) fn mesh_hash_text(mesh: &MeshData) -> String {
    format!("{:032x}", mesh.content_hash())
}

/// The hash of the picture that a scene has as its sky, as 32 hexadecimal digits; `None` where its sky is no picture.
///
/// # Errors
/// [`SessionError::Io`] when the file cannot be read.
pub(crate) fn sky_hash_text(scene: &Scene) -> Result<Option<String>> {
    let Environment::Image { path, .. } = &scene.world.environment else { return Ok(None) };
    Ok(Some(format!("{:032x}", hash_of_file_once(path).map_err(io(path))?)))
}

/// Checks that the sky is the one that a picture was made under.
pub(super) fn check_sky(picture: &Path, made: &Provenance) -> Result<()> {
    let (now, then) = (sky_hash_text(&made.scene)?, &made.sky_hash);
    if now == *then {
        return Ok(());
    }
    let name = |hash: &Option<String>| hash.clone().unwrap_or_else(|| "none".into());
    Err(SessionError::Caller(format!(
        "{}: made under a sky with the hash {}, but the picture of its sky now has {}",
        picture.display(),
        name(then),
        name(&now)
    )))
}

/// Checks that the volumes and meshes, of which each has a hash, are exactly those that a picture was made from: only then is it rendered again.
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
