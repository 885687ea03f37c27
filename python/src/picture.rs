//! Renders a scene to its end, and the resulting picture.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use pumice_core::{CompressedVolume, MeshData};
use pumice_picture::{Image, Matte, Passes, display_pixels, read_exr};
use pumice_session::annotations::lay_out;
use pumice_session::pick_pixels::{find_voxel, pick};
use pumice_session::render_file::{PictureFormat, PicturePaths, Rendered, render_and_denoise, set_width};
use pumice_session::{
    Annotations, CurvePoint, DEFAULT_DPI, DenoiserName, Filter, OpenOptions, Residence, ScaleBar,
    SessionError, Stop, pixels_of_mm, with_built_in,
};
use pumice_transport::LoadedScene;
use pyo3::prelude::*;

use crate::array::{Array, Data};
use crate::errors::{IntoException, input};
use crate::job::{Job, job_of};
use crate::mesh::Mesh;
use crate::scene::{Scene, paths_of};
use crate::volume::Volume;
use crate::waiting::{detached, released};

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

    /// (height, width) whole numbers.
    fn whole(&self, values: Vec<u32>) -> Array {
        let color = &self.0.picture.color;
        Array::new(Data::U32(values), &[color.height, color.width])
    }
}

#[pymethods]
impl Picture {
    /// Scene-linear Rec. 709 radiance: (height, width, 3).
    fn color(&self) -> Array {
        image(&self.0.picture.color)
    }

    /// The mean of the samples, where the colour is denoised.
    fn noisy(&self) -> Option<Array> {
        self.0.picture.noisy.as_ref().map(image)
    }

    /// Variance of the mean of the samples, per channel; `None` with less than one sample for each of four classes.
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
        Some(self.whole(self.0.picture.label.clone()?))
    }

    /// Id of the instance of that label, 0 where there is none, in a scene of several: (height, width).
    fn instance(&self) -> Option<Array> {
        Some(self.whole(self.0.picture.instance.clone()?))
    }

    /// Id of the label of each pixel, 0 where there is none: (height, width).
    fn label_ids(&self, py: Python<'_>) -> PyResult<Array> {
        let ids = detached(py, || self.0.picture.label_ids().map_err(SessionError::Caller))?;
        let color = &self.0.picture.color;
        Ok(Array::new(Data::U64(ids), &[color.height, color.width]))
    }

    /// Id of the instance of each pixel's label, 0 where there is none: (height, width).
    fn instance_ids(&self, py: Python<'_>) -> PyResult<Array> {
        let ids = detached(py, || self.0.picture.instance_ids().map_err(SessionError::Caller))?;
        Ok(self.whole(ids))
    }

    /// What lies under a pixel, as JSON text; its voxel with the volume that is seen there.
    #[pyo3(signature = (x, y, volume))]
    fn pick(&self, py: Python<'_>, x: u32, y: u32, volume: Option<&Bound<'_, Volume>>) -> PyResult<String> {
        let volume = volume.map(|v| Arc::clone(&v.get().0));
        let picture = &self.0.picture;
        let picked = detached(py, || {
            let mut picked = pick(picture, x, y).map_err(SessionError::Caller)?;
            if let Some(volume) = volume {
                picked.voxel = find_voxel(picture, &picked, &volume)?;
            }
            Ok::<_, SessionError>(picked)
        })?;
        serde_json::to_string(&picked).map_err(|e| input(&e))
    }

    /// The bytes that a PNG has, shown by a view transform or that of the scene: (height, width, 3), or 4 with alpha.
    #[pyo3(signature = (view))]
    fn display(&self, py: Python<'_>, view: Option<&str>) -> PyResult<Array> {
        let picture = &self.0.picture;
        let view = match view {
            None => picture.provenance.as_ref().map(|p| p.scene.film.view_transform).unwrap_or_default(),
            Some(name) => serde_json::from_value(name.into()).map_err(|_| {
                input(&format_args!("view_transform: expected standard, filmic or agx, got {name:?}"))
            })?,
        };
        let background = picture.provenance.as_ref().and_then(|p| p.scene.film.background);
        let bytes = detached(py, || display_pixels(picture, view, background))?;
        let channels = 3 + usize::from(picture.alpha.is_some() && background.is_none());
        Ok(Array::new(Data::U8(bytes), &[picture.color.height, picture.color.width, channels]))
    }

    /// The part of each pixel that some names of a Cryptomatte pass cover together: (height, width).
    fn matte(&self, py: Python<'_>, kind: &str, names: Vec<String>) -> PyResult<Array> {
        let picture = &self.0.picture;
        let matte = picture.mattes.iter().find(|m| m.pass.name() == kind).ok_or_else(|| {
            input(&format_args!(
                "matte: expected a picture that was rendered with the pass {kind}, got one without"
            ))
        })?;
        let coverage = detached(py, || Ok::<_, SessionError>(matte.coverage(&names)))?;
        Ok(Array::new(Data::F32(coverage), &[picture.color.height, picture.color.width]))
    }

    /// Seconds, samples, error, curve, what the scene needed and what was left out, as JSON text.
    fn figures(&self) -> PyResult<String> {
        let figures = serde_json::to_value(&self.0.figures).map_err(|e| input(&e))?;
        Ok(serde_json::json!({ "figures": figures, "explanation": self.0.explanation }).to_string())
    }

    /// Writes an EXR or a PNG, which appears complete or not at all; with `no_paths` it does not tell where its sources are.
    #[pyo3(signature = (path, passes, no_paths))]
    fn save(&self, py: Python<'_>, path: PathBuf, passes: Vec<String>, no_paths: bool) -> PyResult<()> {
        let passes = Passes::parse(&passes).map_err(|e| input(&e))?;
        let paths = if no_paths { PicturePaths::None } else { PicturePaths::Relative };
        released(py, &Arc::default(), || {
            PictureFormat::of(&path)?.write(&path, &self.0.picture, &passes, paths)
        })
    }

    /// The files that the picture names, each with its field in the scene.
    fn paths(&self) -> Vec<(String, PathBuf)> {
        self.0.picture.provenance.as_ref().map(|made| paths_of(&made.scene)).unwrap_or_default()
    }
}

/// A backend, and the limits at which a picture is done: samples a pixel, seconds, relative error; a `pumice.arguments.RenderAs`.
pub(crate) type RenderAs = (String, Option<u32>, Option<f64>, Option<f64>);

/// What is drawn over a picture: `AnnotateAs` of the package.
#[derive(FromPyObject)]
pub(crate) struct AnnotateAs {
    width_mm: Option<f64>,
    dpi: Option<f64>,
    scale_bar: Option<String>,
    scale_bar_corner: String,
    legend: Option<u32>,
}

impl AnnotateAs {
    fn annotations(&self) -> PyResult<Annotations> {
        let scale_bar = self.scale_bar.as_ref().map(|text| text.parse::<ScaleBar>()).transpose();
        let scale_bar_corner = self.scale_bar_corner.parse();
        Ok(Annotations {
            dpi: self.dpi.or(self.width_mm.map(|_| DEFAULT_DPI)),
            scale_bar: scale_bar.map_err(|e| input(&format_args!("scale_bar: {e}")))?,
            scale_bar_corner: scale_bar_corner
                .map_err(|e: String| input(&format_args!("scale_bar_corner: {e}")))?,
            legend: self.legend,
        })
    }
}

/// Renders a scene until the first limit is reached. `volumes[i]` belongs to its instance i; without volumes its sources are opened.
/// `meshes[i]` belongs to its mesh i.
#[pyfunction]
#[pyo3(signature = (scene, volumes, meshes, how, annotate, *, denoise, memory_limit, job, on_progress))]
#[allow(clippy::too_many_arguments, reason = "the keywords of the façade")]
pub(crate) fn render(
    py: Python<'_>,
    scene: &Bound<'_, Scene>,
    volumes: Option<Vec<Bound<'_, Volume>>>,
    meshes: Vec<Bound<'_, Mesh>>,
    how: RenderAs,
    annotate: AnnotateAs,
    denoise: Option<&str>,
    memory_limit: Option<u64>,
    job: Option<&Bound<'_, Job>>,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<Picture> {
    let mut scene = scene.get().0.clone();
    let annotations = annotate.annotations()?;
    if let Some(width_mm) = annotate.width_mm {
        set_width(&mut scene.film, pixels_of_mm(width_mm, annotations.dpi.unwrap_or(DEFAULT_DPI)) as u32);
    }
    let volumes: Option<Vec<Arc<CompressedVolume>>> =
        volumes.map(|list| list.iter().map(|v| Arc::clone(&v.get().0)).collect());
    let meshes: Vec<Arc<MeshData>> = meshes.iter().map(|m| Arc::clone(&m.get().0)).collect();
    let job = job_of(job);
    let (backend, spp, seconds, error) = how;
    let stop = Stop { spp, seconds, error };
    let filter = filter_of(denoise)?;
    let told = Told::new(on_progress);
    let result = released(py, &job, || {
        let volumes = match volumes {
            Some(volumes) => volumes,
            None => open_sources(&scene, memory_limit, &job)?,
        };
        let meshes = with_built_in(&scene, meshes)?;
        let scene = LoadedScene::new(scene, volumes, meshes)?;
        let laid_out = lay_out(&scene, &annotations)?;
        let mut rendered = render_and_denoise(&scene, &backend, &stop, filter, &job, &mut |point| {
            told.tell(&job, point);
        })?;
        laid_out.apply(&mut rendered);
        Ok::<_, SessionError>(rendered)
    });
    told.result(result)
}

/// The filter that a caller names, ready for use.
pub(crate) fn filter_of(denoise: Option<&str>) -> PyResult<Option<Filter>> {
    let Some(name) = denoise else { return Ok(None) };
    let name: DenoiserName = name.parse().map_err(|e: String| input(&format_args!("denoise: {e}")))?;
    name.filter().map(Some).map_err(IntoException::into_exception)
}

/// The volumes of a scene, in its order: copied, or from disk within a limit.
fn open_sources(
    scene: &pumice_scene::Scene,
    memory_limit: Option<u64>,
    job: &pumice_core::Job,
) -> Result<Vec<Arc<CompressedVolume>>, SessionError> {
    let residence = match memory_limit {
        None => Residence::Copied,
        limit => Residence::within(limit),
    };
    pumice_session::open_shown(scene, None, &OpenOptions::heeding(job), residence, job)
}

/// As `open_sources`, without the interpreter.
pub(crate) fn opened_sources(
    py: Python<'_>,
    scene: &pumice_scene::Scene,
    memory_limit: Option<u64>,
    job: &Arc<pumice_core::Job>,
) -> PyResult<Vec<Arc<CompressedVolume>>> {
    released(py, job, || open_sources(scene, memory_limit, job))
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

/// Reads a picture from an OpenEXR file.
#[pyfunction]
pub(crate) fn read_picture(py: Python<'_>, path: PathBuf) -> PyResult<Picture> {
    released(py, &Arc::default(), || Ok::<_, SessionError>(Picture(Rendered::of_file(read_exr(&path)?))))
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
