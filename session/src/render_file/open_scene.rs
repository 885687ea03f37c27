//! Opens a file as a scene with its volumes and meshes: a scene file, a state of Neuroglancer, or a volume in a scene composed for it.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job, MeshData, frames_in_file};
use pumice_formats::{OpenOptions, is_on_server};
use pumice_scene::{Scene, Show};

use super::overrides::apply;
use super::request::RenderOverrides;
use crate::error::{Result, SessionError, io};
use crate::figure::{FigureFlags, FigureOptions};
use crate::neuroglancer::{OpenedState, State, open_state};
use crate::open::{Kind, Residence, kind_of, open_chosen, open_meshes, open_shown};
use crate::reading::{options_for, record};

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

/// Whether a path stands for a whole scene, also as a state of Neuroglancer, and not for a volume alone.
pub(crate) fn brings_scene(path: &Path) -> bool {
    is_scene_file(path) || State::is_link(path)
}

/// The state of Neuroglancer that a path stands for, if it does.
///
/// # Errors
/// When the file cannot be read, or is a state with something wrong in it.
pub(super) fn state_at(path: &Path) -> Result<Option<State>> {
    if !brings_scene(path) {
        return Ok(None);
    }
    let name = if State::is_link(path) { "the link".into() } else { path.display().to_string() };
    State::at(path).map_err(|e| SessionError::Caller(format!("{name}: {e}")))
}

/// Opens a scene file, a state of Neuroglancer or a volume, with overrides applied. Only labels that are shown are read, where the file allows it.
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
    let state = state_at(path)?;
    let for_scenes = |flag: &str| {
        let (what, path) =
            (if state.is_some() { "a state of Neuroglancer" } else { "a scene" }, path.display());
        Err(wrong(format!("{flag}: {path} is {what}, which says that itself; expected a volume")))
    };
    if let (Some((name, _)), None) = (overrides.layer_files.first(), &state) {
        let path = path.display();
        return Err(wrong(format!(
            "layer {name}: {path} is no state of Neuroglancer, which alone has layers"
        )));
    }
    let (mut scene, volumes, meshes) = if let Some(state) = &state {
        if let Some(flag) = figure.first_for_volumes() {
            return for_scenes(flag);
        }
        if instead.is_some() {
            return for_scenes("labels, query");
        }
        if !State::is_link(path) {
            reading.outputs.check_input(path)?;
        }
        let reading = &OpenOptions { time: overrides.time_step.or(reading.time), ..reading.clone() };
        let folder = path.parent().filter(|_| !State::is_link(path)).unwrap_or(Path::new(""));
        let size = overrides.pixels(FigureOptions::DEFAULT_SIZE);
        let OpenedState { mut scene, volumes } =
            open_state(state, &overrides.layer_files, (folder, size), (reading, residence), job)?;
        record(&mut scene, reading);
        (scene, volumes, Vec::new())
    } else if is_scene_file(path) {
        reading.outputs.check_input(path)?;
        if let Some(flag) = figure.first_for_volumes() {
            return for_scenes(flag);
        }
        let mut scene =
            Scene::load(path).map_err(|source| SessionError::Scene { path: path.into(), source })?;
        check_files(&scene, reading)?;
        if let Some(step) = overrides.time_step {
            set_time_step(&mut scene, step)?;
        }
        let volumes = open_shown(&scene, instead.as_ref(), reading, residence, job)?;
        show_chosen(figure, &mut scene, &volumes, "the scene").map_err(wrong)?;
        let meshes = open_meshes(&scene)?;
        record(&mut scene, reading);
        (scene, volumes, meshes)
    } else {
        if is_on_server(path) {
            return Err(SessionError::Caller(format!(
                "{}: it lies on a server, and a picture names the files that it is made of: compress it first (pumice compress URL -o FILE.pumice)",
                path.display()
            )));
        }
        let reading = &OpenOptions { time: overrides.time_step.or(reading.time), ..reading.clone() };
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
    scene.validate().map_err(|source| match is_scene_file(path) {
        true => SessionError::Scene { path: path.into(), source },
        // Of a volume the command alone makes the scene.
        false => SessionError::Caller(source.to_string()),
    })?;
    Ok(OpenedScene { scene, volumes, meshes })
}

/// Like [`open_scene`] of a volume, with place, scale and colours that do not depend on which labels are shown: they are those of all labels, so that
/// what is made of some fits together with what is made of others.
///
/// # Errors
/// As [`open_scene`].
pub(crate) fn open_in_place(
    path: &Path,
    overrides: &RenderOverrides,
    reading: &OpenOptions,
    residence: Residence,
    job: &Job,
) -> Result<OpenedScene> {
    let mut opened = open_scene(path, &RenderOverrides::default(), reading, residence, job)?;
    let OpenedScene { scene, volumes, .. } = &mut opened;
    let wrong = |e: String| SessionError::Caller(format!("--{e}"));
    show_chosen(&overrides.figure, scene, volumes, "the volume").map_err(wrong)?;
    for (volume, ids) in volumes.iter().zip(&overrides.labels) {
        dense_labels(volume, ids)?;
    }
    apply(overrides, scene, volumes)?;
    Ok(opened)
}

/// Lets all volumes of a scene that have several time steps show this one.
pub(super) fn set_time_step(scene: &mut Scene, step: u32) -> Result<()> {
    for instance in &mut scene.instances {
        if time_steps_of(&instance.source, &options_for(&instance.reading, &OpenOptions::default()))? > 1 {
            instance.reading.time = Some(step);
        }
    }
    Ok(())
}

/// Number of time steps of a file.
pub(super) fn time_steps_of(path: &Path, reading: &OpenOptions) -> Result<u64> {
    // Without the choice, so that the number is told.
    let reading = OpenOptions { time: None, ..reading.clone() };
    Ok(match kind_of(path, &reading)? {
        Kind::Foreign => {
            let choices = pumice_formats::probe(path, &reading)?.choices;
            choices.iter().find(|choice| choice.keyword == "time").map_or(1, |choice| choice.count)
        }
        Kind::Compressed | Kind::Series => frames_in_file(path)?.into(),
    })
}

/// Checks that no file that a scene names is written.
pub(super) fn check_files(scene: &Scene, reading: &OpenOptions) -> Result<()> {
    Ok(scene.paths().into_iter().try_for_each(|(_, path)| reading.outputs.check_input(path))?)
}

/// Shows of each volume the labels that the flags choose, where they choose any by name; `what` has these volumes, for messages.
fn show_chosen(
    figure: &FigureFlags,
    scene: &mut Scene,
    volumes: &[Arc<CompressedVolume>],
    what: &str,
) -> std::result::Result<(), String> {
    figure.require_matches(volumes.iter().map(|volume| &**volume), what)?;
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
