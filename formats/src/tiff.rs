//! TIFF stacks: the pages become planes of the volume, as ImageJ's or OME's description defines.

use std::path::{Path, PathBuf};

use pumice_core::{Unit, VolumeInfo};

use crate::choice::{self, choose, choose_among, refuse_absent};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::layout::{FileAxis, Layout, Role};
use crate::options::OpenOptions;
use crate::placement;
use crate::stream::{ByteStream, ChainedStream, PlainStream};
use crate::tiff_axes::{self, Axes, PageAxis};
use crate::tiff_ifd::{Directory, TiffFile, tag};
use crate::tiff_page::{self, Compression, Page, PageShape};
use crate::volume_file::{Format, OpenStream, Takes, VolumeFile, Voxels};

/// First bytes of a file: byte order, and version 42 (classic) or 43 (BigTIFF).
const MAGICS: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];

/// TIFF files.
pub(crate) const FORMAT: Format = Format {
    name: "TIFF",
    takes: Takes { axes: true, ..Takes::NOTHING },
    recognises: |_, head| MAGICS.iter().any(|magic| head.starts_with(magic)),
    read,
};

/// Reads the directories of `path`.
fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let mut tiff = TiffFile::open(path)?;
    let pages = tiff.pages()?;
    let (shape, compression) = tiff_page::shape(path, &mut tiff, pages[0])?;
    let directory = tiff.directory(pages[0])?;
    let description = tiff.text(&directory, tag::IMAGE_DESCRIPTION)?.unwrap_or_default();
    let axes = understand(path, &mut tiff, &directory, &description, pages.len(), shape)?;
    let mut choices = Vec::new();
    let axes = match options.axes {
        Some(said) => axes.said_to_be(path, said)?,
        None => {
            choices.extend(axes.open_order());
            axes
        }
    };
    for warning in axes.warnings.iter().chain(&axes.assumed) {
        options.warnings.push(format!("{}: {warning}", path.display()));
    }
    let planes = axes.order.iter().try_fold(1u64, |n, a| n.checked_mul(a.1)).unwrap_or(u64::MAX);

    // A page that holds a volume must be alone, and its slices in a row: no slice of it is read without the others.
    if shape.depth > 1 {
        let in_a_row = Page::read(path, &mut tiff, pages[0])?.has_slices_in_a_row(&mut tiff, pages[0])?;
        if pages.len() > 1 || planes != shape.depth || !in_a_row {
            let slices = shape.depth;
            return Err(FormatError::unsupported(
                path,
                format!("a page holds a volume of {slices} slices (tag ImageDepth) that do not lie in a row"),
                "save one page a slice, or one such page alone without tiles and compression",
            ));
        }
    }

    // All pages in use must have the same shape.
    let contiguous = planes > pages.len() as u64;
    if !contiguous {
        for (number, &at) in pages.iter().enumerate().take(planes as usize).skip(1) {
            let (other, _) = tiff_page::shape(path, &mut tiff, at)?;
            same_shape(path, &format!("page {}", number + 1), shape, "page 1", other)?;
        }
    }

    // The axes are x, y, then those of the pages.
    let mut file_axes = vec![
        FileAxis { size: shape.width, role: Role::Space(0) },
        FileAxis { size: shape.height, role: Role::Space(1) },
    ];
    for &(axis, size) in &axes.order {
        let role = match axis {
            PageAxis::Z => Role::Space(2),
            PageAxis::Channel => Role::Fixed(choose(path, &choice::CHANNEL, options, size, &mut choices)?),
            PageAxis::Time => {
                // Many stacks of slices were saved as time steps, because ImageJ guesses so.
                let last = size.saturating_sub(1);
                let listed = format!("0 to {last}; if they are slices: --axes zyx");
                Role::Fixed(choose_among(
                    path,
                    &choice::TIME,
                    options,
                    size,
                    &listed,
                    |_| String::new(),
                    &mut choices,
                )?)
            }
        };
        file_axes.push(FileAxis { size, role });
    }

    let mut absent = vec![&choice::LAYER];
    for (axis, choice) in [(PageAxis::Time, &choice::TIME), (PageAxis::Channel, &choice::CHANNEL)] {
        if !axes.order.iter().any(|a| a.0 == axis) {
            absent.push(choice);
        }
    }
    refuse_absent(path, options, &absent)?;

    let element_bytes = Element::new(shape.label_type, false).bytes();
    let layout = Layout::new(path, file_axes, element_bytes)?;
    let info = place(path, &axes, VolumeInfo::new(layout.dims(), shape.label_type), options)?;
    let (element, stream) = if contiguous {
        one_directory(path, &mut tiff, pages[0], compression, planes, &layout)?
    } else {
        (Element::new(shape.label_type, false), page_stream(path, pages, axes.page_of_plane, planes, shape))
    };
    Ok(VolumeFile {
        format: axes.format,
        encoding: match compression {
            Compression::None => "raw",
            Compression::Lzw => "LZW",
            Compression::Deflate => "deflate",
            Compression::PackBits => "PackBits",
        }
        .into(),
        info,
        layout,
        element,
        layers: Vec::new(),
        choices,
        voxels: Voxels::of_stream(stream, compression != Compression::None),
    })
}

/// Derives the axes of the pages from the description.
fn understand(
    path: &Path,
    tiff: &mut TiffFile,
    directory: &Directory,
    description: &str,
    pages: usize,
    shape: PageShape,
) -> Result<Axes> {
    let mut length = |id| -> Result<Option<f64>> {
        // The resolution is in pixels per unit; files without one have 0 or 0/0.
        Ok(tiff.rational(directory, id)?.filter(|r| r.is_finite() && *r > 0.0).map(|r| 1.0 / r))
    };
    let pixel = [length(tag::X_RESOLUTION)?, length(tag::Y_RESOLUTION)?];
    if description.starts_with("ImageJ=") {
        return tiff_axes::imagej(path, description, pages as u64, pixel);
    }
    let xml = description.trim_start_matches('\u{feff}').trim_start();
    if xml.starts_with('<') && xml.contains("<OME") || xml.starts_with("<ome:OME") {
        return tiff_axes::ome(path, xml, pages);
    }
    let size = [shape.width, shape.height];
    let mut axes = match pages {
        1 if shape.depth > 1 => tiff_axes::volume(shape.depth),
        _ => tiff_axes::shaped(description, pages as u64, size)
            .unwrap_or_else(|| tiff_axes::plain(pages as u64)),
    };
    // Resolution of the printed page; the unit is 2 for inch, 3 for centimetre. Without a length along z it does not give a voxel size.
    let unit_mm = match tiff.number(directory, tag::RESOLUTION_UNIT)? {
        Some(2) => Some(25.4),
        Some(3) => Some(10.0),
        _ => None,
    };
    if let ([Some(x), Some(y)], Some(mm)) = (pixel, unit_mm) {
        axes.warnings.push(format!(
            "the resolution tags give {} × {} mm a pixel, but nothing along z; they are not used",
            x * mm,
            y * mm
        ));
    }
    Ok(axes)
}

/// Sets spacing and unit; a missing length becomes 1, with a warning.
fn place(path: &Path, axes: &Axes, mut info: VolumeInfo, options: &OpenOptions) -> Result<VolumeInfo> {
    info.unit = axes.unit;
    if axes.spacing[0].is_none() && axes.spacing[1].is_none() {
        info.unit = Unit::Unknown;
    }
    if options.spacing.is_none() {
        let missing: Vec<&str> = (0..3)
            .filter(|&a| axes.spacing[a].is_none() && (a < 2 || info.dims[2] > 1))
            .map(|a| ["x", "y", "z"][a])
            .collect();
        if !missing.is_empty() {
            options.warnings.push(format!(
                "{}: the file has no spacing along {}; 1 is assumed there (give --spacing x,y,z)",
                path.display(),
                missing.join(", ")
            ));
        }
    }
    let spacing = axes.spacing.map(|s| s.unwrap_or(1.0));
    Ok(info.from_centre_affine(placement::from_spacing(path, spacing, options)?))
}

/// One directory for all planes, which lie one after the other, uncompressed: the form in which ImageJ writes stacks above 4 GiB.
fn one_directory(
    path: &Path,
    tiff: &mut TiffFile,
    page_at: u64,
    compression: Compression,
    planes: u64,
    layout: &Layout,
) -> Result<(Element, OpenStream)> {
    let page = Page::read(path, tiff, page_at)?;
    let start = page.chunks.first().map_or(0, |c| c.0);
    let stored = tiff.file_bytes.saturating_sub(start);
    if compression != Compression::None || !page.is_contiguous() || stored < layout.total_bytes() {
        return Err(FormatError::damaged(
            path,
            format!(
                "the description promises {planes} planes, but the file has fewer pages and {stored} bytes after the first \
                 plane's start; expected {} bytes",
                layout.total_bytes()
            ),
        ));
    }
    let path = path.to_owned();
    let stream: OpenStream =
        Box::new(move || Ok(Box::new(PlainStream::open(&path, start)?) as Box<dyn ByteStream>));
    Ok((Element::new(page.shape.label_type, tiff.big_endian), stream))
}

/// The pages one after the other, each opened only when it is needed.
fn page_stream(
    path: &Path,
    pages: Vec<u64>,
    page_of_plane: Option<Vec<usize>>,
    planes: u64,
    shape: PageShape,
) -> OpenStream {
    let path = path.to_owned();
    Box::new(move || {
        let part_bytes = plane_bytes(shape);
        let names: Vec<PathBuf> = vec![path.clone(); planes as usize];
        Ok(Box::new(ChainedStream::new(names, part_bytes, move |plane| {
            let number = page_of_plane.as_ref().map_or(plane, |map| map[plane]);
            let mut tiff = TiffFile::open(&path)?;
            Page::read(&path, &mut tiff, pages[number])?.into_stream()
        })))
    })
}

/// Bytes of one plane. The layout has checked that the product does not overflow.
pub(crate) fn plane_bytes(shape: PageShape) -> u64 {
    shape.width * shape.height * Element::new(shape.label_type, false).bytes() as u64
}

/// Returns an error unless two slices have the same size and type.
pub(crate) fn same_shape(
    path: &Path,
    this_name: &str,
    expected: PageShape,
    first_name: &str,
    got: PageShape,
) -> Result<()> {
    if expected == got {
        return Ok(());
    }
    let size = |shape: PageShape| match shape.depth {
        1 => format!("{} × {}", shape.width, shape.height),
        depth => format!("{} × {} × {depth}", shape.width, shape.height),
    };
    Err(FormatError::damaged(
        path,
        format!(
            "{this_name} has {} pixels of {:?}, expected {} of {:?} as {first_name}",
            size(got),
            got.label_type,
            size(expected),
            expected.label_type
        ),
    ))
}
