//! Opens a file as a scene with its volumes and meshes: a scene file, or a volume in a scene composed for it.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_formats::OpenOptions;
use pumice_scene::{Scene, Show};

use super::overrides::apply;
use super::request::RenderOverrides;
use crate::error::{Result, SessionError, io};
use crate::figure::{FigureOptions, compose};
use crate::open::{Residence, open_chosen, open_meshes, open_shown};
use crate::reading::record;
use crate::selection::select_labels;

/// A scene with its volumes and meshes open.
pub(crate) struct OpenedScene {
    pub(crate) scene: Scene,
    pub(crate) volumes: Vec<Arc<CompressedVolume>>,
    pub(crate) meshes: Vec<Arc<MeshData>>,
}

/// Whether a file is a scene, by its name.
pub(crate) fn is_scene_file(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
}

/// Opens a scene file or a volume, with overrides applied. Only labels that are shown are read, where the file allows it.
///
/// # Errors
/// One line that says what is wrong with which file or override.
pub(crate) fn open_scene(
    path: &Path,
    overrides: &RenderOverrides,
    reading: &OpenOptions,
    job: &Job,
) -> Result<OpenedScene> {
    let instead = overrides.labels.clone().map(Show::Only);
    let (mut scene, volumes, meshes) = if is_scene_file(path) {
        reading.outputs.check_input(path)?;
        refuse_for_scene(path, overrides)?;
        let mut scene =
            Scene::load(path).map_err(|source| SessionError::Scene { path: path.into(), source })?;
        check_files(&scene, reading)?;
        let volumes = open_shown(&scene, instead.as_ref(), reading, Residence::Mapped, job)?;
        let meshes = open_meshes(&scene)?;
        record(&mut scene, reading);
        (scene, volumes, meshes)
    } else {
        // `pick` chooses by the shape of labels and compares all of them, so all are read.
        let shows = instead.as_ref().unwrap_or(&Show::All);
        let volume = open_chosen(path, &[shows], reading, Residence::Mapped, job)?;
        let options = FigureOptions {
            size: overrides.size.unwrap_or([960, 540]),
            labels: match &overrides.labels {
                Some(ids) => Some(dense_labels(&volume, ids)?),
                None => overrides.pick.map(|n| select_labels(&volume, n)),
            },
            view_deg: overrides.view_deg.unwrap_or(FigureOptions::DEFAULT_VIEW_DEG),
        };
        let absolute = path.canonicalize().map_err(io(path))?;
        let mut scene = compose(&volume, absolute, &options);
        record(&mut scene, reading);
        (scene, vec![volume], Vec::new())
    };
    apply(overrides, &mut scene, &volumes)?;
    scene.validate().map_err(|source| SessionError::Scene { path: path.into(), source })?;
    Ok(OpenedScene { scene, volumes, meshes })
}

/// Checks that no file that a scene names is written.
pub(super) fn check_files(scene: &Scene, reading: &OpenOptions) -> Result<()> {
    Ok(scene.paths().into_iter().try_for_each(|(_, path)| reading.outputs.check_input(path))?)
}

/// Refuses what composes the scene of a volume, for a file that is a scene already.
fn refuse_for_scene(path: &Path, overrides: &RenderOverrides) -> Result<()> {
    let (option, why) = match overrides {
        RenderOverrides { pick: Some(_), .. } => {
            ("--pick", "says itself which labels it shows; --labels shows others")
        }
        RenderOverrides { view_deg: Some(_), .. } => ("--view", "has a camera of its own"),
        _ => return Ok(()),
    };
    Err(SessionError::Caller(format!("{option}: {} is a scene, which {why}", path.display())))
}

fn dense_labels(volume: &CompressedVolume, ids: &[u64]) -> Result<Vec<u32>> {
    let dense = |&id: &u64| {
        let index = volume.labels().index_of(id);
        index.ok_or_else(|| SessionError::Caller(format!("--labels: the volume has no label {id}")))
    };
    ids.iter().map(dense).collect()
}
