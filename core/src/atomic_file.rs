//! Writes files that appear complete or not at all.
//!
//! ```text
//! make a temporary file beside the target → write → flush, sync → rename over the target
//! ```
//! If any step fails, the temporary file is removed and an existing target is unchanged. The rename is within one folder, and so
//! within one file system.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Size of the write buffer in bytes.
const BUFFER_BYTES: usize = 1 << 18;

/// Why a file could not be written, apart from errors of whoever writes it.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// The operating system refused (missing folder, no permission, full disk).
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Something else than an ordinary file has that name.
    #[error("{}: {what}", path.display())]
    NoFile {
        /// The name.
        path: PathBuf,
        /// What it is.
        what: String,
    },
}

/// Creates or replaces the file at `path` with what `write` writes.
///
/// # Errors
/// [`TargetError`] where the file cannot be made; errors of `write`.
pub fn write_atomically<E: From<TargetError>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    Ok(WrittenFile::for_place(path, write)?.appear(path)?)
}

/// A file that is written and synced, and has only a temporary name. It is removed when the value is dropped.
#[derive(Debug)]
pub struct WrittenFile {
    file: tempfile::NamedTempFile,
}

impl WrittenFile {
    /// Writes a file into the folder of `place`, for it or for a place beside it.
    ///
    /// # Errors
    /// [`TargetError`] where it cannot be made, or where `place` is taken by something else than a file; errors of `write`.
    pub fn for_place<E: From<TargetError>>(
        place: &Path,
        write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
    ) -> Result<Self, E> {
        let io = |source| TargetError::Io { path: place.to_owned(), source };
        check_is_file(place)?;
        let folder = match place.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".pumice-");
        // Temporary files are private by default; this one gets the permissions that any new file would.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        // If the folder is missing, this call gives the system's own error text: `tempfile` would add its temporary name, which means
        // nothing to the user.
        std::fs::metadata(folder).map_err(io)?;
        let mut file = builder.tempfile_in(folder).map_err(|e| io(e.kind().into()))?;
        let mut writer = BufWriter::with_capacity(BUFFER_BYTES, file.as_file_mut());
        write(&mut writer)?;
        writer.flush().map_err(io)?;
        drop(writer);
        file.as_file().sync_all().map_err(io)?;
        Ok(Self { file })
    }

    /// Gives it its name, in place of a file that had it.
    ///
    /// # Errors
    /// [`TargetError`] where the system refuses; then the former file is unchanged.
    pub fn appear(self, path: &Path) -> Result<(), TargetError> {
        check_is_file(path)?;
        let io = |e: tempfile::PersistError| TargetError::Io { path: path.to_owned(), source: e.error };
        self.file.persist(path).map_err(io)?;
        Ok(())
    }
}

/// Checks that a name is free or that of an ordinary file.
fn check_is_file(path: &Path) -> Result<(), TargetError> {
    // A rename over a device or a pipe would replace it by a file, for every user of the machine.
    match std::fs::metadata(path) {
        Ok(there) if !there.is_file() => {
            let what =
                if there.is_dir() { "is a folder, expected a file" } else { "is not an ordinary file" };
            Err(TargetError::NoFile { path: path.to_owned(), what: what.to_owned() })
        }
        _ => Ok(()),
    }
}
