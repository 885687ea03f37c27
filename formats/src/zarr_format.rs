//! How folders of Zarr are recognised, also by a build that cannot read them.

use std::path::Path;

use crate::error::Result;
use crate::options::OpenOptions;
use crate::store_files::is_file;
use crate::volume_file::{Format, Takes, VolumeFile};

/// Zarr and OME-Zarr folders.
pub(crate) const FORMAT: Format = Format {
    name: "Zarr",
    takes: Takes {
        axes: true,
        dataset: true,
        scale: true,
        label: true,
        missing_chunks: true,
        ..Takes::NOTHING
    },
    recognises: |folder, _| is_node(folder),
    read,
};

/// Whether a folder is a Zarr array or group, by the files in it. N5 has `attributes.json`.
pub(crate) fn is_node(folder: &Path) -> bool {
    let has = |name: &str| is_file(&folder.join(name));
    has("zarr.json") || has(".zarray") || has(".zgroup") || (has(".zattrs") && !has("attributes.json"))
}

#[cfg(feature = "zarr")]
fn read(folder: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    crate::zarr::read(folder, options)
}

#[cfg(not(feature = "zarr"))]
fn read(folder: &Path, _options: &OpenOptions) -> Result<VolumeFile> {
    Err(crate::error::FormatError::unsupported(
        folder,
        "this build of Pumice reads no Zarr",
        "build it with the feature `zarr`",
    ))
}
