//! Writes NPY: an array with indices `a[x, y, z]`, in Fortran order so that it can be streamed. The format stores no placement, unit or
//! names.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use pumice_core::{LabelType, VolumeInfo};

use crate::voxel_writer::{PlainWriter, VoxelWriter};

/// Writes the header (NumPy's `numpy.lib.format`, version 1.0).
pub(crate) fn start(info: &VolumeInfo, mut file: BufWriter<File>) -> io::Result<Box<dyn VoxelWriter>> {
    let descr = match info.label_type {
        LabelType::U8 => "|u1",
        LabelType::U16 => "<u2",
        LabelType::U32 => "<u4",
        LabelType::U64 => "<u8",
        LabelType::I8 => "|i1",
        LabelType::I16 => "<i2",
        LabelType::I32 => "<i4",
        LabelType::I64 => "<i8",
        LabelType::F32 => "<f4",
        LabelType::F64 => "<f8",
    };
    let [x, y, z] = info.dims;
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': True, 'shape': ({x}, {y}, {z}), }}");
    // Magic 6, version 2, length 2, header, newline: the sum must be a multiple of 64.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    file.write_all(b"\x93NUMPY\x01\x00")?;
    // At most 128 characters: three numbers of at most 7 digits.
    file.write_all(&(header.len() as u16).to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    Ok(Box::new(PlainWriter(file)))
}
