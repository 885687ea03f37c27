//! A block of an N5 data set: a header in big-endian order, and the compressed elements (*N5 specification*, github.com/saalfeldlab/n5).
//!
//! ```text
//! u16 mode   0 plain, 1 with a number of elements of its own, 2 objects      u16 number of axes      u32 × axes sizes, x first      data
//! ```

use std::io::Read;
use std::path::{Path, PathBuf};

use flate2::read::{MultiGzDecoder, ZlibDecoder};
use pumice_core::error::one_line;
use pumice_core::read_input;
use serde_json::Value;

use crate::chunks::{Chunk, ChunkReader};
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::stores::is_absent;

/// Compression of a data set's blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    Raw,
    Gzip,
    Zlib,
    Zstd,
    #[cfg(feature = "zarr")]
    Bzip2,
}

impl Compression {
    /// The compression that the attributes of a data set name; `Err` has the name of one that is not read.
    pub(crate) fn of(attributes: &Value) -> std::result::Result<Self, String> {
        let compression = attributes.get("compression");
        let name = compression
            .and_then(|c| c.get("type").unwrap_or(c).as_str())
            // Before version 2.
            .or_else(|| attributes.get("compressionType")?.as_str())
            .unwrap_or("raw");
        Ok(match name {
            "raw" => Self::Raw,
            "gzip" if compression.and_then(|c| c.get("useZlib")?.as_bool()) == Some(true) => Self::Zlib,
            "gzip" => Self::Gzip,
            "zstd" => Self::Zstd,
            #[cfg(feature = "zarr")]
            "bzip2" => Self::Bzip2,
            other => return Err(shorten(other)),
        })
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Gzip => "gzip",
            Self::Zlib => "zlib",
            Self::Zstd => "zstd",
            #[cfg(feature = "zarr")]
            Self::Bzip2 => "bzip2",
        }
    }

    /// The plain bytes, of which there should be `expected`; one more is read where there are more.
    fn plain(self, stored: &[u8], expected: u64) -> std::io::Result<Vec<u8>> {
        let mut plain = Vec::new();
        let most = expected.saturating_add(1);
        match self {
            Self::Raw => plain.extend_from_slice(stored),
            Self::Gzip => {
                MultiGzDecoder::new(stored).take(most).read_to_end(&mut plain)?;
            }
            Self::Zlib => {
                ZlibDecoder::new(stored).take(most).read_to_end(&mut plain)?;
            }
            Self::Zstd => {
                zstd::stream::read::Decoder::new(stored)?.take(most).read_to_end(&mut plain)?;
            }
            #[cfg(feature = "zarr")]
            Self::Bzip2 => {
                bzip2::read::MultiBzDecoder::new(stored).take(most).read_to_end(&mut plain)?;
            }
        }
        Ok(plain)
    }
}

/// Reads the blocks of a data set.
pub(crate) struct N5Blocks {
    pub(crate) folder: PathBuf,
    /// Sizes of the data set and of a block, x first.
    pub(crate) dims: Vec<u64>,
    pub(crate) block: Vec<u64>,
    pub(crate) compression: Compression,
    pub(crate) element_bytes: usize,
}

impl ChunkReader for N5Blocks {
    fn read(&mut self, chunk: &[u64]) -> Result<Option<Chunk>> {
        let mut path = self.folder.clone();
        for index in &chunk[..self.dims.len()] {
            path.push(index.to_string());
        }
        let most = self.block.iter().product::<u64>().saturating_mul(self.element_bytes as u64);
        // What cannot be compressed becomes a little longer.
        let bytes = match read_input(&path, most.saturating_mul(2).saturating_add(1 << 20)) {
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
        let plain = self
            .compression
            .plain(stored, expected)
            .map_err(|e| wrong(one_line(&format!("{}: {e}", self.compression.name()))))?;
        if plain.len() as u64 != expected {
            let got = if plain.len() as u64 > expected { "more".to_owned() } else { plain.len().to_string() };
            return Err(wrong(format!("the block: expected {expected} bytes of voxels, got {got}")));
        }
        Ok(Chunk { bytes: plain, sizes })
    }
}
