//! Scenes. Python writes them as dictionaries; only `pumice_scene` defines and checks their fields.

use std::path::PathBuf;

use pumice_scene::Scene as CoreScene;
use pumice_scene::{SceneEdit, SceneError};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::reading::recorded;
use pumice_session::selection::select_labels;
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
        let said = recorded(&reading(read_as)?);
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

/// Composes a scene that shows a volume: places, frames and lights it.
#[pyfunction]
#[pyo3(signature = (volume, source, size, labels, pick, view_deg))]
pub(crate) fn figure(
    py: Python<'_>,
    volume: &Bound<'_, Volume>,
    source: PathBuf,
    size: [u32; 2],
    labels: Option<Vec<u64>>,
    pick: Option<usize>,
    view_deg: [f64; 2],
) -> PyResult<Scene> {
    let volume = &volume.get().0;
    let table = volume.labels();
    let labels = match labels {
        None => None,
        Some(_) if pick.is_some() => return Err(input(&"give labels or pick, not both")),
        Some(ids) => {
            let dense = |id| {
                table.index_of(id).ok_or_else(|| input(&format_args!("labels: the volume has no label {id}")))
            };
            Some(ids.into_iter().map(dense).collect::<PyResult<Vec<u32>>>()?)
        }
    };
    detached(py, || {
        let labels = labels.or_else(|| pick.map(|n| select_labels(volume, n)));
        let scene = compose(volume, source, &FigureOptions { size, labels, view_deg });
        scene.validate()?;
        Ok::<_, SceneError>(Scene(scene))
    })
}
