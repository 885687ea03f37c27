//! What writers of all formats share: voxels as they are or through gzip, behind a header.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use pumice_core::LabelType;

use crate::element::Element;

/// A format that takes voxels in order, x fastest.
pub(crate) trait VoxelWriter {
    /// The next voxels, little-endian, in the volume's label type.
    fn write_voxels(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Writes what comes behind the voxels and hands the file back.
    fn finish(self: Box<Self>) -> io::Result<File>;
}

/// Bytes of one voxel.
pub(crate) fn bytes_of(label_type: LabelType) -> usize {
    Element::new(label_type, false).bytes()
}

/// Hands a buffered file back, all of it written.
pub(crate) fn unbuffer(buffered: BufWriter<File>) -> io::Result<File> {
    buffered.into_inner().map_err(io::IntoInnerError::into_error)
}

/// Voxels as they are, behind a header.
pub(crate) struct PlainWriter(pub(crate) BufWriter<File>);

impl VoxelWriter for PlainWriter {
    fn write_voxels(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn finish(self: Box<Self>) -> io::Result<File> {
        unbuffer(self.0)
    }
}

/// Voxels through gzip.
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
