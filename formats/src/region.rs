//! The region of a volume that is read, and the source that cuts it out of the blocks of another.

use std::path::Path;

use glam::{DAffine3, DVec3};
use pumice_core::{BlockSource, LabelBlock, LabelBuffer, VolumeInfo};

use crate::chunk_order::Region;
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

/// Delivers the parts of each block that lie in regions of a volume.
pub(crate) struct RegionSource {
    inner: Box<dyn BlockSource>,
    info: VolumeInfo,
    /// Lowest voxel of the volume that is delivered.
    low: [u64; 3],
    regions: Vec<Region>,
    left: u64,
    /// Whether the regions have the last voxel of the volume that is delivered, and its end is still to be read.
    to_end: bool,
    /// Parts of the last block that are still to come.
    parts: Vec<LabelBlock>,
}

impl RegionSource {
    /// The source of `regions` of a volume that `info` describes, with its lowest voxel at `low` in the volume of `inner`.
    pub(crate) fn new(
        inner: Box<dyn BlockSource>,
        (info, low): (VolumeInfo, [u64; 3]),
        regions: Vec<Region>,
    ) -> Self {
        let left = regions.iter().map(|r| r.iter().map(|[low, high]| high - low).product::<u64>()).sum();
        let high = [0, 1, 2].map(|a| low[a] + u64::from(info.dims[a]));
        let to_end = regions.iter().any(|region| region.map(|[_, end]| end) == high);
        Self { inner, info, low, regions, left, to_end, parts: Vec::new() }
    }
}

impl BlockSource for RegionSource {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    /// What lies behind the regions' last voxel is not read, so its checksums are compared only where that is the last of the file.
    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        loop {
            if let Some(part) = self.parts.pop() {
                self.left -= part.dims.iter().map(|&d| u64::from(d)).product::<u64>();
                return Ok(Some(part));
            }
            if self.left == 0 {
                if std::mem::take(&mut self.to_end) {
                    self.inner.next_block()?;
                }
                return Ok(None);
            }
            let Some(block) = self.inner.next_block()? else { return Ok(None) };
            if let [region] = self.regions[..] {
                self.parts.extend(part(block, region, self.low));
            } else {
                self.parts.extend(self.regions.iter().filter_map(|&region| copied(&block, region, self.low)));
            }
        }
    }
}

/// The voxels of a block that lie in a region: the lowest, and the one beyond the highest.
fn common(block: &LabelBlock, region: Region) -> Option<Region> {
    let common = [0, 1, 2].map(|a| {
        let low = u64::from(block.origin[a]);
        [low.max(region[a][0]), (low + u64::from(block.dims[a])).min(region[a][1])]
    });
    common.iter().all(|[low, high]| low < high).then_some(common)
}

/// The part of a block that lies in a region, with its place in a volume that begins at `volume_low`.
fn part(block: LabelBlock, region: Region, volume_low: [u64; 3]) -> Option<LabelBlock> {
    let common = common(&block, region)?;
    // Labels before the part's first voxel are dropped; those behind its last are out of reach of the strides.
    let skip: usize =
        (0..3).map(|a| (common[a][0] - u64::from(block.origin[a])) as usize * block.strides[a]).sum();
    let labels = match block.labels {
        LabelBuffer::U8(v) => LabelBuffer::U8(after(v, skip)),
        LabelBuffer::U16(v) => LabelBuffer::U16(after(v, skip)),
        LabelBuffer::U32(v) => LabelBuffer::U32(after(v, skip)),
        LabelBuffer::U64(v) => LabelBuffer::U64(after(v, skip)),
    };
    Some(LabelBlock {
        origin: [0, 1, 2].map(|a| (common[a][0] - volume_low[a]) as u32),
        dims: common.map(|[low, high]| (high - low) as u32),
        strides: block.strides,
        labels,
    })
}

/// Like [`part`], but the voxels are copied, so that several regions have their part of one block.
fn copied(block: &LabelBlock, region: Region, volume_low: [u64; 3]) -> Option<LabelBlock> {
    let common = common(block, region)?;
    let origin = [0, 1, 2].map(|a| (common[a][0] - volume_low[a]) as u32);
    let dims = common.map(|[low, high]| (high - low) as u32);
    let from = [0, 1, 2].map(|a| (common[a][0] - u64::from(block.origin[a])) as usize);
    let of = (from, dims.map(|d| d as usize), block.strides);
    let labels = match &block.labels {
        LabelBuffer::U8(v) => LabelBuffer::U8(cut_out(v, of)),
        LabelBuffer::U16(v) => LabelBuffer::U16(cut_out(v, of)),
        LabelBuffer::U32(v) => LabelBuffer::U32(cut_out(v, of)),
        LabelBuffer::U64(v) => LabelBuffer::U64(cut_out(v, of)),
    };
    Some(LabelBlock::x_fastest(origin, dims, labels))
}

/// The voxels of a box, x fastest: its first voxel, its size, and the strides of `labels`.
fn cut_out<T: Copy>(labels: &[T], (from, dims, strides): ([usize; 3], [usize; 3], [usize; 3])) -> Vec<T> {
    let mut out = Vec::with_capacity(dims.iter().product());
    for z in from[2]..from[2] + dims[2] {
        for y in from[1]..from[1] + dims[1] {
            let start = from[0] * strides[0] + y * strides[1] + z * strides[2];
            match strides[0] {
                1 => out.extend_from_slice(&labels[start..start + dims[0]]),
                step => out.extend((0..dims[0]).map(|x| labels[start + x * step])),
            }
        }
    }
    out
}

/// Regions that cover the same voxels: those side by side, with the same extent across, are one.
pub(crate) fn joined(mut regions: Vec<Region>) -> Vec<Region> {
    for axis in 0..3 {
        let across = |r: &Region| (r[(axis + 1) % 3], r[(axis + 2) % 3]);
        regions.sort_unstable_by_key(|r| (across(r), r[axis]));
        let mut longer: Vec<Region> = Vec::new();
        for region in regions {
            match longer.last_mut() {
                Some(last) if across(last) == across(&region) && last[axis][1] == region[axis][0] => {
                    last[axis][1] = region[axis][1];
                }
                _ => longer.push(region),
            }
        }
        regions = longer;
    }
    regions
}

fn after<T>(mut labels: Vec<T>, skip: usize) -> Vec<T> {
    labels.drain(..skip);
    labels
}

#[cfg(test)]
mod tests {
    use pumice_core::{ArraySource, LabelType};

    use super::*;

    #[test]
    fn regions_side_by_side_become_one() {
        let cube = |x: u64, y: u64, z: u64| [[x, x + 1], [y, y + 1], [z, z + 1]];
        let all = (0..2).flat_map(|z| (0..3).flat_map(move |y| (0..4).map(move |x| cube(x, y, z))));
        assert_eq!(joined(all.clone().collect()), [[[0, 4], [0, 3], [0, 2]]]);
        let but_one: Vec<Region> = all.filter(|&r| r != cube(3, 2, 1)).collect();
        let voxels = |r: &Region| r.iter().map(|[low, high]| high - low).product::<u64>();
        let joined = joined(but_one);
        assert_eq!(joined.iter().map(voxels).sum::<u64>(), 23);
        assert!(joined.len() <= 4, "{joined:?}");
    }

    /// Each voxel of two regions comes once, at its place, from blocks of any strides.
    #[test]
    fn voxels_of_several_regions_come_once() {
        let dims = [7u32, 5, 9];
        let id = |p: [u32; 3]| u16::try_from(p[0] + 10 * p[1] + 100 * p[2]).unwrap();
        let mut labels = Vec::new();
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                labels.extend((0..dims[0]).map(|x| id([x, y, z])));
            }
        }
        let info = VolumeInfo::new(dims, LabelType::U16);
        let inner = ArraySource::new(info.clone(), LabelBuffer::U16(labels)).unwrap();
        let regions = vec![[[1, 3], [0, 5], [2, 9]], [[4, 7], [1, 2], [0, 3]]];
        let mut source = RegionSource::new(Box::new(inner), (info, [1, 0, 0]), regions.clone());
        let mut seen = std::collections::BTreeMap::new();
        while let Some(block) = source.next_block().unwrap() {
            for z in 0..block.dims[2] {
                for y in 0..block.dims[1] {
                    for x in 0..block.dims[0] {
                        let p = [1 + block.origin[0] + x, block.origin[1] + y, block.origin[2] + z];
                        assert_eq!(block.get([x, y, z]), u64::from(id(p)), "{p:?}");
                        assert!(seen.insert(p, ()).is_none());
                    }
                }
            }
        }
        assert_eq!(seen.len(), 2 * 5 * 7 + 3 * 3);
        let inside =
            |p: &[u32; 3]| regions.iter().any(|r| (0..3).all(|a| (r[a][0]..r[a][1]).contains(&p[a].into())));
        assert!(seen.keys().all(inside));
    }
}
