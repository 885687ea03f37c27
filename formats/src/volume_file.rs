//! Description of a label volume in a file, from its header; and the functions that a format must provide to read its files.
//!
//! A format module makes a [`VolumeFile`] and does not depend on other formats. [`crate::registry`] lists the formats.

use std::path::Path;

use pumice_core::VolumeInfo;

use crate::choice::OpenChoice;
use crate::element::Element;
use crate::error::Result;
use crate::layout::Layout;
use crate::options::OpenOptions;
use crate::stream::ByteStream;

/// A format of label volumes: how its files are recognised and read.
pub(crate) struct Format {
    /// Common name, for messages.
    pub(crate) name: &'static str,
    /// Whether its files leave the order of axes open, so that [`crate::OpenOptions::axes`] applies.
    pub(crate) asks_axes: bool,
    /// Whether its files hold arrays by name, so that [`crate::OpenOptions::array`] applies.
    pub(crate) has_arrays: bool,
    /// Whether a file is of this format, by its path and its first bytes.
    pub(crate) recognises: fn(&Path, &[u8]) -> bool,
    /// Reads the header.
    pub(crate) read: fn(&Path, &OpenOptions) -> Result<VolumeFile>,
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
pub(crate) type OpenStream = Box<dyn FnOnce() -> Result<Box<dyn ByteStream>>>;

/// A label volume in a file: the content of its header, and access to the voxels.
pub(crate) struct VolumeFile {
    /// Name of the format and variant: `NIfTI-2`, `TIFF (OME)`.
    pub(crate) format: &'static str,
    /// Storage of the voxels: `raw`, `gzip`, `ascii`, `deflate`, …
    pub(crate) encoding: String,
    pub(crate) info: VolumeInfo,
    pub(crate) layout: Layout,
    pub(crate) element: Element,
    /// Layers, where the file has overlapping segments; otherwise empty.
    pub(crate) layers: Vec<Layer>,
    /// What the caller has not chosen; the first of each is described.
    pub(crate) choices: Vec<OpenChoice>,
    pub(crate) stream: OpenStream,
}
