//! Writes a volume in a foreign format: NRRD, NPY, NIfTI, TIFF.
//!
//! ```text
//! slabs of planes from the caller ──► bytes of the label type ──► header + raw, gzip or deflate ──► hidden file beside OUT
//!                                                                                               ──► sync, rename to OUT
//! ```
//! A killed process leaves no incomplete file under the final name. The number type is that of the volume's source. Each writer documents
//! what else its format can hold.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use pumice_core::{LabelType, VolumeInfo, write_atomically};

use crate::error::{FormatError, Result};
use crate::voxel_writer::VoxelWriter;
use crate::{write_nifti, write_npy, write_nrrd, write_tiff};

/// Number of voxels that are requested at once: 32 MiB of ids.
const SLAB_VOXELS: u64 = 4 << 20;

/// Function that returns the ids of a block, given as (origin, dims), in x-fastest order.
pub type DecodeIds<'a> = dyn FnMut([u32; 3], [u32; 3]) -> pumice_core::Result<Vec<u64>> + 'a;

/// Writes a volume to `out`, in the format of its ending: `.nrrd`, `.npy`, `.nii`, `.nii.gz`, `.tif`, `.tiff`.
///
/// `decode` is called for whole planes, or for rows of one plane where a plane is large, in file order.
///
/// # Errors
/// When the ending names no format, the folder is missing, the disk is full, a label does not fit the type, or `decode` fails. After an
/// error there is nothing under the final name.
pub fn write_volume(out: &Path, info: &VolumeInfo, decode: &mut DecodeIds<'_>) -> pumice_core::Result<()> {
    let start = writer_of(out)?;
    if info.voxels() == 0 {
        return Err(FormatError::option(out, "the volume has no voxels, so there is nothing to write").into());
    }

    write_atomically(out, |file| {
        // Writers own the file that they write to: a second handle on the same one.
        let to_file = file.get_ref().try_clone().map_err(FormatError::io(out))?;
        let mut writer =
            start(info, BufWriter::with_capacity(1 << 20, to_file)).map_err(FormatError::io(out))?;
        let mut bytes = Vec::new();
        for (origin, dims) in slabs(info.dims) {
            let ids = decode(origin, dims)?;
            bytes.clear();
            encode(out, &ids, info.label_type, &mut bytes)?;
            writer.write_voxels(&bytes).map_err(FormatError::io(out))?;
        }
        writer.finish().map_err(FormatError::io(out))?;
        Ok(())
    })
}

/// Starts a file with its header.
type Start = fn(&VolumeInfo, BufWriter<File>) -> io::Result<Box<dyn VoxelWriter>>;

/// Formats that can be written, by the ending of the file's name; the first one that matches is used.
const WRITERS: [(&str, Start); 6] = [
    (".nrrd", write_nrrd::start),
    (".npy", write_npy::start),
    (".nii.gz", |info, file| write_nifti::start(info, true, file)),
    (".nii", |info, file| write_nifti::start(info, false, file)),
    (".tif", write_tiff::start),
    (".tiff", write_tiff::start),
];

fn writer_of(out: &Path) -> Result<Start> {
    let name = out.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let writer = WRITERS.iter().find(|(ending, _)| name.ends_with(ending));
    writer.map(|&(_, start)| start).ok_or_else(|| FormatError::Unknown {
        path: out.to_owned(),
        what: "the ending names no format that can be written: expected .nrrd, .npy, .nii.gz, .nii, .tif, .tiff, or a folder \
               .zarr or .precomputed"
            .into(),
    })
}

/// Blocks in file order: several planes, or rows of one plane where a plane has more than [`SLAB_VOXELS`].
fn slabs(dims: [u32; 3]) -> impl Iterator<Item = ([u32; 3], [u32; 3])> {
    let [x, y, z] = dims;
    let plane = u64::from(x) * u64::from(y);
    // 16 is the side of a box, so in whole multiples of it each box is decoded once.
    let whole = |n: u64, all: u32| {
        let n = n.clamp(1, all.into()) as u32;
        if n > 16 { n - n % 16 } else { n }
    };
    let (rows, planes) = if plane <= SLAB_VOXELS {
        (y, whole(SLAB_VOXELS / plane, z))
    } else {
        (whole(SLAB_VOXELS / u64::from(x), y), 1)
    };
    (0..z).step_by(planes as usize).flat_map(move |from_z| {
        (0..y)
            .step_by(rows as usize)
            .map(move |from_y| ([0, from_y, from_z], [x, rows.min(y - from_y), planes.min(z - from_z)]))
    })
}

/// Appends ids to `bytes` as little-endian values of `label_type`.
pub(crate) fn encode(out: &Path, ids: &[u64], label_type: LabelType, bytes: &mut Vec<u8>) -> Result<()> {
    macro_rules! whole {
        ($t:ty) => {
            for &id in ids {
                let value =
                    <$t>::try_from(id).map_err(|_| too_large(out, id, label_type, <$t>::MAX as u64))?;
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        };
    }
    macro_rules! float {
        ($t:ty, $digits:expr) => {
            for &id in ids {
                let value = id as $t;
                // The comparison uses 128 bits, because 2⁶⁴ would saturate to the largest id on the way back.
                if value as u128 != u128::from(id) {
                    return Err(too_large(out, id, label_type, 1 << $digits));
                }
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        };
    }
    match label_type {
        LabelType::U8 => whole!(u8),
        LabelType::U16 => whole!(u16),
        LabelType::U32 => whole!(u32),
        LabelType::U64 => whole!(u64),
        LabelType::I8 => whole!(i8),
        LabelType::I16 => whole!(i16),
        LabelType::I32 => whole!(i32),
        LabelType::I64 => whole!(i64),
        LabelType::F32 => float!(f32, 24),
        LabelType::F64 => float!(f64, 53),
    }
    Ok(())
}

fn too_large(out: &Path, id: u64, label_type: LabelType, limit: u64) -> FormatError {
    FormatError::Limit {
        path: out.to_owned(),
        what: format!("a label to be written as {label_type:?}"),
        got: id.to_string(),
        limit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_cover_all_voxels_in_order() {
        for dims in [[1, 1, 1], [7, 5, 300], [4000, 3000, 3], [8_000_000, 2, 2], [3, 1, 5]] {
            let mut next = 0u64;
            for (o, d) in slabs(dims) {
                let [x, y] = [0, 1].map(|a| u64::from(dims[a]));
                let first = u64::from(o[0]) + x * (u64::from(o[1]) + y * u64::from(o[2]));
                assert_eq!(first, next, "{dims:?}");
                assert!(d[2] == 1 || d[1] == dims[1], "rows of several planes are not in order");
                let voxels = d.iter().map(|&v| u64::from(v)).product::<u64>();
                assert!(voxels <= SLAB_VOXELS.max(dims[0].into()));
                next += voxels;
            }
            assert_eq!(next, dims.iter().map(|&v| u64::from(v)).product::<u64>(), "{dims:?}");
        }
    }

    #[test]
    fn labels_that_do_not_fit_are_refused() {
        let out = Path::new("out.npy");
        let encode = |id, t| encode(out, &[id], t, &mut Vec::new());
        assert!(encode(255, LabelType::U8).is_ok() && encode(256, LabelType::U8).is_err());
        assert!(encode(127, LabelType::I8).is_ok() && encode(128, LabelType::I8).is_err());
        assert!(encode(1 << 24, LabelType::F32).is_ok() && encode((1 << 24) + 1, LabelType::F32).is_err());
        assert!(encode(1 << 53, LabelType::F64).is_ok() && encode(u64::MAX, LabelType::F64).is_err());
        assert!(encode(u64::MAX, LabelType::U64).is_ok());
    }
}
