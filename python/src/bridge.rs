//! What leads to other programs: files of them, and the comparison with Cycles.

use std::path::PathBuf;
use std::sync::Arc;

use pumice_session::render_file::RenderOverrides;
use pumice_session::{
    DetailLevel, ExportRequest, Form, Merging, OpenOptions, Reader, VerifyRenderRequest, export_file,
    verify_render,
};
use pyo3::prelude::*;

use crate::array::Array;
use crate::errors::input;
use crate::job::{Job, job_of};
use crate::picture::image;
use crate::waiting::released;

/// How to export: `ExportAs` of the package.
#[derive(FromPyObject)]
pub(crate) struct ExportAs {
    forms: Vec<String>,
    plain: bool,
    for_blender: bool,
    labels: Option<Vec<u64>>,
    region: Option<[u32; 6]>,
    limit_bytes: u64,
}

/// Writes a volume or a scene file for other programs; returns what was written, as JSON text.
#[pyfunction]
#[pyo3(signature = (path, out, export_as, job=None))]
pub(crate) fn export(
    py: Python<'_>,
    path: PathBuf,
    out: PathBuf,
    export_as: ExportAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<String> {
    let job = job_of(job);
    let ExportAs { forms, plain, for_blender, labels, region, limit_bytes } = export_as;
    let named = |name: &String| {
        let found = Form::ALL.into_iter().find(|form| form.name() == name);
        found.ok_or_else(|| {
            let names = Form::ALL.map(Form::name).join(", ");
            input(&format_args!("form: expected one of {names}, got {name}"))
        })
    };
    let request = ExportRequest {
        input: path,
        out,
        forms: forms.iter().map(named).collect::<PyResult<_>>()?,
        merging: if plain { Merging::Plain } else { Merging::Merged },
        limit_bytes,
        reader: if for_blender { Reader::Blender } else { Reader::Specification },
        labels,
        selected: Vec::new(),
        region: region.map(|[x0, y0, z0, x1, y1, z1]| [[x0, y0, z0], [x1, y1, z1]]),
        reading: OpenOptions::heeding(&job),
    };
    let exported = released(py, &job, || export_file(&request, &mut |_| {}, &job))?;
    serde_json::to_string(&exported).map_err(|e| input(&e))
}

/// How to compare with Cycles: `VerifyAs` of the package.
#[derive(FromPyObject)]
pub(crate) struct VerifyAs {
    blender: PathBuf,
    page: Option<PathBuf>,
    control: Option<PathBuf>,
    spp: u32,
    seconds: Option<f64>,
    size: Option<[u32; 2]>,
    lod: Option<u32>,
    backend: String,
    maps: bool,
}

/// Compares our picture of a scene file with that of Cycles; returns the report as JSON text, and if `maps` the pictures and maps by name,
/// each (height, width, 3). While it runs, the job's fraction is the share of the pictures of the next look.
#[pyfunction]
#[pyo3(name = "verify_render", signature = (path, verify_as, job=None))]
pub(crate) fn verify(
    py: Python<'_>,
    path: PathBuf,
    verify_as: VerifyAs,
    job: Option<&Bound<'_, Job>>,
) -> PyResult<(String, Vec<(&'static str, Array)>)> {
    let job = job_of(job);
    let VerifyAs { blender, page, control, spp, seconds, size, lod, backend, maps } = verify_as;
    let level = match lod {
        None => None,
        Some(1) => Some(DetailLevel::Voxels),
        Some(4) => Some(DetailLevel::Cells),
        Some(16) => Some(DetailLevel::Boxes),
        Some(other) => return Err(input(&format_args!("lod: expected 1, 4 or 16, got {other}"))),
    };
    let command = format!("pumice.verify_render({:?})", path.display());
    let request = VerifyRenderRequest {
        input: path,
        blender,
        control,
        page,
        backend,
        spp,
        seconds,
        level,
        memory_limit: None,
        overrides: RenderOverrides { size, ..RenderOverrides::default() },
        reading: OpenOptions::heeding(&job),
        command,
    };
    let watched = Arc::clone(&job);
    let verified = released(py, &job, || {
        verify_render(&request, &job, &mut |progress| {
            watched.begin(progress.next_look as u64);
            watched.advance(progress.pictures as u64);
        })
    })?;
    let report = serde_json::to_string(&verified).map_err(|e| input(&e))?;
    let named = verified.maps.named().into_iter().filter(|_| maps);
    Ok((report, named.map(|(name, of)| (name, image(of))).collect()))
}
