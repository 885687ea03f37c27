//! Scenes. Python writes them as dictionaries; only `pumice_scene` defines and checks their fields.

use std::path::PathBuf;

use pumice_scene::Scene as CoreScene;
use pumice_scene::SceneEdit;
use pumice_session::SessionError;
use pumice_session::figure::{FigureFlags, turned};
use pumice_session::reading::recorded;
use pyo3::prelude::*;

use crate::errors::{IntoException, input};
use crate::labels::{LabelGroups, Visible, show};
use crate::volume::{ReadAs, Volume, reading};
use crate::waiting::detached;

/// A validated scene.
#[pyclass(frozen, eq, module = "pumice._native")]
#[derive(PartialEq)]
pub(crate) struct Scene(pub(crate) CoreScene);

#[pymethods]
impl Scene {
    /// Reads the JSON form and checks every field.
    #[staticmethod]
    fn parse(text: &str) -> PyResult<Self> {
        CoreScene::from_json(text).map(Self).map_err(IntoException::into_exception)
    }

    /// Reads a scene file; its paths become absolute.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        CoreScene::load(&path).map(Self).map_err(|e| input(&format_args!("{}: {e}", path.display())))
    }

    /// Writes a scene file, which appears complete or not at all.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.0.save(&path).map_err(|e| input(&format_args!("{}: {e}", path.display())))
    }

    /// The JSON form, with every default written out.
    fn to_json(&self) -> PyResult<String> {
        self.0.to_json().map_err(IntoException::into_exception)
    }

    /// The path of each instance's volume.
    fn sources(&self) -> Vec<PathBuf> {
        self.0.instances.iter().map(|instance| instance.source.clone()).collect()
    }

    /// All files that the scene names, each with its field.
    fn paths(&self) -> Vec<(String, PathBuf)> {
        paths_of(&self.0)
    }

    /// The scene with the file of its first instance read in this way.
    fn with_reading(&self, read_as: ReadAs) -> PyResult<Self> {
        let said = recorded(&reading(read_as, &pumice_core::Job::new())?);
        let mut scene = self.0.clone();
        scene.instances.iter_mut().take(1).for_each(|instance| instance.reading = said.clone());
        scene.validate().map_err(IntoException::into_exception)?;
        Ok(Self(scene))
    }

    /// Pixels across and down.
    fn size(&self) -> (u32, u32) {
        (self.0.film.width, self.0.film.height)
    }

    /// Whether the settings end a render by themselves, when all pixels rest.
    fn rests(&self) -> bool {
        self.0.settings.adaptive.is_some()
    }

    /// The scene with other labels drawn of an instance, and with other groups of its labels.
    #[pyo3(signature = (id, visible, groups))]
    fn with_labels(
        &self,
        py: Python<'_>,
        id: u32,
        visible: Option<Visible>,
        groups: Option<&LabelGroups>,
    ) -> PyResult<Self> {
        let mut scene = self.0.clone();
        scene.apply(label_edits(py, id, visible, groups)?).map_err(IntoException::into_exception)?;
        scene.validate().map_err(IntoException::into_exception)?;
        Ok(Self(scene))
    }
}

/// All files that a scene names, each with its field.
pub(crate) fn paths_of(scene: &CoreScene) -> Vec<(String, PathBuf)> {
    scene.paths().into_iter().map(|(field, path)| (field, path.to_owned())).collect()
}

/// Edits that set which labels of an instance are drawn, and the groups of its labels.
pub(crate) fn label_edits(
    py: Python<'_>,
    id: u32,
    visible: Option<Visible>,
    groups: Option<&LabelGroups>,
) -> PyResult<Vec<SceneEdit>> {
    let mut edits = Vec::new();
    if let Some((ids, flags)) = visible {
        edits.push(SceneEdit::Show { id, show: show(py, &ids, &flags)? });
    }
    if let Some(groups) = groups {
        edits.push(SceneEdit::Groups { id, groups: groups.0.clone() });
    }
    Ok(edits)
}

/// Composes a scene that shows a volume: places, frames, colours and lights it. `labels` are ids; `flags` are those of `pumice render`, without
/// their dashes, each with its text.
#[pyfunction]
#[pyo3(signature = (volume, source, size, labels, flags))]
pub(crate) fn figure(
    py: Python<'_>,
    volume: &Bound<'_, Volume>,
    source: PathBuf,
    size: [u32; 2],
    labels: Option<Vec<u64>>,
    flags: Vec<(String, String)>,
) -> PyResult<Scene> {
    let volume = &volume.get().0;
    let mut wishes = FigureFlags::default();
    flags.iter().try_for_each(|(flag, text)| wishes.set(flag, text)).map_err(|e| input(&e))?;
    let dense = |id| {
        let index = volume.labels().index_of(id);
        index.ok_or_else(|| input(&format_args!("labels: the volume has no label {id}")))
    };
    let labels = labels.map(|ids| ids.into_iter().map(dense).collect::<PyResult<Vec<u32>>>()).transpose()?;
    detached(py, || {
        let scene = wishes.figure(volume, source, size, labels).map_err(SessionError::Caller)?;
        scene.validate().map_err(|e| SessionError::Caller(e.to_string()))?;
        Ok::<_, SessionError>(Scene(scene))
    })
}

/// The scenes of a turntable: each is seen from a `count`th of a turn further around the vertical axis.
#[pyfunction]
#[pyo3(signature = (scene, count))]
pub(crate) fn turntable(scene: &Bound<'_, Scene>, count: u32) -> Vec<Scene> {
    let scene = &scene.get().0;
    let angle_rad = |number: u32| std::f64::consts::TAU * f64::from(number) / f64::from(count);
    (0..count).map(|number| Scene(turned(scene, angle_rad(number)))).collect()
}
