//! Reads voxels without any header: size and type come from the caller.

use std::path::Path;

use pumice_core::VolumeInfo;

use crate::choice::{self, refuse_absent};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::gzip::{GZIP_MAGIC, InflateStream, Wrapping};
use crate::layout::Layout;
use crate::options::{OpenOptions, RawLayout};
use crate::placement;
use crate::stream::{ByteStream, PlainStream, open_file};
use crate::volume_file::{VolumeFile, Voxels};

/// Describes the file at `path` with the layout `raw`.
pub(crate) fn read(path: &Path, raw: &RawLayout, options: &OpenOptions) -> Result<VolumeFile> {
    refuse_absent(path, options, &[&choice::TIME, &choice::CHANNEL, &choice::LAYER])?;
    if raw.big_endian && Element::new(raw.label_type, false).bytes() == 1 {
        return Err(FormatError::NotApplicable {
            path: path.to_owned(),
            option: "--raw-big-endian".into(),
            why: "the labels have one byte each".into(),
        });
    }
    let element = Element::new(raw.label_type, raw.big_endian);
    let layout = Layout::x_fastest(path, raw.dims, element.bytes())?;
    let mut magic = [0; 2];
    let mut file = open_file(path)?;
    let bytes = file.metadata().map_err(FormatError::io(path))?.len();
    let gzip = std::io::Read::read_exact(&mut file, &mut magic).is_ok() && magic == GZIP_MAGIC;
    if !gzip && bytes.saturating_sub(raw.offset) < layout.total_bytes() {
        return Err(FormatError::Short {
            path: path.to_owned(),
            expected: layout.total_bytes(),
            got: bytes.saturating_sub(raw.offset),
            at: None,
        });
    }
    if options.spacing.is_none() {
        options.warnings.push(format!(
            "{}: raw voxels have no spacing; 1 is assumed along each axis (give --spacing x,y,z)",
            path.display()
        ));
    }
    let affine = placement::from_spacing(path, [1.0; 3], options)?;
    let info = VolumeInfo::new(layout.dims(), raw.label_type).from_centre_affine(affine);
    let (path, offset, warnings) = (path.to_owned(), raw.offset, options.warnings.clone());
    Ok(VolumeFile {
        format: "raw",
        encoding: if gzip { "gzip" } else { "raw" }.into(),
        info,
        layout,
        element,
        layers: Vec::new(),
        choices: Vec::new(),
        voxels: Voxels::of_stream(
            Box::new(move || {
                if gzip {
                    let mut stream = InflateStream::open(&path, 0, Wrapping::Gzip, &warnings)?;
                    stream.skip(offset)?;
                    Ok(Box::new(stream))
                } else {
                    Ok(Box::new(PlainStream::open(&path, offset)?))
                }
            }),
            gzip,
        ),
    })
}
