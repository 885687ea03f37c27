//! Reads single chunks of a Zarr array, also those within a shard.

use std::path::PathBuf;
use std::sync::Arc;

use pumice_core::error::one_line;
use zarrs::array::{Array, ArrayBytes, ArrayError, CodecError, CodecOptions};

use crate::chunks::{Chunk, ChunkReader, place};
use crate::error::{FormatError, Result};
use crate::zarr_files::ZarrFiles;
use crate::zarr_shards::{Sharding, Shards};

/// The chunks of an array.
pub(crate) struct ZarrChunks {
    path: PathBuf,
    array: Arc<Array<ZarrFiles>>,
    /// Elements of a chunk in the order of the indices.
    shape: Vec<u64>,
    /// `None` for an array whose files hold a chunk each.
    shards: Option<Shards>,
    options: CodecOptions,
}

impl ZarrChunks {
    /// `shape` is that of a chunk, in the order of the indices; `sharding` has the number of chunks of a shard with it.
    pub(crate) fn new(
        path: PathBuf,
        array: Arc<Array<ZarrFiles>>,
        shape: Vec<u64>,
        sharding: Option<(Sharding, Vec<std::num::NonZeroU64>)>,
    ) -> Self {
        // The compressor has threads of its own.
        let options = CodecOptions::default().with_concurrent_target(1);
        let shards =
            sharding.map(|(sharding, chunks)| Shards::new(Arc::clone(&array), sharding, chunks, options));
        Self { path, array, shape, shards, options }
    }

    fn retrieve(&self, index: &[u64]) -> std::result::Result<Option<Vec<u8>>, ArrayError> {
        if let Some(shards) = &self.shards {
            return shards.read(index);
        }
        let bytes: Option<ArrayBytes<'static>> =
            self.array.retrieve_chunk_if_exists_opt(index, &self.options)?;
        let plain = bytes.map(|bytes| bytes.into_fixed().map_err(CodecError::from)).transpose()?;
        Ok(plain.map(|plain| plain.into_owned()))
    }
}

impl ChunkReader for ZarrChunks {
    fn read(&self, chunk: &[u64]) -> Result<Option<Chunk>> {
        // Axes that the volume has and the array lacks are slower than those of the array.
        let mut index = chunk[..self.shape.len()].to_vec();
        index.reverse();
        let read = self.retrieve(&index).map_err(|error| {
            let what = one_line(&error.to_string());
            let place = place(&chunk[..self.shape.len()]);
            FormatError::damaged(&self.path, format!("chunk {place} cannot be read: {what}"))
        })?;
        Ok(read.map(|bytes| Chunk { bytes, sizes: self.shape.iter().rev().copied().collect() }))
    }
}
