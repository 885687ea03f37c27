//! Shards of a Zarr array (ZEP 2): a file holds several chunks, and an index that says where each lies.
//!
//! ```text
//! chunk, chunk, …, index      or      index, chunk, chunk, …           `index_location`
//! index: u64 pairs (offset, bytes) of all chunks in C order, both 2⁶⁴−1 for one that is absent; encoded by codecs of its own, with a checksum
//! ```
//! The crate `zarrs` decodes shards too, but adds the two numbers of an absent chunk, and says nothing of those that are absent.

use std::collections::VecDeque;
use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::Value;
use zarrs::array::{
    Array, ArrayBytes, ArrayError, ArrayToBytesCodecTraits as _, BytesRepresentation, CodecChain, CodecError,
    CodecOptions, FillValue, data_type,
};
use zarrs::metadata::v3::MetadataV3;
use zarrs::storage::ReadableStorageTraits as _;
use zarrs::storage::byte_range::ByteRange;

use crate::zarr_files::ZarrFiles;

/// How shards are divided and encoded.
pub(crate) struct Sharding {
    /// Elements of a chunk, in the order of the indices.
    pub(crate) chunk: Vec<NonZeroU64>,
    codecs: CodecChain,
    index_codecs: CodecChain,
    is_index_first: bool,
}

impl Sharding {
    /// The sharding of an array whose only codec it is; `None` for other arrays, whose chunks are read whole.
    pub(crate) fn of(metadata: &Value) -> Option<Self> {
        let [codec] = metadata.get("codecs")?.as_array()?.as_slice() else { return None };
        if codec.get("name")?.as_str()? != "sharding_indexed" {
            return None;
        }
        let about = codec.get("configuration")?;
        let chain = |key: &str| -> Option<CodecChain> {
            let codecs: Vec<MetadataV3> = serde_json::from_value(about.get(key)?.clone()).ok()?;
            CodecChain::from_metadata(&codecs).ok()
        };
        Some(Self {
            chunk: serde_json::from_value(about.get("chunk_shape")?.clone()).ok()?,
            codecs: chain("codecs")?,
            index_codecs: chain("index_codecs")?,
            is_index_first: about.get("index_location").and_then(Value::as_str) == Some("start"),
        })
    }
}

/// A shard and its index.
struct Opened {
    shard: Vec<u64>,
    /// Offset and bytes of each chunk; `None` where there is no shard.
    index: Option<Vec<u64>>,
}

/// Reads chunks of shards.
pub(crate) struct Shards {
    array: Arc<Array<ZarrFiles>>,
    sharding: Sharding,
    /// Chunks of a shard, in the order of the indices.
    chunks: Vec<NonZeroU64>,
    /// The newest first.
    opened: Mutex<VecDeque<Arc<Opened>>>,
    options: CodecOptions,
}

/// Indices of shards that are kept: chunks are read shard by shard, a few at a time.
const KEPT_SHARDS: usize = 4;

impl Shards {
    /// `chunks` are those of a shard along each index.
    pub(crate) fn new(
        array: Arc<Array<ZarrFiles>>,
        sharding: Sharding,
        chunks: Vec<NonZeroU64>,
        options: CodecOptions,
    ) -> Self {
        Self { array, sharding, chunks, opened: Mutex::default(), options }
    }

    /// The bytes of a chunk, by its indices in the grid of chunks; `None` where the shard lacks it.
    pub(crate) fn read(&self, chunk: &[u64]) -> Result<Option<Vec<u8>>, ArrayError> {
        let shard: Vec<u64> = chunk.iter().zip(&self.chunks).map(|(&c, n)| c / n.get()).collect();
        let opened = self.opened(&shard)?;
        let Some(index) = &opened.index else { return Ok(None) };
        let within =
            chunk.iter().zip(&self.chunks).fold(0, |at, (&c, n)| at * n.get() + c % n.get()) as usize;
        let (offset, bytes) = (index[2 * within], index[2 * within + 1]);
        if offset == u64::MAX && bytes == u64::MAX {
            return Ok(None);
        }
        let range = ByteRange::FromStart(offset, Some(bytes));
        let Some(encoded) = self.array.storage().get_partial(&self.array.chunk_key(&shard), range)? else {
            return Ok(None);
        };
        let plain = self.sharding.codecs.decode(
            Vec::from(encoded).into(),
            &self.sharding.chunk,
            self.array.data_type(),
            self.array.fill_value(),
            &self.options,
        )?;
        Ok(Some(plain.into_fixed().map_err(CodecError::from)?.into_owned()))
    }

    /// A shard with its index, which is read if it is not kept.
    fn opened(&self, shard: &[u64]) -> Result<Arc<Opened>, ArrayError> {
        // Each statement under the lock leaves the list whole.
        let list = || self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = list().iter().find(|opened| opened.shard == shard) {
            return Ok(Arc::clone(kept));
        }
        let opened = Arc::new(Opened { shard: shard.to_vec(), index: self.index(shard)? });
        let mut list = list();
        list.truncate(KEPT_SHARDS - 1);
        list.push_front(Arc::clone(&opened));
        Ok(opened)
    }

    /// The index of a shard; `None` where there is no shard.
    fn index(&self, shard: &[u64]) -> Result<Option<Vec<u64>>, ArrayError> {
        let (number, absent) = (data_type::uint64(), FillValue::from(u64::MAX));
        let mut shape = self.chunks.clone();
        shape.extend(NonZeroU64::new(2));
        let codecs = &self.sharding.index_codecs;
        let BytesRepresentation::FixedSize(bytes) =
            codecs.encoded_representation(&shape, &number, &absent)?
        else {
            return Err(CodecError::Other("the index of the shard is compressed".into()).into());
        };
        let range = if self.sharding.is_index_first {
            ByteRange::FromStart(0, Some(bytes))
        } else {
            ByteRange::Suffix(bytes)
        };
        let Some(encoded) = self.array.storage().get_partial(&self.array.chunk_key(shard), range)? else {
            return Ok(None);
        };
        let plain: ArrayBytes<'_> =
            codecs.decode(Vec::from(encoded).into(), &shape, &number, &absent, &self.options)?;
        let plain = plain.into_fixed().map_err(CodecError::from)?;
        Ok(Some(plain.as_chunks::<8>().0.iter().map(|&number| u64::from_ne_bytes(number)).collect()))
    }
}
