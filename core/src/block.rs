//! The compressor's input: blocks of labels, and the trait [`BlockSource`] that delivers them.

use crate::{Result, VolumeInfo};

/// Labels of one block, in the narrowest unsigned type that its source guarantees to hold them.
///
/// Signed and floating-point label maps arrive as unsigned ones too: their reader has checked that every value is a whole number ≥ 0.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum LabelBuffer {
    U8(Vec<u8>),
    U16(Vec<u16>),
    U32(Vec<u32>),
    U64(Vec<u64>),
}

impl LabelBuffer {
    /// Number of labels.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::U32(v) => v.len(),
            Self::U64(v) => v.len(),
        }
    }

    /// Whether there are no labels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Label number `i` as a 64-bit id.
    ///
    /// # Panics
    /// When `i` is out of range.
    pub fn get(&self, i: usize) -> u64 {
        match self {
            Self::U8(v) => v[i].into(),
            Self::U16(v) => v[i].into(),
            Self::U32(v) => v[i].into(),
            Self::U64(v) => v[i],
        }
    }
}

/// A box of voxels in a volume, in any memory order.
///
/// Voxel (x, y, z), counted from the block's lowest corner, is `labels[x·strides[0] + y·strides[1] + z·strides[2]]`. With strides of 0 a block
/// has one label throughout, and holds it once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelBlock {
    /// The block's lowest voxel in the volume.
    pub origin: [u32; 3],
    /// Size in voxels.
    pub dims: [u32; 3],
    /// Distance in elements between neighbours along x, y and z.
    pub strides: [usize; 3],
    /// The labels; id 0 is background.
    pub labels: LabelBuffer,
}

impl LabelBlock {
    /// A block in x-fastest order: x varies fastest, then y, then z.
    pub fn x_fastest(origin: [u32; 3], dims: [u32; 3], labels: LabelBuffer) -> Self {
        let (x, y) = (dims[0] as usize, dims[1] as usize);
        Self { origin, dims, strides: [1, x, x * y], labels }
    }

    /// Label id of voxel (x, y, z), counted from the block's corner.
    pub fn get(&self, voxel: [u32; 3]) -> u64 {
        self.labels.get((0..3).map(|a| voxel[a] as usize * self.strides[a]).sum())
    }
}

/// Delivers a volume block by block: from a file while it is inflated, an array in memory, or a generator.
///
/// Blocks come in the order that is cheapest for the source and cover every voxel exactly once. They need not be aligned, but blocks
/// aligned to 4 voxels are faster. A source never holds the whole volume.
pub trait BlockSource: Send {
    /// Size, label type, matrix and names of the volume.
    fn info(&self) -> &VolumeInfo;

    /// The next block, or `None` after the last one.
    ///
    /// # Errors
    /// [`crate::Error::Source`] with the source's own message; after an error the source is at its end.
    fn next_block(&mut self) -> Result<Option<LabelBlock>>;
}
