//! Writes NIfTI-1, or NIfTI-2 where an axis is longer than NIfTI-1's 16-bit sizes allow. The format stores no names.
//!
//! ```text
//! NIfTI-1   0 sizeof_hdr=348 (i32)   40 dim (8 × i16)    70 datatype, bitpix (i16)   76 pixdim (8 × f32)   108 vox_offset (f32)
//!           112 scl_slope (f32)      123 xyzt_units (u8) 254 sform_code (i16)        280 srow (12 × f32)   344 "n+1\0"
//! NIfTI-2   0 sizeof_hdr=540 (i32)   4 "n+2\0\r\n\x1a\n" 12 datatype, bitpix (i16)   16 dim (8 × i64)      104 pixdim (8 × f64)
//!           168 vox_offset (i64)     176 scl_slope (f64) 348 sform_code (i32)        400 srow (12 × f64)   500 xyzt_units (i32)
//! ```
//! NIfTI's world axes are RAS by definition, so LPS and LAS are turned. NIfTI has no nanometres: lengths become micrometres.

use std::fs::File;
use std::io::{self, BufWriter};

use pumice_core::{LabelType, Unit, VolumeInfo, WorldFrame};

use crate::voxel_writer::{GzipWriter, PlainWriter, VoxelWriter, bytes_of};

/// Voxels begin after the header and four bytes that say "no extensions".
const EXTENSION_BYTES: usize = 4;

/// Writes the header.
pub(crate) fn start(
    info: &VolumeInfo,
    gzip: bool,
    file: BufWriter<File>,
) -> io::Result<Box<dyn VoxelWriter>> {
    let mut writer: Box<dyn VoxelWriter> =
        if gzip { Box::new(GzipWriter::new(file)) } else { Box::new(PlainWriter(file)) };
    writer.write_voxels(&header(info))?;
    Ok(writer)
}

fn header(info: &VolumeInfo) -> Vec<u8> {
    // Rows of the matrix from voxel centres to RAS, in a unit of NIfTI.
    let (scale, unit_code) = match info.unit {
        Unit::Unknown => (1.0, 0u8),
        Unit::Metre => (1.0, 1),
        Unit::Millimetre => (1.0, 2),
        Unit::Micrometre => (1.0, 3),
        Unit::Nanometre => (1e-3, 3),
    };
    let sign = match info.frame {
        WorldFrame::Lps => [-1.0, -1.0, 1.0],
        WorldFrame::Las => [-1.0, 1.0, 1.0],
        WorldFrame::Ras | WorldFrame::Unknown => [1.0; 3],
    };
    let m = info.world_from_centre();
    let mut rows = Vec::new();
    for (row, sign) in sign.into_iter().enumerate() {
        for column in [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation] {
            rows.push(column[row] * sign * scale);
        }
    }
    let spacing = info.spacing().map(|s| s * scale);
    let (code, bits) = datatype(info.label_type);
    let long = info.dims.iter().any(|&d| d > i16::MAX as u32);

    if long {
        let mut header = vec![0; 540 + EXTENSION_BYTES];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &540i32.to_le_bytes());
        put(4, b"n+2\0\r\n\x1a\n");
        put(12, &code.to_le_bytes());
        put(14, &bits.to_le_bytes());
        for i in 0..8 {
            let dim = if i == 0 { 3 } else { info.dims.get(i - 1).map_or(1, |&d| i64::from(d)) };
            put(16 + 8 * i, &dim.to_le_bytes());
            let pixdim = if i == 0 { 1.0 } else { spacing.get(i - 1).copied().unwrap_or(0.0) };
            put(104 + 8 * i, &pixdim.to_le_bytes());
        }
        put(168, &((540 + EXTENSION_BYTES) as i64).to_le_bytes());
        put(176, &1f64.to_le_bytes());
        put(348, &2i32.to_le_bytes());
        for (i, value) in rows.iter().enumerate() {
            put(400 + 8 * i, &value.to_le_bytes());
        }
        put(500, &i32::from(unit_code).to_le_bytes());
        return header;
    }
    let mut header = vec![0; 348 + EXTENSION_BYTES];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    put(38, b"r");
    for i in 0..8 {
        // At most i16::MAX, checked above.
        let dim = if i == 0 { 3 } else { info.dims.get(i - 1).map_or(1, |&d| d as i16) };
        put(40 + 2 * i, &dim.to_le_bytes());
        let pixdim = if i == 0 { 1.0 } else { spacing.get(i - 1).copied().unwrap_or(0.0) };
        put(76 + 4 * i, &(pixdim as f32).to_le_bytes());
    }
    put(70, &code.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(108, &((348 + EXTENSION_BYTES) as f32).to_le_bytes());
    put(112, &1f32.to_le_bytes());
    put(123, &[unit_code]);
    // Code 2: aligned to something that the matrix describes.
    put(254, &2i16.to_le_bytes());
    for (i, &value) in rows.iter().enumerate() {
        put(280 + 4 * i, &(value as f32).to_le_bytes());
    }
    put(344, b"n+1\0");
    header
}

/// NIfTI's code and number of bits of a type (`nifti1.h`, `DT_*`).
fn datatype(label_type: LabelType) -> (i16, i16) {
    let code = match label_type {
        LabelType::U8 => 2,
        LabelType::I16 => 4,
        LabelType::I32 => 8,
        LabelType::F32 => 16,
        LabelType::F64 => 64,
        LabelType::I8 => 256,
        LabelType::U16 => 512,
        LabelType::U32 => 768,
        LabelType::I64 => 1024,
        LabelType::U64 => 1280,
    };
    (code, 8 * bytes_of(label_type) as i16)
}
