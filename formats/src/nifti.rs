//! NIfTI-1 and NIfTI-2: one file (`.nii`, `.nii.gz`) or a pair (`.hdr` with `.img`, either gzipped).
//!
//! ```text
//! header (348 or 540 bytes) · extensions · … vox_offset: x fastest, y, z, then time (dim 4), channel (dim 5)
//! ```
//! A file may give the volume's placement up to three times. The order of preference is that of nibabel's `get_best_affine`: sform, else
//! qform, else the voxel lengths alone. The world is RAS (`nifti1.h`, "3D image (volume) orientation and location in space").

use std::io::Read;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use pumice_core::{LabelType, Unit, VolumeInfo, WorldFrame, open_input};

use crate::choice::{self, choose, refuse_absent};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::gzip::{GZIP_MAGIC, InflateStream, Wrapping};
use crate::layout::{FileAxis, Layout, Role};
use crate::nifti_header::{self, MAX_BYTES, NiftiHeader};
use crate::options::{OpenOptions, Warnings};
use crate::placement;
use crate::stream::{ByteStream, PlainStream, open_file};
use crate::volume_file::{Format, Takes, VolumeFile, Voxels};

/// NIfTI files.
pub(crate) const FORMAT: Format = Format { name: "NIfTI", takes: Takes::NOTHING, recognises, read };

/// Whether a file is NIfTI: by its first bytes (inflated if necessary), or else by its name.
fn recognises(path: &Path, head: &[u8]) -> bool {
    let name = lower_name(path);
    let named =
        [".nii", ".hdr", ".img"].iter().any(|e| name.strip_suffix(".gz").unwrap_or(&name).ends_with(e));
    if head.starts_with(&GZIP_MAGIC) {
        // A damaged file has no version. Then the name decides, and reading the file reports what is wrong.
        named || first_bytes(path).is_ok_and(|head| nifti_header::version(&head).is_some())
    } else {
        named || nifti_header::version(head).is_some()
    }
}

/// Reads the header of `path`, or the header file beside it where `path` is the `.img` of a pair.
fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let header_path = header_path(path)?;
    let header = nifti_header::parse(&header_path, &first_bytes(&header_path)?)?;
    let (label_type, bits) = label_type(&header_path, header.datatype)?;
    let mut element = Element::new(label_type, header.big_endian);
    element.scale = scale(&header_path, &header)?;

    // The axes are x, y, z, then those along which a step must be chosen.
    let mut choices = Vec::new();
    let sizes = sizes(&header_path, &header)?;
    let time = choose(path, &choice::TIME, options, sizes[3], &mut choices)?;
    let channel = choose(path, &choice::CHANNEL, options, sizes[4], &mut choices)?;
    refuse_absent(path, options, &[&choice::LAYER])?;
    let roles = [Role::Space(0), Role::Space(1), Role::Space(2), Role::Fixed(time), Role::Fixed(channel)];
    let axes = roles.iter().zip(sizes).map(|(&role, size)| FileAxis { size, role }).collect();
    let layout = Layout::new(&header_path, axes, bits / 8)?;

    // Placement and unit.
    let affine = world_from_centre(&header_path, &header, layout.dims(), options)?;
    let mut info = VolumeInfo::new(layout.dims(), label_type).from_centre_affine(affine);
    info.frame = WorldFrame::Ras;
    info.unit = unit(&header_path, header.xyzt_units, &options.warnings);

    // Location of the voxels.
    let data_path = if header.single_file { header_path.clone() } else { image_path(&header_path)? };
    options.outputs.check_input(&header_path)?;
    options.outputs.check_input(&data_path)?;
    let offset = offset(&header_path, &header)?;
    let gzip = is_gzip(&data_path)?;
    if !gzip {
        let bytes = open_file(&data_path)?.metadata().map_err(FormatError::io(&data_path))?.len();
        let got = bytes.saturating_sub(offset);
        if got < layout.total_bytes() {
            let expected = layout.total_bytes();
            return Err(FormatError::Short { path: data_path, expected, got, at: Some(bytes) });
        }
    }
    let mut encoding = String::from(if gzip { "gzip" } else { "raw" });
    if !header.single_file {
        encoding.push_str(", detached");
    }
    let warnings = options.warnings.clone();
    Ok(VolumeFile {
        format: if header.version == 1 { "NIfTI-1" } else { "NIfTI-2" },
        encoding,
        info,
        layout,
        element,
        layers: Vec::new(),
        choices,
        voxels: Voxels::of_stream(
            Box::new(move || {
                if gzip {
                    let mut stream = InflateStream::open(&data_path, 0, Wrapping::Gzip, &warnings)?;
                    stream.skip(offset)?;
                    Ok(Box::new(stream))
                } else {
                    Ok(Box::new(PlainStream::open(&data_path, offset)?))
                }
            }),
            gzip,
        ),
    })
}

fn lower_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Whether a file begins with the magic number of gzip.
fn is_gzip(path: &Path) -> Result<bool> {
    let mut magic = [0; 2];
    Ok(open_file(path)?.read_exact(&mut magic).is_ok() && magic == GZIP_MAGIC)
}

/// The first bytes of a header file, inflated if necessary; fewer where the file ends early.
fn first_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut head = vec![0; MAX_BYTES];
    let n = if is_gzip(path)? {
        InflateStream::open(path, 0, Wrapping::Gzip, &Warnings::default())?.fill(&mut head)?
    } else {
        PlainStream::open(path, 0)?.fill(&mut head)?
    };
    head.truncate(n);
    Ok(head)
}

/// Possible names of the other file of a pair: `brain.img.gz` → `brain.hdr.gz`, `brain.hdr`, and upper case. Names that are compressed like
/// `path` come first.
fn siblings(path: &Path, ending: &str) -> Vec<PathBuf> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut stem = name.as_str();
    for ending in [".gz", ".img", ".hdr", ".nii"] {
        // The endings are ASCII, so removing their length leaves whole characters.
        if stem.to_ascii_lowercase().ends_with(ending) {
            stem = &stem[..stem.len() - ending.len()];
        }
    }
    let mut endings = [ending.to_owned(), format!("{ending}.gz")];
    if lower_name(path).ends_with(".gz") {
        endings.reverse();
    }
    endings
        .iter()
        .flat_map(|ending| [ending.clone(), ending.to_uppercase()])
        .map(|ending| path.with_file_name(format!("{stem}{ending}")))
        .collect()
}

/// The header file of a pair, where `path` is its image; otherwise `path`.
fn header_path(path: &Path) -> Result<PathBuf> {
    let name = lower_name(path);
    if !name.strip_suffix(".gz").unwrap_or(&name).ends_with(".img") {
        return Ok(path.to_owned());
    }
    // Some programs name a single file `.img`.
    if first_bytes(path).is_ok_and(|head| nifti_header::parse(path, &head).is_ok()) {
        return Ok(path.to_owned());
    }
    let candidates = siblings(path, ".hdr");
    candidates.iter().find(|c| c.is_file()).cloned().ok_or_else(|| {
        FormatError::damaged(
            path,
            format!(
                "the voxels of a NIfTI pair need their header, but {} does not exist",
                candidates[0].display()
            ),
        )
    })
}

/// The image file of a pair.
fn image_path(header: &Path) -> Result<PathBuf> {
    let candidates = siblings(header, ".img");
    if let Some(found) = candidates.iter().find(|c| c.is_file()) {
        return Ok(found.clone());
    }
    let data = candidates[0].clone();
    match open_input(&data) {
        Err(source) => Err(FormatError::Detached { header: header.to_owned(), data, source }),
        // It has come since.
        Ok(_) => Ok(data),
    }
}

/// Number type and bits of `datatype` (`nifti1.h`, `DT_*`).
fn label_type(path: &Path, datatype: i64) -> Result<(LabelType, usize)> {
    let refused = match datatype {
        2 => return Ok((LabelType::U8, 8)),
        4 => return Ok((LabelType::I16, 16)),
        8 => return Ok((LabelType::I32, 32)),
        16 => return Ok((LabelType::F32, 32)),
        64 => return Ok((LabelType::F64, 64)),
        256 => return Ok((LabelType::I8, 8)),
        512 => return Ok((LabelType::U16, 16)),
        768 => return Ok((LabelType::U32, 32)),
        1024 => return Ok((LabelType::I64, 64)),
        1280 => return Ok((LabelType::U64, 64)),
        1 => "single bits",
        32 | 1792 | 2048 => "complex numbers",
        128 | 2304 => "colours",
        1536 => "128-bit floating point",
        0 => {
            return Err(FormatError::damaged(
                path,
                "the NIfTI datatype is 0, unknown: expected the type of the voxels",
            ));
        }
        _ => return Err(FormatError::damaged(path, format!("the NIfTI datatype {datatype} is not defined"))),
    };
    Err(FormatError::unsupported(
        path,
        format!("the voxels are {refused} (NIfTI datatype {datatype})"),
        "save the label map with an integer type",
    ))
}

/// `scl_slope` and `scl_inter` where they have an effect (`nifti1.h`, "Data scaling"; NaN means none, which is what nibabel writes).
fn scale(path: &Path, header: &NiftiHeader) -> Result<Option<(f64, f64)>> {
    let (slope, inter) = (header.scl_slope, header.scl_inter);
    if slope == 0.0 || !slope.is_finite() || (slope == 1.0 && inter == 0.0) {
        return Ok(None);
    }
    if !inter.is_finite() {
        return Err(FormatError::damaged(
            path,
            format!("scl_slope is {slope} but scl_inter is {inter}, expected a finite number"),
        ));
    }
    Ok(Some((slope, inter)))
}

/// Sizes along x, y, z, time and channel.
fn sizes(path: &Path, header: &NiftiHeader) -> Result<[u64; 5]> {
    let count = header.dim[0];
    if !(1..=7).contains(&count) {
        return Err(FormatError::damaged(
            path,
            format!("the number of axes (dim[0]) is {count}, expected 1 to 7"),
        ));
    }
    let mut sizes = [1; 5];
    for axis in 1..=count as usize {
        let size = header.dim[axis];
        match u64::try_from(size) {
            Ok(size) if size > 0 && axis <= 5 => sizes[axis - 1] = size,
            Ok(1) => {}
            Ok(size) if size > 0 => {
                return Err(FormatError::unsupported(
                    path,
                    format!("axis {axis} (dim[{axis}]) has {size} steps"),
                    "only x, y, z, time and channel are read: save one label map a file",
                ));
            }
            _ => {
                return Err(FormatError::damaged(
                    path,
                    format!("the size of axis {axis} (dim[{axis}]) is {size}, expected at least 1"),
                ));
            }
        }
    }
    Ok(sizes)
}

/// Length unit, the lowest three bits of `xyzt_units`.
fn unit(path: &Path, xyzt_units: i64, warnings: &Warnings) -> Unit {
    match xyzt_units & 7 {
        0 => Unit::Unknown,
        1 => Unit::Metre,
        2 => Unit::Millimetre,
        3 => Unit::Micrometre,
        other => {
            warnings.push(format!("{}: the length unit {other} (xyzt_units) is not known", path.display()));
            Unit::Unknown
        }
    }
}

/// Number of bytes before the first voxel.
fn offset(path: &Path, header: &NiftiHeader) -> Result<u64> {
    let offset = header.vox_offset;
    // The voxels of a single file follow the header and the four bytes that announce extensions; an offset of 0 stands for that.
    let least = if header.single_file { header.bytes() + 4 } else { 0 };
    if offset == 0.0 {
        return Ok(least);
    }
    // Beyond 2⁵³ an f64 is not an exact offset, and no file is that long.
    if !(offset >= least as f64 && offset < crate::element::MAX_EXACT_F64 && offset.fract() == 0.0) {
        return Err(FormatError::damaged(
            path,
            format!("the offset of the voxels (vox_offset) is {offset}, expected a whole number ≥ {least}"),
        ));
    }
    Ok(offset as u64)
}

/// The matrix from sform, else qform, else from lengths alone, with the volume's middle at 0 and x towards the left, as nibabel does.
fn world_from_centre(
    path: &Path,
    header: &NiftiHeader,
    dims: [u32; 3],
    options: &OpenOptions,
) -> Result<DAffine3> {
    if header.sform_code > 0 {
        let [x, y, z] = header.srow;
        let column = |i: usize| DVec3::new(x[i], y[i], z[i]);
        return placement::world_from_centre(path, [column(0), column(1), column(2)], column(3), options);
    }
    // An axis of one voxel may lack a length; without a qform, nibabel takes 1 along axes that the file does not have.
    let mut lengths = [header.pixdim[1], header.pixdim[2], header.pixdim[3]];
    for (a, length) in lengths.iter_mut().enumerate() {
        let absent = a as i64 >= header.dim[0];
        if (dims[a] == 1 && *length == 0.0) || (absent && header.qform_code <= 0) {
            *length = 1.0;
        }
    }
    // Checked here, because a negative length would pass as the length of a vector.
    placement::from_spacing(path, lengths, options)?;
    if header.qform_code > 0 {
        let rotation = DMat3::from_quat(quaternion(path, header)?);
        let [x, y, z] = lengths;
        // pixdim[0] is −1 for a left-handed system; any other value counts as 1 (nibabel corrects other values to 1 when it loads a file).
        let z = if header.pixdim[0] == -1.0 { -z } else { z };
        let axes = [rotation.x_axis * x, rotation.y_axis * y, rotation.z_axis * z];
        return placement::world_from_centre(path, axes, DVec3::from_array(header.qoffset), options);
    }
    options.warnings.push(format!(
        "{}: the header has no orientation (sform and qform code 0); x is taken to run to the left, the middle to be at 0",
        path.display()
    ));
    let axes = [DVec3::X * -lengths[0], DVec3::Y * lengths[1], DVec3::Z * lengths[2]];
    let matrix = placement::world_from_centre(path, axes, DVec3::ZERO, options)?;
    let middle = DVec3::from_array(dims.map(|d| f64::from(d - 1) / 2.0));
    Ok(DAffine3::from_mat3_translation(matrix.matrix3, -(matrix.matrix3 * middle)))
}

/// Quaternion (a, b, c, d) from the stored b, c, d: a = √(1 − b² − c² − d²) ≥ 0 (`nifti1.h`, "Method 2").
///
/// a² may be rounded below 0; nibabel takes |a²| < 3 ε as 0 and refuses anything lower, where niftilib would normalise.
fn quaternion(path: &Path, header: &NiftiHeader) -> Result<DQuat> {
    let [b, c, d] = header.quatern;
    let a_squared = 1.0 - (b * b + c * c + d * d);
    let tolerance = 3.0 * header.quatern_epsilon;
    let a = if a_squared.abs() < tolerance {
        0.0
    } else if a_squared > 0.0 {
        a_squared.sqrt()
    } else {
        return Err(FormatError::damaged(
            path,
            format!("the quaternion ({b}, {c}, {d}) is longer than 1: the header's orientation is damaged"),
        ));
    };
    Ok(DQuat::from_xyzw(b, c, d, a).normalize())
}
