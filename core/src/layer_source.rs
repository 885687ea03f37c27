//! Divides the blocks of a source into layers along its slowest axis, so that what is finished of a stream can be kept before its end.

use crate::{BlockSource, LabelBlock, Result, VolumeInfo};

/// A source that ends where it is told to, and goes on from there.
pub struct LayerSource {
    inner: Box<dyn BlockSource>,
    axis: usize,
    end: u32,
    /// Where the blocks that were delivered end.
    reached: u32,
    /// The first block behind the end.
    behind: Option<LabelBlock>,
}

impl LayerSource {
    /// Divides a source whose blocks come in the order of their voxels along `axis` (0 to 2 for x to z). It has no layer yet.
    pub fn new(inner: Box<dyn BlockSource>, axis: usize) -> Self {
        Self { inner, axis, end: 0, reached: 0, behind: None }
    }

    /// The axis along which blocks come.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Adds the blocks that begin before `end`, a voxel along the axis, to what is delivered.
    pub fn up_to(&mut self, end: u32) {
        self.end = self.end.max(end);
    }

    /// Where the first block behind the end begins, once all before it were delivered and if there is one.
    pub fn next_begin(&self) -> Option<u32> {
        self.behind.as_ref().map(|block| block.origin[self.axis])
    }

    /// Where the blocks that were delivered end.
    pub fn reached(&self) -> u32 {
        self.reached
    }
}

impl BlockSource for LayerSource {
    fn info(&self) -> &VolumeInfo {
        self.inner.info()
    }

    /// The next block that begins before the end. (Blocks end at the faces of chunks, so none reaches beyond a layer of chunks.)
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let next = match self.behind.take() {
            Some(block) => Some(block),
            None => self.inner.next_block()?,
        };
        let is_behind = |block: &LabelBlock| block.origin[self.axis] >= self.end;
        if next.as_ref().is_some_and(is_behind) {
            self.behind = next;
            return Ok(None);
        }
        if let Some(block) = &next {
            self.reached = self.reached.max(block.origin[self.axis].saturating_add(block.dims[self.axis]));
        }
        Ok(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArraySource, LabelBuffer, LabelType};

    #[test]
    fn each_layer_has_its_own_blocks_and_none_is_lost() {
        let dims = [2, 2, 2500];
        let labels = LabelBuffer::U16((0..10_000u32).map(|i| (i / 4) as u16).collect());
        let all = ArraySource::new(VolumeInfo::new(dims, LabelType::U16), labels).unwrap();
        for ends in [&[1024, 2048, 2500][..], &[2048, 2500], &[1024, 1024, 2500]] {
            let mut source = LayerSource::new(Box::new(all.clone()), 2);
            // Nothing is delivered before a layer is.
            assert!(source.next_block().unwrap().is_none());
            let mut reached = 0;
            for &end in ends {
                source.up_to(end);
                while let Some(block) = source.next_block().unwrap() {
                    assert_eq!((block.origin[2], block.get([1, 1, 0])), (reached, reached.into()));
                    reached += block.dims[2];
                }
                assert_eq!((reached, source.next_begin()), (end, Some(end).filter(|&end| end < 2500)));
            }
            assert!(source.next_block().unwrap().is_none());
        }
    }
}
