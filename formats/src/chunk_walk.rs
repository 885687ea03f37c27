//! The order in which the chunks of regions are read, and the blocks that are made of them.
//!
//! ```text
//! file axes, fastest first     x   y   z   t          chunk 64 × 64 × 64 × 1, shard 512 × 512 × 512 × 1
//! regions                      cut where the compressed form's chunks of 1024³ meet, and read in these chunks' order
//! blocks                       one chunk, or several thin ones together, until a block has 16 steps along each axis; shard by shard
//! ```

use crate::chunk_order::{InChunkOrder, Region};
use crate::layout::Role;

/// Thin chunks are put together until a block has so many voxels along an axis: the side of the boxes of the compressed form.
const BLOCK_STEPS: u64 = 16;

/// Largest number of bytes of a block that is put together from several chunks.
const BLOCK_BYTES: u64 = 16 << 20;

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
    /// Regions that come later.
    later: InChunkOrder,
    /// Bytes of a block of one chunk.
    chunk_bytes: u64,
    /// The next block, in blocks along each file axis; empty after the last.
    at: Vec<u64>,
}

impl Walk {
    /// `chunk_bytes` are those of a block of one chunk.
    pub(crate) fn new(axes: Vec<Axis>, chunk_bytes: u64, regions: Vec<Region>) -> Self {
        let mut steps = [1; 3];
        for axis in &axes {
            if let Role::Space(space) = axis.role {
                steps[space] = axis.chunk.saturating_mul(axis.shard_chunks).max(1);
            }
        }
        let later = InChunkOrder::new(regions, steps);
        Self { axes, later, chunk_bytes, at: Vec::new() }
    }

    /// Goes to the next region; false after the last.
    fn next_region(&mut self) -> bool {
        let Some(region) = self.later.next() else { return false };
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn blocks(chunk: [u64; 3], shard: u64, regions: Vec<Region>) -> Vec<BlockPlace> {
        let axes = [0, 1, 2].map(|a| Axis::new(Role::Space(a), chunk[a], shard)).to_vec();
        Walk::new(axes, chunk.iter().product(), regions).collect()
    }

    /// Whether blocks lie side by side in `region` is decided by their sum and by their corners.
    fn cover_once(blocks: &[BlockPlace], region: Region) -> bool {
        let voxels = |span: &[[u64; 2]]| span.iter().map(|[low, high]| high - low).product::<u64>();
        let corners: std::collections::BTreeSet<Vec<u64>> =
            blocks.iter().map(|b| b.span.iter().map(|s| s[0]).collect()).collect();
        corners.len() == blocks.len()
            && blocks.iter().map(|b| voxels(&b.span)).sum::<u64>() == voxels(&region)
            && blocks
                .iter()
                .all(|b| (0..3).all(|a| region[a][0] <= b.span[a][0] && b.span[a][1] <= region[a][1]))
    }

    /// How often each chunk of a store is read.
    fn reads(blocks: &[BlockPlace]) -> BTreeMap<Vec<u64>, usize> {
        let mut reads = BTreeMap::new();
        for block in blocks {
            let mut chunk = block.first.clone();
            loop {
                *reads.entry(chunk.clone()).or_default() += 1;
                if !step(&mut chunk, &block.first, &block.last) {
                    break;
                }
            }
        }
        reads
    }

    /// How often two successive blocks are of different chunks of the compressed form, and how many of these have blocks. Faces between them
    /// are at the nearest multiples of `step` voxels.
    fn changes_of_chunk(blocks: &[BlockPlace], low: [u64; 3], step: [u64; 3]) -> (usize, usize) {
        let of = |block: &BlockPlace| {
            [0, 1, 2].map(|a| {
                let face = |chunk: u64| {
                    ((low[a] + 1024 * chunk) as f64 / step[a] as f64 + 0.5).floor() as u64 * step[a]
                };
                (1..10).take_while(|&chunk| face(chunk) <= block.span[a][0]).count()
            })
        };
        let changes = blocks.windows(2).filter(|pair| of(&pair[0]) != of(&pair[1])).count();
        (changes, blocks.iter().map(of).collect::<std::collections::BTreeSet<_>>().len())
    }

    #[test]
    fn one_chunk_of_the_compressed_form_comes_after_another() {
        for (chunk, shard, low) in
            [([64; 3], 1, 0), ([64; 3], 4, 128), ([100; 3], 1, 0), ([100, 64, 30], 2, 17)]
        {
            // 3 × 2 × 2 chunks. The last along an axis may be thinner than half a shard: it is read with the one before it.
            for (dims, thin) in [([2300u64, 1300, 1200], false), ([2100, 1100, 1030], true)] {
                let region = dims.map(|size| [low, low + size]);
                let blocks = blocks(chunk, shard, vec![region]);
                assert!(cover_once(&blocks, region), "{chunk:?}");
                assert!(reads(&blocks).values().all(|&n| n == 1), "{chunk:?}");
                let (changes, chunks) = changes_of_chunk(&blocks, [low; 3], chunk.map(|c| c * shard));
                assert_eq!(changes, chunks - 1, "{chunk:?} {shard}");
                assert!(chunks == 12 || (thin && chunks < 12), "{chunks}");
            }
        }
        // The negative control: regions that come one after another cross the same chunks again.
        let slabs = (0..8).map(|i| [[0, 2048], [64 * i, 64 * i + 64], [0, 1024]]).collect();
        assert_eq!(changes_of_chunk(&blocks([64; 3], 1, slabs), [0; 3], [64; 3]), (15, 2));
    }

    /// A shard that is larger than two chunks is read at once, and a region that lies within one stays whole.
    #[test]
    fn large_shards_are_read_once() {
        let region = [[0, 5000], [0, 64], [0, 64]];
        let shards = blocks([64; 3], 64, vec![region]);
        assert!(cover_once(&shards, region) && reads(&shards).values().all(|&n| n == 1));
        assert!(shards.windows(2).all(|pair| pair[0].span[0][0] < pair[1].span[0][0]));
        // Most chunks of a volume of the largest size are never looked at.
        let huge = u64::from(pumice_core::MAX_DIM);
        let axes = [0, 1, 2].map(|a| Axis::new(Role::Space(a), 64, 1)).to_vec();
        assert_eq!(Walk::new(axes, 64 * 64 * 64, vec![[[0, huge]; 3]]).take(100).count(), 100);
    }
}
