//! The files of stores: on this machine, or on a server.
//!
//! ```text
//! /data/cortex/info                     a file
//! https://server/cortex/info            by HTTP (`crate::server`, with the feature `http`)
//! gs://bucket/cortex/info               a public bucket of Google's Cloud Storage
//! s3://bucket/cortex/info               a public bucket of Amazon's S3
//! precomputed://gs://bucket/cortex      as Neuroglancer writes it; also zarr, zarr2, zarr3, n5
//! ```
//! Paths and URLs are both [`Path`]s: a file below a folder is the folder joined with its name.

use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use crate::server;

/// What a URL of a server begins with.
const SCHEMES: [&str; 4] = ["https://", "http://", "gs://", "s3://"];

/// What Neuroglancer writes before a URL: how the files are read.
const KINDS: [&str; 5] = ["precomputed://", "zarr://", "zarr2://", "zarr3://", "n5://"];

/// Whether a path is the URL of a place on a server, and not a file of this machine.
pub fn is_on_server(path: &Path) -> bool {
    let text = path.to_str().unwrap_or_default();
    let place = KINDS.iter().find_map(|kind| text.strip_prefix(kind)).unwrap_or(text);
    SCHEMES.iter().any(|scheme| place.starts_with(scheme))
}

/// The URL of a place on a server without what Neuroglancer adds to it and without `/` at its end; `None` for files of this machine.
pub(crate) fn plain_url(path: &Path) -> Option<PathBuf> {
    if !is_on_server(path) {
        return None;
    }
    let text = path.to_str()?.split('|').next()?;
    let place = KINDS.iter().find_map(|kind| text.strip_prefix(kind)).unwrap_or(text);
    Some(place.trim_end_matches('/').into())
}

/// Whether there is a file of this name. What a server says other than that is found out by reading the file.
pub(crate) fn is_file(path: &Path) -> bool {
    match is_on_server(path) {
        true => server::description(path).is_ok_and(|found| found.is_some()),
        false => path.is_file(),
    }
}

/// Reads all of a file that has at most `most` bytes.
pub(crate) fn read(path: &Path, most: u64) -> Result<Vec<u8>, Error> {
    match is_on_server(path) {
        true => server::read(path, Part::Whole, most),
        false => pumice_core::read_input(path, most),
    }
}

/// Reads a short file that describes a store; `None` where there is none.
pub(crate) fn description(path: &Path, most: u64) -> Result<Option<Vec<u8>>, Error> {
    if is_on_server(path) {
        return Ok(server::description(path)?.map(|bytes| bytes.to_vec()));
    }
    match pumice_core::read_input(path, most) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if is_absent(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Whether an error says that there is no file of this name.
pub(crate) fn is_absent(error: &Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
}

/// The part of a file that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    not(feature = "zarr"),
    expect(dead_code, reason = "only Zarr reads files from a byte to their end, and their ends")
)]
pub(crate) enum Part {
    Whole,
    /// From this byte to the end.
    From(u64),
    Piece {
        begin: u64,
        size: u64,
    },
    /// So many bytes at the end.
    Last(u64),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_told_from_files() {
        for (text, expected) in [
            ("https://server/cells.zarr/", Some("https://server/cells.zarr")),
            ("gs://bucket/cortex", Some("gs://bucket/cortex")),
            ("precomputed://gs://bucket/cortex", Some("gs://bucket/cortex")),
            ("s3://bucket/cells.n5/|n5:", Some("s3://bucket/cells.n5")),
            ("precomputed://file:///data/cortex", None),
            ("/data/cells.zarr", None),
            ("http/cells", None),
            ("C:\\https:\\cells", None),
        ] {
            assert_eq!(plain_url(Path::new(text)).as_deref(), expected.map(Path::new), "{text}");
            assert_eq!(is_on_server(Path::new(text)), expected.is_some(), "{text}");
        }
    }
}
