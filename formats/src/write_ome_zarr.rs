//! Writes OME-Zarr: a label image of one level, version 0.5 on Zarr 3, with shards if asked for, or 0.4 on Zarr 2.
//!
//! ```text
//! OUT/zarr.json | .zgroup, .zattrs     multiscales: axes z y x, unit, scale, translation; image-label: colours and properties
//! OUT/0/zarr.json | .zarray            the array a[z, y, x], zstd
//! OUT/0/c/K/J/I | K/J/I                a chunk, or a shard of 8 × 8 × 8 chunks
//! ```
//! A chunk of background alone is absent: 0 is the fill value. Specifications: *OME-NGFF* 0.4 and 0.5, *Zarr storage specification version 2*, *Zarr core
//! specification version 3*, ZEP 2 (shards).

use glam::{DAffine3, DVec3};
use pumice_core::{AnnotationTable, LabelType, Unit, VolumeInfo};
use serde_json::{Map, Value, json};

use crate::error::{FormatError, Result};
use crate::write::DecodeIds;
use crate::write_store::{OmeVersion, SHARD_SIDE, StoreJob, cells};

/// Level of zstd: larger ones gain little on labels and take much longer.
const ZSTD_LEVEL: i32 = 3;

pub(crate) fn write(
    job: &StoreJob<'_>,
    table: &AnnotationTable,
    version: OmeVersion,
    sharded: bool,
    decode: &mut DecodeIds<'_>,
) -> pumice_core::Result<Vec<String>> {
    if sharded && version == OmeVersion::V0_4 {
        return Err(FormatError::option(
            job.out,
            "OME-Zarr 0.4 lies on Zarr 2, which has no shards: choose 0.5",
        )
        .into());
    }
    let mut notes = Vec::new();
    write_metadata(job, table, version, sharded, &mut notes)?;
    if sharded {
        write_shards(job, decode)?;
    } else {
        let prefix = if version == OmeVersion::V0_5 { "0/c" } else { "0" };
        for chunk in cells(job.grid()) {
            if let Some(stored) = chunk_bytes(job, chunk, decode)? {
                job.put(&format!("{prefix}/{}/{}/{}", chunk[2], chunk[1], chunk[0]), &stored)?;
            }
        }
    }
    Ok(notes)
}

/// The encoded bytes of a chunk, which has its whole size also at the volume's end; `None` where it is background alone.
fn chunk_bytes(
    job: &StoreJob<'_>,
    chunk: [u32; 3],
    decode: &mut DecodeIds<'_>,
) -> pumice_core::Result<Option<Vec<u8>>> {
    let (origin, dims) = job.place(chunk);
    let ids = decode(origin, dims)?;
    if ids.iter().all(|&id| id == 0) {
        return Ok(None);
    }
    let side = job.side as usize;
    let [dx, dy, dz] = dims.map(|d| d as usize);
    let ids = if [dx, dy, dz] == [side; 3] {
        ids
    } else {
        let mut whole = vec![0; side.pow(3)];
        for (row, from) in ids.chunks_exact(dx).enumerate() {
            let at = side * (row % dy + side * (row / dy));
            whole[at..at + dx].copy_from_slice(from);
        }
        debug_assert_eq!(ids.len(), dx * dy * dz);
        whole
    };
    let mut bytes = Vec::new();
    job.encode(&ids, &mut bytes)?;
    let stored = zstd::bulk::compress(&bytes, ZSTD_LEVEL).map_err(FormatError::io(job.out))?;
    Ok(Some(stored))
}

/// Shards: chunks one after another in C order, then pairs of offset and size of all chunks, both 2⁶⁴−1 for an absent one, and their CRC-32C.
fn write_shards(job: &StoreJob<'_>, decode: &mut DecodeIds<'_>) -> pumice_core::Result<()> {
    let grid = job.grid();
    let within = shard_grid(job);
    for shard in cells([0, 1, 2].map(|a| grid[a].div_ceil(within[a]))) {
        let mut index = vec![u64::MAX; 2 * within.iter().product::<u32>() as usize];
        let mut content = Vec::new();
        for (number, cell) in cells(within).enumerate() {
            let chunk = [0, 1, 2].map(|a| shard[a] * within[a] + cell[a]);
            if (0..3).any(|a| chunk[a] >= grid[a]) {
                continue;
            }
            let Some(stored) = chunk_bytes(job, chunk, decode)? else { continue };
            index[2 * number] = content.len() as u64;
            index[2 * number + 1] = stored.len() as u64;
            content.extend_from_slice(&stored);
        }
        if content.is_empty() {
            continue;
        }
        let pairs: Vec<u8> = index.iter().flat_map(|number| number.to_le_bytes()).collect();
        content.extend_from_slice(&pairs);
        content.extend_from_slice(&crc32c::crc32c(&pairs).to_le_bytes());
        job.put(&format!("0/c/{}/{}/{}", shard[2], shard[1], shard[0]), &content)?;
    }
    Ok(())
}

/// Chunks of a shard along x, y, z: fewer where the volume has fewer.
fn shard_grid(job: &StoreJob<'_>) -> [u32; 3] {
    job.grid().map(|chunks| chunks.min(SHARD_SIDE))
}

fn write_metadata(
    job: &StoreJob<'_>,
    table: &AnnotationTable,
    version: OmeVersion,
    sharded: bool,
    notes: &mut Vec<String>,
) -> Result<()> {
    let info = job.info;
    let zyx = |xyz: [u32; 3]| [xyz[2], xyz[1], xyz[0]];
    let (shape, chunk) = (zyx(info.dims), [job.side; 3]);
    let mut about = json!({ "multiscales": [multiscale(job, version, notes)], "image-label": image_label(table, version, notes) });
    match version {
        OmeVersion::V0_4 => {
            job.put_json(".zgroup", &json!({ "zarr_format": 2 }))?;
            job.put_json(".zattrs", &about)?;
            job.put_json(
                "0/.zarray",
                &json!({
                    "zarr_format": 2, "shape": shape, "chunks": chunk, "dtype": v2_type(info.label_type), "fill_value": 0, "order": "C",
                    "compressor": { "id": "zstd", "level": ZSTD_LEVEL }, "filters": null, "dimension_separator": "/"
                }),
            )
        }
        OmeVersion::V0_5 => {
            about["version"] = json!("0.5");
            job.put_json(
                "zarr.json",
                &json!({ "zarr_format": 3, "node_type": "group", "attributes": { "ome": about } }),
            )?;
            let bytes = json!({ "name": "bytes", "configuration": { "endian": "little" } });
            let codecs = json!([bytes, { "name": "zstd", "configuration": { "level": ZSTD_LEVEL, "checksum": false } }]);
            let (outer, codecs) = if sharded {
                let sharding = json!({
                    "name": "sharding_indexed",
                    "configuration": { "chunk_shape": chunk, "codecs": codecs, "index_codecs": [bytes, { "name": "crc32c" }], "index_location": "end" }
                });
                (zyx(shard_grid(job).map(|chunks| chunks * job.side)), json!([sharding]))
            } else {
                (chunk, codecs)
            };
            job.put_json(
                "0/zarr.json",
                &json!({
                    "zarr_format": 3, "node_type": "array", "shape": shape, "data_type": v3_type(info.label_type), "fill_value": 0,
                    "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": outer } },
                    "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
                    "codecs": codecs, "attributes": {}, "dimension_names": ["z", "y", "x"]
                }),
            )
        }
    }
}

fn multiscale(job: &StoreJob<'_>, version: OmeVersion, notes: &mut Vec<String>) -> Value {
    let info = job.info;
    let unit = match info.unit {
        Unit::Nanometre => Some("nanometer"),
        Unit::Micrometre => Some("micrometer"),
        Unit::Millimetre => Some("millimeter"),
        Unit::Metre => Some("meter"),
        Unit::Unknown => None,
    };
    let axes: Vec<Value> = ["z", "y", "x"]
        .into_iter()
        .map(|name| match unit {
            Some(unit) => json!({ "name": name, "type": "space", "unit": unit }),
            None => json!({ "name": name, "type": "space" }),
        })
        .collect();
    let [x, y, z] = info.spacing();
    let mut steps = vec![json!({ "type": "scale", "scale": [z, y, x] })];
    match origin(info, notes) {
        // The place of the first voxel's middle.
        Some(at) if at != DVec3::ZERO => {
            steps.push(json!({ "type": "translation", "translation": [at.z, at.y, at.x] }));
        }
        _ => {}
    }
    let name = job.out.file_name().unwrap_or_default().to_string_lossy();
    let mut about = json!({ "name": name, "axes": axes, "datasets": [{ "path": "0", "coordinateTransformations": steps }] });
    if version == OmeVersion::V0_4 {
        about["version"] = json!("0.4");
    }
    about
}

/// Where the middle of the first voxel lies. Formats with lengths along the axes alone hold no directions: these are left out with the origin, and
/// a line says so.
pub(crate) fn origin(info: &VolumeInfo, notes: &mut Vec<String>) -> Option<DVec3> {
    let DAffine3 { matrix3, translation } = info.world_from_centre();
    let along = DVec3::from_array(info.spacing());
    let straight = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis]
        .into_iter()
        .zip([DVec3::X * along.x, DVec3::Y * along.y, DVec3::Z * along.z])
        .all(|(axis, expected)| axis == expected);
    if !straight {
        notes.push("left out: the directions of the axes, and the origin; the format has axes along x, y and z alone".into());
        return None;
    }
    Some(translation)
}

fn image_label(table: &AnnotationTable, version: OmeVersion, notes: &mut Vec<String>) -> Value {
    let byte = |channel: f32| (channel * 255.0).round() as u8;
    let (mut colors, mut properties) = (Vec::new(), Vec::new());
    let clashing: Vec<&str> = table
        .columns()
        .iter()
        .map(|column| column.name.as_str())
        .filter(|name| ["label-value", "name", "type"].contains(name))
        .collect();
    if !clashing.is_empty() {
        notes
            .push(format!("left out: the columns {}, whose names have another meaning", clashing.join(", ")));
    }
    for (row, &id) in table.ids().iter().enumerate() {
        if let Some([r, g, b]) = table.colors_srgb()[row] {
            colors.push(json!({ "label-value": id, "rgba": [byte(r), byte(g), byte(b), 255] }));
        }
        let mut about = Map::new();
        let texts = [("name", &table.names()[row]), ("type", &table.types()[row])];
        for (key, text) in texts.into_iter().filter(|(_, text)| !text.is_empty()) {
            about.insert(key.into(), text.as_str().into());
        }
        for column in table.columns().iter().filter(|column| !clashing.contains(&column.name.as_str())) {
            if !column.values[row].is_nan() {
                about.insert(column.name.clone(), column.values[row].into());
            }
        }
        if !about.is_empty() {
            about.insert("label-value".into(), id.into());
            properties.push(Value::Object(about));
        }
    }
    let mut label = Map::new();
    if version == OmeVersion::V0_4 {
        label.insert("version".into(), "0.4".into());
    }
    // The schema wants at least one entry of a list that is there.
    for (key, list) in [("colors", colors), ("properties", properties)] {
        if !list.is_empty() {
            label.insert(key.into(), list.into());
        }
    }
    Value::Object(label)
}

fn v3_type(label_type: LabelType) -> &'static str {
    match label_type {
        LabelType::U8 => "uint8",
        LabelType::U16 => "uint16",
        LabelType::U32 => "uint32",
        LabelType::U64 => "uint64",
        LabelType::I8 => "int8",
        LabelType::I16 => "int16",
        LabelType::I32 => "int32",
        LabelType::I64 => "int64",
        LabelType::F32 => "float32",
        LabelType::F64 => "float64",
    }
}

fn v2_type(label_type: LabelType) -> &'static str {
    match label_type {
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
    }
}
