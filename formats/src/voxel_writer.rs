//! Shared by the writers of all formats: writes voxels after a header, plain or through gzip.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use pumice_core::LabelType;

use crate::element::Element;

/// Writes the voxels of a volume in x-fastest order, in some format.
pub(crate) trait VoxelWriter {
    /// Appends voxels, given as little-endian values of the volume's label type.
    fn write_voxels(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Writes what follows the voxels and returns the file.
    fn finish(self: Box<Self>) -> io::Result<File>;
}

/// Size of one voxel in bytes.
pub(crate) fn bytes_of(label_type: LabelType) -> usize {
    Element::new(label_type, false).bytes()
}

/// Writes all buffered bytes and returns the file.
pub(crate) fn unbuffer(buffered: BufWriter<File>) -> io::Result<File> {
    buffered.into_inner().map_err(io::IntoInnerError::into_error)
}

/// Writes plain voxels after a header.
pub(crate) struct PlainWriter(pub(crate) BufWriter<File>);

impl VoxelWriter for PlainWriter {
    fn write_voxels(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn finish(self: Box<Self>) -> io::Result<File> {
        unbuffer(self.0)
    }
}

/// Writes voxels through gzip.
pub(crate) struct GzipWriter(pub(crate) flate2::write::GzEncoder<BufWriter<File>>);

impl GzipWriter {
    pub(crate) fn new(file: BufWriter<File>) -> Self {
        Self(flate2::write::GzEncoder::new(file, flate2::Compression::default()))
    }
}

impl VoxelWriter for GzipWriter {
    fn write_voxels(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn finish(self: Box<Self>) -> io::Result<File> {
        unbuffer(self.0.finish()?)
    }
}
