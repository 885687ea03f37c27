//! The formats of label volumes that can be read, recognised by content first and by name second.

use std::fmt::Write as _;
use std::io::Read;
use std::path::Path;

use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::options::OpenOptions;
use crate::stream::open_file;
use crate::volume_file::{Format, VolumeFile};
use crate::{metaimage, nifti, npy, npz, nrrd, raw, tiff, tiff_folder};

/// The formats in the order in which they are tried: those with a magic number come before NIfTI and MetaImage, which also go by the file's
/// name.
const FORMATS: [Format; 6] =
    [nrrd::FORMAT, tiff::FORMAT, npy::FORMAT, npz::FORMAT, nifti::FORMAT, metaimage::FORMAT];

/// Number of bytes at a file's start that are used to recognise it; enough for every magic number.
const HEAD_BYTES: u64 = 1024;

/// Reads the header of a file, or of a folder of TIFF slices. Raw voxels are read where the options describe them.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    options.outputs.check_input(path)?;
    if let Some(layout) = &options.raw {
        refuse_axes(path, options, "raw voxels lie with x fastest")?;
        refuse_array(path, options, "raw voxels")?;
        return raw::read(path, layout, options);
    }
    let metadata = std::fs::metadata(path).map_err(FormatError::io(path))?;
    if metadata.is_dir() {
        refuse_axes(path, options, "slices of a folder have x and y, and lie along z")?;
        refuse_array(path, options, "a folder of slices")?;
        return tiff_folder::read(path, options);
    }
    let mut head = Vec::new();
    open_file(path)?.take(HEAD_BYTES).read_to_end(&mut head).map_err(FormatError::io(path))?;
    if head.is_empty() {
        return Err(FormatError::damaged(path, "the file is empty"));
    }
    match FORMATS.iter().find(|format| (format.recognises)(path, &head)) {
        Some(format) => {
            if !format.asks_axes {
                refuse_axes(path, options, &format!("{} files say which axis is which", format.name))?;
            }
            if !format.has_arrays {
                refuse_array(path, options, &format!("{} files", format.name))?;
            }
            (format.read)(path, options)
        }
        None => Err(unknown(path, &guess(&head))),
    }
}

/// Refuses an order of axes for a file that does not leave it open; `why` says who decides.
fn refuse_axes(path: &Path, options: &OpenOptions, why: &str) -> Result<()> {
    options.axes.map_or(Ok(()), |axes| {
        Err(FormatError::NotApplicable {
            path: path.to_owned(),
            option: format!("--axes {}", axes.name()),
            why: format!("{why}; only .npy and .npz arrays leave it open"),
        })
    })
}

/// Refuses the name of an array for a file that is no archive of arrays.
fn refuse_array(path: &Path, options: &OpenOptions, what: &str) -> Result<()> {
    options.array.as_ref().map_or(Ok(()), |name| {
        Err(FormatError::NotApplicable {
            path: path.to_owned(),
            option: format!("--array {}", shorten(name)),
            why: format!("{what} have no named arrays; only .npz archives do"),
        })
    })
}

/// A guess at what a file of unknown format is.
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
    let formats = FORMATS.map(|format| format.name).join(", ");
    FormatError::Unknown {
        path: path.to_owned(),
        what: format!(
            "this is {what}; expected {formats}, a folder of TIFF slices, or raw voxels with their size and type given"
        ),
    }
}
