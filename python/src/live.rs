//! A live picture: a Rust worker thread refines it, and Python takes frames. No Rust thread ever calls Python.

use std::sync::Arc;

use pumice_core::Job as CoreJob;
use pumice_scene::{Instance, Mesh as SceneMesh, SceneEdit};
use pumice_session::live::{Live, LiveOptions};
use pumice_session::{SessionError, Stop, with_built_in};
use pumice_transport::{LoadedEdit, LoadedScene};
use pyo3::prelude::*;

use crate::array::{Array, Data};
use crate::calls::Call;
use crate::errors::{IntoException, input};
use crate::forked::OfProcess;
use crate::frame::Frame;
use crate::job::{Job, job_of};
use crate::labels::{LabelGroups, Visible};
use crate::mesh::Mesh;
use crate::picture::{RenderAs, opened_sources};
use crate::scene::{Scene, label_edits};
use crate::volume::Volume;
use crate::waiting::released;

/// A live, progressively refined picture.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct Session(OfProcess<Live>);

impl Session {
    fn live(&self) -> PyResult<&Live> {
        self.0.get("live picture")
    }
}

#[pymethods]
impl Session {
    /// Starts the worker. `volumes[i]` belongs to the scene's instance i; without volumes its sources are opened, and with a limit drawn from
    /// disk. `meshes[i]` belongs to its mesh i. `how`: a `pumice.arguments.RenderAs`.
    #[new]
    #[pyo3(signature = (scene, volumes, meshes, how, *, denoise, memory_limit, job))]
    #[allow(clippy::too_many_arguments, reason = "the keywords of the façade")]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, Scene>,
        volumes: Option<Vec<Bound<'_, Volume>>>,
        meshes: Vec<Bound<'_, Mesh>>,
        how: RenderAs,
        denoise: bool,
        memory_limit: Option<u64>,
        job: Option<&Bound<'_, Job>>,
    ) -> PyResult<Self> {
        let meshes = meshes.iter().map(|m| Arc::clone(&m.get().0)).collect();
        let scene = scene.get().0.clone();
        let volumes = match volumes {
            Some(volumes) => volumes.iter().map(|v| Arc::clone(&v.get().0)).collect(),
            None => opened_sources(py, &scene, memory_limit, &job_of(job))?,
        };
        let meshes = with_built_in(&scene, meshes).map_err(IntoException::into_exception)?;
        let scene = LoadedScene::new(scene, volumes, meshes).map_err(IntoException::into_exception)?;
        let (backend, spp, seconds, error) = how;
        let options = LiveOptions { backend, stop: Stop { spp, seconds, error }, denoise };
        let live = Live::start(scene, options).map_err(IntoException::into_exception)?;
        Ok(Self(OfProcess::new(live)))
    }

    /// Applies a list of edits in JSON, all or none; returns the new revision.
    fn edit(&self, edits: &str) -> PyResult<u64> {
        let edits = SceneEdit::list_from_json(edits).map_err(IntoException::into_exception)?;
        self.live()?.edit(edits).map_err(IntoException::into_exception)
    }

    /// Sets which labels of an instance are drawn, and the groups of its labels; returns the new revision.
    #[pyo3(signature = (id, visible, groups))]
    fn set_labels(
        &self,
        py: Python<'_>,
        id: u32,
        visible: Option<Visible>,
        groups: Option<&LabelGroups>,
    ) -> PyResult<u64> {
        let edits = label_edits(py, id, visible, groups)?;
        self.live()?.edit(edits).map_err(IntoException::into_exception)
    }

    /// Adds an instance in JSON with its volume, or replaces the one with the same id; returns the new revision.
    fn add(&self, instance: &str, volume: &Bound<'_, Volume>) -> PyResult<u64> {
        let instance: Instance =
            serde_json::from_str(instance).map_err(|e| input(&format_args!("instance: {e}")))?;
        let added = LoadedEdit::Add { instance: Box::new(instance), volume: Arc::clone(&volume.get().0) };
        self.live()?.edit(vec![added]).map_err(IntoException::into_exception)
    }

    /// Adds a mesh in JSON with its triangles, or replaces the one with the same id; returns the new revision.
    fn add_mesh(&self, mesh: &str, data: &Bound<'_, Mesh>) -> PyResult<u64> {
        let mesh: SceneMesh = serde_json::from_str(mesh).map_err(|e| input(&format_args!("mesh: {e}")))?;
        let added = LoadedEdit::AddMesh { mesh: Box::new(mesh), data: Arc::clone(&data.get().0) };
        self.live()?.edit(vec![added]).map_err(IntoException::into_exception)
    }

    /// The newest frame if its serial is above `after`, else `None`; never waits.
    fn latest(&self, py: Python<'_>, after: u64) -> PyResult<Option<Frame>> {
        self.live()?.latest(after).map(|frame| Frame::new(py, frame)).transpose()
    }

    /// (instance id, label id, name, voxel, depth) under the centre of a pixel, counted from the upper left.
    #[allow(clippy::type_complexity, reason = "a tuple for the façade, which names its parts")]
    fn pick(&self, py: Python<'_>, x: u32, y: u32) -> PyResult<Option<(u32, u64, String, [u32; 3], f64)>> {
        let live = self.live()?;
        let found = released(py, &Arc::<CoreJob>::default(), || {
            let Some(pick) = live.pick(x, y)? else { return Ok(None) };
            let scene = live.scene();
            let Some(instance) = scene.instances.get(pick.instance as usize) else { return Ok(None) };
            let Some(volume) = live.volume(instance.id) else { return Ok(None) };
            let label = volume.labels().ids()[pick.label as usize];
            let name = volume.note(pick.label).and_then(|n| n.name.clone()).unwrap_or_default();
            Ok::<_, SessionError>(Some((instance.id, label, name, pick.voxel, pick.depth)))
        })?;
        Ok(found)
    }

    /// The revision of which the label film was made, its pixels and its depth: (height, width, 2) of the id of the instance or mesh and the
    /// row in the label table + 1, 0 where there is none, and (height, width) of world units along the view axis, infinite where there is
    /// nothing; row 0 at the top. `None` while the worker makes it; never waits.
    fn label_film(&self) -> PyResult<Option<(u64, Array, Array)>> {
        let Some(film) = self.live()?.label_film() else { return Ok(None) };
        let [height, width] = [film.height as usize, film.width as usize];
        let pixels = Array::new(Data::Labels(Arc::clone(&film)), &[height, width, 2]);
        Ok(Some((film.revision, pixels, Array::new(Data::Depth(film), &[height, width]))))
    }

    /// (state, error, revision, backend, device, backend that compiles, notices, counters, pages as JSON text).
    #[allow(clippy::type_complexity, reason = "a tuple for the façade, which names its parts")]
    fn status(
        &self,
    ) -> PyResult<(
        &'static str,
        Option<String>,
        u64,
        &'static str,
        String,
        Option<&'static str>,
        Vec<String>,
        std::collections::BTreeMap<String, u64>,
        Option<String>,
    )> {
        let s = self.live()?.status();
        let pages = s.pages.map(|pages| serde_json::to_string(&pages)).transpose().map_err(|e| input(&e))?;
        let state = s.state.name();
        Ok((state, s.error, s.revision, s.backend, s.device, s.compiling, s.notices, s.counters, pages))
    }

    /// The scene as it is now.
    fn scene(&self) -> PyResult<Scene> {
        Ok(Scene(self.live()?.scene()))
    }

    /// Stops the worker and waits until it ends its current slice.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        let live = self.live()?;
        // While the interpreter shuts down, it must not be released to wait, so it stays held.
        match Call::begin(&Arc::default()) {
            Ok(_call) => py.detach(|| live.stop()),
            Err(_) => live.stop(),
        }
        Ok(())
    }

    /// Makes the worker panic, for tests that clients survive it.
    fn _panic_on_purpose(&self) -> PyResult<()> {
        self.live()?.panic_on_purpose();
        Ok(())
    }
}
