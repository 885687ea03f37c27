//! Renders a scene to its end, and the resulting picture.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use pumice_core::{CompressedVolume, MeshData};
use pumice_picture::{Image, Matte, Passes};
use pumice_session::render_file::{PictureFormat, Rendered, render_scene};
use pumice_session::{CurvePoint, OpenOptions, SessionError, Stop, with_built_in};
use pumice_transport::LoadedScene;
use pyo3::prelude::*;

use crate::array::{Array, Data};
use crate::errors::input;
use crate::job::{Job, job_of};
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::volume::Volume;
use crate::waiting::released;

/// A finished picture. Row 0 is the top.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct Picture(pub(crate) Rendered);

/// The pixels of an image: (height, width, 3).
pub(crate) fn image(image: &Image) -> Array {
    let values = image.pixels.as_flattened().to_vec();
    Array::new(Data::F32(values), &[image.height, image.width, 3])
}

impl Picture {
    /// (height, width) floats.
    fn plane(&self, values: Option<&Vec<f32>>) -> Option<Array> {
        let color = &self.0.picture.color;
        Some(Array::new(Data::F32(values?.clone()), &[color.height, color.width]))
    }
}

#[pymethods]
impl Picture {
    /// Scene-linear Rec. 709 radiance: (height, width, 3).
    fn color(&self) -> Array {
        image(&self.0.picture.color)
    }

    /// Variance of the colour, per channel; `None` with less than one sample per independent replicate.
    fn variance(&self) -> Option<Array> {
        self.0.picture.variance.as_ref().map(image)
    }

    /// Base colour of the first surface.
    fn albedo(&self) -> Option<Array> {
        self.0.picture.albedo.as_ref().map(image)
    }

    /// Normal of the first surface.
    fn normal(&self) -> Option<Array> {
        self.0.picture.normal.as_ref().map(image)
    }

    /// Share of the samples that hit a surface, for a transparent film: (height, width).
    fn alpha(&self) -> Option<Array> {
        self.plane(self.0.picture.alpha.as_ref())
    }

    /// World position of the first surface.
    fn position(&self) -> Option<Array> {
        self.0.picture.position.as_ref().map(image)
    }

    /// Samples of each pixel: (height, width).
    fn samples(&self) -> Option<Array> {
        self.plane(self.0.picture.samples.as_ref())
    }

    /// Passes of light, by name.
    fn light(&self) -> Vec<(&'static str, Array)> {
        self.0.picture.light.iter().map(|(pass, of)| (pass.name(), image(of))).collect()
    }

    /// Cryptomatte passes, by name: (height, width, ranks, 2) of ids and coverages, and the hash of each name in the picture.
    fn mattes(&self) -> Vec<(&'static str, Array, BTreeMap<String, u32>)> {
        let color = &self.0.picture.color;
        let array = |matte: &Matte| {
            let shape = [color.height, color.width, 2 * matte.layers.len(), 2];
            let pixels = color.pixels.len();
            let values =
                (0..pixels).flat_map(|i| matte.layers.iter().flat_map(move |layer| layer[i])).collect();
            Array::new(Data::F32(values), &shape)
        };
        let named = |m: &Matte| (m.pass.name(), array(m), m.names.clone());
        self.0.picture.mattes.iter().map(named).collect()
    }

    /// Distance along the view axis to the first surface, infinite where there is none: (height, width).
    fn depth(&self) -> Option<Array> {
        self.plane(self.0.picture.depth.as_ref())
    }

    /// Row of the label of the first surface in the label table + 1, 0 where there is none: (height, width).
    fn label(&self) -> Option<Array> {
        let color = &self.0.picture.color;
        let label = self.0.picture.label.clone()?;
        Some(Array::new(Data::U32(label), &[color.height, color.width]))
    }

    /// Seconds, samples, error, curve, what the scene needed and what was left out, as JSON text.
    fn figures(&self) -> PyResult<String> {
        let figures = serde_json::to_value(&self.0.figures).map_err(|e| input(&e))?;
        Ok(serde_json::json!({ "figures": figures, "explanation": self.0.explanation }).to_string())
    }

    /// Writes an EXR or a PNG, which appears complete or not at all.
    #[pyo3(signature = (path, passes))]
    fn save(&self, py: Python<'_>, path: PathBuf, passes: Vec<String>) -> PyResult<()> {
        let passes = Passes::parse(&passes).map_err(|e| input(&e))?;
        released(py, &Arc::default(), || PictureFormat::of(&path)?.write(&path, &self.0.picture, &passes))
    }
}

/// A backend, and the limits at which a picture is done: samples a pixel, seconds, relative error; a `pumice.arguments.RenderAs`.
pub(crate) type RenderAs = (String, Option<u32>, Option<f64>, Option<f64>);

/// Renders a scene until the first limit is reached. `volumes[i]` belongs to its instance i; without volumes its sources are opened.
/// `meshes[i]` belongs to its mesh i.
#[pyfunction]
#[pyo3(signature = (scene, volumes, meshes, how, *, job, on_progress))]
pub(crate) fn render(
    py: Python<'_>,
    scene: &Bound<'_, Scene>,
    volumes: Option<Vec<Bound<'_, Volume>>>,
    meshes: Vec<Bound<'_, Mesh>>,
    how: RenderAs,
    job: Option<&Bound<'_, Job>>,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<Picture> {
    let scene = scene.get().0.clone();
    let volumes: Option<Vec<Arc<CompressedVolume>>> =
        volumes.map(|list| list.iter().map(|v| Arc::clone(&v.get().0)).collect());
    let meshes: Vec<Arc<MeshData>> = meshes.iter().map(|m| Arc::clone(&m.get().0)).collect();
    let job = job_of(job);
    let (backend, spp, seconds, error) = how;
    let stop = Stop { spp, seconds, error };
    let told = Told::new(on_progress);
    let result = released(py, &job, || {
        let volumes = match volumes {
            Some(volumes) => volumes,
            None => pumice_session::open_shown(
                &scene,
                None,
                &OpenOptions::default(),
                pumice_session::Residence::Copied,
                &job,
            )?,
        };
        let meshes = with_built_in(&scene, meshes)?;
        let scene = LoadedScene::new(scene, volumes, meshes)?;
        render_scene(&scene, &backend, &stop, &job, &mut |point| told.tell(&job, point))
    });
    told.result(result)
}

/// A function of the caller that is told the progress of a render, and the exception that it raised.
pub(crate) struct Told {
    call: Option<Py<PyAny>>,
    raised: Mutex<Option<PyErr>>,
}

impl Told {
    pub(crate) fn new(call: Option<Py<PyAny>>) -> Self {
        Self { call, raised: Mutex::new(None) }
    }

    /// Calls the function; an exception cancels the job.
    pub(crate) fn tell(&self, job: &pumice_core::Job, point: &CurvePoint) {
        let Some(call) = &self.call else { return };
        Python::attach(|py| {
            let arguments = (point.spp, point.seconds, point.cpu_seconds, point.error_estimate);
            if let Err(error) = call.call1(py, arguments) {
                *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                job.cancel();
            }
        });
    }

    /// The picture, unless the function or the render failed.
    pub(crate) fn result(self, rendered: PyResult<Rendered>) -> PyResult<Picture> {
        match self.raised.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => rendered.map(Picture),
        }
    }
}

/// The hash of a name in Cryptomatte: MurmurHash3_x86_32 of its UTF-8.
#[pyfunction]
pub(crate) fn cryptomatte_hash(name: &str) -> u32 {
    pumice_picture::cryptomatte::hash(name.as_bytes())
}

/// The backends and devices that can render here, as JSON text.
#[pyfunction]
pub(crate) fn devices() -> PyResult<String> {
    serde_json::to_string(&pumice_session::devices()).map_err(|e| input(&e))
}

/// Panics, to test that a panic becomes an exception.
#[pyfunction]
#[pyo3(name = "_panic_on_purpose")]
#[expect(clippy::panic, reason = "that is what it is for; `released` catches it")]
pub(crate) fn panic_on_purpose(py: Python<'_>) -> PyResult<()> {
    released(py, &Arc::default(), || -> Result<(), SessionError> { panic!("a panic on purpose") })
}
