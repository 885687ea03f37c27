//! Writes a volume or a scene for other programs.

use std::path::PathBuf;

use pumice_core::Job;
use pumice_export::{
    ExportOptions, ExportSize, FileFormat, Form, Merging, Reader, VoxelRegion, export_scene, left_out_of,
};
use pumice_formats::OpenOptions;
use pumice_transport::LoadedScene;
use serde::Serialize;

use crate::error::{Result, SessionError};
use crate::figure::{FigureFlags, Selector};
use crate::measure::{Stopwatch, peak_rss_bytes};
use crate::open::Residence;
use crate::render_file::RenderOverrides;
use crate::render_file::open_scene::{OpenedScene, brings_scene, open_in_place, open_scene};

/// Input, output and options of [`export_file`].
#[derive(Clone, Debug)]
pub struct ExportRequest {
    /// A `.pumice` file, any label volume, or a scene (`.json`).
    pub input: PathBuf,
    /// The file to write; its ending chooses the format ([`FileFormat`]).
    pub out: PathBuf,
    /// Forms of the volumes; the first is the one that programs show.
    pub forms: Vec<Form>,
    /// Whether neighbouring faces become one.
    pub merging: Merging,
    /// Bytes that the file may take, as estimated while its faces are found.
    pub limit_bytes: u64,
    /// The program whose reading of the format is followed.
    pub reader: Reader,
    /// Labels to write, by id, instead of those that the scene shows.
    pub labels: Option<Vec<u64>>,
    /// The same by names and queries, where labels are not given by id alone.
    pub selected: Vec<Selector>,
    /// Voxels of each volume outside of which nothing is written: the lowest, and the one beyond the highest; none for all.
    pub region: Option<[[u32; 3]; 2]>,
    /// How to read a volume.
    pub reading: OpenOptions,
}

/// What an export wrote.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exported {
    /// Names of the forms.
    pub forms: Vec<&'static str>,
    /// Faces of all forms together, and triangles of meshes.
    pub faces: u64,
    /// Boxes of the form `instances`.
    pub boxes: u64,
    /// Bytes of the file.
    pub bytes: u64,
    /// What the scene has and the file has not.
    pub left_out: Vec<String>,
    /// Wall seconds.
    pub seconds: f64,
    /// CPU seconds of all threads.
    pub cpu_seconds: f64,
    /// Largest resident set of the process, where the system reports it.
    pub peak_rss_bytes: Option<u64>,
}

/// Exports a volume or a scene. `tell` hears how much it is before writing begins.
///
/// # Errors
/// Errors of the input and of the output; [`SessionError::Caller`] for a reader that the format knows nothing of;
/// [`pumice_core::Error::Caller`] for a region that is empty or reaches beyond a volume;
/// [`pumice_core::Error::Limit`] for a file that would be larger than allowed; [`pumice_core::Error::Cancelled`].
pub fn export_file(request: &ExportRequest, tell: &mut dyn FnMut(ExportSize), job: &Job) -> Result<Exported> {
    let clock = Stopwatch::start();
    let format = FileFormat::of(&request.out)?;
    format.check_forms(&request.forms)?;
    request.reading.outputs.declare(&request.out)?;
    let region = request.region.map(|[low, high]| VoxelRegion::new(low, high)).transpose()?;
    if request.reader != Reader::Specification && !format.is_usd() {
        let ending = format.ending();
        return Err(SessionError::Caller(format!(
            "for blender: a .{ending} file is the same for every program"
        )));
    }
    if request.merging == Merging::Plain
        && request.forms.iter().all(|form| matches!(form, Form::Instances | Form::Smooth))
    {
        let forms = request.forms.iter().map(|form| form.name()).collect::<Vec<_>>().join(", ");
        return Err(SessionError::Caller(format!(
            "--plain: the form {forms} has no merged faces; boxes, cells4 and voxels have"
        )));
    }
    // The camera and the light of a volume's own picture are nobody's work.
    let surroundings = brings_scene(&request.input);
    let figure = FigureFlags { labels: request.selected.clone(), ..FigureFlags::default() };
    let overrides = RenderOverrides { labels: request.labels.clone(), figure, ..RenderOverrides::default() };
    let residence = Residence::Mapped;
    let opened = match surroundings {
        true => open_scene(&request.input, &overrides, &request.reading, residence, job)?,
        false => open_in_place(&request.input, &overrides, &request.reading, residence, job)?,
    };
    let OpenedScene { scene, volumes, meshes } = opened;
    let left_out = left_out_of(&scene, format, &request.forms, surroundings);
    let loaded = LoadedScene::new(scene, volumes, meshes)?;
    let options = ExportOptions {
        forms: request.forms.clone(),
        merging: request.merging,
        limit_bytes: request.limit_bytes,
        surroundings,
        reader: request.reader,
        region,
    };
    let size = export_scene(&loaded, &options, &request.out, tell, job)?;
    Ok(Exported {
        forms: request.forms.iter().map(|form| form.name()).collect(),
        faces: size.faces,
        boxes: size.boxes,
        bytes: size.bytes,
        left_out,
        seconds: clock.seconds(),
        cpu_seconds: clock.cpu_seconds(),
        peak_rss_bytes: peak_rss_bytes(),
    })
}
