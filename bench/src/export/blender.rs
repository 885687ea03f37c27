//! What Blender takes to read a file and to draw its first sample with Cycles.

use std::path::{Path, PathBuf};
use std::time::Instant;

use pumice_core::Job;
use pumice_session::error::{Result, SessionError, io};
use pumice_session::script::{Script, is_blender_program};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::table::Row;
use crate::timing::Took;

/// The script that imports a file and draws it.
const SCRIPT: &str = include_str!("blender.py");

/// Measurements of one file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Imported {
    /// The volume's name.
    pub volume: String,
    /// Name of the form.
    pub form: String,
    /// Ending of the file.
    pub format: String,
    /// Seconds after which it was given up; `None` where it ended.
    pub given_up_after: Option<u32>,
    /// What Blender reports.
    pub report: ImportReport,
}

/// What Blender reports of one file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImportReport {
    /// Blender's version.
    pub version: String,
    /// The import alone.
    pub import: Took,
    /// From there to the first sample.
    pub first_sample: Took,
    /// Objects in the scene.
    pub objects: u64,
    /// Polygons of all meshes.
    pub polygons: u64,
    /// Largest resident set of the process.
    pub peak_rss_bytes: u64,
}

/// Blender, or a Python that has it as a module.
pub(super) struct Blender<'a> {
    program: &'a Path,
    is_blender: bool,
    most_seconds: u32,
}

impl<'a> Blender<'a> {
    pub(super) fn new(program: &'a Path, most_seconds: u32) -> Result<Self> {
        Ok(Self { program, is_blender: is_blender_program(program)?, most_seconds })
    }

    /// Imports a file in a process of its own.
    ///
    /// # Errors
    /// Where Blender fails, but not where it takes too long.
    pub(super) fn measure(&self, file: &Path, scratch: &Path, job: &Job) -> Result<Imported> {
        let [script, asked, report, said] =
            ["blender.py", "blender.json", "imported.json", "said.txt"].map(|name| scratch.join(name));
        std::fs::write(&script, SCRIPT).map_err(io(&script))?;
        let request = json!({ "file": file, "report": report, "most_seconds": self.most_seconds });
        std::fs::write(&asked, request.to_string()).map_err(io(&asked))?;
        let mut imported = Imported {
            format: file.extension().unwrap_or_default().to_string_lossy().into_owned(),
            ..Imported::default()
        };
        let begun = Instant::now();
        let ended =
            Script::start("Blender", self.program, self.is_blender, [&script, &asked], &said)?.finish(job);
        job.check()?;
        match ended {
            Ok(()) => {
                imported.report = report_at(&report)?;
                std::fs::remove_file(&report).map_err(io(&report))?;
            }
            Err(_) if begun.elapsed().as_secs() >= self.most_seconds.into() => {
                imported.given_up_after = Some(self.most_seconds);
            }
            Err(error) => return Err(error),
        }
        Ok(imported)
    }
}

fn report_at(path: &PathBuf) -> Result<ImportReport> {
    let text = std::fs::read(path).map_err(io(path))?;
    serde_json::from_slice(&text).map_err(|e| {
        SessionError::Caller(format!("the report of Blender is not the JSON that was expected: {e}"))
    })
}

impl Row for Imported {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let report = &self.report;
        let cell = |text: String| match self.given_up_after {
            Some(_) => "–".to_owned(),
            None => text,
        };
        let seconds = |took: Took| cell(format!("{:.2} ({:.2})", took.seconds, took.cpu_seconds));
        let import = self.given_up_after.map(|s| format!("not done after {s}"));
        vec![
            ("volume", self.volume.clone()),
            ("form", self.form.clone()),
            ("file", format!(".{}", self.format)),
            ("Blender", cell(report.version.clone())),
            ("import, s (CPU)", import.unwrap_or_else(|| seconds(report.import))),
            ("first sample, s (CPU)", seconds(report.first_sample)),
            ("objects", cell(report.objects.to_string())),
            ("polygons", cell(report.polygons.to_string())),
            ("peak, MB", cell(format!("{:.0}", report.peak_rss_bytes as f64 / 1e6))),
        ]
    }
}
