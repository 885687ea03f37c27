//! Another choice of labels of a volume that is on the device. The *widest* choice is the largest set of labels that was shown: what was made
//! for it serves for its subsets.
//!
//! ```text
//! labels shown now               rays traverse bricks                              rays traverse boxes
//! those of the widest choice     what was made for it                              the same
//! at least a quarter of its      its bricks, copied where no hidden box reaches    its hierarchy; hidden boxes have no voxels
//! boxes                          into them
//! fewer                          made of these labels; the widest stays            the same
//! others                         made of these labels, the widest choice now on    the same
//! ```
//! Bricks and boxes are read back from the device; the host keeps only the number of each box in the volume. Every way draws the same picture,
//! bit by bit. The CPU's way is in cpu-renderer/src/traverse/volume_tracer/showing.rs.

use std::sync::Arc;

use pumice_core::reserve::zeroed;
use pumice_transport::geometry::DetailLevel;
use pumice_transport::geometry::visible_boxes::count_visible;
use pumice_transport::{BoxBounds, RenderError};

use super::{Boxes, BricksOnDevice, Content, Drawn, Nodes, UploadError, WholeBoxes, hierarchy};
use crate::device::{Acceleration, Backend, Buffer, Gpu};
use crate::layout::{self, Chunk};
use crate::pack::{PackedBricks, level_of, take_voxels};

/// What was made for the widest choice serves while at least one of so many of its boxes is shown; below that the shown boxes alone are packed.
const BOXES_A_SHOWN_ONE: u64 = 4;

/// What was drawn of a volume before an edit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Former<'a> {
    pub(crate) boxes: &'a Arc<Boxes>,
    /// Which labels were visible.
    pub(crate) visible: &'a [bool],
}

/// What is drawn of a volume now.
#[derive(Debug)]
pub(crate) struct Showing {
    pub(crate) boxes: Arc<Boxes>,
    /// Whether boxes were packed for it.
    pub(crate) is_built: bool,
    /// Whether anything was sent to the device.
    pub(crate) is_sent: bool,
}

/// The widest choice of labels so far, and what was made for it.
#[derive(Clone, Debug)]
pub(super) struct Widest {
    /// Whether each label, by dense index, is in the choice.
    visible: Vec<bool>,
    /// Made from the volume: the content is [`Content::Whole`].
    boxes: Arc<Boxes>,
}

/// What is on the device for a subset of the widest choice, beside what was made for that.
#[derive(Debug)]
pub(super) enum Fewer {
    /// Bricks without hidden boxes, and hardware's hierarchy over them where it finds bricks.
    Bricks(Box<BricksOnDevice>, Option<Acceleration>),
    /// Records of boxes of which hidden ones have no voxels.
    Boxes(Buffer),
}

impl Fewer {
    pub(super) fn has_bricks(&self) -> bool {
        matches!(self, Self::Bricks(..))
    }
}

impl Widest {
    pub(super) fn boxes(&self) -> &Arc<Boxes> {
        &self.boxes
    }

    /// The widest choice before an edit, if the labels shown now are a subset of it and are drawn in the same way.
    fn of(former: Former<'_>, gpu: &Gpu, what: &Drawn<'_>) -> Option<Self> {
        let widest = match &former.boxes.widest {
            Some(widest) => widest.clone(),
            None => Self { visible: former.visible.to_vec(), boxes: Arc::clone(former.boxes) },
        };
        let Content::Whole(whole) = &widest.boxes.content else { return None };
        // (A ray tracing pipeline identifies an instance by its hierarchy.)
        let is_same = whole.nodes.is_of(what.volume)
            && whole.lod == what.lod
            && whole.neighbors.is_some() == what.smooth
            && !whole.hidden_too
            && !what.hidden_too
            && (whole.place == what.place || gpu.backend() != Backend::RayPipeline);
        let covers = what.visible.iter().zip(&widest.visible).all(|(visible, has)| !visible || *has);
        (is_same && covers).then_some(widest)
    }
}

impl Boxes {
    /// What is drawn of a volume in memory, made of what was drawn of it before the edit where that has it. `nodes` are those of the
    /// visible labels.
    ///
    /// # Errors
    /// As [`Boxes::new`].
    pub(crate) fn showing(
        gpu: &Gpu,
        what: &Drawn<'_>,
        former: Option<Former<'_>>,
        nodes: impl FnOnce() -> Result<Arc<Nodes>, UploadError>,
    ) -> Result<Showing, UploadError> {
        let built = |widest| -> Result<Showing, UploadError> {
            let boxes = Self { widest, ..Self::new(gpu, what, nodes()?)? };
            Ok(Showing { boxes: Arc::new(boxes), is_built: true, is_sent: true })
        };
        let Some(widest) = former.and_then(|former| Widest::of(former, gpu, what)) else {
            return built(None);
        };
        let shown = count_visible(what.volume, what.visible);
        if shown.saturating_mul(BOXES_A_SHOWN_ONE) < u64::from(widest.boxes.record.box_count) {
            return built(Some(widest));
        }
        if widest.visible == what.visible {
            return Ok(Showing { boxes: widest.boxes, is_built: false, is_sent: false });
        }
        match Self::fewer(gpu, what, widest)? {
            Some(fewer) => Ok(Showing { boxes: Arc::new(fewer), is_built: false, is_sent: true }),
            None => built(None),
        }
    }

    /// A subset of the widest choice, made from what the device holds; `None` where rays traverse boxes that are drawn whole, whose voxels do
    /// not matter.
    fn fewer(gpu: &Gpu, what: &Drawn<'_>, widest: Widest) -> Result<Option<Self>, UploadError> {
        let Content::Whole(whole) = &widest.boxes.content else { return Ok(None) };
        let mut record = widest.boxes.record;
        let content = match (&whole.bricks, level_of(what.lod)) {
            (Some(bricks), Some(level)) => {
                let packed = bricks.packed(gpu)?;
                let less = packed.without(what.volume, &whole.items, what.visible, level);
                let less = less.map_err(RenderError::from)?;
                drop(packed);
                let bricks = BricksOnDevice::new(gpu, &less, &mut record)?;
                let mut built = None;
                if gpu.backend().uses_hardware_hierarchy() {
                    let all = BoxBounds { lo: record.lo, hi: record.hi };
                    let aabbs = || less.aabbs(all);
                    (_, built) = hierarchy(gpu, what.place, &mut record, aabbs, || Ok(Vec::new()))?;
                }
                Fewer::Bricks(Box::new(bricks), built)
            }
            (None, Some(DetailLevel::Voxels | DetailLevel::Cells)) => {
                let boxes = whole.without_voxels(gpu, &record, what.visible)?;
                record.boxes = boxes.address();
                Fewer::Boxes(boxes)
            }
            _ => return Ok(None),
        };
        Ok(Some(Self { content: Content::Fewer(content), record, widest: Some(widest) }))
    }
}

impl WholeBoxes {
    /// Records of these boxes, without voxels where their labels are not `visible`.
    fn without_voxels(
        &self,
        gpu: &Gpu,
        record: &layout::Instance,
        visible: &[bool],
    ) -> Result<Buffer, UploadError> {
        let chunks: Vec<Chunk> = read(gpu, &self.chunks, record.chunk_count as usize)?;
        let labels: Vec<u32> = read(gpu, &self.labels, record.box_count as usize)?;
        let mut boxes: Vec<u64> = read(gpu, &self.boxes, record.box_count as usize)?;
        take_voxels(&chunks, &mut boxes, &labels, &self.nodes.packed, visible)?;
        Ok(gpu.buffer_of("the boxes of a volume", bytemuck::cast_slice(&boxes))?)
    }
}

impl BricksOnDevice {
    /// The bricks as they were packed, but for the corners.
    fn packed(&self, gpu: &Gpu) -> Result<PackedBricks, UploadError> {
        let [blocks, bricks, fields, parts] = self.counts;
        Ok(PackedBricks {
            blocks: read(gpu, &self.blocks, blocks)?,
            bricks: read(gpu, &self.bricks, bricks)?,
            fields: read(gpu, &self.fields, fields)?,
            parts: read(gpu, &self.parts, parts)?,
            corners: Vec::new(),
        })
    }
}

/// The first elements of a buffer.
fn read<T: bytemuck::Pod>(gpu: &Gpu, buffer: &Buffer, count: usize) -> Result<Vec<T>, UploadError> {
    let mut all: Vec<T> = zeroed(count, "what is drawn of a volume").map_err(RenderError::from)?;
    gpu.download(buffer, 0, bytemuck::cast_slice_mut(&mut all))?;
    Ok(all)
}
