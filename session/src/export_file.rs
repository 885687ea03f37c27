//! Writes the volumes of a scene for other programs.

use std::path::PathBuf;

use pumice_core::Job;
use pumice_export::usd::{check_name, write_stage};
use pumice_export::{Form, Merging, StageOptions, stage_of_scene};
use pumice_formats::OpenOptions;
use pumice_scene::Scene;
use pumice_transport::LoadedScene;
use serde::Serialize;

use crate::error::{Result, SessionError};
use crate::measure::{Stopwatch, peak_rss_bytes};
use crate::progressive::Stop;
use crate::render_file::prepare::{Prepared, prepare};
use crate::render_file::{RenderOverrides, RenderRequest, Subject};

/// Input, output and options of [`export_file`].
#[derive(Clone, Debug)]
pub struct ExportRequest {
    /// A `.pumice` file, any label volume, or a scene (`.json`).
    pub input: PathBuf,
    /// The file to write; its ending chooses the form: `.usda` or `.usdc`.
    pub out: PathBuf,
    /// Forms of the volumes; the first is the one that programs show.
    pub forms: Vec<Form>,
    /// Whether neighbouring faces become one.
    pub merging: Merging,
    /// Most faces and boxes of all forms together.
    pub most_faces: u64,
    /// Labels to write, by id, instead of those that the scene shows.
    pub labels: Option<Vec<u64>>,
    /// How to read a volume.
    pub reading: OpenOptions,
}

/// What an export wrote.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exported {
    /// Names of the forms.
    pub forms: Vec<&'static str>,
    /// Faces and boxes of all forms together.
    pub faces: u64,
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

/// Exports a volume or a scene.
///
/// # Errors
/// Errors of the input and of the output; [`SessionError::Caller`] for a scene with cuts, whose surface is not written yet;
/// [`pumice_core::Error::Limit`] for more faces than allowed; [`pumice_core::Error::Cancelled`].
pub fn export_file(request: &ExportRequest, job: &Job) -> Result<Exported> {
    let clock = Stopwatch::start();
    check_name(&request.out)?;
    let Prepared { scene, volumes, meshes, .. } = prepare(&as_render(request), job)?;
    if !scene.cuts.is_empty() {
        let input = request.input.display();
        return Err(SessionError::Caller(format!(
            "{input}: cuts: the surface of cut volumes cannot be exported yet"
        )));
    }
    // The camera and the light of a volume's own picture are nobody's work.
    let is_scene = request.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let left_out = if is_scene { left_out(&scene) } else { Vec::new() };
    let loaded = LoadedScene::new(scene, volumes, meshes)?;
    let options = StageOptions {
        forms: request.forms.clone(),
        merging: request.merging,
        most_faces: request.most_faces,
    };
    let (stage, faces) = stage_of_scene(&loaded, &options, job)?;
    let bytes = write_stage(&stage, &request.out, job)?;
    Ok(Exported {
        forms: request.forms.iter().map(|form| form.name()).collect(),
        faces,
        bytes,
        left_out,
        seconds: clock.seconds(),
        cpu_seconds: clock.cpu_seconds(),
        peak_rss_bytes: peak_rss_bytes(),
    })
}

/// A request to render the same, which opens the same scene.
fn as_render(request: &ExportRequest) -> RenderRequest {
    RenderRequest {
        subject: Subject::File(request.input.clone()),
        out: request.out.clone(),
        backend: "cpu".into(),
        stop: Stop::default(),
        passes: Vec::new(),
        overrides: RenderOverrides { labels: request.labels.clone(), ..RenderOverrides::default() },
        reading: request.reading.clone(),
        threads: None,
        save_scene: None,
        explain: false,
    }
}

fn left_out(scene: &Scene) -> Vec<String> {
    let counted = |count: usize, [one, several]: [&str; 2]| match count {
        0 => None,
        1 => Some(format!("a {one}")),
        n => Some(format!("{n} {several}")),
    };
    [
        Some("the camera".into()),
        Some("the world".into()),
        counted(scene.suns.len(), ["sun", "suns"]),
        counted(scene.lights.len(), ["lamp", "lamps"]),
        counted(scene.meshes.len(), ["mesh", "meshes"]),
    ]
    .into_iter()
    .flatten()
    .collect()
}
