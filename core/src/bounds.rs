//! Tight bounds of each label, computed from its boxes.

use crate::{BoxView, CompressedVolume};

/// Lowest and highest voxel of a label, both inclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// Lowest coordinate along each axis.
    pub low: [u32; 3],
    /// Highest coordinate along each axis.
    pub high: [u32; 3],
}

impl CompressedVolume {
    /// Bounds of all labels, by dense index. This visits every box, so callers should keep the result.
    pub fn label_bounds(&self) -> Vec<Bounds> {
        let mut bounds = vec![Bounds { low: [u32::MAX; 3], high: [0; 3] }; self.labels().len()];
        self.for_each_box(|label, b| {
            let of_label = &mut bounds[label as usize];
            let (low, high) = b.voxel_bounds();
            for a in 0..3 {
                of_label.low[a] = of_label.low[a].min(low[a]);
                of_label.high[a] = of_label.high[a].max(high[a]);
            }
        });
        bounds
    }
}

impl BoxView<'_> {
    /// Lowest and highest voxel of the label in this box, both inclusive, in voxels of the volume.
    pub fn voxel_bounds(&self) -> ([u32; 3], [u32; 3]) {
        // Bit p of used[a] is set when some voxel has coordinate p along axis a, counted from the box's corner.
        let mut used = [0u32; 3];
        for (c, field) in self.node.fields() {
            // OR the z layers together, then the rows; the remaining bits are the coordinates in use.
            let layer = field | field >> 32;
            let layer = (layer | layer >> 16) as u32 & 0xFFFF;
            let row = layer | layer >> 8;
            used[0] |= ((row | row >> 4) & 15) << (4 * (c & 3));
            let y = (0..4).filter(|y| layer >> (4 * y) & 15 != 0).fold(0, |m, y| m | 1 << y);
            used[1] |= y << (4 * (c >> 2 & 3));
            let z = (0..4).filter(|z| field >> (16 * z) & 0xFFFF != 0).fold(0, |m, z| m | 1 << z);
            used[2] |= z << (4 * (c >> 4));
        }
        let low = [0, 1, 2].map(|a| self.origin[a] + used[a].trailing_zeros());
        let high = [0, 1, 2].map(|a| self.origin[a] + 31 - used[a].leading_zeros());
        (low, high)
    }
}
