//! Shards of Neuroglancer's precomputed volumes: files that hold many chunks (`src/datasource/precomputed/sharded.md` in its repository).
//!
//! ```text
//! chunk number ─► compressed Morton code ─► preshift, hash ─┬─► lowest bits: minishard
//!                                                            └─► next bits: shard, a file of that name
//! shard file     u64 pairs (begin, end) of each minishard's index    data of chunks, indices of minishards
//! minishard      u64 × n chunk ids, × n begins, × n sizes, each as the difference from the one before; gzip or raw
//! ```
//! All offsets count from the end of the pairs.

use std::collections::HashMap;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use pumice_core::{open_input, reserve};
use serde_json::Value;

use crate::error::{FormatError, Result};
use crate::precomputed::inflated;
use crate::server;
use crate::store_files::{Part, is_absent, is_on_server};

/// How chunks lie in shards.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sharding {
    preshift_bits: u32,
    /// MurmurHash3 of the shifted id; otherwise the id itself.
    is_hashed: bool,
    minishard_bits: u32,
    shard_bits: u32,
    is_index_gzip: bool,
    pub(crate) is_data_gzip: bool,
}

impl Sharding {
    pub(crate) fn parse(sharding: &Value) -> std::result::Result<Self, String> {
        let text = |key: &str| sharding.get(key).and_then(Value::as_str);
        let bits = |key: &str| {
            sharding
                .get(key)
                .and_then(Value::as_u64)
                .filter(|&n| n <= 64)
                .map(|n| n as u32)
                .ok_or_else(|| format!("{key}: expected a number of bits from 0 to 64"))
        };
        if text("@type") != Some("neuroglancer_uint64_sharded_v1") {
            return Err("@type: expected neuroglancer_uint64_sharded_v1".into());
        }
        let is_hashed = match text("hash") {
            Some("identity") => false,
            Some("murmurhash3_x86_128") => true,
            _ => return Err("hash: expected identity or murmurhash3_x86_128".into()),
        };
        let is_gzip = |key: &str| match text(key) {
            None | Some("raw") => Ok(false),
            Some("gzip") => Ok(true),
            Some(_) => Err(format!("{key}: expected raw or gzip")),
        };
        let (minishard_bits, shard_bits) = (bits("minishard_bits")?, bits("shard_bits")?);
        // The pairs of a file of 2³² minishards take 64 GiB.
        if minishard_bits > 32 || minishard_bits + shard_bits > 64 {
            return Err("minishard_bits, shard_bits: expected at most 32, and 64 together".into());
        }
        Ok(Self {
            preshift_bits: bits("preshift_bits")?,
            is_hashed,
            minishard_bits,
            shard_bits,
            is_index_gzip: is_gzip("minishard_index_encoding")?,
            is_data_gzip: is_gzip("data_encoding")?,
        })
    }

    /// The shard and the minishard of a chunk.
    fn place(&self, id: u64) -> (u64, u64) {
        let shifted = id.checked_shr(self.preshift_bits).unwrap_or(0);
        let hash = if self.is_hashed { murmur3(shifted) } else { shifted };
        let low = |value: u64, bits: u32| if bits == 64 { value } else { value & ((1 << bits) - 1) };
        let shard = hash.checked_shr(self.minishard_bits).unwrap_or(0);
        (low(shard, self.shard_bits), low(hash, self.minishard_bits))
    }

    fn file_name(&self, shard: u64) -> String {
        let digits = self.shard_bits.div_ceil(4) as usize;
        format!("{shard:0digits$x}.shard")
    }
}

/// The number of a chunk of a grid: the bits of its indices in turn, where the grid is long enough for a bit.
pub(crate) fn morton(chunk: [u64; 3], grid: [u64; 3]) -> u64 {
    let (mut code, mut to) = (0, 0);
    for bit in 0..64 {
        for a in 0..3 {
            if grid[a] > 1 && (grid[a] - 1) >> bit != 0 {
                code |= (chunk[a] >> bit & 1).checked_shl(to).unwrap_or(0);
                to += 1;
            }
        }
    }
    code
}

/// The low 64 bits of MurmurHash3_x86_128 of the eight bytes of `key`, with seed 0 (A. Appleby, public domain).
fn murmur3(key: u64) -> u64 {
    const C: [u32; 4] = [0x239b_961b, 0xab0e_9789, 0x38b3_4ae5, 0xa1e3_8b93];
    let mix = |mut h: u32| {
        h = (h ^ h >> 16).wrapping_mul(0x85eb_ca6b);
        h = (h ^ h >> 13).wrapping_mul(0xc2b2_ae35);
        h ^ h >> 16
    };
    // Eight bytes are a tail: two words for the first two lanes.
    let (k1, k2) = (key as u32, (key >> 32) as u32);
    let mut h = [0u32; 4];
    h[1] ^= k2.wrapping_mul(C[1]).rotate_left(16).wrapping_mul(C[2]);
    h[0] ^= k1.wrapping_mul(C[0]).rotate_left(15).wrapping_mul(C[1]);
    h = h.map(|lane| lane ^ 8);
    let add = |h: &mut [u32; 4]| {
        h[0] = h[0].wrapping_add(h[1]).wrapping_add(h[2]).wrapping_add(h[3]);
        for lane in 1..4 {
            h[lane] = h[lane].wrapping_add(h[0]);
        }
    };
    add(&mut h);
    h = h.map(mix);
    add(&mut h);
    u64::from(h[1]) << 32 | u64::from(h[0])
}

/// Chunks of a minishard: id, begin and size, sorted by id.
type Index = Vec<(u64, u64, u64)>;

/// Entries of indices that are kept: 24 bytes each.
const KEPT_ENTRIES: usize = 1 << 20;

/// Largest index of a minishard that is read, inflated.
const MOST_INDEX_BYTES: u64 = 1 << 30;

/// Reads the chunks of a folder of shards.
pub(crate) struct Shards {
    folder: PathBuf,
    sharding: Sharding,
    kept: Mutex<Kept>,
}

/// Indices that were read.
#[derive(Default)]
struct Kept {
    /// By shard and minishard; empty where there is none.
    indices: HashMap<(u64, u64), Arc<Index>>,
    entries: usize,
}

impl Shards {
    pub(crate) fn new(folder: PathBuf, sharding: Sharding) -> Self {
        Self { folder, sharding, kept: Mutex::default() }
    }

    /// The stored bytes of a chunk, and its file; `None` where no shard has it.
    pub(crate) fn read(&self, id: u64, most_bytes: u64) -> Result<Option<(Vec<u8>, PathBuf)>> {
        let (shard, minishard) = self.sharding.place(id);
        let path = self.folder.join(self.sharding.file_name(shard));
        // The indices are whole between any two statements under the lock.
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept().indices.get(&(shard, minishard)).cloned();
        let index = match known {
            Some(index) => index,
            None => {
                let index = Arc::new(self.index(&path, minishard)?);
                let mut kept = kept();
                if kept.entries + index.len() > KEPT_ENTRIES {
                    *kept = Kept::default();
                }
                // An empty index costs memory too.
                kept.entries += index.len() + 8;
                kept.indices.insert((shard, minishard), Arc::clone(&index));
                index
            }
        };
        let Ok(at) = index.binary_search_by_key(&id, |entry| entry.0) else { return Ok(None) };
        let (_, begin, size) = index[at];
        let mut bytes = part_of(&path, self.base() + begin, size, most_bytes)?;
        if self.sharding.is_data_gzip {
            bytes = inflated(&path, &bytes, most_bytes)?;
        }
        Ok(Some((bytes, path)))
    }

    /// Bytes of the pairs at a shard's start.
    fn base(&self) -> u64 {
        16 << self.sharding.minishard_bits
    }

    /// The index of a minishard; empty where the shard or the minishard is absent.
    fn index(&self, path: &Path, minishard: u64) -> Result<Index> {
        let Some(pair) = part(path, 16 * minishard, 16, 16)? else { return Ok(Vec::new()) };
        let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| pair[at + i]));
        let (begin, end) = (number(0), number(8));
        if begin == end {
            return Ok(Vec::new());
        }
        let wrong = |what: &str| FormatError::damaged(path, format!("minishard {minishard}: {what}"));
        let size = end.checked_sub(begin).ok_or_else(|| wrong("its index ends before it begins"))?;
        let begin = begin.checked_add(self.base()).ok_or_else(|| wrong("its index lies beyond the file"))?;
        let mut bytes = part_of(path, begin, size, MOST_INDEX_BYTES)?;
        if self.sharding.is_index_gzip {
            bytes = inflated(path, &bytes, MOST_INDEX_BYTES)?;
        }
        let (numbers, []) = bytes.as_chunks::<8>() else {
            return Err(wrong("its index is no list of 64-bit numbers"));
        };
        let count = numbers.len() / 3;
        if count * 3 != numbers.len() {
            return Err(wrong("its index has not three numbers a chunk"));
        }
        let of = |row: usize, n: usize| u64::from_le_bytes(numbers[row * count + n]);
        let mut index =
            reserve::reserved(count, "the index of a shard").map_err(FormatError::memory(path))?;
        let (mut id, mut at) = (0u64, 0u64);
        for n in 0..count {
            id = id.wrapping_add(of(0, n));
            let size = of(2, n);
            let begin = at.checked_add(of(1, n)).ok_or_else(|| wrong("a chunk lies beyond the file"))?;
            at = begin
                .checked_add(size)
                .filter(|&end| end < 1 << 62)
                .ok_or_else(|| wrong("a chunk lies beyond the file"))?;
            index.push((id, begin, size));
        }
        index.sort_unstable();
        Ok(index)
    }
}

/// A part of a file that is there, of at most `most` bytes.
fn part_of(path: &Path, begin: u64, size: u64, most: u64) -> Result<Vec<u8>> {
    part(path, begin, size, most)?.ok_or_else(|| FormatError::damaged(path, "the shard is no longer there"))
}

/// A part of a file, of at most `most` bytes; `None` where there is no file.
fn part(path: &Path, begin: u64, size: u64, most: u64) -> Result<Option<Vec<u8>>> {
    if is_on_server(path) {
        if size > most {
            return Err(too_long(path, size, most));
        }
        return match server::read(path, Part::Piece { begin, size }, most) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if is_absent(&error) => Ok(None),
            Err(error) => Err(FormatError::Io { path: path.to_owned(), source: error }),
        };
    }
    let mut file = match open_input(path) {
        Ok(file) => file,
        Err(error) if is_absent(&error) => return Ok(None),
        Err(error) => return Err(FormatError::Io { path: path.to_owned(), source: error }),
    };
    let has = file.metadata().map_err(FormatError::io(path))?.len();
    if begin.checked_add(size).is_none_or(|end| end > has) {
        return Err(FormatError::damaged(
            path,
            format!("the shard has {has} bytes, but {size} bytes from byte {begin} on are wanted"),
        ));
    }
    if size > most {
        return Err(too_long(path, size, most));
    }
    let mut bytes = reserve::zeroed(size as usize, "a chunk").map_err(FormatError::memory(path))?;
    file.seek(SeekFrom::Start(begin))
        .and_then(|_| file.read_exact(&mut bytes))
        .map_err(FormatError::io(path))?;
    Ok(Some(bytes))
}

fn too_long(path: &Path, size: u64, most: u64) -> FormatError {
    FormatError::damaged(path, format!("a part of the shard has {size} bytes, expected at most {most}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bits_of_a_long_axis_go_on_alone() {
        // x has 3 bits, y has 1, z none: x0 y0 x1 x2.
        for (chunk, code) in
            [([0, 0, 0], 0), ([1, 0, 0], 1), ([0, 1, 0], 2), ([2, 0, 0], 4), ([4, 1, 0], 10), ([7, 1, 0], 15)]
        {
            assert_eq!(morton(chunk, [8, 2, 1]), code);
        }
        // A grid of 5 needs 3 bits, one of 4 needs 2.
        assert_eq!(morton([4, 0, 0], [5, 4, 1]), 1 << 4);
    }
}
