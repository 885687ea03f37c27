//! Decodes boxes to labels: one voxel, or a block of voxels.

use crate::grid::{BRICK_VOXELS, BoxGrid, cells_between};
use crate::reserve::{make_room, reserved, zeroed};
use crate::{BoxView, CompressedVolume, Error, Result};

impl CompressedVolume {
    /// Spatial index of the boxes, built on first use.
    ///
    /// # Errors
    /// [`Error::Memory`]; the next query tries again. [`Error::Caller`] where the boxes are on disk ([`CompressedVolume::pages`]).
    pub fn grid(&self) -> Result<&BoxGrid> {
        if let Some(grid) = self.grid.get() {
            return Ok(grid);
        }
        // Threads that ask at once may each build one; the first is kept.
        let grid = self.new_grid()?;
        Ok(self.grid.get_or_init(|| grid))
    }

    /// Builds a spatial index that the caller owns, for callers that need one only once and do not want the volume to keep its memory.
    ///
    /// # Errors
    /// [`Error::Memory`]; [`Error::Caller`] where the boxes are on disk.
    pub(crate) fn new_grid(&self) -> Result<BoxGrid> {
        self.require_boxes("a look-up of voxels")?;
        Ok(BoxGrid::new(self.boxes().len(), |i| {
            let place = self.place_of_box(i);
            (place.origin, place.extent)
        })?)
    }

    /// Frees the spatial index; the next query builds it again.
    pub fn forget_grid(&mut self) {
        self.grid.take();
    }

    /// Dense label index of a voxel; `None` for background and outside the volume.
    ///
    /// # Errors
    /// As [`CompressedVolume::grid`].
    pub fn label_at(&self, voxel: [u32; 3]) -> Result<Option<u32>> {
        if (0..3).any(|a| voxel[a] >= self.info.dims[a]) {
            return Ok(None);
        }
        let boxes = self.grid()?.boxes_in(voxel.map(|v| v / BRICK_VOXELS));
        let found = boxes.iter().find(|&&i| self.get_box(i as usize).contains(voxel));
        Ok(found.map(|&i| self.label_of_box(i as usize)))
    }

    /// Labels of a block, x fastest, as dense index + 1; 0 is background.
    ///
    /// # Errors
    /// [`Error::Caller`] when the block is not within the volume, [`Error::Memory`] when it does not fit into memory.
    pub fn decode_block(&self, origin: [u32; 3], dims: [u32; 3]) -> Result<Vec<u32>> {
        self.decode_block_by(self.grid()?, origin, dims)
    }

    /// Like [`CompressedVolume::decode_block`], with a spatial index that the caller provides.
    pub(crate) fn decode_block_by(
        &self,
        grid: &BoxGrid,
        origin: [u32; 3],
        dims: [u32; 3],
    ) -> Result<Vec<u32>> {
        if (0..3).any(|a| u64::from(origin[a]) + u64::from(dims[a]) > u64::from(self.info.dims[a])) {
            return Err(Error::Caller(format!(
                "block at {origin:?} of {dims:?} voxels reaches beyond the volume of {:?}",
                self.info.dims
            )));
        }
        let voxels = dims.iter().fold(1usize, |n, &d| n.saturating_mul(d as usize));
        let mut labels = zeroed(voxels, "a block of labels")?;
        if labels.is_empty() {
            return Ok(labels);
        }
        let last = [0, 1, 2].map(|a| (origin[a] + dims[a] - 1) / BRICK_VOXELS);
        let mut boxes: Vec<u32> = Vec::new();
        for brick in cells_between(origin.map(|o| o / BRICK_VOXELS), last) {
            let within = grid.boxes_in(brick);
            make_room(&mut boxes, within.len(), "a list of the boxes of a block of labels")?;
            boxes.extend_from_slice(within);
        }
        boxes.sort_unstable();
        boxes.dedup();
        for i in boxes {
            let label = self.label_of_box(i as usize) + 1;
            self.get_box(i as usize).paint(label, origin, dims, &mut labels);
        }
        Ok(labels)
    }

    /// Labels of a block, x fastest, as 64-bit ids of the source; 0 is background.
    ///
    /// # Errors
    /// As [`CompressedVolume::decode_block`].
    pub fn decode_ids(&self, origin: [u32; 3], dims: [u32; 3]) -> Result<Vec<u64>> {
        let ids = self.labels.ids();
        let dense = self.decode_block(origin, dims)?;
        let mut labels = reserved(dense.len(), "a block of labels")?;
        labels.extend(dense.into_iter().map(|d| if d == 0 { 0 } else { ids[d as usize - 1] }));
        Ok(labels)
    }
}

impl BoxView<'_> {
    /// Whether the box contains this voxel of the volume.
    #[inline]
    pub fn contains(&self, voxel: [u32; 3]) -> bool {
        if (0..3).any(|a| voxel[a].wrapping_sub(self.origin[a]) >= self.extent[a]) {
            return false;
        }
        let [x, y, z] = [0, 1, 2].map(|a| voxel[a] - self.origin[a]);
        let cell = (x >> 2) + (y & !3) + 4 * (z & !3);
        let bit = (x & 3) + 4 * (y & 3) + 16 * (z & 3);
        self.node.has(cell, bit)
    }

    /// Writes `label` for every voxel of the box that lies within the block.
    fn paint(&self, label: u32, origin: [u32; 3], dims: [u32; 3], labels: &mut [u32]) {
        for (c, field) in self.node.fields() {
            let low = [0, 1, 2].map(|a| self.origin[a] + 4 * (c >> (2 * a) & 3));
            for row in 0..16 {
                let four = field >> (4 * row) & 15;
                // For voxels before the block this wraps to a number beyond the block's end.
                let y = (low[1] + (row & 3)).wrapping_sub(origin[1]);
                let z = (low[2] + (row >> 2)).wrapping_sub(origin[2]);
                if four == 0 || y >= dims[1] || z >= dims[2] {
                    continue;
                }
                let start = (z as usize * dims[1] as usize + y as usize) * dims[0] as usize;
                let line = &mut labels[start..start + dims[0] as usize];
                let x = low[0].wrapping_sub(origin[0]);
                match line.get_mut(x as usize..(x as usize).saturating_add(4)) {
                    Some(voxels) if four == 15 => voxels.fill(label),
                    _ => {
                        for i in (0..4).filter(|i| four >> i & 1 != 0) {
                            if let Some(voxel) = line.get_mut(x.wrapping_add(i) as usize) {
                                *voxel = label;
                            }
                        }
                    }
                }
            }
        }
    }
}
