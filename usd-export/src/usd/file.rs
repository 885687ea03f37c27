//! Writes a stage to a file, whose ending chooses the form. The file appears complete or not at all.

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use pumice_core::{Error, Job, TargetError, write_atomically};

use super::{Stage, write_usda, write_usdc};
use crate::{ExportError, Result};

/// Endings of the names of files that can be written.
pub const ENDINGS: [&str; 2] = ["usda", "usdc"];

impl From<TargetError> for ExportError {
    fn from(error: TargetError) -> Self {
        Self::Volume(error.into())
    }
}

/// The ending of a file's name, where files of it can be written and its folder exists: so that a wrong name shows before the work is done.
///
/// # Errors
/// [`Error::Caller`] for another ending; [`Error::Io`] for a folder that does not exist.
pub fn check_name(path: &Path) -> Result<&'static str> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let known = ENDINGS.into_iter().find(|known| ending.eq_ignore_ascii_case(known));
    let known = known.ok_or_else(|| {
        let (path, endings) = (path.display(), ENDINGS.join(", ."));
        Error::Caller(format!("{path}: expected a name that ends in .{endings}"))
    })?;
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::metadata(folder).map_err(|source| Error::Io { path: folder.to_owned(), source })?;
    }
    Ok(known)
}

/// Writes a stage: `.usda` as text, `.usdc` as a crate file. Returns the bytes written.
///
/// # Errors
/// Those of [`check_name`]; [`Error::Io`] with the file's name where it cannot be written; [`Error::Cancelled`]; errors of whoever produces
/// the arrays.
pub fn write_stage(stage: &Stage<'_>, path: &Path, job: &Job) -> Result<u64> {
    let ending = check_name(path)?;
    let mut bytes = 0;
    let written = write_atomically(path, |out| {
        let mut out = Cancellable { out, job };
        match ending {
            "usda" => write_usda(stage, &mut out)?,
            _ => write_usdc(stage, &mut out)?,
        }
        bytes = out.stream_position()?;
        Ok(())
    });
    job.check()?;
    written.map_err(|error| match error {
        ExportError::Write(source) => Error::Io { path: path.to_owned(), source }.into(),
        other => other,
    })?;
    Ok(bytes)
}

/// Fails once the job is cancelled, so that long arrays do not delay it.
struct Cancellable<'a, W> {
    out: &'a mut W,
    job: &'a Job,
}

impl<W: Write> Write for Cancellable<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.job.check().map_err(std::io::Error::other)?;
        self.out.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

impl<W: Seek> Seek for Cancellable<'_, W> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.out.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_whole_or_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let stage = Stage { default_prim: "none".into(), ..Stage::default() };
        for name in ["a.usda", "b.USDC"] {
            let path = folder.path().join(name);
            let bytes = write_stage(&stage, &path, &Job::new()).unwrap();
            assert_eq!(std::fs::metadata(&path).unwrap().len(), bytes);
        }
        let refused = |path: &Path, job: &Job| write_stage(&stage, path, job).unwrap_err().to_string();
        let job = Job::new();
        assert!(
            refused(&folder.path().join("a.usd"), &job)
                .ends_with("a.usd: expected a name that ends in .usda, .usdc")
        );
        assert!(refused(&folder.path().join("missing/a.usda"), &job).contains("missing: No such file"));
        std::fs::create_dir(folder.path().join("c.usda")).unwrap();
        assert!(refused(&folder.path().join("c.usda"), &job).ends_with("is a folder, expected a file"));
        job.cancel();
        assert_eq!(refused(&folder.path().join("d.usdc"), &job), "cancelled");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3, "nothing else is left");
    }
}
