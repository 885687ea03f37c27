//! MetaImage (`.mha`, or `.mhd` with files beside it), the format of ITK: axes, placement, and where the voxels are.
//!
//! World space is ITK's, LPS. Each run of `NDims` numbers in `TransformMatrix` is the direction of one axis of the volume (as in ITK's
//! `MetaImageIO`), and `Offset` is the centre of the first voxel.

use std::path::Path;

use glam::DVec3;
use pumice_core::{Unit, VolumeInfo, WorldFrame};

use crate::choice::{self, choose, refuse_absent};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::gzip::{GZIP_MAGIC, InflateStream, Wrapping};
use crate::layout::{FileAxis, Layout, Role};
use crate::metaimage_header::{self, DataFile, Encoding, MetaHeader};
use crate::options::{OpenOptions, Warnings};
use crate::placement;
use crate::stream::{ByteStream, ChainedStream, PlainStream, detached_files, open_file};
use crate::text_stream::TextStream;
use crate::volume_file::{Format, OpenStream, Takes, VolumeFile, Voxels};

/// MetaImage files.
pub(crate) const FORMAT: Format = Format { name: "MetaImage", takes: Takes::NOTHING, recognises, read };

/// Whether a file is a MetaImage. The format has no magic number, so its first fields decide, or else the file's name.
fn recognises(path: &Path, head: &[u8]) -> bool {
    let named =
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mha") || e.eq_ignore_ascii_case("mhd"));
    named || metaimage_header::recognises(head)
}

/// Reads the header of `path`.
fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let header = metaimage_header::read(path)?;
    // Numbers written as text are converted to little-endian.
    let big_endian = header.big_endian && header.encoding != Encoding::Ascii;
    let element = Element::new(header.label_type, big_endian);

    // The axes are x, y, z, then time.
    let mut choices = Vec::new();
    let mut axes = Vec::new();
    for (a, &size) in header.sizes.iter().enumerate() {
        let role = if a < 3 {
            Role::Space(a)
        } else {
            Role::Fixed(choose(path, &choice::TIME, options, size, &mut choices)?)
        };
        axes.push(FileAxis { size, role });
    }
    let has_time = header.sizes.len() > 3;
    let absent: &[_] = if has_time {
        &[&choice::CHANNEL, &choice::LAYER]
    } else {
        &[&choice::TIME, &choice::CHANNEL, &choice::LAYER]
    };
    refuse_absent(path, options, absent)?;
    let layout = Layout::new(path, axes, element.bytes())?;
    let info = place(path, &header, VolumeInfo::new(layout.dims(), header.label_type), options)?;
    let (stream, encoding) = data(path, &header, &layout, options)?;
    Ok(VolumeFile {
        format: "MetaImage",
        encoding,
        info,
        layout,
        element,
        layers: Vec::new(),
        choices,
        voxels: Voxels::of_stream(stream, header.encoding != Encoding::Raw),
    })
}

/// Sets spacing, directions, origin and unit.
fn place(
    path: &Path,
    header: &MetaHeader,
    mut info: VolumeInfo,
    options: &OpenOptions,
) -> Result<VolumeInfo> {
    let count = header.sizes.len();
    let mut spacing = [1.0; 3];
    match &header.spacing {
        Some(lengths) => spacing.iter_mut().zip(lengths).for_each(|(s, &length)| *s = length),
        None if options.spacing.is_none() => options.warnings.push(format!(
            "{}: the header has no spacing; 1 is assumed along each axis (give --spacing x,y,z)",
            path.display()
        )),
        None => {}
    }
    // The lengths are checked before the directions are multiplied in, or else a negative length would mirror the volume unnoticed.
    placement::from_spacing(path, spacing, options)?;
    let mut axes = DVec3::AXES;
    if let Some(directions) = &header.directions {
        for (a, axis) in axes.iter_mut().enumerate().take(count) {
            // An image of two axes lies in the plane z = 0.
            *axis =
                DVec3::from_array([0, 1, 2].map(|i| if i < count { directions[a * count + i] } else { 0.0 }));
        }
    }
    for (axis, length) in axes.iter_mut().zip(spacing) {
        *axis *= length;
    }
    let mut origin = DVec3::ZERO;
    if let Some(offset) = &header.origin {
        (0..count.min(3)).for_each(|a| origin[a] = offset[a]);
    }
    let affine = placement::world_from_centre(path, axes, origin, options)?;
    info.frame = WorldFrame::Lps;
    info.unit = unit(path, header.units.as_deref(), &options.warnings);
    Ok(info.from_centre_affine(affine))
}

/// Unit from `DistanceUnits`, which few files have; ITK's world is in millimetres.
fn unit(path: &Path, name: Option<&str>, warnings: &Warnings) -> Unit {
    match name {
        None | Some("" | "?") => Unit::Millimetre,
        Some(name) => placement::unit_by_name(name).unwrap_or_else(|| {
            warnings.push(format!("{}: the unit {name:?} is not known", path.display()));
            Unit::Unknown
        }),
    }
}

/// Prepares access to the voxels.
fn data(
    path: &Path,
    header: &MetaHeader,
    layout: &Layout,
    options: &OpenOptions,
) -> Result<(OpenStream, String)> {
    let part = VoxelFile {
        encoding: header.encoding,
        header_size: header.header_size,
        bytes: layout.total_bytes(),
        compressed_bytes: header.compressed_bytes,
        label_type: header.label_type,
        warnings: options.warnings.clone(),
    };
    let encoding = match header.encoding {
        Encoding::Raw => "raw",
        Encoding::Ascii => "ascii",
        Encoding::Compressed => "zlib",
    };
    let names = match &header.data {
        DataFile::Local => {
            let place = part.place(path, header.end)?;
            let path = path.to_owned();
            return Ok((Box::new(move || part.open(&path, place)), encoding.into()));
        }
        DataFile::Names(names) => names,
    };
    let files = detached_files(path, names, &options.outputs)?;
    let encoding = format!("{encoding}, detached");
    if let [file] = files.as_slice() {
        let place = part.place(file, 0)?;
        let file = file.clone();
        return Ok((Box::new(move || part.open(&file, place)), encoding));
    }
    let count = files.len() as u64;
    if !layout.total_bytes().is_multiple_of(count) {
        return Err(FormatError::damaged(
            path,
            format!("{count} data files cannot hold equal parts of {} bytes of voxels", layout.total_bytes()),
        ));
    }
    // One compressed size cannot hold for each of several files.
    let part = VoxelFile { bytes: layout.total_bytes() / count, compressed_bytes: None, ..part };
    let part_bytes = part.bytes;
    let stream = Box::new(move || {
        let paths = files.clone();
        let open = move |i: usize| part.open(&paths[i], part.place(&paths[i], 0)?);
        Ok(Box::new(ChainedStream::new(files, part_bytes, open)) as Box<dyn ByteStream>)
    });
    Ok((stream, encoding))
}

/// One file with voxels.
struct VoxelFile {
    encoding: Encoding,
    header_size: i64,
    /// Bytes of voxels in the file.
    bytes: u64,
    compressed_bytes: Option<u64>,
    label_type: pumice_core::LabelType,
    warnings: Warnings,
}

impl VoxelFile {
    /// Byte offset at which the file's voxels begin, where `start` is the end of its own header. Returns an error if the file is too short.
    fn place(&self, path: &Path, start: u64) -> Result<u64> {
        let size = open_file(path)?.metadata().map_err(FormatError::io(path))?.len();
        let stored = match self.encoding {
            Encoding::Raw => self.bytes,
            Encoding::Compressed => self.compressed_bytes.unwrap_or(0),
            Encoding::Ascii => 0,
        };
        let place = match u64::try_from(self.header_size) {
            Ok(0) => start,
            // The offset counts from the file's start and lies after any header (MetaIO, `M_ReadElements`).
            Ok(skip) if skip >= start => skip,
            Ok(skip) => {
                return Err(FormatError::damaged(
                    path,
                    format!("HeaderSize is {skip}, but the header alone has {start} bytes"),
                ));
            }
            Err(_) if stored == 0 => {
                return Err(FormatError::damaged(
                    path,
                    "HeaderSize −1 needs voxels of known length, raw or compressed",
                ));
            }
            Err(_) => size.saturating_sub(stored).max(start),
        };
        let got = size.saturating_sub(place);
        if got >= stored {
            return Ok(place);
        }
        if self.encoding == Encoding::Raw {
            return Err(FormatError::Short { path: path.to_owned(), expected: stored, got, at: Some(size) });
        }
        Err(FormatError::Damaged {
            path: path.to_owned(),
            what: format!(
                "expected {stored} bytes of compressed data, got {got}: the file was not copied completely"
            ),
            at: Some(size),
        })
    }

    fn open(&self, path: &Path, place: u64) -> Result<Box<dyn ByteStream>> {
        Ok(match self.encoding {
            Encoding::Raw => Box::new(PlainStream::open(path, place)?),
            Encoding::Ascii => Box::new(TextStream::open(path, place, self.label_type)?),
            Encoding::Compressed => {
                // MetaIO lets its inflater distinguish gzip and zlib.
                let mut magic = [0; 2];
                let n = PlainStream::open(path, place)?.fill(&mut magic)?;
                let gzip = n == 2 && magic == GZIP_MAGIC;
                let wrapping = if gzip { Wrapping::Gzip } else { Wrapping::Zlib };
                Box::new(InflateStream::open(path, place, wrapping, &self.warnings)?)
            }
        })
    }
}
