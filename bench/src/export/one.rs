//! One export in a process of its own: this program is started again, and prints what it measured as a line of JSON.

use std::ffi::OsStr;
use std::path::Path;

use pumice_core::Job;
use pumice_formats::OpenOptions;
use pumice_session::error::{Result, SessionError};
use pumice_session::{ExportRequest, Form, Merging, Reader, Stopwatch, export_file};
use serde::{Deserialize, Serialize};

use super::WrittenRow;
use crate::itself::Itself;
use crate::timing::Took;

/// What the process prints.
#[derive(Debug, Serialize, Deserialize)]
struct Report {
    faces: u64,
    boxes: u64,
    bytes: u64,
    prepare: Took,
    write: Took,
    peak_rss_bytes: Option<u64>,
}

/// Exports `input` to `out` and returns what that took, as JSON.
///
/// # Errors
/// An unknown form; errors of the volume and of the file.
pub(super) fn measured(input: &Path, out: &Path, form: &str, job: &Job) -> Result<String> {
    let forms = [Form::Instances, Form::Boxes, Form::Cells, Form::Voxels];
    let form = forms.into_iter().find(|known| known.name() == form);
    let form = form.ok_or_else(|| SessionError::Caller("--one: expected the name of a form".into()))?;
    let request = ExportRequest {
        region: None,
        input: input.to_owned(),
        out: out.to_owned(),
        forms: vec![form],
        merging: Merging::Merged,
        limit_bytes: u64::MAX,
        reader: Reader::Specification,
        labels: None,
        selected: Vec::new(),
        reading: OpenOptions::default(),
    };
    let clock = Stopwatch::start();
    let mut prepare = Took::default();
    let exported = export_file(&request, &mut |_| prepare = Took::since(&clock), job)?;
    let all = Took::since(&clock);
    let report = Report {
        faces: exported.faces,
        boxes: exported.boxes,
        bytes: exported.bytes,
        prepare,
        write: Took {
            seconds: all.seconds - prepare.seconds,
            cpu_seconds: all.cpu_seconds - prepare.cpu_seconds,
        },
        peak_rss_bytes: exported.peak_rss_bytes,
    };
    serde_json::to_string(&report).map_err(|e| SessionError::Caller(format!("the report of an export: {e}")))
}

/// Exports in processes of this program.
pub(super) struct Program(Itself);

impl Program {
    pub(super) fn this() -> Result<Self> {
        Itself::of("export").map(Self)
    }

    /// Exports `rounds` times, each in a process.
    pub(super) fn measure(
        &self,
        input: &Path,
        out: &Path,
        form: Form,
        rounds: u32,
        job: &Job,
    ) -> Result<WrittenRow> {
        let mut best: Option<Report> = None;
        for _ in 0..rounds {
            let report = self.once(input, out, form)?;
            job.check()?;
            best = Some(match best {
                None => report,
                Some(best) => Report {
                    prepare: best.prepare.least(report.prepare),
                    write: best.write.least(report.write),
                    peak_rss_bytes: best.peak_rss_bytes.max(report.peak_rss_bytes),
                    ..report
                },
            });
        }
        let best = best.ok_or_else(|| SessionError::Caller("--rounds: expected at least 1".into()))?;
        Ok(WrittenRow {
            volume: String::new(),
            form: form.name().into(),
            format: out.extension().unwrap_or_default().to_string_lossy().into_owned(),
            writer: format!("pumice {}", env!("CARGO_PKG_VERSION")),
            faces: best.faces,
            boxes: best.boxes,
            bytes: best.bytes,
            prepare: Some(best.prepare),
            write: best.write,
            peak_rss_bytes: best.peak_rss_bytes,
        })
    }

    fn once(&self, input: &Path, out: &Path, form: Form) -> Result<Report> {
        self.0.report([OsStr::new("--one"), input.as_os_str(), out.as_os_str(), OsStr::new(form.name())])
    }
}
