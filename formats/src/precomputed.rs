//! Neuroglancer's precomputed volumes: a folder with the file `info`, and a folder of chunks for each scale.
//!
//! ```text
//! cortex.precomputed/info                                     --scale
//! cortex.precomputed/16_16_40/0-64_0-64_0-64[.gz]             a chunk a file: its first voxel and the one beyond its last, with the offset
//! cortex.precomputed/16_16_40/0a.shard                        or many chunks a file (`precomputed_shards`)
//! cortex.precomputed/names/info                               segment properties: names of labels
//! ```
//! Voxel (0, 0, 0) of a scale lies at `voxel_offset · resolution` nanometres. Chunks are cut off at the volume's end.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use pumice_core::{LabelNote, Unit, VolumeInfo};

use crate::bounded_decoder::Coder;
use crate::choice::{self, choose, refuse_absent};
use crate::chunks::{Chunk, ChunkReader, Chunks, place};
use crate::compressed_segmentation;
use crate::compresso;
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::label_tables::read_label_table;
use crate::layout::{FileAxis, Layout, Role};
use crate::levels::{Level, choose_level};
use crate::options::{MissingChunks, OpenOptions};
use crate::placement;
use crate::precomputed_info::{self, Encoding, ScaleInfo};
use crate::precomputed_shards::{Shards, morton};
use crate::store_files::{self, is_absent, is_file, is_on_server};
use crate::stores;
use crate::volume_file::{Format, Takes, VolumeFile, Voxels};

/// Folders of precomputed volumes.
pub(crate) const FORMAT: Format = Format {
    name: "Neuroglancer precomputed",
    takes: Takes { scale: true, missing_chunks: true, ..Takes::NOTHING },
    // A description that is damaged is one all the same: reading it says what is wrong.
    recognises: |folder, _| match stores::json(folder, "info") {
        Ok(Some(info)) => info.get("scales").is_some() || info.get("type").is_some(),
        Ok(None) => false,
        Err(_) => is_file(&folder.join("info")),
    },
    read,
};

/// Reads `info`.
fn read(folder: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let path = folder.join("info");
    let Some(json) = stores::json(folder, "info")? else {
        return Err(FormatError::damaged(folder, "the folder has no file info"));
    };
    let info = precomputed_info::parse(&path, &json)?;
    let mut choices = Vec::new();
    let levels: Vec<Level> =
        info.scales.iter().map(|s| Level { dims: Some(s.size), spacing: s.resolution }).collect();
    let scale = &info.scales[choose_level(folder, &levels, Unit::Nanometre, options, &mut choices)?];
    refuse_absent(folder, options, &[&choice::TIME, &choice::LAYER])?;
    let channel = choose(folder, &choice::CHANNEL, options, info.channels, &mut choices)?;
    let Some(encoding) = scale.encoding else {
        return Err(FormatError::unsupported(
            &path,
            format!(
                "the chunks of scale {} have the encoding {}",
                shorten(&scale.key),
                shorten(&scale.encoding_name)
            ),
            "write them as raw, compressed_segmentation or compresso",
        ));
    };
    let element = Element::new(info.label_type, false);
    if matches!(encoding, Encoding::CompressedSegmentation(_)) && !matches!(element.bytes(), 4 | 8) {
        return Err(FormatError::damaged(
            &path,
            "compressed_segmentation holds labels of 32 or 64 bits only",
        ));
    }
    if encoding == Encoding::Compresso && info.channels > 1 {
        return Err(FormatError::damaged(&path, "compresso holds one channel only"));
    }
    // Some scales lie beside the volume's folder: `../../other/8_8_8`. That is no reason to leave it.
    if scale.key.starts_with('/') || scale.key.split('/').any(|part| part == "..") {
        return Err(FormatError::unsupported(
            &path,
            format!("the scale {} lies outside the folder", shorten(&scale.key)),
            "copy it into the folder and change its key",
        ));
    }
    let mut axes: Vec<FileAxis> =
        (0..3).map(|a| FileAxis { size: scale.size[a], role: Role::Space(a) }).collect();
    axes.push(FileAxis { size: info.channels, role: Role::Fixed(channel) });
    let layout = Layout::new(&path, axes, element.bytes())?;
    let mut volume = VolumeInfo::new(layout.dims(), info.label_type);
    let offset = DVec3::from_array(scale.voxel_offset.map(|n| n as f64));
    volume.world_from_index =
        placement::from_spacing(&path, scale.resolution, options)? * DAffine3::from_translation(offset);
    volume.unit = Unit::Nanometre;
    volume.notes = notes(folder, info.segment_properties.as_deref(), options);
    let mut reader = Reader {
        folder: folder.join(&scale.key),
        scale: scale.clone(),
        encoding,
        channels: info.channels,
        id_bytes: element.bytes(),
        shards: None,
    };
    let sharded = if scale.sharding.is_some() { "sharded " } else { "" };
    Ok(VolumeFile {
        format: "Neuroglancer precomputed",
        encoding: format!("{sharded}{}", scale.encoding_name),
        info: volume,
        layout,
        element,
        layers: Vec::new(),
        choices,
        voxels: Voxels::Chunks(Chunks {
            chunk: vec![scale.chunk[0], scale.chunk[1], scale.chunk[2], info.channels],
            shard: vec![1; 4],
            fill: vec![0; element.bytes()],
            missing: options.missing_chunks.unwrap_or(MissingChunks::Fill),
            open: Box::new(move || {
                if !is_on_server(&reader.folder) {
                    std::fs::metadata(&reader.folder).map_err(FormatError::io(&reader.folder))?;
                }
                reader.shards = reader
                    .scale
                    .sharding
                    .clone()
                    .map(|sharding| Shards::new(reader.folder.clone(), sharding));
                Ok(Box::new(reader))
            }),
        }),
    })
}

/// Names of labels from the segment properties. Where they cannot be read, a warning says so, and the labels have no names.
fn notes(folder: &Path, properties: Option<&str>, options: &OpenOptions) -> Vec<LabelNote> {
    let Some(name) = properties else { return Vec::new() };
    let path = folder.join(name);
    match read_label_table(&path) {
        Ok(found) => {
            let table = found.table;
            let mut notes: Vec<LabelNote> = table
                .ids()
                .iter()
                .zip(table.names())
                .filter(|(id, name)| **id != 0 && !name.is_empty())
                .map(|(&id, name)| LabelNote { id, name: Some(name.clone()), color_srgb: None })
                .collect();
            notes.sort_by_key(|note| note.id);
            notes
        }
        Err(error) => {
            options.warnings.push(format!("{}: the labels get no names: {error}", folder.display()));
            Vec::new()
        }
    }
}

/// Reads the chunks of a scale.
struct Reader {
    folder: PathBuf,
    scale: ScaleInfo,
    encoding: Encoding,
    channels: u64,
    id_bytes: usize,
    shards: Option<Shards>,
}

impl ChunkReader for Reader {
    fn read(&self, chunk: &[u64]) -> Result<Option<Chunk>> {
        let ScaleInfo { size, voxel_offset, chunk: whole, .. } = &self.scale;
        let low = [0, 1, 2].map(|a| chunk[a] * whole[a]);
        let high = [0, 1, 2].map(|a| (low[a] + whole[a]).min(size[a]));
        let sizes = [0, 1, 2].map(|a| high[a] - low[a]);
        let voxels = sizes.iter().product::<u64>().saturating_mul(self.channels);
        let plain_bytes = voxels.saturating_mul(self.id_bytes as u64);
        // Compressed segmentation of noise: an id and an index of 32 bits a voxel, and headers.
        let most_bytes = plain_bytes.saturating_mul(4).saturating_add(1 << 20);
        let read = match &self.shards {
            Some(shards) => {
                let grid = [0, 1, 2].map(|a| size[a].div_ceil(whole[a]));
                shards.read(morton([chunk[0], chunk[1], chunk[2]], grid), most_bytes)?
            }
            None => {
                let part = |a: usize| {
                    let offset = i128::from(voxel_offset[a]);
                    format!("{}-{}", offset + i128::from(low[a]), offset + i128::from(high[a]))
                };
                chunk_file(&self.folder, &[part(0), part(1), part(2)].join("_"), most_bytes)?
            }
        };
        let Some((bytes, path)) = read else { return Ok(None) };
        let wrong =
            |what: String| FormatError::damaged(&path, format!("chunk {}: {what}", place(&chunk[..3])));
        let bytes = match self.encoding {
            Encoding::Raw if bytes.len() as u64 == plain_bytes => bytes,
            Encoding::Raw => return Err(wrong(format!("expected {plain_bytes} bytes, got {}", bytes.len()))),
            Encoding::Compresso => compresso::decode(&bytes, sizes, self.id_bytes).map_err(wrong)?,
            Encoding::CompressedSegmentation(block) => {
                compressed_segmentation::decode(&bytes, sizes, self.channels, block, self.id_bytes)
                    .map_err(wrong)?
            }
        };
        Ok(Some(Chunk { bytes, sizes: vec![sizes[0], sizes[1], sizes[2], self.channels] }))
    }
}

/// The bytes of a chunk's own file, inflated, and the file; `None` where there is none.
fn chunk_file(folder: &Path, name: &str, most_bytes: u64) -> Result<Option<(Vec<u8>, PathBuf)>> {
    // A server says in its answer how the file is compressed, and its reader undoes it.
    let endings: &[(&str, Option<Coder>)] = match is_on_server(folder) {
        true => &[("", None)],
        false => &[
            ("", None),
            (".gz", Some(Coder::Gzip)),
            (".br", Some(Coder::Brotli)),
            (".zstd", Some(Coder::Zstd)),
        ],
    };
    for (ending, coder) in endings {
        let path = folder.join(format!("{name}{ending}"));
        let bytes = match store_files::read(&path, most_bytes) {
            Ok(bytes) => bytes,
            Err(error) if is_absent(&error) => continue,
            Err(error) => return Err(FormatError::Io { path, source: error }),
        };
        // Files that a server sent are without an ending as they are stored: as gzip.
        let coder = coder.or_else(|| bytes.starts_with(&[0x1F, 0x8B, 8]).then_some(Coder::Gzip));
        let plain = coder.map(|coder| coder.decode(&bytes, most_bytes)).transpose();
        let plain = plain.map_err(|what| FormatError::damaged(&path, what))?;
        return Ok(Some((plain.unwrap_or(bytes), path)));
    }
    Ok(None)
}

/// The content of a gzip file, of at most `most_bytes` bytes.
pub(crate) fn inflated(path: &Path, bytes: &[u8], most_bytes: u64) -> Result<Vec<u8>> {
    Coder::Gzip.decode(bytes, most_bytes).map_err(|what| FormatError::damaged(path, what))
}
