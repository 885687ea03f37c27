//! Writes files that appear complete or not at all, also when the job is cancelled in between.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

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

/// Writes two files that belong together, both or neither; former ones stay where that fails. The second, which names the first, appears
/// last:
///
/// ```text
/// second into a temporary file ─► first into another ─► former first gets another name ─► first appears ─► second appears
/// ```
/// Returns the bytes of both.
///
/// # Errors
/// As [`write_whole`].
pub(crate) fn write_both(
    [first, second]: [&Path; 2],
    job: &Job,
    write_first: impl FnOnce(&mut dyn Write) -> Result<()>,
    write_second: impl FnOnce(&mut dyn Write) -> Result<()>,
) -> Result<u64> {
    let mut bytes = 0;
    let mut former = None;
    let written = write_whole(second, job, |out| {
        write_second(out)?;
        out.flush()?;
        bytes += write_whole(first, job, |out| {
            write_first(out)?;
            out.flush()?;
            former = Some(Former::aside(first)?);
            Ok(())
        })?;
        Ok(())
    });
    match (written, former) {
        (Ok(of_second), former) => {
            former.map_or(Ok(()), Former::forget)?;
            Ok(bytes + of_second)
        }
        (Err(error), former) => {
            former.map_or(Ok(()), Former::restore)?;
            Err(error)
        }
    }
}

/// A file that was at a place before another is written there.
struct Former {
    path: PathBuf,
    /// Where it is meanwhile; none where there was no file.
    kept: Option<PathBuf>,
}

impl Former {
    /// Gives the file at `path` another name in its folder.
    fn aside(path: &Path) -> Result<Self> {
        let mut name = std::ffi::OsString::from(".pumice-former-");
        name.push(path.file_name().unwrap_or_default());
        let kept = path.with_file_name(name);
        let kept = match std::fs::rename(path, &kept) {
            Ok(()) => Some(kept),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(source) => return Err(Error::Io { path: path.to_owned(), source }.into()),
        };
        Ok(Self { path: path.to_owned(), kept })
    }

    /// Puts it back, in place of what has been written there.
    fn restore(self) -> Result<()> {
        let done = match &self.kept {
            Some(kept) => std::fs::rename(kept, &self.path),
            None => std::fs::remove_file(&self.path),
        };
        match done {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                Err(Error::Io { path: self.path, source }.into())
            }
            _ => Ok(()),
        }
    }

    fn forget(self) -> Result<()> {
        let Some(kept) = self.kept else { return Ok(()) };
        std::fs::remove_file(&kept).map_err(|source| Error::Io { path: kept, source }.into())
    }
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

    #[test]
    fn two_files_are_both_there_or_neither() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = ["a.bin", "a.gltf"].map(|name| folder.path().join(name));
        let text = |text: &'static str| move |out: &mut dyn Write| Ok(out.write_all(text.as_bytes())?);
        let files = || {
            let mut names: Vec<_> =
                std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            let contents = [&first, &second].map(|path| std::fs::read_to_string(path).unwrap_or_default());
            (names.len(), contents)
        };
        let full = |_: &mut dyn Write| Err(std::io::Error::from(std::io::ErrorKind::StorageFull).into());
        let fails = |is_first: bool| {
            let paths = [first.as_path(), second.as_path()];
            let error = match is_first {
                true => write_both(paths, &Job::new(), full, text("2")),
                false => write_both(paths, &Job::new(), text("1"), full),
            };
            error.unwrap_err().to_string()
        };
        // A new pair that fails leaves nothing.
        assert!(fails(true).contains("a.bin: ") && fails(false).contains("a.gltf: "));
        assert_eq!(files(), (0, [String::new(), String::new()]));
        let paths = [first.as_path(), second.as_path()];
        assert_eq!(write_both(paths, &Job::new(), text("one"), text("two")).unwrap(), 6);
        assert_eq!(files(), (2, ["one".into(), "two".into()]));
        // A pair that fails in place of another leaves that, also where only the last step fails.
        assert!(fails(true).contains("a.bin: ") && fails(false).contains("a.gltf: "));
        assert_eq!(files(), (2, ["one".into(), "two".into()]));
        let job = Job::new();
        let cancels = |out: &mut dyn Write| {
            out.write_all(b"1")?;
            job.cancel();
            Ok(())
        };
        assert_eq!(write_both(paths, &job, cancels, text("2")).unwrap_err().to_string(), "cancelled");
        assert_eq!(files(), (2, ["one".into(), "two".into()]));
        // Control: what is written later replaces both.
        write_both(paths, &Job::new(), text("1"), text("2")).unwrap();
        assert_eq!(files(), (2, ["1".into(), "2".into()]));
        std::fs::remove_file(&second).unwrap();
        std::fs::create_dir(&second).unwrap();
        assert!(fails(true).ends_with("is a folder, expected a file"));
        assert_eq!(std::fs::read_to_string(&first).unwrap(), "1");
    }
}
