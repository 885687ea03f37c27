//! Opens a file as a scene with its volumes and meshes: a scene file, or a volume in a scene composed for it.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_formats::OpenOptions;
use pumice_scene::{Scene, Show};

use super::overrides::apply;
use super::request::RenderOverrides;
use crate::error::{Result, SessionError, io};
use crate::figure::{FigureFlags, FigureOptions};
use crate::open::{Residence, open_chosen, open_meshes, open_shown};
use crate::reading::record;

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
    residence: Residence,
    job: &Job,
) -> Result<OpenedScene> {
    let figure = &overrides.figure;
    let wrong = |e: String| SessionError::Caller(format!("--{e}"));
    // Queries, and `pick`, compare all labels, so all are read.
    let only = overrides.labels.clone().map(Show::Only);
    let instead = only.or_else(|| figure.queries().then_some(Show::All));
    let (mut scene, volumes, meshes) = if is_scene_file(path) {
        reading.outputs.check_input(path)?;
        if let Some(flag) = figure.first_for_volumes() {
            let path = path.display();
            return Err(wrong(format!(
                "{flag}: {path} is a scene, which says that itself; expected a volume"
            )));
        }
        let mut scene =
            Scene::load(path).map_err(|source| SessionError::Scene { path: path.into(), source })?;
        check_files(&scene, reading)?;
        let volumes = open_shown(&scene, instead.as_ref(), reading, residence, job)?;
        show_chosen(figure, &mut scene, &volumes).map_err(wrong)?;
        let meshes = open_meshes(&scene)?;
        record(&mut scene, reading);
        (scene, volumes, meshes)
    } else {
        let shows = instead.as_ref().unwrap_or(&Show::All);
        let volume = open_chosen(path, &[shows], reading, residence, job)?;
        let labels = overrides.labels.as_ref().map(|ids| dense_labels(&volume, ids)).transpose()?;
        let absolute = path.canonicalize().map_err(io(path))?;
        let size = overrides.pixels(FigureOptions::DEFAULT_SIZE);
        let mut scene = figure.figure(&volume, absolute, size, labels).map_err(wrong)?;
        let meshes = open_meshes(&scene)?;
        record(&mut scene, reading);
        (scene, vec![volume], meshes)
    };
    apply(overrides, &mut scene, &volumes)?;
    scene.validate().map_err(|source| SessionError::Scene { path: path.into(), source })?;
    Ok(OpenedScene { scene, volumes, meshes })
}

/// Checks that no file that a scene names is written.
pub(super) fn check_files(scene: &Scene, reading: &OpenOptions) -> Result<()> {
    Ok(scene.paths().into_iter().try_for_each(|(_, path)| reading.outputs.check_input(path))?)
}

/// Shows of each volume the labels that the flags choose, where they choose any by name.
fn show_chosen(
    figure: &FigureFlags,
    scene: &mut Scene,
    volumes: &[Arc<CompressedVolume>],
) -> std::result::Result<(), String> {
    figure.require_matches(volumes.iter().map(|volume| &**volume), "the scene")?;
    for (instance, volume) in scene.instances.iter_mut().zip(volumes) {
        if let Some(chosen) = figure.chosen(volume)? {
            let id = |label: u32| volume.labels().ids()[label as usize];
            instance.style.show = Show::Only(chosen.into_iter().map(id).collect());
        }
    }
    Ok(())
}

fn dense_labels(volume: &CompressedVolume, ids: &[u64]) -> Result<Vec<u32>> {
    let dense = |&id: &u64| {
        let index = volume.labels().index_of(id);
        index.ok_or_else(|| SessionError::Caller(format!("--labels: the volume has no label {id}")))
    };
    ids.iter().map(dense).collect()
}
