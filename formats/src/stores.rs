//! Folders that are stores of chunks: the small files that describe them.

use std::path::{Path, PathBuf};

use pumice_core::error::one_line;
use serde_json::Value;

use crate::error::{FormatError, Result};
use crate::stream::open_file;

/// Largest description that is read. Consolidated metadata and long tables of names take some MB.
const MOST_BYTES: u64 = 64 << 20;

/// Names of the files that describe a store, by which a file dialog can choose its folder.
const DESCRIPTIONS: [&str; 6] = ["zarr.json", ".zarray", ".zgroup", ".zattrs", "info", "attributes.json"];

/// The folder of the store that the file `path` describes; `None` for any other file.
pub(crate) fn folder_of(path: &Path) -> Option<&Path> {
    let name = path.file_name()?.to_str()?;
    let folder = path.parent()?;
    (DESCRIPTIONS.contains(&name) && path.is_file())
        .then(|| if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
}

/// The JSON object in file `name` of a folder; `None` where there is no such file.
pub(crate) fn json(folder: &Path, name: &str) -> Result<Option<Value>> {
    let path = folder.join(name);
    let found = match std::fs::metadata(&path) {
        Ok(found) => found,
        Err(error) if is_absent(&error) => return Ok(None),
        Err(error) => return Err(FormatError::Io { path, source: error }),
    };
    if found.len() > MOST_BYTES {
        return Err(FormatError::Limit {
            path,
            what: "the size of the description".into(),
            got: format!("{} bytes", found.len()),
            limit: MOST_BYTES,
        });
    }
    let mut text = Vec::new();
    std::io::Read::read_to_end(&mut std::io::Read::take(open_file(&path)?, MOST_BYTES), &mut text)
        .map_err(FormatError::io(&path))?;
    let value: Value = serde_json::from_slice(&text)
        .map_err(|e| FormatError::damaged(&path, one_line(&format!("JSON: {e}"))))?;
    if !value.is_object() {
        return Err(FormatError::damaged(&path, "expected a JSON object, got something else"));
    }
    Ok(Some(value))
}

/// Whether the system says that there is no file of this name.
pub(crate) fn is_absent(error: &std::io::Error) -> bool {
    matches!(error.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory)
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
