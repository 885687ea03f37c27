//! Content hashes of volumes, meshes and skies as pictures carry them, and the check that a picture's hashes match its files.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, MeshData};
use pumice_picture::Provenance;
use pumice_scene::{Environment, Instance, Scene, Show};
use xxhash_rust::xxh3::Xxh3;

use super::hashed_files::hash_of_file_once;
use crate::error::{Result, SessionError, io};

/// The content hash of a volume as 32 hexadecimal digits, as pictures carry it.
pub fn hash_text(volume: &CompressedVolume) -> String {
    format!("{:032x}", volume.content_hash())
}

/// The hash of what a volume says of the labels that are shown, as 32 hexadecimal digits: ids, names and types, which legends and mattes have
/// from it. The content hash of the volume knows the ids alone.
pub(super) fn labels_hash_text(show: &Show, volume: &CompressedVolume) -> String {
    let table = volume.labels();
    let mut hash = Xxh3::new();
    let mut text = |text: &str| {
        hash.update(&(text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    };
    let is_shown = show.among(table.ids());
    for (label, id) in (0..).zip(table.ids()).filter(|(label, _)| is_shown[*label as usize]) {
        text(&id.to_string());
        text(volume.note(label).and_then(|note| note.name.as_deref()).unwrap_or(""));
        text(table.type_of(label).map_or("", |number| &table.type_names()[usize::from(number)]));
    }
    format!("{:032x}", hash.digest128())
}

/// A line for each volume whose shown labels have other names or types than when a picture was made.
pub(super) fn other_labels(made: &Provenance, volumes: &[Arc<CompressedVolume>]) -> Vec<String> {
    let instances = made.scene.instances.iter().zip(&made.label_hashes).zip(volumes);
    let changed = instances
        .filter(|((instance, then), volume)| labels_hash_text(&instance.style.show, volume) != **then);
    let line = |instance: &Instance| {
        format!(
            "{}: names or types of its labels have changed since the earlier picture: a legend and mattes are not the same",
            instance.source.display()
        )
    };
    changed.map(|((instance, _), _)| line(instance)).collect()
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
