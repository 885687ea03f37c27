//! The chunks of a store, and the source of blocks that reads them one after another.
//!
//! ```text
//! file axes, fastest first     x   y   z   t          chunk 64 × 64 × 64 × 1, shard 512 × 512 × 512 × 1
//! blocks                       one chunk, or several thin ones together, until a block has 16 steps along each axis; shard by shard
//! ```
//! A chunk that the store lacks is the fill value. It is counted, and costs neither memory nor time, as does a chunk with one value
//! throughout: the block has a single label then, and strides of 0. Memory: one chunk, and the block that is made of it.

use std::path::PathBuf;

use pumice_core::reserve;
use pumice_core::{BlockSource, LabelBlock, LabelBuffer, VolumeInfo};

use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::layout::{Layout, Role};
use crate::options::{MissingChunks, Warnings};

/// Thin chunks are put together until a block has so many voxels along an axis: the side of the boxes of the compressed form.
const BLOCK_STEPS: u64 = 16;

/// Largest number of bytes of a block that is put together from several chunks.
const BLOCK_BYTES: u64 = 16 << 20;

/// Reads single chunks.
pub(crate) trait ChunkReader: Send {
    /// The chunk at these indices, one a file axis, fastest first; `None` where the store lacks it.
    fn read(&mut self, chunk: &[u64]) -> Result<Option<Chunk>>;
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

/// A box of voxels: the lowest voxel, and the one beyond the highest, along x, y, z.
pub(crate) type Region = [[u64; 2]; 3];

/// An axis of the file, as the loops over chunks need it.
#[derive(Clone, Copy, Debug)]
struct Axis {
    role: Role,
    /// Elements of a chunk.
    chunk: u64,
    /// Chunks of a block.
    group: u64,
    /// Chunks of a shard.
    shard_chunks: u64,
    /// Blocks of a shard.
    shard: u64,
    /// Number of the first block that is read, and of the first beyond.
    blocks: [u64; 2],
    /// The elements that are read.
    range: [u64; 2],
}

/// Delivers the voxels of regions of a store, one region after another.
pub(crate) struct ChunkSource {
    path: PathBuf,
    /// The volume that the regions lie in.
    info: VolumeInfo,
    /// Lowest voxel of that volume in the store.
    low: [u64; 3],
    /// Regions that come later, the next one last.
    later: Vec<Region>,
    /// Bytes of a block of one chunk.
    chunk_bytes: u64,
    element: Element,
    fill: Vec<u8>,
    missing: MissingChunks,
    warnings: Warnings,
    reader: Box<dyn ChunkReader>,
    axes: Vec<Axis>,
    /// The next block, in blocks along each file axis; empty after the last.
    at: Vec<u64>,
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
            let (role, range) = (axis.role, [0; 2]);
            axes.push(Axis { role, chunk, group: 1, shard_chunks, shard: 1, blocks: [0; 2], range });
        }
        // A chunk as it is stored, with the steps of fixed axes that are not read, and the block that is cut from it.
        let stored = chunks.chunk.iter().fold(element.bytes() as u64, |n, &size| n.saturating_mul(size));
        reserve::check_room("a chunk of the store", stored.saturating_mul(2))
            .map_err(FormatError::memory(&path))?;
        let reader = (chunks.open)()?;
        let (fill, missing) = (chunks.fill, chunks.missing);
        let mut source = Self {
            path,
            info,
            low,
            later: regions.into_iter().rev().collect(),
            chunk_bytes: bytes,
            element,
            fill,
            missing,
            warnings,
            reader,
            axes,
            at: Vec::new(),
            absent: 0,
            read: 0,
        };
        source.next_region();
        Ok(source)
    }

    /// Goes to the next region; false after the last.
    fn next_region(&mut self) -> bool {
        let Some(region) = self.later.pop() else { return false };
        let mut bytes = self.chunk_bytes;
        for axis in &mut self.axes {
            axis.range = match axis.role {
                Role::Space(space) => region[space],
                Role::Fixed(index) => [index, index + 1],
            };
            (axis.group, axis.shard) = (1, axis.shard_chunks);
        }
        for axis in self.axes.iter_mut().filter(|axis| matches!(axis.role, Role::Space(_))) {
            axis.group = group(axis, bytes);
            bytes = bytes.saturating_mul(axis.group);
        }
        for axis in &mut self.axes {
            axis.shard = (axis.shard / axis.group).max(1);
            let block = axis.chunk.saturating_mul(axis.group);
            axis.blocks = [axis.range[0] / block, axis.range[1].div_ceil(block)];
        }
        self.at = self.axes.iter().map(|axis| axis.blocks[0]).collect();
        true
    }

    /// The next block, or `None` after the last.
    fn next(&mut self) -> Result<Option<LabelBlock>> {
        if self.at.is_empty() && !self.next_region() {
            self.say_absent();
            return Ok(None);
        }
        let at = self.at.clone();
        self.advance();
        // The elements of the block along the file axes, cut to the region.
        let span: Vec<[u64; 2]> = self
            .axes
            .iter()
            .zip(&at)
            .map(|(axis, &index)| {
                let block = axis.chunk.saturating_mul(axis.group);
                let low = index * block;
                [low.max(axis.range[0]), low.saturating_add(block).min(axis.range[1])]
            })
            .collect();
        let sizes: Vec<usize> = span.iter().map(|[low, high]| (high - low) as usize).collect();
        let bytes = self.element.bytes();
        let wanted = sizes.iter().product::<usize>() * bytes;

        // Read its chunks.
        let first: Vec<u64> = self.axes.iter().zip(&span).map(|(axis, s)| s[0] / axis.chunk).collect();
        let last: Vec<u64> = self.axes.iter().zip(&span).map(|(axis, s)| (s[1] - 1) / axis.chunk).collect();
        let mut buffer: Option<Vec<u8>> = None;
        let mut chunk = first.clone();
        loop {
            self.read += 1;
            match self.reader.read(&chunk)? {
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
                        self.paste(target, (&span, &sizes), &chunk, &read)?;
                    }
                }
            }
            if !step(&mut chunk, &first, &last) {
                break;
            }
        }
        self.block(buffer, &span, &sizes).map(Some)
    }

    /// Goes to the next block: x first, then y and z within a shard, then to the next shard.
    fn advance(&mut self) {
        let Self { at, axes, .. } = self;
        // Within the shard, as far as it lies in the region.
        for (index, axis) in at.iter_mut().zip(axes.iter()) {
            let end = ((*index / axis.shard + 1) * axis.shard).min(axis.blocks[1]);
            if *index + 1 < end {
                *index += 1;
                return;
            }
            *index = (*index / axis.shard * axis.shard).max(axis.blocks[0]);
        }
        for (index, axis) in at.iter_mut().zip(axes.iter()) {
            let next = (*index / axis.shard + 1) * axis.shard;
            if next < axis.blocks[1] {
                *index = next;
                return;
            }
            *index = axis.blocks[0];
        }
        at.clear();
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
            self.at.clear();
            self.later.clear();
            self.absent = 0;
        }
        Ok(block?)
    }
}

/// The number of chunks along an axis that make a block, of which a chunk in all has `bytes`: as many as have the steps of a whole block and end
/// with whole cells, as far as they lie in the region and in a shard, and the block does not become too large.
fn group(axis: &Axis, bytes: u64) -> u64 {
    let least = BLOCK_STEPS.div_ceil(axis.chunk);
    let in_region = (axis.range[1] - 1) / axis.chunk - axis.range[0] / axis.chunk + 1;
    let fits = |&group: &u64| {
        let within_shard = axis.shard == 1 || axis.shard.is_multiple_of(group);
        within_shard && group <= in_region && bytes.saturating_mul(group) <= BLOCK_BYTES
    };
    // One of four successive numbers makes a multiple of four.
    let whole_cells =
        (least..least + 4).filter(|group| axis.chunk.saturating_mul(*group).is_multiple_of(4)).find(&fits);
    whole_cells.or_else(|| (1..=least).rev().find(fits)).unwrap_or(1)
}

/// Counts indices up from `first` to `last`, both inclusive, the first fastest; false after the last.
fn step(index: &mut [u64], first: &[u64], last: &[u64]) -> bool {
    for a in 0..index.len() {
        if index[a] < last[a] {
            index[a] += 1;
            return true;
        }
        index[a] = first[a];
    }
    false
}

/// Indices of a chunk in the order of the file's axes, slowest first, as its name has them.
pub(crate) fn place(chunk: &[u64]) -> String {
    let slowest_first: Vec<String> = chunk.iter().rev().map(u64::to_string).collect();
    format!("({})", slowest_first.join(", "))
}
