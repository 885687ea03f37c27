//! The order in which the chunks of regions are read, and the blocks that are made of them.
//!
//! ```text
//! file axes, fastest first     x   y   z   t          chunk 64 × 64 × 64 × 1, shard 512 × 512 × 512 × 1
//! blocks                       one chunk, or several thin ones together, until a block has 16 steps along each axis; shard by shard
//! ```

use crate::layout::Role;

/// Thin chunks are put together until a block has so many voxels along an axis: the side of the boxes of the compressed form.
const BLOCK_STEPS: u64 = 16;

/// Largest number of bytes of a block that is put together from several chunks.
const BLOCK_BYTES: u64 = 16 << 20;

/// A box of voxels: the lowest voxel, and the one beyond the highest, along x, y, z.
pub(crate) type Region = [[u64; 2]; 3];

/// An axis of the file, as the loops over chunks need it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    pub(crate) role: Role,
    /// Elements of a chunk.
    pub(crate) chunk: u64,
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

impl Axis {
    pub(crate) fn new(role: Role, chunk: u64, shard_chunks: u64) -> Self {
        Self { role, chunk, group: 1, shard_chunks, shard: 1, blocks: [0; 2], range: [0; 2] }
    }
}

/// A block: its elements along the file axes, and the chunks that they lie in.
#[derive(Clone, Debug)]
pub(crate) struct BlockPlace {
    /// First element, and the one beyond the last.
    pub(crate) span: Vec<[u64; 2]>,
    /// Indices of the first and of the last chunk.
    pub(crate) first: Vec<u64>,
    pub(crate) last: Vec<u64>,
}

impl BlockPlace {
    /// Elements along the file axes.
    pub(crate) fn sizes(&self) -> Vec<usize> {
        self.span.iter().map(|[low, high]| (high - low) as usize).collect()
    }
}

/// Goes over the blocks of regions, one region after another.
#[derive(Clone, Debug)]
pub(crate) struct Walk {
    axes: Vec<Axis>,
    /// Regions that come later, the next one last.
    later: Vec<Region>,
    /// Bytes of a block of one chunk.
    chunk_bytes: u64,
    /// The next block, in blocks along each file axis; empty after the last.
    at: Vec<u64>,
}

impl Walk {
    /// `chunk_bytes` are those of a block of one chunk.
    pub(crate) fn new(axes: Vec<Axis>, chunk_bytes: u64, regions: Vec<Region>) -> Self {
        Self { axes, later: regions.into_iter().rev().collect(), chunk_bytes, at: Vec::new() }
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
}

impl Iterator for Walk {
    type Item = BlockPlace;

    fn next(&mut self) -> Option<BlockPlace> {
        if self.at.is_empty() && !self.next_region() {
            return None;
        }
        // Cut to the region.
        let span: Vec<[u64; 2]> = self
            .axes
            .iter()
            .zip(&self.at)
            .map(|(axis, &index)| {
                let block = axis.chunk.saturating_mul(axis.group);
                let low = index * block;
                [low.max(axis.range[0]), low.saturating_add(block).min(axis.range[1])]
            })
            .collect();
        let first = self.axes.iter().zip(&span).map(|(axis, s)| s[0] / axis.chunk).collect();
        let last = self.axes.iter().zip(&span).map(|(axis, s)| (s[1] - 1) / axis.chunk).collect();
        self.advance();
        Some(BlockPlace { span, first, last })
    }
}

/// Goes over the chunks of the blocks of a walk, in the order in which blocks need them.
#[derive(Clone, Debug)]
pub(crate) struct ChunkWalk {
    walk: Walk,
    block: Option<BlockPlace>,
    next: Vec<u64>,
}

impl ChunkWalk {
    pub(crate) fn new(walk: Walk) -> Self {
        Self { walk, block: None, next: Vec::new() }
    }
}

impl Iterator for ChunkWalk {
    type Item = Vec<u64>;

    fn next(&mut self) -> Option<Vec<u64>> {
        let has_more = match &self.block {
            Some(block) => step(&mut self.next, &block.first, &block.last),
            None => false,
        };
        if !has_more {
            let block = self.walk.next()?;
            self.next.clone_from(&block.first);
            self.block = Some(block);
        }
        Some(self.next.clone())
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
pub(crate) fn step(index: &mut [u64], first: &[u64], last: &[u64]) -> bool {
    for a in 0..index.len() {
        if index[a] < last[a] {
            index[a] += 1;
            return true;
        }
        index[a] = first[a];
    }
    false
}
