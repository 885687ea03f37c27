//! The formats of label volumes that can be read, recognised by content first and by name second.

use std::fmt::Write as _;
use std::io::Read;
use std::path::Path;

use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::options::OpenOptions;
use crate::stream::open_file;
use crate::volume_file::{Format, Takes, VolumeFile};
use crate::{
    hdf5_format, metaimage, n5, nifti, npy, npz, nrrd, precomputed, raw, server, stores, tiff, tiff_folder,
    zarr_format,
};

/// The formats in the order in which they are tried: those with a magic number come before NIfTI and MetaImage, which also go by the file's
/// name.
const FORMATS: [Format; 7] = [
    nrrd::FORMAT,
    tiff::FORMAT,
    npy::FORMAT,
    npz::FORMAT,
    hdf5_format::FORMAT,
    nifti::FORMAT,
    metaimage::FORMAT,
];

/// The formats that are folders, recognised by the files in them.
const FOLDERS: [Format; 3] = [zarr_format::FORMAT, precomputed::FORMAT, n5::FORMAT];

/// Number of bytes at a file's start that are used to recognise it; enough for every magic number.
const HEAD_BYTES: u64 = 1024;

/// Reads the header of a file, or of a folder that is a store or holds TIFF slices. Raw voxels are read where the options describe them.
///
/// # Errors
/// [`FormatError::Cancelled`] soon after the caller has given up, also where a server is silent.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    server::heeding(&options.cancelled, || read_any(path, options))
        .map_err(|error| if options.cancelled.is_set() { FormatError::Cancelled } else { error })
}

fn read_any(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    options.outputs.check_input(path)?;
    let url = stores::store_url(path);
    if let (Some(url), Some(_)) = (&url, &options.raw) {
        return Err(FormatError::unsupported(
            url,
            "raw voxels are not read from a server",
            "copy the file to this machine",
        ));
    }
    if let Some(layout) = &options.raw {
        refuse_others(path, options, Takes::NOTHING, "raw voxels", "raw voxels lie with x fastest")?;
        return raw::read(path, layout, options);
    }
    if let Some(url) = url {
        stores::server_descriptions(&url, &options.cancelled)?;
        return match FOLDERS.iter().find(|format| (format.recognises)(&url, &[])) {
            Some(format) => read_folder(&url, format, options),
            None => Err(unknown(&url, "no store that is known")),
        };
    }
    // A file dialog that cannot choose a folder chooses the file in it that describes the store.
    let is_store = |folder: &&Path| FOLDERS.iter().any(|format| (format.recognises)(folder, &[]));
    let path = stores::folder_of(path).filter(is_store).unwrap_or(path);
    let metadata = std::fs::metadata(path).map_err(FormatError::io(path))?;
    if metadata.is_dir() {
        if let Some(format) = FOLDERS.iter().find(|format| (format.recognises)(path, &[])) {
            return read_folder(path, format, options);
        }
        let axes = "slices of a folder have x and y, and lie along z";
        refuse_others(path, options, Takes::NOTHING, "a folder of slices", axes)?;
        return tiff_folder::read(path, options);
    }
    let mut head = Vec::new();
    open_file(path)?.take(HEAD_BYTES).read_to_end(&mut head).map_err(FormatError::io(path))?;
    if head.is_empty() {
        return Err(FormatError::damaged(path, "the file is empty"));
    }
    match FORMATS.iter().find(|format| (format.recognises)(path, &head)) {
        Some(format) => {
            let what = format!("{} files", format.name);
            refuse_others(path, options, format.takes, &what, &format!("{what} say which axis is which"))?;
            (format.read)(path, options)
        }
        None => Err(unknown(path, &guess(&head))),
    }
}

/// Reads the description of a store.
fn read_folder(folder: &Path, format: &Format, options: &OpenOptions) -> Result<VolumeFile> {
    let what = format!("{} folders", format.name);
    refuse_others(folder, options, format.takes, &what, &format!("{what} say which axis is which"))?;
    (format.read)(folder, options)
}

/// Refuses the options that leave nothing to choose in a file; `what` is its kind in the plural, and `axes` says who decides their order.
fn refuse_others(path: &Path, options: &OpenOptions, takes: Takes, what: &str, axes: &str) -> Result<()> {
    let refuse =
        |option: String, why: String| Err(FormatError::NotApplicable { path: path.to_owned(), option, why });
    if let (Some(order), false) = (options.axes, takes.axes) {
        let why = format!(
            "{axes}; only TIFF files, .npy and .npz arrays, HDF5 and plain Zarr arrays leave it open"
        );
        return refuse(format!("--axes {}", order.name()), why);
    }
    if let (Some(name), false) = (&options.array, takes.array) {
        let why = format!("{what} have no named arrays; only .npz archives do");
        return refuse(format!("--array {}", shorten(name)), why);
    }
    if let (Some(name), false) = (&options.dataset, takes.dataset) {
        let why = format!("{what} hold no data sets by path; HDF5 files, Zarr and N5 folders do");
        return refuse(format!("--dataset {}", shorten(name)), why);
    }
    if let (Some(name), false) = (&options.label, takes.label) {
        let why = format!("{what} have no label images by name; only OME-Zarr folders do");
        return refuse(format!("--label {}", shorten(name)), why);
    }
    if let (Some(scale), false) = (&options.scale, takes.scale) {
        let why = format!("{what} hold one level; OME-Zarr, N5 and Neuroglancer folders may hold several");
        return refuse(format!("--scale {scale}"), why);
    }
    if let (Some(missing), false) = (options.missing_chunks, takes.missing_chunks) {
        let why = format!("{what} have no chunks that may be absent; Zarr, N5 and Neuroglancer folders do");
        return refuse(format!("--missing-chunks {}", missing.name()), why);
    }
    Ok(())
}

/// A guess at what a file of unknown format is.
fn guess(head: &[u8]) -> String {
    const KNOWN: [(&[u8], &str); 8] = [
        (b"\x89PNG", "a PNG picture"),
        (b"\xFF\xD8\xFF", "a JPEG picture"),
        (b"%PDF", "a PDF document"),
        (
            &pumice_core::file::MAGIC,
            "a .pumice file, and a source is needed: pumice decompress writes one from it",
        ),
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
    let folders = FOLDERS.map(|format| format.name).join(", ");
    FormatError::Unknown {
        path: path.to_owned(),
        what: format!(
            "this is {what}; expected {formats}, a folder ({folders}, TIFF slices), or raw voxels with their size and \
             type given"
        ),
    }
}
