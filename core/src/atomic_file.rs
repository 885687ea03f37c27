//! Writes files that appear complete or not at all. All outputs of all commands are written here.
//!
//! ```text
//! follow links to the target → make a temporary file beside it → write → flush, sync → rename over the target → sync the folder
//! ```
//! If any step fails, the temporary file is removed and an existing target is unchanged. The rename is within one folder, and so
//! within one file system. A process that is killed may leave a file `.pumice-…`.
//!
//! What a name stands for stays as it is: a symbolic link still leads to the same place, where the new file is; the new file has the
//! permissions of the one that it replaces, and its owner where the system allows it. Devices, pipes, sockets and folders are
//! refused: a rename would replace them by a file, for every user of the machine.

use std::fs::{File, Metadata};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::input_file::check_is_ordinary;

/// Size of the write buffer in bytes.
const BUFFER_BYTES: usize = 1 << 18;

/// Most links that are followed one after the other, as on Linux (`path_resolution(7)`).
const MOST_LINKS: usize = 40;

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
    /// The name is that of something which must not be replaced: no ordinary file, or a file that is read.
    #[error("{}: {what}", path.display())]
    Refused {
        /// The name.
        path: PathBuf,
        /// Expected and got.
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

/// Creates or replaces the file at `path` with a text.
///
/// # Errors
/// [`TargetError`] where the file cannot be made or written.
pub fn write_text(path: &Path, text: &str) -> Result<(), TargetError> {
    let io = |source| TargetError::Io { path: path.to_owned(), source };
    write_atomically(path, |file| file.write_all(text.as_bytes()).map_err(io))
}

/// A file that is written and synced, and has only a temporary name. It is removed when the value is dropped.
#[derive(Debug)]
pub struct WrittenFile {
    file: tempfile::NamedTempFile,
}

impl WrittenFile {
    /// Writes a file into the folder of `place`, for it or for a place beside it. Where `place` is a link, that is the folder of what it
    /// leads to.
    ///
    /// # Errors
    /// [`TargetError`] where it cannot be made, or where `place` is taken by something else than a file; errors of `write`.
    pub fn for_place<E: From<TargetError>>(
        place: &Path,
        write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
    ) -> Result<Self, E> {
        let io = |source| TargetError::Io { path: place.to_owned(), source };
        check_is_file(place)?;
        let target = link_target(place)?;
        let folder = folder_of(&target);
        let former = std::fs::metadata(&target).ok();
        let mut builder = tempfile::Builder::new();
        builder.prefix(".pumice-");
        // Temporary files are private by default; this one gets the permissions that any new file would, or those of the former one.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let mode = former.as_ref().map_or(0o666, |former| former.permissions().mode() & 0o777);
            builder.permissions(std::fs::Permissions::from_mode(mode));
        }
        // If the folder is missing, this call gives the system's own error text: `tempfile` would add its temporary name, which means
        // nothing to the user.
        std::fs::metadata(folder).map_err(io)?;
        let mut file = builder.tempfile_in(folder).map_err(|e| io(e.kind().into()))?;
        if let Some(former) = former {
            take_owner_and_mode(file.as_file(), &former).map_err(io)?;
        }
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
        let target = link_target(path)?;
        let io = |e: tempfile::PersistError| TargetError::Io { path: path.to_owned(), source: e.error };
        self.file.persist(&target).map_err(io)?;
        // The rename itself must reach the disk too. Some systems cannot sync a folder; nothing more can be done there.
        if let Ok(folder) = File::open(folder_of(&target)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

/// The name that a chain of symbolic links ends at, whether or not a file is there; `path` itself where it is no link.
///
/// # Errors
/// [`TargetError::Io`] for links that lead in a circle.
pub fn link_target(path: &Path) -> Result<PathBuf, TargetError> {
    let mut name = path.to_owned();
    for _ in 0..MOST_LINKS {
        // What cannot be read as a link is none, or is not there; if the folder refuses, writing tells it.
        let Ok(next) = std::fs::read_link(&name) else { return Ok(name) };
        name = folder_of(&name).join(next);
    }
    let source = std::io::Error::new(ErrorKind::InvalidInput, "too many symbolic links, one to the next");
    Err(TargetError::Io { path: path.to_owned(), source })
}

/// The folder that a name is in.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Gives a new file the permissions of the one that it replaces, and its owner where the system allows it.
#[cfg(unix)]
fn take_owner_and_mode(file: &File, former: &Metadata) -> std::io::Result<()> {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, fchown};
    let new = file.metadata()?;
    if (new.uid(), new.gid()) != (former.uid(), former.gid()) {
        // Only root may give files away; a file of anybody else is their own, as after any save that renames.
        let _ = fchown(file, Some(former.uid()), Some(former.gid()));
    }
    let mode = former.mode() & 0o777;
    // File systems without permissions show the same ones for all files, and refuse to set them.
    if file.metadata()?.mode() & 0o777 == mode {
        return Ok(());
    }
    file.set_permissions(std::fs::Permissions::from_mode(mode))
}

#[cfg(not(unix))]
fn take_owner_and_mode(_: &File, _: &Metadata) -> std::io::Result<()> {
    Ok(())
}

/// Checks that a name is free or that of an ordinary file.
pub(crate) fn check_is_file(path: &Path) -> Result<(), TargetError> {
    let Ok(there) = std::fs::metadata(path) else { return Ok(()) };
    check_is_ordinary(&there).map_err(|e| TargetError::Refused { path: path.to_owned(), what: e.to_string() })
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    use super::*;

    fn mode(path: &Path) -> u32 {
        std::fs::metadata(path).unwrap().permissions().mode() & 0o7777
    }

    #[test]
    fn a_replaced_file_keeps_its_permissions_and_a_new_one_has_those_of_any() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        for kept in [0o600, 0o640, 0o666, 0o444] {
            std::fs::write(&path, "before").unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(kept)).unwrap();
            write_text(&path, "after").unwrap();
            assert_eq!((mode(&path), std::fs::read_to_string(&path).unwrap().as_str()), (kept, "after"));
            std::fs::remove_file(&path).unwrap();
        }
        write_text(&path, "new").unwrap();
        std::fs::write(folder.path().join("plain"), "").unwrap();
        assert_eq!(mode(&path), mode(&folder.path().join("plain")));
    }

    #[test]
    fn a_link_stays_and_what_it_leads_to_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("far")).unwrap();
        std::fs::write(at("far/there"), "before").unwrap();
        // One to a file that is there, over another link, and one to a name that is free.
        for (link, to) in [("over", "far/there"), ("link", "over"), ("free", "far/new")] {
            symlink(to, at(link)).unwrap();
        }
        for (link, target) in [("link", "far/there"), ("free", "far/new")] {
            write_text(&at(link), "after").unwrap();
            assert!(at(link).is_symlink() && at("over").is_symlink());
            assert_eq!(std::fs::read_to_string(at(target)).unwrap(), "after");
        }
        symlink("circle", at("circle")).unwrap();
        let error = write_text(&at("circle"), "").unwrap_err().to_string();
        assert!(error.contains("circle: too many symbolic links"), "{error}");
        assert_eq!(std::fs::read_dir(at("far")).unwrap().count(), 2, "a temporary file is left");
    }

    #[test]
    fn what_is_no_ordinary_file_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let link = folder.path().join("link");
        symlink("/dev/full", &link).unwrap();
        for (path, what) in [
            (folder.path(), "a folder"),
            (&socket, "a socket"),
            (Path::new("/dev/full"), "a device"),
            (&link, "a device"),
        ] {
            let error = write_text(path, "").unwrap_err().to_string();
            assert_eq!(error, format!("{}: expected an ordinary file, got {what}", path.display()));
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
