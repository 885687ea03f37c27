//! How HDF5 files are recognised, also by a build that cannot read them.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::error::Result;
use crate::options::OpenOptions;
use crate::stream::open_file;
use crate::volume_file::{Format, Takes, VolumeFile};

/// HDF5 files.
pub(crate) const FORMAT: Format =
    Format { name: "HDF5", takes: Takes { axes: true, dataset: true, ..Takes::NOTHING }, recognises, read };

const SIGNATURE: &[u8; 8] = b"\x89HDF\r\n\x1a\n";

/// The signature stands at byte 0, 512, 1024, 2048, …: before it another program may have a block of its own (*HDF5 File Format Specification* II.A).
/// It is looked for up to byte 4096, and behind byte 0 only in files whose name says HDF5.
fn recognises(path: &Path, head: &[u8]) -> bool {
    if head.starts_with(SIGNATURE) {
        return true;
    }
    let is_named = path
        .extension()
        .is_some_and(|e| ["h5", "hdf5", "hdf", "ilp"].iter().any(|n| e.eq_ignore_ascii_case(n)));
    is_named
        && [512, 1024, 2048, 4096].iter().any(|&at| {
            let mut found = [0; 8];
            open_file(path).is_ok_and(|mut file| {
                file.seek(SeekFrom::Start(at)).is_ok()
                    && file.read_exact(&mut found).is_ok()
                    && found == *SIGNATURE
            })
        })
}

#[cfg(feature = "hdf5")]
fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    crate::hdf5::read(path, options)
}

#[cfg(not(feature = "hdf5"))]
fn read(path: &Path, _options: &OpenOptions) -> Result<VolumeFile> {
    Err(crate::error::FormatError::unsupported(
        path,
        "this build of Pumice reads no HDF5",
        "build it with the feature `hdf5`, or export the labels as NRRD, TIFF or NPY",
    ))
}
