//! Keeps what was read of chunks that are not finished, so that after an interrupt a source that is read from its beginning needs to be
//! taken apart only from there on.
//!
//! ```text
//! NAME.records   the records of all voxels that were read: the scratch file of their store, which stays
//! NAME.read      replaced after each slab: how far the source was read, and which bytes of the other file hold what, as a line of JSON;
//!                the XXH3 of that line
//! ```
//! What a killed process wrote behind the last slab is cut off. The bytes before it have a hash in the JSON.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use crate::store::{KeptPiece, KeptPieces, PartStore};
use crate::{CHUNK_VOXELS, ChunkGrid, ChunkSet, Error, Result, morton, read_input, write_text};

/// Largest description that is read: a slab of a chunk takes a line.
const MOST_BYTES: u64 = 1 << 28;

/// Bytes of records that are hashed at once.
const HASHED_BYTES: usize = 1 << 20;

/// Voxels of a slab: a quarter of a chunk's.
const VOXELS_A_SLAB: u64 = (CHUNK_VOXELS as u64).pow(3) / 4;

/// What the records are of.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Description {
    chunks: ChunkSet,
    /// The voxel along the source's slowest axis from which reading goes on; of a time series 0.
    reached: u32,
    /// Number of frames that were read; of a volume 0.
    frames: u32,
    /// Length of the records and their XXH3.
    bytes: u64,
    hash: u64,
    kept: KeptPieces,
}

impl Description {
    /// That of a whole file; `None` where any of its bytes changed.
    fn of_text(text: &[u8]) -> Option<Self> {
        let (line, hash) = std::str::from_utf8(text).ok()?.split_once('\n')?;
        if hash.strip_suffix('\n')? != hash_of(line) {
            return None;
        }
        serde_json::from_str(line).ok()
    }
}

fn hash_of(line: &str) -> String {
    format!("{:016x}", xxh3_64(line.as_bytes()))
}

/// What was read of some chunks, in two files.
#[derive(Debug)]
pub struct KeptRecords {
    description: PathBuf,
    records: PathBuf,
    read: Description,
    /// Of the records before `hashed`.
    hash: Xxh3Of,
    hashed: u64,
    slab_voxels: u64,
}

/// A hash that goes on.
#[derive(Clone)]
struct Xxh3Of(Box<Xxh3>);

impl std::fmt::Debug for Xxh3Of {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:016x}", self.0.digest())
    }
}

impl KeptRecords {
    /// What the files `NAME.read` and `NAME.records` in `folder` have of these chunks of a volume; nothing where they are not there or where
    /// they lack one of the chunks.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Caller`] where the files are damaged.
    pub fn open(folder: &Path, name: &str, chunks: &ChunkSet, grid: &ChunkGrid) -> Result<Self> {
        let [description, records] = ["read", "records"].map(|end| folder.join(format!("{name}.{end}")));
        let mut kept = Self {
            description,
            records,
            read: Description { chunks: chunks.clone(), ..Description::default() },
            hash: Xxh3Of(Box::new(Xxh3::new())),
            hashed: 0,
            slab_voxels: VOXELS_A_SLAB,
        };
        if !kept.description.exists() {
            return Ok(kept);
        }
        let io = |source| Error::Io { path: kept.description.clone(), source };
        let text = read_input(&kept.description, MOST_BYTES).map_err(io)?;
        let Some(mut read) = Description::of_text(&text) else { return Err(kept.damaged()) };
        let is_whole = |piece: &KeptPiece| piece.end().is_some_and(|end| end <= read.bytes);
        let length = std::fs::metadata(&kept.records).map_or(0, |file| file.len());
        if length < read.bytes || !read.kept.pieces.iter().all(is_whole) {
            return Err(kept.damaged());
        }
        if !chunks.iter().all(|chunk| read.chunks.contains(chunk)) {
            return Ok(kept);
        }
        // Of other chunks there are parts already.
        let is_wanted = |code: u64| {
            let origin = morton::decode(code).map(|c| u64::from(c) * u64::from(CHUNK_VOXELS));
            let origin = origin.map(|o| u32::try_from(o).unwrap_or(u32::MAX));
            (0..3).all(|a| origin[a] < grid.dims()[a]) && chunks.contains(grid.number(origin))
        };
        read.kept.pieces.retain(|piece| is_wanted(piece.chunk));
        read.kept.delivered.retain(|&(code, _)| is_wanted(code));
        read.chunks = chunks.clone();
        let (bytes, hash) = (read.bytes, read.hash);
        kept.read = read;
        kept.hash_to(&kept.store_file(bytes)?, bytes)?;
        if kept.hash.0.digest() != hash {
            return Err(kept.damaged());
        }
        Ok(kept)
    }

    /// The same, with so many voxels in a slab, which is what an interrupt may cost.
    #[must_use]
    pub fn after_each(self, slab_voxels: u64) -> Self {
        Self { slab_voxels, ..self }
    }

    pub(crate) fn slab_voxels(&self) -> u64 {
        self.slab_voxels
    }

    fn damaged(&self) -> Error {
        Error::Caller(format!("{}: the file or its records are damaged", self.description.display()))
    }

    /// The voxel along the source's slowest axis from which it is still to be read.
    pub fn reached(&self) -> u32 {
        self.read.reached
    }

    /// Number of frames of a time series that were read.
    pub(crate) fn frames(&self) -> u32 {
        self.read.frames
    }

    /// What the records are of.
    pub(crate) fn pieces(&self) -> &KeptPieces {
        &self.read.kept
    }

    /// The file of the records, behind which a store appends others.
    pub(crate) fn file(&self) -> Result<crate::Scratch> {
        self.store_file(self.read.bytes)
    }

    fn store_file(&self, bytes: u64) -> Result<crate::Scratch> {
        crate::Scratch::kept_at(&self.records, bytes)
    }

    /// Keeps all that a store has, which appends to these records: of a volume up to `reached`, of a time series so many `frames`.
    pub(crate) fn keep(&mut self, store: &PartStore, reached: u32, frames: u32) -> Result<()> {
        let kept = store.all_in_file()?;
        let bytes = store.scratch().len();
        self.hash_to(store.scratch(), bytes)?;
        let hash = self.hash.0.digest();
        self.read = Description { reached, frames, bytes, hash, kept, chunks: self.read.chunks.clone() };
        let line = serde_json::to_string(&self.read)
            .map_err(|e| Error::Caller(format!("{}: {e}", self.description.display())))?;
        Ok(write_text(&self.description, &format!("{line}\n{}\n", hash_of(&line)))?)
    }

    /// Hashes the records up to a place.
    fn hash_to(&mut self, file: &crate::Scratch, end: u64) -> Result<()> {
        let mut buffer = vec![0; HASHED_BYTES];
        while self.hashed < end {
            let n = (end - self.hashed).min(HASHED_BYTES as u64) as usize;
            file.read(&mut buffer[..n], self.hashed)?;
            self.hash.0.update(&buffer[..n]);
            self.hashed += n as u64;
        }
        Ok(())
    }

    /// Removes the files.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove(self) -> Result<()> {
        // The records last: they mean nothing without the other file.
        for path in [&self.description, &self.records] {
            match std::fs::remove_file(path) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(Error::Io { path: path.clone(), source });
                }
                _ => (),
            }
        }
        Ok(())
    }
}
