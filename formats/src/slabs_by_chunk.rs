//! The voxels of a file that are stored without compression, chunk after chunk of the compressed form.
//!
//! ```text
//! regions ─► cut where chunks meet ─► for each piece: the file, opened again ─► rows of the piece
//! ```
//! A plane of a wide volume crosses many chunks. Read plane by plane, each chunk would come in thin pieces, of which there are as many as planes.

use pumice_core::{BlockSource, LabelBlock, VolumeInfo};

use crate::chunk_order::{InChunkOrder, Region};
use crate::error::Result;
use crate::slab::SlabSource;

/// Opens the voxels of a window.
type OpenWindow = Box<dyn FnMut(Region) -> Result<SlabSource> + Send>;

/// Delivers the voxels of regions of one file.
pub(crate) struct SlabsByChunk {
    info: VolumeInfo,
    pieces: InChunkOrder,
    open: OpenWindow,
    current: Option<SlabSource>,
}

impl SlabsByChunk {
    /// The source of `regions` of the volume that `info` describes; `open` is called with a piece of them at a time.
    pub(crate) fn new(info: VolumeInfo, regions: Vec<Region>, open: OpenWindow) -> Self {
        Self { info, pieces: InChunkOrder::new(regions, [1; 3]), open, current: None }
    }
}

impl BlockSource for SlabsByChunk {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        loop {
            if let Some(source) = &mut self.current {
                let block = source.next_block();
                if !matches!(block, Ok(None)) {
                    return block;
                }
                self.current = None;
            }
            let Some(piece) = self.pieces.next() else { return Ok(None) };
            self.current = Some((self.open)(piece)?);
        }
    }
}
