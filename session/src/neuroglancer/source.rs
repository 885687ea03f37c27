//! Where the volume of a layer is, from the URL that a state has.

use std::path::{Path, PathBuf};

/// The path of a source on this machine, relative to `folder` where the URL is; `None` where it lies on a server or in a bucket.
///
/// ```text
/// precomputed://file:///data/cortex     zarr://cells.zarr     file:///data/cells.zarr/|zarr3:     cells.zarr
/// precomputed://gs://bucket/cortex      https://server/cells.zarr/|zarr2:                         None
/// ```
pub(super) fn local_path(url: &str, folder: &Path) -> Option<PathBuf> {
    // What follows a bar says how the file before it is read, which the readers find out by themselves.
    let url = url.split('|').next().unwrap_or(url);
    let kinds = ["precomputed", "zarr", "zarr2", "zarr3", "n5", "nifti", "auto"];
    let place = match url.split_once("://") {
        Some((kind, place)) if kinds.contains(&kind) => place,
        _ => url,
    };
    match place.split_once("://") {
        None => Some(folder.join(unescaped(place)?)),
        Some(("file", path)) => Some(unescaped(path)?.into()),
        Some(_) => None,
    }
}

/// The text of a part of a URL, in which %20 and the like stand for bytes; `None` where they are no Unicode.
pub(super) fn unescaped(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        let digit = |at: usize| after.get(at).and_then(|&d| char::from(d).to_digit(16));
        match (first, digit(0), digit(1)) {
            (b'%', Some(high), Some(low)) => {
                bytes.push((16 * high + low) as u8);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_and_servers_are_told_apart() {
        let path = |url| local_path(url, Path::new("/states"));
        for (url, expected) in [
            ("precomputed://file:///data/the%20cortex", "/data/the cortex"),
            ("zarr2://file:///data/cells.zarr", "/data/cells.zarr"),
            ("file:///data/cells.zarr/|zarr3:", "/data/cells.zarr/"),
            ("precomputed://cortex.precomputed", "/states/cortex.precomputed"),
            ("cells.zarr", "/states/cells.zarr"),
            ("100%", "/states/100%"),
        ] {
            assert_eq!(path(url).as_deref(), Some(Path::new(expected)), "{url}");
        }
        for url in [
            "precomputed://gs://bucket/cortex",
            "precomputed://https://server/cortex",
            "https://server/cells.zarr/|zarr2:",
            "graphene://https://server/table",
            "s3://bucket/cells.n5/|n5:",
            "boss://server/x",
            "%ff",
        ] {
            assert_eq!(path(url), None, "{url}");
        }
    }
}
