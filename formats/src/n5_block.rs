//! A block of an N5 data set: a header in big-endian order, and the compressed elements (*N5 specification*, github.com/saalfeldlab/n5).
//!
//! ```text
//! u16 mode   0 plain, 1 with a number of elements of its own, 2 objects      u16 number of axes      u32 × axes sizes, x first      data
//! ```

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::bounded_decoder::Coder;
use crate::chunks::{Chunk, ChunkReader};
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::store_files::{self, is_absent};

/// The compression that the attributes of a data set name, `None` for plain blocks; `Err` has the name of one that is not read.
pub(crate) fn compression(attributes: &Value) -> std::result::Result<Option<Coder>, String> {
    let compression = attributes.get("compression");
    let name = compression
        .and_then(|c| c.get("type").unwrap_or(c).as_str())
        // Before version 2.
        .or_else(|| attributes.get("compressionType")?.as_str())
        .unwrap_or("raw");
    Ok(Some(match name {
        "raw" => return Ok(None),
        "gzip" if compression.and_then(|c| c.get("useZlib")?.as_bool()) == Some(true) => Coder::Zlib,
        "gzip" => Coder::Gzip,
        "zstd" => Coder::Zstd,
        #[cfg(feature = "zarr")]
        "bzip2" => Coder::Bzip2,
        #[cfg(feature = "zarr")]
        "blosc" => Coder::Blosc,
        other => return Err(shorten(other)),
    }))
}

/// Reads the blocks of a data set.
pub(crate) struct N5Blocks {
    pub(crate) folder: PathBuf,
    /// Sizes of the data set and of a block, x first.
    pub(crate) dims: Vec<u64>,
    pub(crate) block: Vec<u64>,
    /// `None` for plain blocks.
    pub(crate) compression: Option<Coder>,
    pub(crate) element_bytes: usize,
}

impl ChunkReader for N5Blocks {
    fn read(&self, chunk: &[u64]) -> Result<Option<Chunk>> {
        let mut path = self.folder.clone();
        for index in &chunk[..self.dims.len()] {
            path.push(index.to_string());
        }
        let most = self.block.iter().product::<u64>().saturating_mul(self.element_bytes as u64);
        // What cannot be compressed becomes a little longer.
        let bytes = match store_files::read(&path, most.saturating_mul(2).saturating_add(1 << 20)) {
            Ok(bytes) => bytes,
            Err(error) if is_absent(&error) => return Ok(None),
            Err(source) => return Err(FormatError::Io { path, source }),
        };
        self.decode(&path, &bytes).map(Some)
    }
}

impl N5Blocks {
    fn decode(&self, path: &Path, bytes: &[u8]) -> Result<Chunk> {
        let wrong = |what: String| FormatError::damaged(path, what);
        let axes = self.dims.len();
        let short = || wrong(format!("the block has {} bytes, fewer than its header", bytes.len()));
        let u16_at = |at: usize| bytes.get(at..at + 2).map(|b| u16::from_be_bytes([b[0], b[1]]));
        let u32_at = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]));
        let (mode, count) = (u16_at(0).ok_or_else(short)?, u16_at(2).ok_or_else(short)?);
        if mode > 1 {
            return Err(wrong(format!(
                "the block has mode {mode}, expected 0 or 1: it holds no plain numbers"
            )));
        }
        if usize::from(count) != axes {
            return Err(wrong(format!("the block has {count} axes, expected {axes}")));
        }
        let mut sizes = Vec::new();
        for a in 0..axes {
            let size = u64::from(u32_at(4 + 4 * a).ok_or_else(short)?);
            if size == 0 || size > self.block[a] {
                return Err(wrong(format!(
                    "the block has size {size} along axis {a}, expected 1 to {}",
                    self.block[a]
                )));
            }
            sizes.push(size);
        }
        let mut at = 4 + 4 * axes;
        let expected = sizes.iter().product::<u64>() * self.element_bytes as u64;
        if mode == 1 {
            let elements = u64::from(u32_at(at).ok_or_else(short)?);
            if elements.saturating_mul(self.element_bytes as u64) != expected {
                return Err(wrong(format!(
                    "the block holds {elements} elements, which is not the product of its sizes"
                )));
            }
            at += 4;
        }
        let stored = bytes.get(at..).ok_or_else(short)?;
        let plain = match self.compression {
            None => stored.to_vec(),
            Some(coder) => {
                coder.decode(stored, expected).map_err(|what| wrong(format!("the block: {what}")))?
            }
        };
        if plain.len() as u64 != expected {
            let got = plain.len();
            return Err(wrong(format!("the block: expected {expected} bytes of voxels, got {got}")));
        }
        Ok(Chunk { bytes: plain, sizes })
    }
}
