//! A block source for a volume that already lies in memory.

use crate::{BlockSource, LabelBlock, LabelBuffer, Result, VolumeInfo};

/// Delivers an x-fastest array in slabs of whole z layers.
#[derive(Clone, Debug)]
pub struct ArraySource {
    info: VolumeInfo,
    labels: LabelBuffer,
    layers: u32,
    next_z: u32,
}

impl ArraySource {
    /// Makes a source from labels in x-fastest order: x varies fastest, then y, then z.
    ///
    /// # Errors
    /// [`crate::Error::Caller`] when the number of labels differs from the number of voxels in the volume.
    pub fn new(info: VolumeInfo, labels: LabelBuffer) -> Result<Self> {
        if labels.len() as u64 != info.voxels() {
            return Err(crate::Error::Caller(format!(
                "a volume of {:?} voxels needs {} labels, got {}",
                info.dims,
                info.voxels(),
                labels.len()
            )));
        }
        // Slabs of about 4 M voxels, in a multiple of 4 layers.
        let layer = u64::from(info.dims[0]) * u64::from(info.dims[1]);
        let layers = ((1 << 22) / layer.max(1)).clamp(4, 1024) as u32 / 4 * 4;
        Ok(Self { info, labels, layers, next_z: 0 })
    }

    /// Returns the source reset to its first block.
    pub fn rewound(self) -> Self {
        Self { next_z: 0, ..self }
    }
}

impl BlockSource for ArraySource {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let dims = self.info.dims;
        if self.next_z >= dims[2] {
            return Ok(None);
        }
        let z = self.next_z;
        let depth = self.layers.min(dims[2] - z);
        self.next_z += depth;
        let layer = dims[0] as usize * dims[1] as usize;
        let range = z as usize * layer..(z + depth) as usize * layer;
        let labels = match &self.labels {
            LabelBuffer::U8(v) => LabelBuffer::U8(v[range].to_vec()),
            LabelBuffer::U16(v) => LabelBuffer::U16(v[range].to_vec()),
            LabelBuffer::U32(v) => LabelBuffer::U32(v[range].to_vec()),
            LabelBuffer::U64(v) => LabelBuffer::U64(v[range].to_vec()),
        };
        Ok(Some(LabelBlock::x_fastest([0, 0, z], [dims[0], dims[1], depth], labels)))
    }
}
