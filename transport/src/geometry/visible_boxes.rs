//! The boxes of a volume that are drawn, as input for building a hierarchy.

use std::ops::Range;

use crate::BoxBounds;
use pumice_core::reserve::{collected, reserved};
use pumice_core::{CompressedVolume, NoMemory};

use super::each_axis;

/// What memory is for, in errors.
const SHOWN: &str = "a list of the boxes that are shown";

/// Bounds and index of each box of a visible label, in the volume's order. `tight` bounds enclose the box's voxels only.
///
/// # Errors
/// [`NoMemory`].
pub fn visible_boxes(
    volume: &CompressedVolume,
    visible: &[bool],
    tight: bool,
) -> Result<Vec<(BoxBounds, u32)>, NoMemory> {
    let mut boxes = reserved(count_visible(volume, visible) as usize, SHOWN)?;
    for_each_visible_box(volume, visible, tight, |bounds, item| boxes.push((bounds, item)));
    Ok(boxes)
}

/// Indices of the boxes of visible labels, rising.
///
/// # Errors
/// [`NoMemory`].
pub fn visible_items(volume: &CompressedVolume, visible: &[bool]) -> Result<Vec<u32>, NoMemory> {
    let items = visible_ranges(volume, visible).flatten().map(|item| item as u32);
    collected(count_visible(volume, visible) as usize, items, SHOWN)
}

/// Calls `visit` with what [`visible_boxes`] lists.
pub fn for_each_visible_box(
    volume: &CompressedVolume,
    visible: &[bool],
    tight: bool,
    mut visit: impl FnMut(BoxBounds, u32),
) {
    for i in visible_ranges(volume, visible).flatten() {
        let place = volume.place_of_box(i as usize);
        let bounds = if tight {
            let (lo, last) = volume.box_at(&place).voxel_bounds();
            BoxBounds { lo, hi: last.map(|v| v + 1) }
        } else {
            let hi = clipped_end(place.origin, place.extent, volume.info().dims);
            BoxBounds { lo: place.origin, hi }
        };
        visit(bounds, i as u32);
    }
}

/// Number of boxes of visible labels.
pub fn count_visible(volume: &CompressedVolume, visible: &[bool]) -> u64 {
    visible_ranges(volume, visible).map(|boxes| boxes.end - boxes.start).sum()
}

/// Indices of the boxes of visible labels: a range for each label and chunk.
fn visible_ranges<'a>(
    volume: &'a CompressedVolume,
    visible: &'a [bool],
) -> impl Iterator<Item = Range<u64>> + 'a {
    volume.chunks().iter().enumerate().flat_map(move |(c, chunk)| {
        let next = volume.chunks().get(c + 1);
        let end_of_runs = next.map_or(volume.runs().len(), |n| n.first_run as usize);
        let runs = &volume.runs()[chunk.first_run as usize..end_of_runs];
        let end_of_chunk = next.map_or(volume.boxes().len() as u64, |n| n.first_box);
        let is_visible = |label: u32| visible.get(label as usize).copied().unwrap_or(false);
        runs.iter().enumerate().filter(move |(_, run)| is_visible(run.label)).map(move |(r, run)| {
            let start = chunk.first_box + u64::from(run.first_box);
            start..runs.get(r + 1).map_or(end_of_chunk, |n| chunk.first_box + u64::from(n.first_box))
        })
    })
}

/// One past the highest voxel of a box that lies within the volume.
#[inline(always)]
pub fn clipped_end(origin: [u32; 3], extent: [u32; 3], dims: [u32; 3]) -> [u32; 3] {
    each_axis(|a| (origin[a] + extent[a]).min(dims[a]))
}
