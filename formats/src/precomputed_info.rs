//! The file `info` of a Neuroglancer precomputed volume (`src/datasource/precomputed/volume.md` in its repository).
//!
//! ```text
//! { "type": "segmentation", "data_type": "uint64", "num_channels": 1, "segment_properties": "names",
//!   "scales": [ { "key": "16_16_40", "size": [x, y, z], "resolution": [16, 16, 40], "voxel_offset": [0, 0, 0], "chunk_sizes": [[64, 64, 64]],
//!                 "encoding": "compressed_segmentation", "compressed_segmentation_block_size": [8, 8, 8],
//!                 "sharding": { "@type": "neuroglancer_uint64_sharded_v1", … } } ] }
//! ```

use std::path::Path;

use pumice_core::LabelType;
use serde_json::Value;

use crate::element::type_of_name;
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::precomputed_shards::Sharding;
use crate::stores::{lengths, numbers};

/// How the voxels of a chunk are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Raw,
    /// With the size of its blocks.
    CompressedSegmentation([u64; 3]),
    Compresso,
}

/// One scale of a volume.
#[derive(Clone, Debug)]
pub(crate) struct ScaleInfo {
    pub(crate) key: String,
    pub(crate) size: [u64; 3],
    pub(crate) resolution: [f64; 3],
    pub(crate) voxel_offset: [i64; 3],
    pub(crate) chunk: [u64; 3],
    pub(crate) encoding_name: String,
    pub(crate) encoding: Option<Encoding>,
    pub(crate) sharding: Option<Sharding>,
}

/// A volume.
#[derive(Clone, Debug)]
pub(crate) struct Info {
    pub(crate) label_type: LabelType,
    pub(crate) channels: u64,
    pub(crate) segment_properties: Option<String>,
    pub(crate) scales: Vec<ScaleInfo>,
}

/// Parses the JSON of `info`.
pub(crate) fn parse(path: &Path, info: &Value) -> Result<Info> {
    let wrong = |what: String| FormatError::damaged(path, what);
    let text = |value: &Value, key: &str| value.get(key).and_then(Value::as_str).map(str::to_owned);
    let name = text(info, "data_type").ok_or_else(|| wrong("data_type: expected a name, got none".into()))?;
    let label_type = type_of_name(&name.to_lowercase())
        .ok_or_else(|| wrong(format!("data_type: expected a number type, got {:?}", shorten(&name))))?;
    let channels = info.get("num_channels").map_or(Some(1), Value::as_u64).filter(|&n| n > 0);
    let channels = channels.ok_or_else(|| wrong("num_channels: expected a whole number above 0".into()))?;
    let list = info.get("scales").and_then(Value::as_array).filter(|list| !list.is_empty());
    let list = list.ok_or_else(|| wrong("scales: expected a list of scales, got none".into()))?;
    let scales = list
        .iter()
        .enumerate()
        .map(|(n, scale)| parse_scale(scale).map_err(|what| wrong(format!("scales[{n}]: {what}"))))
        .collect::<Result<_>>()?;
    Ok(Info { label_type, channels, segment_properties: text(info, "segment_properties"), scales })
}

fn parse_scale(scale: &Value) -> std::result::Result<ScaleInfo, String> {
    let three = |key: &str| -> std::result::Result<[u64; 3], String> {
        numbers(scale.get(key))
            .and_then(|list| list.try_into().ok())
            .ok_or_else(|| format!("{key}: expected three whole numbers"))
    };
    let key =
        scale.get("key").and_then(Value::as_str).ok_or("key: expected the name of a folder, got none")?;
    let resolution: [f64; 3] = lengths(scale.get("resolution"))
        .and_then(|list| list.try_into().ok())
        .ok_or("resolution: expected three lengths")?;
    let voxel_offset = match scale.get("voxel_offset") {
        None => [0; 3],
        // Some writers store whole numbers as floating-point ones.
        Some(list) => lengths(Some(list))
            .and_then(|list| <[f64; 3]>::try_from(list).ok())
            .filter(|list| list.iter().all(|n| n.fract() == 0.0 && n.abs() < 9e15))
            .ok_or("voxel_offset: expected three whole numbers")?
            .map(|n| n as i64),
    };
    let chunk: [u64; 3] = scale
        .get("chunk_sizes")
        .and_then(|list| numbers(list.get(0)))
        .and_then(|list| list.try_into().ok())
        .filter(|chunk: &[u64; 3]| !chunk.contains(&0))
        .ok_or("chunk_sizes: expected a list of three whole numbers above 0")?;
    let encoding_name =
        scale.get("encoding").and_then(Value::as_str).ok_or("encoding: expected a name, got none")?;
    let encoding = match encoding_name {
        "raw" => Some(Encoding::Raw),
        "compresso" => Some(Encoding::Compresso),
        "compressed_segmentation" => {
            let block = match scale.get("compressed_segmentation_block_size") {
                None => [8; 3],
                Some(_) => three("compressed_segmentation_block_size")?,
            };
            if block.iter().any(|&n| n == 0 || n > 1 << 16) {
                return Err("compressed_segmentation_block_size: expected 1 to 65536 voxels".into());
            }
            Some(Encoding::CompressedSegmentation(block))
        }
        _ => None,
    };
    let sharding = match scale.get("sharding") {
        None | Some(Value::Null) => None,
        Some(sharding) => Some(Sharding::parse(sharding).map_err(|what| format!("sharding: {what}"))?),
    };
    Ok(ScaleInfo {
        key: key.to_owned(),
        size: three("size")?,
        resolution,
        voxel_offset,
        chunk,
        encoding_name: encoding_name.to_owned(),
        encoding,
        sharding,
    })
}
