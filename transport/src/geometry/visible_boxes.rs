//! The boxes of a volume that are drawn, as input for building a hierarchy.

use crate::BoxBounds;
use pumice_core::CompressedVolume;

use super::each_axis;

/// Bounds and index of each box of a visible label, in the volume's order. `tight` bounds enclose the box's voxels only.
pub fn visible_boxes(volume: &CompressedVolume, visible: &[bool], tight: bool) -> Vec<(BoxBounds, u32)> {
    let mut boxes = Vec::new();
    for (c, chunk) in volume.chunks().iter().enumerate() {
        let next = volume.chunks().get(c + 1);
        let runs = &volume.runs()
            [chunk.first_run as usize..next.map_or(volume.runs().len(), |n| n.first_run as usize)];
        let chunk_end = next.map_or(volume.boxes().len() as u64, |n| n.first_box);
        for (r, run) in runs.iter().enumerate() {
            if !visible.get(run.label as usize).copied().unwrap_or(false) {
                continue;
            }
            let first = chunk.first_box + u64::from(run.first_box);
            let end = runs.get(r + 1).map_or(chunk_end, |n| chunk.first_box + u64::from(n.first_box));
            for i in first..end {
                let place = volume.place_of_box(i as usize);
                let bounds = if tight {
                    let (lo, last) = volume.box_at(&place).voxel_bounds();
                    BoxBounds { lo, hi: last.map(|v| v + 1) }
                } else {
                    let hi = clipped_end(place.origin, place.extent, volume.info().dims);
                    BoxBounds { lo: place.origin, hi }
                };
                boxes.push((bounds, i as u32));
            }
        }
    }
    // Building needs several times this memory, so no spare capacity is kept.
    boxes.shrink_to_fit();
    boxes
}

/// One past the highest voxel of a box that lies within the volume.
#[inline(always)]
pub fn clipped_end(origin: [u32; 3], extent: [u32; 3], dims: [u32; 3]) -> [u32; 3] {
    each_axis(|a| (origin[a] + extent[a]).min(dims[a]))
}
