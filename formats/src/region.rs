//! The region of a volume that is read, and the source that cuts it out of the blocks of another.

use std::path::Path;

use glam::{DAffine3, DVec3};
use pumice_core::{BlockSource, LabelBlock, LabelBuffer, VolumeInfo};

use crate::chunks::Region;
use crate::error::{FormatError, Result};
use crate::options::Roi;

/// The region that `roi` means in a volume of `dims` voxels.
pub(crate) fn resolve(path: &Path, dims: [u32; 3], roi: Option<&Roi>) -> Result<Region> {
    let mut region = dims.map(|size| [0, u64::from(size)]);
    let Some(roi) = roi else { return Ok(region) };
    for (a, [low, high]) in roi.0.into_iter().enumerate() {
        let size = u64::from(dims[a]);
        let (low, high) = (low.unwrap_or(0), high.unwrap_or(size));
        if low >= high || high > size {
            return Err(FormatError::option(
                path,
                format!(
                    "--roi {roi}: {low}:{high} along {} is outside the volume, which has {size} voxels there ({} × {} × {})",
                    ["x", "y", "z"][a],
                    dims[0],
                    dims[1],
                    dims[2]
                ),
            ));
        }
        region[a] = [low, high];
    }
    Ok(region)
}

/// The description of a region: its size, and the matrix from its own lowest voxel.
pub(crate) fn cut(info: &VolumeInfo, region: Region) -> VolumeInfo {
    let low = region.map(|[low, _]| low as f64);
    VolumeInfo {
        // At most the volume's own size.
        dims: region.map(|[low, high]| (high - low) as u32),
        world_from_index: info.world_from_index * DAffine3::from_translation(DVec3::from_array(low)),
        ..info.clone()
    }
}

/// Delivers the part of each block that lies in a region.
pub(crate) struct RegionSource {
    inner: Box<dyn BlockSource>,
    info: VolumeInfo,
    region: Region,
    left: u64,
}

impl RegionSource {
    pub(crate) fn new(inner: Box<dyn BlockSource>, region: Region) -> Self {
        let info = cut(inner.info(), region);
        let left = info.voxels();
        Self { inner, info, region, left }
    }
}

impl BlockSource for RegionSource {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    /// What lies behind the region's last voxel is not read, so its checksums are not compared.
    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        while self.left > 0 {
            let Some(block) = self.inner.next_block()? else { return Ok(None) };
            if let Some(block) = part(block, self.region) {
                self.left -= block.dims.iter().map(|&d| u64::from(d)).product::<u64>();
                return Ok(Some(block));
            }
        }
        Ok(None)
    }
}

/// The part of a block that lies in a region, with its place in the region.
fn part(block: LabelBlock, region: Region) -> Option<LabelBlock> {
    let low = [0, 1, 2].map(|a| u64::from(block.origin[a]).max(region[a][0]));
    let high = [0, 1, 2].map(|a| (u64::from(block.origin[a]) + u64::from(block.dims[a])).min(region[a][1]));
    if (0..3).any(|a| low[a] >= high[a]) {
        return None;
    }
    // Labels before the part's first voxel are dropped; those behind its last are out of reach of the strides.
    let skip: usize = (0..3).map(|a| (low[a] - u64::from(block.origin[a])) as usize * block.strides[a]).sum();
    let labels = match block.labels {
        LabelBuffer::U8(v) => LabelBuffer::U8(after(v, skip)),
        LabelBuffer::U16(v) => LabelBuffer::U16(after(v, skip)),
        LabelBuffer::U32(v) => LabelBuffer::U32(after(v, skip)),
        LabelBuffer::U64(v) => LabelBuffer::U64(after(v, skip)),
    };
    Some(LabelBlock {
        origin: [0, 1, 2].map(|a| (low[a] - region[a][0]) as u32),
        dims: [0, 1, 2].map(|a| (high[a] - low[a]) as u32),
        strides: block.strides,
        labels,
    })
}

fn after<T>(mut labels: Vec<T>, skip: usize) -> Vec<T> {
    labels.drain(..skip);
    labels
}
