//! Other writers of USD: Pixar's library in Python, and the crate openusd. They get the arrays of the `.usdc` that Pumice wrote.

use std::path::{Path, PathBuf};

use pumice_core::Job;
use pumice_session::Form;
use pumice_session::error::{Result, SessionError, io};
use pumice_session::script::run_script;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::{ExportBenchOptions, WrittenRow, remove};
use crate::timing::Took;

/// The script that reads and writes with usd-core.
const SCRIPT: &str = include_str!("usd.py");

/// Version of the crate that `bench/openusd` names in its manifest.
const OPENUSD: &str = "openusd 0.8.0";

#[derive(Deserialize)]
struct Packages {
    version: Option<String>,
}

#[derive(Deserialize)]
struct Nothing {}

#[derive(Deserialize)]
struct Checked {
    differing: Option<String>,
}

#[derive(Deserialize)]
struct Report {
    #[serde(flatten)]
    took: Took,
    peak_rss_bytes: Option<u64>,
}

/// The writers that the options name.
pub(super) struct Peers<'a> {
    options: &'a ExportBenchOptions,
    folder: PathBuf,
    /// usd-core with its version; empty where there is no Python.
    usd_core: String,
}

impl<'a> Peers<'a> {
    /// Asks the Python for its library.
    ///
    /// # Errors
    /// Where it has none.
    pub(super) fn new(options: &'a ExportBenchOptions, scratch: &Path, job: &Job) -> Result<Self> {
        let folder = scratch.join("peers");
        std::fs::create_dir(&folder).map_err(io(&folder))?;
        let script = folder.join("usd.py");
        std::fs::write(&script, SCRIPT).map_err(io(&script))?;
        let mut peers = Self { options, folder, usd_core: String::new() };
        if let Some(python) = &options.python {
            let found: Packages =
                peers.ask("usd-core", python, &script, json!({ "task": "packages" }), job)?;
            let version = found.version.ok_or_else(|| {
                SessionError::Caller(format!(
                    "{}: usd-core and numpy are missing: pip install usd-core numpy, or --without usd-core",
                    python.display()
                ))
            })?;
            peers.usd_core = format!("usd-core {version}");
        }
        Ok(peers)
    }

    /// Writes the arrays of a stage with each writer, as text and as crate files, and compares what they wrote.
    ///
    /// # Errors
    /// Errors of the programs; a file that has other arrays.
    pub(super) fn measure(
        &self,
        volume: &str,
        form: Form,
        stage: &Path,
        job: &Job,
        watch: &mut dyn FnMut(&str),
    ) -> Result<Vec<WrittenRow>> {
        let Some(python) = &self.options.python else { return Ok(Vec::new()) };
        let script = self.folder.join("usd.py");
        let arrays = self.folder.join("ARRAYS.json");
        let request = json!({ "task": "arrays", "stage": stage, "folder": self.folder });
        let Nothing {} = self.ask("usd-core", python, &script, request, job)?;
        let mut writers = vec![(self.usd_core.as_str(), python, &script)];
        writers.extend(self.options.openusd.iter().map(|program| (OPENUSD, program, &arrays)));
        let mut rows = Vec::new();
        for (writer, program, first) in writers {
            for format in ["usda", "usdc"] {
                watch(&format!("{volume}, {}, .{format} by {writer}", form.name()));
                let out = self.folder.join(format!("o.{format}"));
                let mut best: Option<Report> = None;
                for _ in 0..self.options.rounds {
                    remove(&out)?;
                    let request = json!({ "task": "write", "arrays": arrays, "out": out });
                    let report: Report = self.ask(writer, program, first, request, job)?;
                    best = Some(match best {
                        None => report,
                        Some(best) => Report {
                            took: best.took.least(report.took),
                            peak_rss_bytes: best.peak_rss_bytes.max(report.peak_rss_bytes),
                        },
                    });
                }
                let best =
                    best.ok_or_else(|| SessionError::Caller("--rounds: expected at least 1".into()))?;
                let request = json!({ "task": "check", "arrays": arrays, "out": out });
                let checked: Checked = self.ask("usd-core", python, &script, request, job)?;
                if let Some(attribute) = checked.differing {
                    return Err(SessionError::Caller(format!(
                        "{volume}, {}, .{format}: {writer} wrote another {attribute} than it was given",
                        form.name()
                    )));
                }
                let bytes = std::fs::metadata(&out).map_err(io(&out))?.len();
                remove(&out)?;
                rows.push(WrittenRow {
                    volume: volume.into(),
                    form: form.name().into(),
                    format: format.into(),
                    writer: writer.into(),
                    faces: 0,
                    boxes: 0,
                    bytes,
                    prepare: None,
                    write: best.took,
                    peak_rss_bytes: best.peak_rss_bytes,
                });
            }
        }
        Ok(rows)
    }

    /// Runs a program with a file and a request, and returns its report.
    fn ask<T: DeserializeOwned>(
        &self,
        what: &str,
        program: &Path,
        first: &Path,
        mut request: Value,
        job: &Job,
    ) -> Result<T> {
        let [asked, report, said] =
            ["job.json", "report.json", "said.txt"].map(|name| self.folder.join(name));
        request["report"] = json!(report);
        std::fs::write(&asked, request.to_string()).map_err(io(&asked))?;
        run_script(what, program, first, &asked, &said, job)?;
        let text = std::fs::read(&report).map_err(io(&report))?;
        serde_json::from_slice(&text).map_err(|e| {
            SessionError::Caller(format!("the report of {what} is not the JSON that was expected: {e}"))
        })
    }
}
