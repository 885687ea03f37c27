//! The order in which regions of a source are read: chunk after chunk of the compressed form, so that what one chunk needs comes together.

use pumice_core::ChunkGrid;

/// A box of voxels: the lowest voxel, and the one beyond the highest, along x, y, z.
pub(crate) type Region = [[u64; 2]; 3];

/// Regions, each cut where chunks of the compressed form meet and in the order of these chunks, of which the first begins at the region's lowest
/// voxel. Cuts are moved to the nearest multiple of `steps`, the ends of a store's own chunks or shards, so that none of these is read twice.
#[derive(Clone, Debug)]
pub(crate) struct InChunkOrder {
    regions: std::vec::IntoIter<Region>,
    steps: [u64; 3],
    /// The region that is being cut, its chunks, and the number of the next one.
    current: Option<(Region, ChunkGrid, u64)>,
}

impl InChunkOrder {
    pub(crate) fn new(regions: Vec<Region>, steps: [u64; 3]) -> Self {
        Self { regions: regions.into_iter(), steps, current: None }
    }
}

impl Iterator for InChunkOrder {
    type Item = Region;

    fn next(&mut self) -> Option<Region> {
        loop {
            let Some((region, grid, number)) = &mut self.current else {
                let region = self.regions.next()?;
                // At most the volume's own size.
                let grid = ChunkGrid::new(region.map(|[low, high]| (high - low) as u32));
                self.current = Some((region, grid, 0));
                continue;
            };
            let Some(chunk) = grid.region(*number) else {
                self.current = None;
                continue;
            };
            *number += 1;
            let piece = [0, 1, 2].map(|a| {
                let [low, high] = region[a];
                chunk[a].map(|face| match low + u64::from(face) {
                    at if at == low || at == high => at,
                    at => ((at + self.steps[a] / 2) / self.steps[a])
                        .saturating_mul(self.steps[a])
                        .clamp(low, high),
                })
            });
            // Of a chunk that is smaller than half a step, nothing may be left.
            if piece.iter().all(|[low, high]| low < high) {
                return Some(piece);
            }
        }
    }
}
