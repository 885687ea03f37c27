//! The chunks of a store, and the source of blocks that is made of them.
//!
//! A chunk that the store lacks is the fill value. It is counted, and costs neither memory nor time, as does a chunk with one value
//! throughout: the block has a single label then, and strides of 0. Memory: the chunks that are read ahead ([`crate::chunks_ahead`]), and the
//! block that is made of them.

use std::path::PathBuf;

use pumice_core::reserve;
use pumice_core::{BlockSource, LabelBlock, LabelBuffer, VolumeInfo};

use crate::chunk_order::Region;
use crate::chunk_walk::{Axis, BlockPlace, ChunkWalk, Walk, step};
use crate::chunks_ahead::ChunksAhead;
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::layout::{Layout, Role};
use crate::options::{MissingChunks, Warnings};
use crate::store_files::is_on_server;

/// Reads single chunks.
pub(crate) trait ChunkReader: Send + Sync {
    /// The chunk at these indices, one a file axis, fastest first; `None` where the store lacks it.
    fn read(&self, chunk: &[u64]) -> Result<Option<Chunk>>;
}

/// The plain bytes of a chunk.
pub(crate) struct Chunk {
    pub(crate) bytes: Vec<u8>,
    /// Elements along the file axes, fastest first. The last chunk along an axis may be cut off at the volume's end, or not.
    pub(crate) sizes: Vec<u64>,
}

/// How a volume lies in chunks.
pub(crate) struct Chunks {
    /// Elements of a chunk along the file axes, fastest first.
    pub(crate) chunk: Vec<u64>,
    /// Chunks of a shard along the file axes: a file that holds several. They are read together.
    pub(crate) shard: Vec<u64>,
    /// Bytes of one element of an absent chunk, in the order of [`Element`].
    pub(crate) fill: Vec<u8>,
    pub(crate) missing: MissingChunks,
    /// Opens the reader when voxels are needed.
    pub(crate) open: Box<dyn FnOnce() -> Result<Box<dyn ChunkReader>>>,
}

/// Delivers the voxels of regions of a store, one region after another.
pub(crate) struct ChunkSource {
    path: PathBuf,
    /// The volume that the regions lie in.
    info: VolumeInfo,
    /// Lowest voxel of that volume in the store.
    low: [u64; 3],
    element: Element,
    fill: Vec<u8>,
    missing: MissingChunks,
    warnings: Warnings,
    /// `None` after an error.
    chunks: Option<ChunksAhead>,
    axes: Vec<Axis>,
    walk: Walk,
    absent: u64,
    read: u64,
}

impl ChunkSource {
    /// The source of `regions` of a volume that `info` describes, with its lowest voxel at `low` in the store.
    pub(crate) fn new(
        path: PathBuf,
        (info, low): (VolumeInfo, [u64; 3]),
        (layout, element): (&Layout, Element),
        chunks: Chunks,
        regions: Vec<Region>,
        warnings: Warnings,
    ) -> Result<Self> {
        let mut axes = Vec::new();
        // Fixed axes add nothing to a block.
        let mut bytes = element.bytes() as u64;
        for (a, axis) in layout.axes().iter().enumerate() {
            // An axis that `Layout` has added has no chunks of its own.
            let chunk = chunks.chunk.get(a).copied().unwrap_or(1);
            let shard_chunks = chunks.shard.get(a).copied().unwrap_or(1).max(1);
            if chunk == 0 {
                return Err(FormatError::damaged(
                    &path,
                    "a chunk has no voxels along an axis: its size is 0",
                ));
            }
            if matches!(axis.role, Role::Space(_)) {
                bytes = bytes.saturating_mul(chunk.min(axis.size));
            }
            axes.push(Axis::new(axis.role, chunk, shard_chunks));
        }
        // A chunk as it is stored, with the steps of fixed axes that are not read, and the block that is cut from it.
        let stored = chunks.chunk.iter().fold(element.bytes() as u64, |n, &size| n.saturating_mul(size));
        reserve::check_room("a chunk of the store", stored.saturating_mul(2))
            .map_err(FormatError::memory(&path))?;
        let reader = (chunks.open)()?;
        let walk = Walk::new(axes.clone(), bytes, regions);
        let ahead = ChunksAhead::new(reader, ChunkWalk::new(walk.clone()), stored, is_on_server(&path));
        let (fill, missing) = (chunks.fill, chunks.missing);
        Ok(Self {
            path,
            info,
            low,
            element,
            fill,
            missing,
            warnings,
            chunks: Some(ahead),
            axes,
            walk,
            absent: 0,
            read: 0,
        })
    }

    /// The next block, or `None` after the last.
    fn next(&mut self) -> Result<Option<LabelBlock>> {
        let Some(place) = self.chunks.as_ref().and_then(|_| self.walk.next()) else {
            self.say_absent();
            return Ok(None);
        };
        let BlockPlace { span, first, last } = &place;
        let sizes = place.sizes();
        let wanted = sizes.iter().product::<usize>() * self.element.bytes();
        let mut buffer: Option<Vec<u8>> = None;
        let mut chunk = first.clone();
        loop {
            self.read += 1;
            let Some(chunks) = &mut self.chunks else { return Ok(None) };
            match chunks.next(&chunk)? {
                None => {
                    self.absent += 1;
                    if self.missing == MissingChunks::Error {
                        return Err(self.absent_chunk(&chunk));
                    }
                }
                Some(read) => {
                    let whole = first == last
                        && read.sizes.iter().zip(&sizes).all(|(&has, &wants)| has == wants as u64)
                        && span.iter().zip(&self.axes).all(|(s, axis)| s[0].is_multiple_of(axis.chunk));
                    if whole && read.bytes.len() == wanted {
                        buffer = Some(read.bytes);
                    } else {
                        let target = match &mut buffer {
                            Some(target) => target,
                            none => none.insert(self.filled(wanted)?),
                        };
                        self.paste(target, (span, &sizes), &chunk, &read)?;
                    }
                }
            }
            if !step(&mut chunk, first, last) {
                break;
            }
        }
        self.block(buffer, span, &sizes).map(Some)
    }

    /// A buffer of `bytes` bytes with the fill value.
    fn filled(&self, bytes: usize) -> Result<Vec<u8>> {
        let mut buffer =
            reserve::zeroed::<u8>(bytes, "a block of a store").map_err(FormatError::memory(&self.path))?;
        if self.fill.iter().any(|&b| b != 0) {
            buffer.chunks_exact_mut(self.fill.len()).for_each(|to| to.copy_from_slice(&self.fill));
        }
        Ok(buffer)
    }

    /// Copies what a chunk has of a block, row by row along the fastest axis.
    fn paste(
        &self,
        target: &mut [u8],
        (span, sizes): (&[[u64; 2]], &[usize]),
        chunk: &[u64],
        read: &Chunk,
    ) -> Result<()> {
        let bytes = self.element.bytes();
        let expected = read.sizes.iter().product::<u64>().saturating_mul(bytes as u64);
        if read.bytes.len() as u64 != expected || read.sizes.len() > span.len() {
            return Err(FormatError::damaged(
                &self.path,
                format!("chunk {}: expected {expected} bytes, got {}", place(chunk), read.bytes.len()),
            ));
        }
        // Where the overlap begins in chunk and block, and how far it goes.
        let (mut from, mut to, mut count) = (Vec::new(), Vec::new(), Vec::new());
        for (a, axis) in self.axes.iter().enumerate() {
            let has = read.sizes.get(a).copied().unwrap_or(1);
            let low = chunk[a] * axis.chunk;
            let begin = low.max(span[a][0]);
            let end = low.saturating_add(axis.chunk).min(span[a][1]);
            if low.saturating_add(has) < end {
                return Err(FormatError::damaged(
                    &self.path,
                    format!(
                        "chunk {} has {has} voxels along file axis {a}, expected {}",
                        place(chunk),
                        end - low
                    ),
                ));
            }
            from.push((begin - low) as usize);
            to.push((begin - span[a][0]) as usize);
            count.push((end - begin) as usize);
        }
        let (mut from_stride, mut to_stride) = (vec![bytes], vec![bytes]);
        for a in 1..self.axes.len() {
            from_stride.push(from_stride[a - 1] * read.sizes.get(a - 1).copied().unwrap_or(1) as usize);
            to_stride.push(to_stride[a - 1] * sizes[a - 1]);
        }
        let row = count[0] * bytes;
        let (zero, end): (Vec<u64>, Vec<u64>) =
            (vec![0; count.len() - 1], count[1..].iter().map(|&n| n as u64 - 1).collect());
        let mut index = zero.clone();
        loop {
            let place = |start: &[usize], stride: &[usize]| {
                let rest: usize =
                    (1..start.len()).map(|a| (start[a] + index[a - 1] as usize) * stride[a]).sum();
                start[0] * stride[0] + rest
            };
            let (a, b) = (place(&from, &from_stride), place(&to, &to_stride));
            target[b..b + row].copy_from_slice(&read.bytes[a..a + row]);
            if !step(&mut index, &zero, &end) {
                return Ok(());
            }
        }
    }

    /// The block of these bytes, or of the fill value where no chunk was there.
    fn block(&self, buffer: Option<Vec<u8>>, span: &[[u64; 2]], sizes: &[usize]) -> Result<LabelBlock> {
        let (mut origin, mut dims, mut strides) = ([0u32; 3], [1u32; 3], [0usize; 3]);
        let mut stride = 1;
        for (a, axis) in self.axes.iter().enumerate() {
            if let Role::Space(space) = axis.role {
                // All numbers are at most MAX_DIM.
                origin[space] = (span[a][0] - self.low[space]) as u32;
                dims[space] = sizes[a] as u32;
                strides[space] = stride;
                stride *= sizes[a];
            }
        }
        let bytes = self.element.bytes();
        let one = match &buffer {
            None => Some(self.fill.clone()),
            // All bytes equal those one element on: one value throughout.
            Some(b) if b[bytes..] == b[..b.len() - bytes] => Some(b[..bytes].to_vec()),
            Some(_) => None,
        };
        let (stored, strides) = match (one, buffer) {
            (Some(one), _) => (one, [0; 3]),
            (None, buffer) => (buffer.unwrap_or_default(), strides),
        };
        let labels = self.element.decode(&stored).map_err(|bad| FormatError::Label {
            path: self.path.clone(),
            voxel: [0, 1, 2].map(|a| {
                let within =
                    bad.index / strides[a].max(1) % if strides[a] == 0 { 1 } else { dims[a] as usize };
                self.low[a] + u64::from(origin[a]) + within as u64
            }),
            value: bad.value,
            reason: bad.reason,
        })?;
        Ok(LabelBlock { origin, dims, strides, labels })
    }

    fn absent_chunk(&self, chunk: &[u64]) -> FormatError {
        FormatError::damaged(
            &self.path,
            format!(
                "chunk {} is not there: --missing-chunks fill takes absent chunks as the fill value",
                place(chunk)
            ),
        )
    }

    /// Says how many chunks the store lacks.
    fn say_absent(&self) {
        if self.absent > 0 {
            let value = self
                .element
                .decode(&self.fill)
                .map_or_else(|bad| bad.value, |v: LabelBuffer| v.get(0).to_string());
            self.warnings.push(format!(
                "{}: {} of {} chunks are not there and are taken as {value}, the fill value (--missing-chunks error refuses them)",
                self.path.display(),
                self.absent,
                self.read
            ));
        }
    }
}

impl BlockSource for ChunkSource {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        let block = self.next();
        if block.is_err() {
            self.chunks = None;
            self.absent = 0;
        }
        Ok(block?)
    }
}

/// Indices of a chunk in the order of the file's axes, slowest first, as its name has them.
pub(crate) fn place(chunk: &[u64]) -> String {
    let slowest_first: Vec<String> = chunk.iter().rev().map(u64::to_string).collect();
    format!("({})", slowest_first.join(", "))
}
