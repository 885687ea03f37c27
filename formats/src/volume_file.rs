//! Description of a label volume in a file, from its header; and the functions that a format must provide to read its files.
//!
//! A format module makes a [`VolumeFile`] and does not depend on other formats. [`crate::registry`] lists the formats.

use std::path::Path;

use pumice_core::VolumeInfo;

use crate::choice::OpenChoice;
use crate::chunks::Chunks;
use crate::element::Element;
use crate::error::Result;
use crate::layout::Layout;
use crate::options::OpenOptions;
use crate::stream::ByteStream;

/// A format of label volumes: how its files are recognised and read.
pub(crate) struct Format {
    /// Common name, for messages.
    pub(crate) name: &'static str,
    /// The options that its files leave to the caller.
    pub(crate) takes: Takes,
    /// Whether a file is of this format, by its path and its first bytes. A folder has no bytes.
    pub(crate) recognises: fn(&Path, &[u8]) -> bool,
    /// Reads the header.
    pub(crate) read: fn(&Path, &OpenOptions) -> Result<VolumeFile>,
}

/// Which options have a meaning for the files of a format; the others are refused by name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Takes {
    /// Files leave the order of axes open: [`OpenOptions::axes`].
    pub(crate) axes: bool,
    /// Files hold arrays by name: [`OpenOptions::array`].
    pub(crate) array: bool,
    /// Files hold data sets by path: [`OpenOptions::dataset`].
    pub(crate) dataset: bool,
    /// Files hold the volume at several levels: [`OpenOptions::scale`].
    pub(crate) scale: bool,
    /// Files hold several label images of one picture: [`OpenOptions::label`].
    pub(crate) label: bool,
    /// Chunks may be absent: [`OpenOptions::missing_chunks`].
    pub(crate) missing_chunks: bool,
}

impl Takes {
    /// None of the options.
    pub(crate) const NOTHING: Self =
        Self { axes: false, array: false, dataset: false, scale: false, label: false, missing_chunks: false };
}

/// One of several label maps of the same region.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Index that chooses it, from 0.
    pub index: u32,
    /// Names of its segments, if the file has any.
    pub segments: Vec<String>,
}

/// Opens the stream of voxels when they are needed.
pub(crate) type OpenStream = Box<dyn FnOnce() -> Result<Box<dyn ByteStream>> + Send>;

/// How the voxels of a file are reached.
pub(crate) enum Voxels {
    /// From first to last: compressed, or with a checksum.
    Stream(OpenStream),
    /// As they are stored, without compression: what is not wanted is skipped.
    Plain(OpenStream),
    /// Chunk by chunk, in any order.
    Chunks(Chunks),
}

impl Voxels {
    /// Those of a stream that is compressed, or not.
    pub(crate) fn of_stream(open: OpenStream, is_compressed: bool) -> Self {
        if is_compressed { Self::Stream(open) } else { Self::Plain(open) }
    }
}

/// A label volume in a file: the content of its header, and access to the voxels.
pub(crate) struct VolumeFile {
    /// Name of the format and variant: `NIfTI-2`, `TIFF (OME)`.
    pub(crate) format: &'static str,
    /// Storage of the voxels: `raw`, `gzip`, `ascii`, `deflate`, …
    pub(crate) encoding: String,
    /// The whole volume, whatever region of it the caller wants.
    pub(crate) info: VolumeInfo,
    pub(crate) layout: Layout,
    pub(crate) element: Element,
    /// Layers, where the file has overlapping segments; otherwise empty.
    pub(crate) layers: Vec<Layer>,
    /// What the caller has not chosen; the first of each is described.
    pub(crate) choices: Vec<OpenChoice>,
    pub(crate) voxels: Voxels,
}
