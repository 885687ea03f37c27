//! Which format is this? Content first, extension second.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use pumice_core::{BlockSource, VolumeInfo};

use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::layout::Layout;
use crate::options::OpenOptions;
use crate::slab::SlabSource;
use crate::stream::ByteStream;
use crate::{metaimage, nifti, npy, npz, nrrd, raw, tiff, tiff_folder};

/// What the header of a file says.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Name of the format, as people call it.
    pub format: &'static str,
    /// How the voxels are stored: `raw`, `gzip`, `ascii`, `deflate`, …
    pub encoding: String,
    /// Size, type, place, names.
    pub info: VolumeInfo,
    /// Layers, where the file has overlapping segments; else empty.
    pub layers: Vec<Layer>,
    /// Bytes of the volume's voxels in the file's own type, without compression and without other layers.
    pub bytes_uncompressed: u64,
    /// What the user should know though it is no error.
    pub warnings: Vec<String>,
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

/// What a format module has understood of a file.
pub(crate) struct Found {
    pub(crate) format: &'static str,
    pub(crate) encoding: String,
    pub(crate) info: VolumeInfo,
    pub(crate) layout: Layout,
    pub(crate) element: Element,
    pub(crate) layers: Vec<Layer>,
    /// A choice that the caller still has to make: no error when only the header is wanted.
    pub(crate) undecided: Option<FormatError>,
    pub(crate) stream: OpenStream,
}

/// Opens a label volume for reading by blocks.
///
/// # Errors
/// One line that says what and where, for any content whatsoever.
pub fn open(path: &Path, options: &OpenOptions) -> std::result::Result<Box<dyn BlockSource>, FormatError> {
    let found = find(path, options)?;
    if let Some(undecided) = found.undecided {
        return Err(undecided);
    }
    let stream = (found.stream)()?;
    let warnings = options.warnings.clone();
    Ok(Box::new(SlabSource::new(path.to_owned(), found.info, found.layout, found.element, stream, warnings)?))
}

/// Reads the header only.
///
/// # Errors
/// As [`open`], but a layer, time step or channel need not be chosen: then the first one is described.
pub fn probe(path: &Path, options: &OpenOptions) -> std::result::Result<Probe, FormatError> {
    let found = find(path, options)?;
    let voxels = found.info.voxels();
    Ok(Probe {
        format: found.format,
        encoding: found.encoding,
        info: found.info,
        layers: found.layers,
        bytes_uncompressed: voxels * found.element.bytes() as u64,
        warnings: options.warnings.list(),
    })
}

/// The first bytes of a file, enough for every magic number.
const HEAD_BYTES: u64 = 1024;

/// Byte order and version 42 (classic) or 43 (BigTIFF).
const TIFF_MAGIC: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];

fn find(path: &Path, options: &OpenOptions) -> Result<Found> {
    if let Some(layout) = &options.raw {
        return raw::read(path, layout, options);
    }
    let metadata = std::fs::metadata(path).map_err(FormatError::io(path))?;
    if metadata.is_dir() {
        return tiff_folder::read(path, options);
    }
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head))
        .map_err(FormatError::io(path))?;
    if head.is_empty() {
        return Err(FormatError::damaged(path, "the file is empty"));
    }
    if head.starts_with(b"NRRD") {
        return nrrd::read(path, options);
    }
    if TIFF_MAGIC.iter().any(|magic| head.starts_with(magic)) {
        return tiff::read(path, options);
    }
    if head.starts_with(npy::MAGIC) {
        return npy::read(path, options);
    }
    if npz::MAGICS.iter().any(|magic| head.starts_with(magic)) {
        return npz::read(path, options);
    }
    if nifti::recognises(path, &head) {
        return nifti::read(path, options);
    }
    if metaimage::recognises(path, &head) {
        return metaimage::read(path, options);
    }
    Err(unknown(path, &guess(&head)))
}

/// What an unreadable file seems to be.
fn guess(head: &[u8]) -> String {
    const KNOWN: [(&[u8], &str); 9] = [
        (
            b"\x89HDF\r\n\x1a\n",
            "HDF5, which this version does not read: export the label array as NRRD, TIFF or NPY",
        ),
        (b"\x89PNG", "a PNG picture"),
        (b"\xFF\xD8\xFF", "a JPEG picture"),
        (b"%PDF", "a PDF document"),
        (b"PUMICE", "a compressed Pumice volume, not a source volume"),
        (b"# vtk DataFile", "legacy VTK, which is not read: export NRRD or MetaImage"),
        (b"<?xml", "an XML file"),
        (b"MATLAB 5.0", "a MATLAB file: save the labels with numpy.save or nrrdwrite"),
        (b"BZh", "bzip2-compressed: unpack it first"),
    ];
    if let Some((_, what)) = KNOWN.iter().find(|(magic, _)| head.starts_with(magic)) {
        return (*what).to_owned();
    }
    let mut text = String::from("a file that begins with bytes");
    for byte in head.iter().take(8) {
        // Writing to a string cannot fail.
        let _ = write!(text, " {byte:02x}");
    }
    text
}

fn unknown(path: &Path, what: &str) -> FormatError {
    FormatError::Unknown {
        path: path.to_owned(),
        what: format!(
            "this is {what}; expected NRRD, NIfTI, TIFF, NPY/NPZ, MetaImage, a folder of TIFF slices, or raw voxels with \
             their size and type given"
        ),
    }
}
