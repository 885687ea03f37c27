//! A label volume in a file, as its header describes it; and what a format must tell so that its files can be read.
//!
//! A format module makes a [`VolumeFile`] and knows nothing of the other formats. [`crate::registry`] lists the formats.

use std::path::Path;

use pumice_core::VolumeInfo;

use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::layout::Layout;
use crate::options::OpenOptions;
use crate::stream::ByteStream;

/// A format of label volumes: how its files are recognised and read.
pub(crate) struct Format {
    /// What people call it, for messages.
    pub(crate) name: &'static str,
    /// Whether a file is of this format, by its path and its first bytes.
    pub(crate) recognises: fn(&Path, &[u8]) -> bool,
    /// Reads the header.
    pub(crate) read: fn(&Path, &OpenOptions) -> Result<VolumeFile>,
}

/// One of several label maps in the same place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Number to choose it by, from 0.
    pub index: u32,
    /// Names of its segments, as far as the file has them.
    pub segments: Vec<String>,
}

/// Opens the bytes of the voxels when they are wanted.
pub(crate) type OpenStream = Box<dyn FnOnce() -> Result<Box<dyn ByteStream>>>;

/// A label volume in a file: what the header says, and how to get at the voxels.
pub(crate) struct VolumeFile {
    /// The format, with its variant: `NIfTI-2`, `OME-TIFF`.
    pub(crate) format: &'static str,
    /// How the voxels are stored: `raw`, `gzip`, `ascii`, `deflate`, …
    pub(crate) encoding: String,
    pub(crate) info: VolumeInfo,
    pub(crate) layout: Layout,
    pub(crate) element: Element,
    /// Layers, where the file has overlapping segments; else empty.
    pub(crate) layers: Vec<Layer>,
    /// A choice that the caller still has to make. It is no error where only the header is wanted.
    pub(crate) undecided: Option<FormatError>,
    pub(crate) stream: OpenStream,
}
