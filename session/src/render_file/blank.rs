//! Pictures of volumes in which no pixel shows a surface, which is hardly what was wished.

use std::path::Path;
use std::sync::Arc;

use pumice_core::CompressedVolume;
use pumice_picture::Picture;
use pumice_scene::Instance;
use pumice_transport::LoadedScene;

/// A line about a picture of `scene` that shows nothing of its volumes and meshes; `None` where a pixel shows something, or there are no volumes.
/// `source` is what the picture was made of.
pub(super) fn notice(scene: &LoadedScene, picture: &Picture, source: &Path) -> Option<String> {
    let depth = picture.depth.as_ref()?;
    if scene.volumes().is_empty() || depth.iter().any(|depth| depth.is_finite()) {
        return None;
    }
    let why = match shows_no_label(scene) {
        true => "nothing is shown, because no label of a volume is",
        false => "no pixel shows a surface: cuts, clipping or the camera leave nothing to see",
    };
    Some(format!("{}: {why}", source.display()))
}

/// Whether a scene has neither a label with a voxel that is shown nor a mesh.
fn shows_no_label(scene: &LoadedScene) -> bool {
    let mut instances = scene.scene().instances.iter().zip(scene.volumes());
    let is_hidden = |(instance, volume): (&Instance, &Arc<CompressedVolume>)| {
        let shown = instance.style.show.among(volume.labels().ids());
        !shown.iter().zip(volume.labels().voxels()).any(|(&is_shown, &voxels)| is_shown && voxels > 0)
    };
    scene.meshes().is_empty() && instances.all(is_hidden)
}
