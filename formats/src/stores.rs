//! Folders that are stores of chunks: the small files that describe them.

use std::path::{Path, PathBuf};

use pumice_core::CancelFlag;
use pumice_core::error::one_line;
use serde_json::Value;

use crate::error::{FormatError, Result};
use crate::server;
use crate::store_files::{self, is_on_server, plain_url};

/// Largest description that is read. Consolidated metadata and long tables of names take some MB.
const MOST_BYTES: u64 = 64 << 20;

/// Names of the files that describe a store, by which a file dialog can choose its folder.
const DESCRIPTIONS: [&str; 6] = ["zarr.json", ".zarray", ".zgroup", ".zattrs", "info", "attributes.json"];

/// The folder of the store that the file `path` describes; `None` for any other file.
pub(crate) fn folder_of(path: &Path) -> Option<&Path> {
    let name = path.file_name()?.to_str()?;
    let folder = path.parent()?;
    (DESCRIPTIONS.contains(&name) && store_files::is_file(path))
        .then(|| if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
}

/// The URL of a store on a server, which is that of its folder where the path is that of a file that describes it; `None` for files of this
/// machine.
pub(crate) fn store_url(path: &Path) -> Option<PathBuf> {
    let url = plain_url(path)?;
    Some(folder_of(&url).map(Path::to_owned).unwrap_or(url))
}

/// The files that describe a store on a server, by name. What the server says other than that one is absent is an error.
///
/// # Errors
/// When the server cannot be read, or has none of them; [`FormatError::Cancelled`] soon after the caller has given up.
pub fn server_descriptions(
    url: &Path,
    cancelled: &CancelFlag,
) -> std::result::Result<Vec<(&'static str, Vec<u8>)>, FormatError> {
    server::heeding(cancelled, || descriptions(url))
        .map_err(|error| if cancelled.is_set() { FormatError::Cancelled } else { error })
}

fn descriptions(url: &Path) -> Result<Vec<(&'static str, Vec<u8>)>> {
    let Some(folder) = store_url(url) else {
        return Err(FormatError::option(url, "expected the URL of a store"));
    };
    let folder = folder.as_path();
    if !server::IS_THERE {
        let way_out = "install or build it with the feature http, or copy the folder to this machine";
        return Err(FormatError::unsupported(folder, "this build reads nothing from servers", way_out));
    }
    let mut there = Vec::new();
    for name in DESCRIPTIONS {
        let path = folder.join(name);
        let found = store_files::description(&path, MOST_BYTES).map_err(FormatError::io(&path))?;
        there.extend(found.map(|bytes| (name, bytes)));
    }
    if !there.is_empty() {
        return Ok(there);
    }
    let what = "the server gives none of the files that describe a store (zarr.json, .zarray, .zgroup, info, attributes.json)";
    let way_out = "give the URL of the folder that holds one (private buckets are not read); copy other files, such as TIFF, to this machine";
    Err(FormatError::unsupported(folder, what, way_out))
}

/// The JSON object in file `name` of a folder; `None` where there is no such file.
pub(crate) fn json(folder: &Path, name: &str) -> Result<Option<Value>> {
    let path = folder.join(name);
    let Some(text) = store_files::description(&path, MOST_BYTES).map_err(FormatError::io(&path))? else {
        return Ok(None);
    };
    let value: Value = serde_json::from_slice(&text)
        .map_err(|e| FormatError::damaged(&path, one_line(&format!("JSON: {e}"))))?;
    if !value.is_object() {
        return Err(FormatError::damaged(&path, "expected a JSON object, got something else"));
    }
    Ok(Some(value))
}

/// Whole numbers of a JSON list.
pub(crate) fn numbers(value: Option<&Value>) -> Option<Vec<u64>> {
    value?.as_array()?.iter().map(Value::as_u64).collect()
}

/// Numbers of a JSON list.
pub(crate) fn lengths(value: Option<&Value>) -> Option<Vec<f64>> {
    value?.as_array()?.iter().map(Value::as_f64).collect()
}

/// Folders below `folder` that `is_one` accepts, by their path with `/`, sorted. The search does not enter those that it accepts, nor links,
/// and ends `most_depth` levels below, or when `most_seen` entries were looked at.
pub(crate) fn find_below(
    folder: &Path,
    most_depth: usize,
    is_one: &dyn Fn(&Path) -> bool,
) -> Result<Vec<String>> {
    /// Entries that are looked at: the chunks of a flat store are not folders, but are listed too.
    const MOST_SEEN: usize = 100_000;
    if is_on_server(folder) {
        return Err(FormatError::unsupported(
            folder,
            "a server does not list what a folder holds",
            "name the array by --dataset, or by its own URL",
        ));
    }
    let mut found = Vec::new();
    let mut left: Vec<(PathBuf, String, usize)> = vec![(folder.to_owned(), String::new(), 0)];
    let mut seen = 0;
    while let Some((here, name, depth)) = left.pop() {
        for entry in std::fs::read_dir(&here).map_err(FormatError::io(&here))? {
            let entry = entry.map_err(FormatError::io(&here))?;
            seen += 1;
            if seen > MOST_SEEN {
                break;
            }
            // The type of the entry itself: a link is not followed, so a loop of links ends here.
            if !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                continue;
            }
            let path = entry.path();
            let below = format!(
                "{name}{}{}",
                if name.is_empty() { "" } else { "/" },
                entry.file_name().to_string_lossy()
            );
            if is_one(&path) {
                found.push(below);
            } else if depth + 1 < most_depth {
                left.push((path, below, depth + 1));
            }
        }
    }
    found.sort();
    Ok(found)
}
