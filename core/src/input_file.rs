//! Opens files for reading, and only ordinary ones.
//!
//! A pipe ends when its writer closes it, and opening one may wait for ever for a writer to come; a device such as `/dev/zero` never ends;
//! nothing can be read twice from either, as readers of headers do. So the name is looked at before it is opened, since opening alone
//! may wait, and what was opened is looked at again, since the name may have got another file in between.

use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Opens an ordinary file for reading. Links are followed.
///
/// # Errors
/// Those of the system, and [`ErrorKind::InvalidInput`] for a folder, a pipe, a socket or a device, with a text that names it.
pub fn open_input(path: &Path) -> Result<File> {
    check_is_ordinary(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    check_is_ordinary(&file.metadata()?)?;
    Ok(file)
}

/// Reads all of an ordinary file that has at most `most_bytes` bytes.
///
/// # Errors
/// As [`open_input`], and [`ErrorKind::FileTooLarge`] for a longer file.
pub fn read_input(path: &Path, most_bytes: u64) -> Result<Vec<u8>> {
    let file = open_input(path)?;
    let too_long = |got| {
        let what = format!("expected a file of at most {most_bytes} bytes, got {got}");
        Error::new(ErrorKind::FileTooLarge, what)
    };
    let length = file.metadata()?.len();
    if length > most_bytes {
        return Err(too_long(length.to_string()));
    }
    // Files of `/proc` say that they have 0 bytes, and others grow while they are read: one byte more than allowed shows it.
    let mut bytes = Vec::new();
    file.take(most_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        return Err(too_long("more".into()));
    }
    Ok(bytes)
}

/// Checks that metadata are those of an ordinary file.
///
/// # Errors
/// [`ErrorKind::InvalidInput`] with a text that names what it is.
pub(crate) fn check_is_ordinary(metadata: &Metadata) -> Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let got = if metadata.is_dir() { "a folder" } else { kind_of_special(metadata) };
    Err(Error::new(ErrorKind::InvalidInput, format!("expected an ordinary file, got {got}")))
}

#[cfg(unix)]
fn kind_of_special(metadata: &Metadata) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    let kind = metadata.file_type();
    if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn kind_of_special(_: &Metadata) -> &'static str {
    "a device"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_limit_and_no_further() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, [7; 100]).unwrap();
        assert_eq!(read_input(&path, 100).unwrap(), [7; 100]);
        let error = read_input(&path, 99).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::FileTooLarge);
        assert_eq!(error.to_string(), "expected a file of at most 99 bytes, got 100");
        let error = open_input(folder.path()).unwrap_err().to_string();
        assert_eq!(error, "expected an ordinary file, got a folder");
        assert_eq!(open_input(&folder.path().join("none")).unwrap_err().kind(), ErrorKind::NotFound);
    }

    /// A file that says it has no bytes, and has some.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_length_that_a_file_states_is_not_trusted() {
        let path = Path::new("/proc/self/status");
        assert_eq!(std::fs::metadata(path).unwrap().len(), 0);
        assert!(read_input(path, 1 << 20).unwrap().len() > 100);
        let error = read_input(path, 100).unwrap_err().to_string();
        assert_eq!(error, "expected a file of at most 100 bytes, got more");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_ordinary_file_is_named_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for (path, what) in [(&socket, "a socket"), (&link, "a device")] {
            let error = read_input(path, 100).unwrap_err().to_string();
            assert_eq!(error, format!("expected an ordinary file, got {what}"));
        }
    }
}
