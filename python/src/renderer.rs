//! A renderer that Python keeps from one picture to the next, and whose picture grows while it renders.

use std::collections::BTreeMap;
use std::sync::Arc;

use pumice_core::{CompressedVolume, MeshData};
use pumice_session::{PersistentRenderer, Stop, Watching, with_built_in};
use pumice_transport::LoadedScene;
use pyo3::prelude::*;

use crate::errors::IntoException;
use crate::forked::OfProcess;
use crate::frame::Frame;
use crate::job::{Job, job_of};
use crate::mesh::Mesh;
use crate::picture::{Picture, Told, filter_of};
use crate::scene::Scene;
use crate::volume::Volume;
use crate::waiting::released;

/// Limits at which a picture is done: samples a pixel, seconds, relative error.
type Limits = (Option<u32>, Option<f64>, Option<f64>);

/// A renderer that is kept from one picture to the next.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct Renderer(OfProcess<PersistentRenderer>);

impl Renderer {
    fn renderer(&self) -> PyResult<&PersistentRenderer> {
        self.0.get("renderer")
    }
}

#[pymethods]
impl Renderer {
    /// A renderer on the backend of this name.
    #[new]
    fn new(backend: &str) -> PyResult<Self> {
        let renderer = PersistentRenderer::new(backend).map_err(IntoException::into_exception)?;
        Ok(Self(OfProcess::new(renderer)))
    }

    /// The newest frame of the picture that is rendered now, if its serial is above `after`; never waits.
    fn latest(&self, py: Python<'_>, after: u64) -> PyResult<Option<Frame>> {
        self.renderer()?.latest(after).map(|frame| Frame::new(py, frame)).transpose()
    }

    /// The newest picture so far with all its passes, of what is rendered now, if it was not taken before; never waits.
    fn take_so_far(&self) -> PyResult<Option<Picture>> {
        Ok(self.renderer()?.take_so_far().map(Picture))
    }

    /// How often each kind of data was built, by name; waits for a picture that is being rendered.
    fn rebuilt(&self, py: Python<'_>) -> PyResult<BTreeMap<&'static str, u64>> {
        let renderer = self.renderer()?;
        Ok(py.detach(|| renderer.rebuilt()).into_iter().collect())
    }

    /// Renders a scene until the first limit is reached. `watching`: whether frames are published, whether pictures so far are
    /// made with all passes, and whether a cancelled render returns its picture so far.
    #[pyo3(signature = (scene, volumes, meshes, limits, watching, *, denoise, job, on_progress))]
    #[expect(clippy::too_many_arguments, reason = "the façade's keywords")]
    fn render(
        &self,
        py: Python<'_>,
        scene: &Bound<'_, Scene>,
        volumes: Vec<Bound<'_, Volume>>,
        meshes: Vec<Bound<'_, Mesh>>,
        limits: Limits,
        watching: (bool, bool, bool),
        denoise: Option<&str>,
        job: Option<&Bound<'_, Job>>,
        on_progress: Option<Py<PyAny>>,
    ) -> PyResult<Picture> {
        let renderer = self.renderer()?;
        let scene = scene.get().0.clone();
        let volumes: Vec<Arc<CompressedVolume>> = volumes.iter().map(|v| Arc::clone(&v.get().0)).collect();
        let meshes: Vec<Arc<MeshData>> = meshes.iter().map(|m| Arc::clone(&m.get().0)).collect();
        let job = job_of(job);
        let (spp, seconds, error) = limits;
        let stop = Stop { spp, seconds, error };
        let (growing, passes, unfinished) = watching;
        let denoise = filter_of(denoise)?;
        let told = Told::new(on_progress);
        let rendered = released(py, &job, || {
            let meshes = with_built_in(&scene, meshes)?;
            let scene = LoadedScene::new(scene, volumes, meshes)?;
            let watching = Watching { growing, passes, unfinished, denoise };
            renderer.render(&scene, &stop, &job, watching, &mut |point| told.tell(&job, point))
        });
        told.result(rendered)
    }
}
