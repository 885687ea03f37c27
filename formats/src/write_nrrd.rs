//! Writes NRRD with the whole volume info: type, axes, origin, unit, and names and colours in the form of 3D Slicer.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};

use glam::DVec3;
use pumice_core::{LabelType, Unit, VolumeInfo, WorldFrame};

use crate::voxel_writer::{GzipWriter, VoxelWriter};

/// Writes the header; the voxels follow as gzip.
pub(crate) fn start(info: &VolumeInfo, mut file: BufWriter<File>) -> io::Result<Box<dyn VoxelWriter>> {
    file.write_all(header(info).as_bytes())?;
    Ok(Box::new(GzipWriter::new(file)))
}

fn header(info: &VolumeInfo) -> String {
    let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let m = info.world_from_centre();
    let type_name = match info.label_type {
        LabelType::U8 => "uint8",
        LabelType::U16 => "uint16",
        LabelType::U32 => "uint32",
        LabelType::U64 => "uint64",
        LabelType::I8 => "int8",
        LabelType::I16 => "int16",
        LabelType::I32 => "int32",
        LabelType::I64 => "int64",
        LabelType::F32 => "float",
        LabelType::F64 => "double",
    };
    let space = match info.frame {
        WorldFrame::Ras => "space: right-anterior-superior",
        WorldFrame::Lps => "space: left-posterior-superior",
        WorldFrame::Las => "space: left-anterior-superior",
        WorldFrame::Unknown => "space dimension: 3",
    };
    let mut text = format!(
        "NRRD0005\ntype: {type_name}\ndimension: 3\n{space}\nsizes: {} {} {}\nspace directions: {} {} {}\nkinds: domain domain \
         domain\nendian: little\nencoding: gzip\nspace origin: {}\n",
        info.dims[0],
        info.dims[1],
        info.dims[2],
        vector(m.matrix3.x_axis),
        vector(m.matrix3.y_axis),
        vector(m.matrix3.z_axis),
        vector(m.translation),
    );
    let unit = match info.unit {
        Unit::Nanometre => Some("nm"),
        Unit::Micrometre => Some("um"),
        Unit::Millimetre => Some("mm"),
        Unit::Metre => Some("m"),
        Unit::Unknown => None,
    };
    // Writing to a string cannot fail, here and below.
    if let Some(unit) = unit {
        let _ = writeln!(text, "space units: \"{unit}\" \"{unit}\" \"{unit}\"");
    }
    for (i, note) in info.notes.iter().enumerate() {
        let _ = writeln!(text, "Segment{i}_ID:=Segment_{}", note.id);
        let _ = writeln!(text, "Segment{i}_LabelValue:={}", note.id);
        let _ = writeln!(text, "Segment{i}_Layer:=0");
        if let Some(name) = &note.name {
            let name = name.replace('\\', "\\\\").replace('\n', "\\n").replace('\r', " ");
            let _ = writeln!(text, "Segment{i}_Name:={name}");
        }
        if let Some([r, g, b]) = note.color_srgb {
            let _ = writeln!(text, "Segment{i}_Color:={r} {g} {b}");
        }
    }
    text.push('\n');
    text
}
