//! A folder of TIFF slices: one plane per file, in the order of the numbers in the file names.

use std::path::{Path, PathBuf};

use pumice_core::VolumeInfo;

use crate::choice::{self, refuse_absent};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::layout::Layout;
use crate::natural_order::natural;
use crate::options::OpenOptions;
use crate::placement;
use crate::slice_numbers::{Gap, gap};
use crate::stream::{ByteStream, ChainedStream};
use crate::tiff::{plane_bytes, same_shape};
use crate::tiff_ifd::TiffFile;
use crate::tiff_page::{self, Compression, Page};
use crate::volume_file::{VolumeFile, Voxels};

/// Reads the headers of the slices in `folder`.
pub(crate) fn read(folder: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    refuse_absent(folder, options, &[&choice::TIME, &choice::CHANNEL, &choice::LAYER])?;
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(FormatError::io(folder))? {
        let path = entry.map_err(FormatError::io(folder))?.path();
        let hidden = path.file_name().is_none_or(|n| n.to_string_lossy().starts_with('.'));
        let tiff =
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case("tif") || e.eq_ignore_ascii_case("tiff"));
        if tiff && !hidden {
            files.push(path);
        }
    }
    files.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
    let Some(first) = files.first() else {
        return Err(FormatError::Unknown {
            path: folder.to_owned(),
            what:
                "the folder has no TIFF slices (.tif, .tiff) in it, and is no Zarr, N5 or Neuroglancer store"
                    .into(),
        });
    };
    refuse_gap(folder, &files)?;

    // All slices must have the same shape and one page each.
    let mut expected = None;
    for file in &files {
        options.outputs.check_input(file)?;
        let mut tiff = TiffFile::open(file)?;
        let pages = tiff.pages()?;
        if pages.len() > 1 {
            return Err(FormatError::damaged(
                file,
                format!(
                    "a slice of a folder must have one page, this file has {}: open it by itself",
                    pages.len()
                ),
            ));
        }
        let (shape, compression) = tiff_page::shape(file, &mut tiff, pages[0])?;
        if shape.depth > 1 {
            let what = format!(
                "a slice of a folder must be one slice, this page holds {} (tag ImageDepth)",
                shape.depth
            );
            return Err(FormatError::damaged(file, format!("{what}: open it by itself")));
        }
        let (wanted, _) = *expected.get_or_insert((shape, compression));
        let first_name = first.file_name().unwrap_or_default().to_string_lossy();
        same_shape(file, "this slice", wanted, &first_name, shape)?;
    }
    let Some((shape, compression)) = expected else {
        return Err(FormatError::damaged(folder, "the folder has no slices"));
    };

    let element = Element::new(shape.label_type, false);
    let dims = [shape.width, shape.height, files.len() as u64];
    let layout = Layout::x_fastest(folder, dims, element.bytes())?;
    if options.spacing.is_none() {
        options.warnings.push(format!(
            "{}: slices in a folder have no spacing; 1 is assumed along each axis (give --spacing x,y,z)",
            folder.display()
        ));
    }
    let affine = placement::from_spacing(folder, [1.0; 3], options)?;
    let info = VolumeInfo::new(layout.dims(), shape.label_type).from_centre_affine(affine);
    let stream = Box::new(move || {
        let paths = files.clone();
        Ok(Box::new(ChainedStream::new(files, plane_bytes(shape), move |slice| {
            let mut tiff = TiffFile::open(&paths[slice])?;
            let page = tiff.pages()?[0];
            Page::read(&paths[slice], &mut tiff, page)?.into_stream()
        })) as Box<dyn ByteStream>)
    });
    Ok(VolumeFile {
        format: "folder of TIFF slices",
        encoding: if compression == Compression::None { "raw" } else { "compressed" }.into(),
        info,
        layout,
        element,
        layers: Vec::new(),
        choices: Vec::new(),
        voxels: Voxels::of_stream(stream, compression != Compression::None),
    })
}

/// Refuses a folder in which a slice is missing: what is read would be too short, and all behind the gap in the wrong place.
fn refuse_gap(folder: &Path, files: &[PathBuf]) -> Result<()> {
    let names: Vec<_> = files.iter().map(|f| f.file_name().unwrap_or_default().to_string_lossy()).collect();
    let names: Vec<&str> = names.iter().map(|name| name.as_ref()).collect();
    let Some(Gap { missing, count, before, after }) = gap(&names) else { return Ok(()) };
    let more = if count == 1 { String::new() } else { format!(" (the first of {count})") };
    Err(FormatError::damaged(
        folder,
        format!(
            "slice number {missing} is missing between {before} and {after}{more}: add it, or number the slices without a gap"
        ),
    ))
}
