//! NRRD (`.nrrd`, `.nhdr`) and 3D Slicer's `.seg.nrrd`: axes, placement, layers, segment names, and where the voxels are.
//!
//! A file may have a `list` or `vector` axis: Slicer stores overlapping segments as several label maps side by side. Only one of them is
//! read (`layer`). They are never merged, because a voxel with two labels would lose one of them.

use std::path::Path;

use glam::DVec3;
use pumice_core::{LabelNote, Unit, VolumeInfo, WorldFrame};

use crate::choice::{self, choose, choose_among, refuse_absent};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::gzip::{InflateStream, Wrapping};
use crate::layout::{FileAxis, Layout, Role};
use crate::nrrd_header::{self, DataFile, Encoding, NrrdHeader};
use crate::options::{OpenOptions, Warnings};
use crate::placement;
use crate::stream::{ByteStream, ChainedStream, CountingFile, PlainStream, detached_files, open_file};
use crate::text_stream::TextStream;
use crate::volume_file::{Format, Layer, OpenStream, Takes, VolumeFile, Voxels};

/// First bytes of a file, before its version.
const MAGIC: &[u8] = b"NRRD";

/// NRRD files.
pub(crate) const FORMAT: Format =
    Format { name: "NRRD", takes: Takes::NOTHING, recognises: |_, head| head.starts_with(MAGIC), read };

/// Reads the header of `path`.
fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let header = nrrd_header::read(path)?;
    let element = Element::new(header.label_type, header.big_endian);

    // Assign the axes, and choose the layer along a `list` axis.
    let mut choices = Vec::new();
    let axes = assign_axes(path, &header)?;
    let layer_count =
        axes.iter().find(|a| a.space.is_none() && a.is_layers && a.size > 1).map_or(1, |a| a.size);
    // Layers without segments have numbers alone, and are no segmentation of Slicer.
    let segments = segments(&header);
    let layers = if layer_count > 1 && !segments.is_empty() {
        list_layers(&segments, layer_count)
    } else {
        Vec::new()
    };
    let mut file_axes = Vec::new();
    for axis in &axes {
        let role = match axis.space {
            Some(space) => Role::Space(space),
            None if axis.size <= 1 => Role::Fixed(0),
            None if axis.is_layers => {
                let text_of = |index| layers.get(index as usize).map_or_else(String::new, segments_of);
                let last = axis.size.saturating_sub(1);
                let listed = if layers.is_empty() { format!("0 to {last}") } else { describe(&layers) };
                Role::Fixed(choose_among(
                    path,
                    &choice::LAYER,
                    options,
                    axis.size,
                    &listed,
                    text_of,
                    &mut choices,
                )?)
            }
            None => Role::Fixed(choose(path, &choice::TIME, options, axis.size, &mut choices)?),
        };
        file_axes.push(FileAxis { size: axis.size, role });
    }
    let has_time = axes.iter().any(|a| a.space.is_none() && !a.is_layers && a.size > 1);
    let mut absent = vec![&choice::CHANNEL];
    absent.extend((layer_count == 1).then_some(&choice::LAYER));
    absent.extend((!has_time).then_some(&choice::TIME));
    refuse_absent(path, options, &absent)?;
    let layout = Layout::new(path, file_axes, element.bytes())?;

    // Placement, unit, names.
    let mut info = VolumeInfo::new(layout.dims(), header.label_type);
    info = place(path, &header, &axes, info, options)?;
    info.notes = notes(segments, if layer_count > 1 { Some(options.layer.unwrap_or(0)) } else { None });

    let (stream, encoding) = data(path, &header, &layout, options)?;
    Ok(VolumeFile {
        format: if info.notes.is_empty() && layers.is_empty() {
            "NRRD"
        } else {
            "NRRD (3D Slicer segmentation)"
        },
        encoding,
        info,
        layout,
        element,
        layers,
        choices,
        voxels: Voxels::of_stream(stream, header.encoding != Encoding::Raw),
    })
}

/// Meaning of one axis of the file.
#[derive(Debug)]
struct Axis {
    size: u64,
    /// x, y or z (0, 1, 2); `None` for an axis outside space.
    space: Option<usize>,
    /// Whether an axis outside space has layers; otherwise it is time.
    is_layers: bool,
    /// Index of the axis in the header.
    index: usize,
}

/// Sorts the axes into space, layers and time.
fn assign_axes(path: &Path, header: &NrrdHeader) -> Result<Vec<Axis>> {
    let count = header.sizes.len();
    let mut axes = Vec::new();
    for (index, &size) in header.sizes.iter().enumerate() {
        let kind = header.kinds.get(index).map_or("", String::as_str);
        let outside_by_kind = match kind {
            "" | "domain" | "space" | "???" | "none" => false,
            "list" | "vector" | "point" | "covariant-vector" | "normal" | "stub" | "scalar" | "complex"
            | "2-vector" | "3-vector" | "4-vector" | "3-gradient" | "3-normal" | "time" => true,
            _ if size == 1 => true,
            _ => {
                return Err(FormatError::unsupported(
                    path,
                    format!("axis {index} holds {size} values of kind {kind:?} a voxel"),
                    "labels are one whole number a voxel: save the label map instead of a colour or tensor image",
                ));
            }
        };
        // With more than three axes, an axis without direction or length is outside space too, whatever its kind.
        let no_direction = match (&header.directions, &header.spacings) {
            (Some(directions), _) => directions[index].is_none(),
            (None, Some(spacings)) => spacings[index].is_nan(),
            (None, None) => false,
        };
        let outside = outside_by_kind || (count > 3 && no_direction);
        axes.push(Axis { size, space: (!outside).then_some(0), is_layers: kind != "time", index });
    }
    // If more than three remain, axes of one step are dropped, the slowest first.
    let mut spatial = axes.iter().filter(|a| a.space.is_some()).count();
    for axis in axes.iter_mut().rev() {
        if spatial > 3 && axis.space.is_some() && axis.size == 1 {
            axis.space = None;
            spatial -= 1;
        }
    }
    let outside = |layers: bool| {
        axes.iter().filter(|a| a.space.is_none() && a.size > 1 && a.is_layers == layers).count()
    };
    if !(1..=3).contains(&spatial) || outside(true) > 1 || outside(false) > 1 {
        return Err(FormatError::unsupported(
            path,
            format!(
                "the axes have sizes {:?} and kinds {:?}, expected x, y, z and at most one list and one time axis",
                header.sizes, header.kinds
            ),
            way_out(header),
        ));
    }
    for (space, axis) in axes.iter_mut().filter(|a| a.space.is_some()).enumerate() {
        axis.space = Some(space);
    }
    Ok(axes)
}

/// What to do about axes that are not understood: four axes without kinds need one line more in the header.
fn way_out(header: &NrrdHeader) -> String {
    let all = "save one 3-D label map a file";
    if !header.kinds.is_empty() || header.sizes.len() != 4 {
        return all.into();
    }
    // The slowest axis, unless the fastest is the short one, as in files of Slicer.
    let [first, .., last] = header.sizes[..] else { return all.into() };
    let (layers, steps) = if first < last {
        ("list domain domain domain", "time domain domain domain")
    } else {
        ("domain domain domain list", "domain domain domain time")
    };
    format!(
        "add a line to the header, \"kinds: {layers}\" for layers or \"kinds: {steps}\" for time steps, or {all}"
    )
}

/// Sets spacing, orientation, origin and unit.
fn place(
    path: &Path,
    header: &NrrdHeader,
    axes: &[Axis],
    mut info: VolumeInfo,
    options: &OpenOptions,
) -> Result<VolumeInfo> {
    info.frame = frame(header.space.as_deref());
    info.unit = unit(path, &header.units, &options.warnings);
    let spatial: Vec<&Axis> = axes.iter().filter(|a| a.space.is_some()).collect();
    let affine = if let Some(directions) = &header.directions {
        // A space of fewer than three dimensions lies in the plane z = 0.
        let to_vec3 = |v: &[f64]| DVec3::from_array([0, 1, 2].map(|i| v.get(i).copied().unwrap_or(0.0)));
        let mut vectors = DVec3::AXES;
        for (a, axis) in spatial.iter().enumerate() {
            vectors[a] = match &directions[axis.index] {
                Some(vector) => to_vec3(vector),
                None => DVec3::NAN,
            };
        }
        let origin = header.origin.as_deref().map_or(DVec3::ZERO, to_vec3);
        placement::world_from_centre(path, vectors, origin, options)?
    } else {
        let mut spacing = [1.0; 3];
        match &header.spacings {
            Some(spacings) => {
                for (a, axis) in spatial.iter().enumerate() {
                    spacing[a] = spacings[axis.index];
                }
            }
            None if options.spacing.is_none() => options.warnings.push(format!(
                "{}: the header has no spacing; 1 is assumed along each axis (give --spacing x,y,z)",
                path.display()
            )),
            None => {}
        }
        placement::from_spacing(path, spacing, options)?
    };
    Ok(info.from_centre_affine(affine))
}

/// Directions of the world's axes (format definition §7, `space`); the variants with time differ in the fourth axis only.
fn frame(space: Option<&str>) -> WorldFrame {
    match space {
        Some("right-anterior-superior" | "ras" | "right-anterior-superior-time" | "rast") => WorldFrame::Ras,
        Some("left-anterior-superior" | "las" | "left-anterior-superior-time" | "last") => WorldFrame::Las,
        Some("left-posterior-superior" | "lps" | "left-posterior-superior-time" | "lpst") => WorldFrame::Lps,
        _ => WorldFrame::Unknown,
    }
}

/// The unit of all spatial axes; if the names differ, a warning says so and the unit is unknown.
fn unit(path: &Path, names: &[String], warnings: &Warnings) -> Unit {
    let mut found = None;
    for name in names.iter().filter(|n| !n.is_empty() && n.as_str() != "???" && n.as_str() != "none") {
        let unit = placement::unit_by_name(name);
        match found {
            None => found = unit,
            Some(before) if unit == Some(before) => continue,
            Some(_) => {
                warnings.push(format!(
                    "{}: the units {names:?} differ from each other; lengths are left as they are, without a unit",
                    path.display()
                ));
                return Unit::Unknown;
            }
        }
        if unit.is_none() {
            warnings.push(format!("{}: the unit {name:?} is not known", path.display()));
        }
    }
    found.unwrap_or_default()
}

/// One segment of a Slicer header.
struct Segment {
    layer: u64,
    note: LabelNote,
}

/// The header's segments by rising number.
fn segments(header: &NrrdHeader) -> Vec<Segment> {
    let get = |number: &str, key: &str| {
        let name = format!("Segment{number}_{key}");
        header.pairs.iter().find(|(k, _)| *k == name).map(|(_, v)| v.as_str())
    };
    let mut numbers: Vec<&str> = Vec::new();
    for (key, _) in &header.pairs {
        if let Some((number, _)) = key.strip_prefix("Segment").and_then(|rest| rest.split_once('_'))
            && !number.is_empty()
            && number.bytes().all(|b| b.is_ascii_digit())
            && numbers.last() != Some(&number)
        {
            numbers.push(number);
        }
    }
    numbers.sort_by_key(|n| (n.len(), *n));
    numbers.dedup();
    numbers
        .into_iter()
        .filter_map(|number| {
            // Slicer before 4.11 wrote neither value nor layer: segment N was a binary map in layer N.
            let layer = match get(number, "Layer") {
                Some(text) => text.trim().parse().ok()?,
                None => number.parse().ok()?,
            };
            let id = match get(number, "LabelValue") {
                Some(text) => text.trim().parse().ok()?,
                None => 1,
            };
            let name = get(number, "Name").map(str::to_owned);
            let color_srgb = get(number, "Color")
                .and_then(crate::header_text::numbers::<f32>)
                .and_then(|c| <[f32; 3]>::try_from(c).ok())
                .filter(|c| c.iter().all(|v| v.is_finite()))
                .map(|c| c.map(|v| v.clamp(0.0, 1.0)));
            Some(Segment { layer, note: LabelNote { id, name, color_srgb } })
        })
        .collect()
}

/// Names and colours of one layer (or of the only one), sorted by id.
fn notes(segments: Vec<Segment>, layer: Option<u32>) -> Vec<LabelNote> {
    let mut notes: Vec<LabelNote> = segments
        .into_iter()
        .filter(|s| layer.is_none_or(|l| s.layer == u64::from(l)))
        .map(|s| s.note)
        .filter(|n| n.name.is_some() || n.color_srgb.is_some())
        .collect();
    notes.sort_by_key(|n| n.id);
    notes.dedup_by_key(|n| n.id);
    notes
}

/// Largest number of layers that are listed.
const MAX_LISTED_LAYERS: u64 = 4096;

fn list_layers(segments: &[Segment], count: u64) -> Vec<Layer> {
    (0..count.min(MAX_LISTED_LAYERS) as u32)
        .map(|index| Layer {
            index,
            segments: segments
                .iter()
                .filter(|s| s.layer == u64::from(index))
                .map(|s| s.note.name.clone().unwrap_or_else(|| format!("label {}", s.note.id)))
                .collect(),
        })
        .collect()
}

/// A text such as "0: ribs, left lung; 1: heart".
fn describe(layers: &[Layer]) -> String {
    const MOST: usize = 32;
    let mut parts: Vec<String> = layers
        .iter()
        .take(MOST)
        .map(|layer| match layer.segments.len() {
            0 => format!("{}", layer.index),
            _ => format!("{}: {}", layer.index, segments_of(layer)),
        })
        .collect();
    if layers.len() > MOST {
        parts.push("…".into());
    }
    parts.join("; ")
}

/// The first names of a layer's segments, in one line.
fn segments_of(layer: &Layer) -> String {
    let names = match layer.segments.len() {
        0..=8 => layer.segments.join(", "),
        n => format!("{}, … ({n} segments)", layer.segments[..8].join(", ")),
    };
    // Names may hold line breaks; messages are one line.
    names.replace(char::is_control, " ")
}

/// Prepares access to the voxels.
fn data(
    path: &Path,
    header: &NrrdHeader,
    layout: &Layout,
    options: &OpenOptions,
) -> Result<(OpenStream, String)> {
    let part = VoxelFile {
        encoding: header.encoding,
        line_skip: header.line_skip,
        byte_skip: header.byte_skip,
        bytes: layout.total_bytes(),
        label_type: header.label_type,
        warnings: options.warnings.clone(),
    };
    let encoding = match header.encoding {
        Encoding::Raw => "raw",
        Encoding::Ascii => "ascii",
        Encoding::Gzip => "gzip",
    };
    let names = match &header.data {
        DataFile::Attached => {
            let (path, end) = (path.to_owned(), header.end);
            return Ok((Box::new(move || part.open(&path, end)), encoding.into()));
        }
        DataFile::Names(names) => names,
    };
    let files = detached_files(path, names, &options.outputs)?;
    let count = files.len() as u64;
    if !layout.total_bytes().is_multiple_of(count) {
        return Err(FormatError::damaged(
            path,
            format!("{count} data files cannot hold equal parts of {} bytes of voxels", layout.total_bytes()),
        ));
    }
    let encoding = format!("{encoding}, detached");
    if let [file] = files.as_slice() {
        let file = file.clone();
        return Ok((Box::new(move || part.open(&file, 0)), encoding));
    }
    let part = VoxelFile { bytes: layout.total_bytes() / count, ..part };
    let part_bytes = part.bytes;
    let stream = Box::new(move || {
        let paths = files.clone();
        Ok(Box::new(ChainedStream::new(files, part_bytes, move |i| part.open(&paths[i], 0)))
            as Box<dyn ByteStream>)
    });
    Ok((stream, encoding))
}

/// One file with voxels.
struct VoxelFile {
    encoding: Encoding,
    line_skip: u64,
    byte_skip: i64,
    /// Bytes of voxels in the file.
    bytes: u64,
    label_type: pumice_core::LabelType,
    warnings: Warnings,
}

impl VoxelFile {
    /// Opens the voxels of a file. Lines are skipped before inflating, bytes after it (format definition §5).
    fn open(&self, path: &Path, start: u64) -> Result<Box<dyn ByteStream>> {
        let offset = self.after_lines(path, start)?;
        let skip = u64::try_from(self.byte_skip).unwrap_or(0);
        match self.encoding {
            Encoding::Raw => {
                let size = open_file(path)?.metadata().map_err(FormatError::io(path))?.len();
                // −1: the voxels are the last bytes of the file.
                let offset = if self.byte_skip < 0 {
                    size.checked_sub(self.bytes).filter(|&o| o >= offset)
                } else {
                    offset.checked_add(skip).filter(|&o| size.saturating_sub(o) >= self.bytes)
                };
                let offset = offset.ok_or_else(|| FormatError::Short {
                    path: path.to_owned(),
                    expected: self.bytes,
                    got: size.saturating_sub(start).saturating_sub(skip),
                    at: Some(size),
                })?;
                Ok(Box::new(PlainStream::open(path, offset)?))
            }
            Encoding::Ascii => {
                Ok(Box::new(TextStream::open(path, offset.saturating_add(skip), self.label_type)?))
            }
            Encoding::Gzip => {
                if self.byte_skip < 0 {
                    return Err(FormatError::damaged(path, "byte skip −1 is for raw voxels, these are gzip"));
                }
                let mut stream = InflateStream::open(path, offset, Wrapping::Gzip, &self.warnings)?;
                stream.skip(skip)?;
                Ok(Box::new(stream))
            }
        }
    }

    /// Offset of the first byte after the lines to skip.
    fn after_lines(&self, path: &Path, start: u64) -> Result<u64> {
        if self.line_skip == 0 {
            return Ok(start);
        }
        let mut file = CountingFile::open(path, start)?;
        for _ in 0..self.line_skip {
            // Nothing of a line is kept, so that a file of one endless line costs no memory.
            loop {
                let buffered = std::io::BufRead::fill_buf(&mut file).map_err(FormatError::io(path))?;
                if buffered.is_empty() {
                    return Err(FormatError::damaged(
                        path,
                        format!("the file ends before the {} lines to skip", self.line_skip),
                    ));
                }
                let end = buffered.iter().position(|&b| b == b'\n');
                let n = end.map_or(buffered.len(), |e| e + 1);
                std::io::BufRead::consume(&mut file, n);
                if end.is_some() {
                    break;
                }
            }
        }
        Ok(file.taken().load(std::sync::atomic::Ordering::Relaxed))
    }
}
