//! Writes Neuroglancer's precomputed format: one scale, a file a chunk (`src/datasource/precomputed/volume.md` in its repository).
//!
//! ```text
//! OUT/info                                 type, resolution in nm, voxel offset, encoding
//! OUT/16_16_40/0-64_0-64_0-64[.gz]         a chunk, cut off at the volume's end; also of background alone, since some readers miss absent ones
//! OUT/segment_properties/info              names, types and numbers of labels
//! ```

use glam::DVec3;
use pumice_core::{AnnotationTable, LabelType, Unit};
use serde_json::json;
use std::io::Write as _;

use crate::compressed_segmentation_writer::Encoder;
use crate::error::{FormatError, Result};
use crate::label_tables::LabelTableFormat;
use crate::placement;
use crate::write::{DecodeIds, encode};
use crate::write_ome_zarr::origin;
use crate::write_store::{PrecomputedEncoding, StoreJob, cells};

/// Folder of the table of labels.
const PROPERTIES: &str = "segment_properties";

pub(crate) fn write(
    job: &StoreJob<'_>,
    table: &AnnotationTable,
    encoding: PrecomputedEncoding,
    gzip: bool,
    decode: &mut DecodeIds<'_>,
) -> pumice_core::Result<Vec<String>> {
    let info = job.info;
    let mut notes = Vec::new();
    let (label_type, name) = stored_type(info.label_type, encoding);
    if label_type != info.label_type {
        notes.push(format!("labels are written as {name}, which the format can hold"));
    }
    if info.unit == Unit::Unknown {
        notes.push("the volume has no unit: its lengths are written as nanometres".into());
    }
    let nanometres = match info.unit {
        Unit::Nanometre | Unit::Unknown => 1.0,
        unit => (placement::metres(unit) * 1e9).round(),
    };
    let spacing = DVec3::from_array(info.spacing());
    let resolution = (spacing * nanometres).to_array();
    let offset = voxel_offset(job, spacing, &mut notes);
    let key = resolution.map(|length| length.to_string()).join("_");
    let chunk = [job.side; 3];
    let mut scale = json!({
        "key": key, "size": info.dims, "resolution": resolution, "voxel_offset": offset, "chunk_sizes": [chunk],
        "encoding": encoding.name()
    });
    if encoding == PrecomputedEncoding::CompressedSegmentation {
        scale["compressed_segmentation_block_size"] = json!([8, 8, 8]);
    }
    let mut about = json!({
        "@type": "neuroglancer_multiscale_volume", "type": "segmentation", "data_type": name, "num_channels": 1, "scales": [scale]
    });
    if table.names().iter().any(|name| !name.is_empty())
        || table.types().iter().any(|kind| !kind.is_empty())
        || !table.columns().is_empty()
    {
        let (text, left_out) = LabelTableFormat::Neuroglancer.to_text(job.out, table)?;
        job.put(&format!("{PROPERTIES}/info"), text.as_bytes())?;
        about[PROPERTIES] = json!(PROPERTIES);
        notes.extend(left_out);
    } else if table.colors_srgb().iter().flatten().next().is_some() {
        notes.push("left out: the colours of labels".into());
    }
    job.put_json("info", &about)?;

    let id_bytes = crate::voxel_writer::bytes_of(label_type);
    let mut encoder = Encoder::new(id_bytes);
    for chunk in cells(job.grid()) {
        let (at, dims) = job.place(chunk);
        let ids = decode(at, dims)?;
        let mut bytes = Vec::new();
        match encoding {
            PrecomputedEncoding::Raw => encode(job.out, &ids, label_type, &mut bytes)?,
            PrecomputedEncoding::CompressedSegmentation => {
                // Checks that each id fits the type.
                let most = if id_bytes == 4 { u64::from(u32::MAX) } else { u64::MAX };
                if let Some(&id) = ids.iter().find(|&&id| id > most) {
                    encode(job.out, &[id], label_type, &mut bytes)?;
                }
                bytes = encoder.encode(&ids, dims).map_err(|what| FormatError::option(job.out, what))?;
            }
        }
        let part = |a: usize| {
            let low = offset[a] + i64::from(at[a]);
            format!("{low}-{}", low + i64::from(dims[a]))
        };
        let name = format!("{key}/{}_{}_{}", part(0), part(1), part(2));
        if gzip {
            job.put(&format!("{name}.gz"), &gzipped(job, &bytes)?)?;
        } else {
            job.put(&name, &bytes)?;
        }
    }
    Ok(notes)
}

fn gzipped(job: &StoreJob<'_>, bytes: &[u8]) -> Result<Vec<u8>> {
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(bytes).and_then(|()| gzip.finish()).map_err(FormatError::io(job.out))
}

/// The type in which labels are stored, and its name. The format has unsigned integers, of 32 and 64 bits alone where tables of ids are written.
fn stored_type(label_type: LabelType, encoding: PrecomputedEncoding) -> (LabelType, &'static str) {
    let raw = match label_type {
        LabelType::U8 | LabelType::I8 => (LabelType::U8, "uint8"),
        LabelType::U16 | LabelType::I16 => (LabelType::U16, "uint16"),
        LabelType::U32 | LabelType::I32 => (LabelType::U32, "uint32"),
        // Floats are exact up to 2⁵³, or beyond where they happen to be whole.
        LabelType::U64 | LabelType::I64 | LabelType::F32 | LabelType::F64 => (LabelType::U64, "uint64"),
    };
    match (encoding, raw.0) {
        (PrecomputedEncoding::CompressedSegmentation, LabelType::U8 | LabelType::U16) => {
            (LabelType::U32, "uint32")
        }
        _ => raw,
    }
}

/// The number of the first voxel along each axis: the format places volumes by whole voxels.
fn voxel_offset(job: &StoreJob<'_>, spacing: DVec3, notes: &mut Vec<String>) -> [i64; 3] {
    let Some(middle) = origin(job.info, notes) else { return [0; 3] };
    // The lowest corner of the first voxel, in voxels.
    let wanted = middle / spacing - DVec3::splat(0.5);
    // A volume whose first voxel has its middle at the origin has no place in the world: that is how most formats begin.
    if middle == DVec3::ZERO {
        return [0; 3];
    }
    // Adding 0 makes 0 of −0, which is no way to write a whole number.
    let offset = wanted.round() + 0.0;
    let far = offset.abs().max_element() > 9e15;
    if far || (wanted - offset).abs().max_element() > 1e-6 {
        let text = if far {
            "left out".to_owned()
        } else {
            format!("rounded to ({}, {}, {}) voxels", offset.x, offset.y, offset.z)
        };
        notes.push(format!("the origin is {text}: the format places volumes by whole voxels"));
    }
    if far { [0; 3] } else { offset.to_array().map(|n| n as i64) }
}
