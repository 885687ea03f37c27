//! Writes a file that appears complete or not at all, also when the job is cancelled in between.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use pumice_core::{Error, Job, TargetError, write_atomically};

use crate::{ExportError, Result};

impl From<TargetError> for ExportError {
    fn from(error: TargetError) -> Self {
        Self::Volume(error.into())
    }
}

/// Writes a file with `write`, which fails once the job is cancelled. Returns the bytes written.
///
/// # Errors
/// [`Error::Io`] with the file's name where it cannot be written; [`Error::Cancelled`]; errors of `write`.
pub(crate) fn write_whole(
    path: &Path,
    job: &Job,
    write: impl FnOnce(&mut Output<'_, '_>) -> Result<()>,
) -> Result<u64> {
    let mut bytes = 0;
    let written = write_atomically(path, |out| {
        let mut out = Cancellable { out, job };
        write(&mut out)?;
        bytes = out.seek(SeekFrom::End(0))?;
        Ok(())
    });
    job.check()?;
    written.map_err(|error| match error {
        ExportError::Write(source) => Error::Io { path: path.to_owned(), source }.into(),
        other => other,
    })?;
    Ok(bytes)
}

/// Writes a file without a name in the folder of `path`, which is gone once it is closed. Returns it from its beginning, and its bytes.
///
/// # Errors
/// As [`write_whole`].
pub(crate) fn temporary_beside(
    path: &Path,
    job: &Job,
    write: impl FnOnce(&mut Output<'_, '_>) -> Result<()>,
) -> Result<(File, u64)> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::tempfile_in(folder)?;
    let mut buffered = BufWriter::new(&mut file);
    write(&mut Cancellable { out: &mut buffered, job })?;
    buffered.flush()?;
    drop(buffered);
    let bytes = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(0))?;
    Ok((file, bytes))
}

/// What a file is written to.
pub(crate) type Output<'a, 'f> = Cancellable<'a, BufWriter<&'f mut File>>;

/// Fails once the job is cancelled, so that long arrays do not delay it.
pub(crate) struct Cancellable<'a, W> {
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
        let text = |out: &mut Output<'_, '_>| Ok(out.write_all(b"text")?);
        let path = folder.path().join("a.usda");
        assert_eq!(write_whole(&path, &Job::new(), text).unwrap(), 4);
        assert_eq!(std::fs::read(&path).unwrap(), b"text");

        // Where writing fails or is cancelled, the former file stays.
        let job = Job::new();
        let fails = |out: &mut Output<'_, '_>| {
            out.write_all(&[0; 1 << 20])?;
            job.cancel();
            Ok(out.write_all(b"more")?)
        };
        assert_eq!(write_whole(&path, &job, fails).unwrap_err().to_string(), "cancelled");
        let full = |_: &mut Output<'_, '_>| Err(std::io::Error::from(std::io::ErrorKind::StorageFull).into());
        let error = write_whole(&path, &Job::new(), full).unwrap_err().to_string();
        assert!(error.contains("a.usda: ") && error.contains("no storage space"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"text");
        std::fs::create_dir(folder.path().join("c.usda")).unwrap();
        let error = write_whole(&folder.path().join("c.usda"), &Job::new(), text).unwrap_err().to_string();
        assert!(error.ends_with("is a folder, expected a file"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left");
    }
}
