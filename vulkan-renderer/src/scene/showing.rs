//! Another choice of labels of a volume that is on the device. What was made for many labels serves for fewer of them:
//!
//! ```text
//! shown before   shown now            rays traverse bricks                              rays traverse boxes
//! the widest     the same labels      the widest                                        the widest
//! the widest     most of them         copied, but where a hidden box reaches into       the same hierarchy; hidden boxes have no voxels
//! the widest     few of them          made of the few; the widest stay on the device    the same
//! any            others               made of these, the widest from now on             the same
//! ```
//! Bricks and boxes are copied from the device, so the host keeps no second form of them. Every way draws the same picture, bit by bit. The
//! CPU's way is in cpu-renderer/src/traverse/volume_tracer/showing.rs.

use std::sync::Arc;

use pumice_core::reserve::zeroed;
use pumice_transport::geometry::DetailLevel;
use pumice_transport::geometry::visible_boxes::count_visible;
use pumice_transport::{BoxBounds, RenderError};

use super::{Boxes, BricksOnDevice, Content, Drawn, Nodes, UploadError, WholeBoxes, hierarchy};
use crate::device::{Acceleration, Backend, Buffer, Gpu};
use crate::layout::{self, Chunk};
use crate::pack::{PackedBricks, level_of, take_voxels};

/// Hidden boxes stay among the others while at least one of so many boxes is shown; below that these alone are packed.
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

/// The most boxes that were drawn of a volume.
#[derive(Clone, Debug)]
pub(super) struct Widest {
    /// Which labels they have.
    visible: Vec<bool>,
    /// Their content is [`Content::Whole`].
    boxes: Arc<Boxes>,
}

/// Some of the widest boxes.
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

    /// The most boxes up to now, if what is drawn now is among them and is drawn in the same way.
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

    /// Most of the widest boxes; `None` where rays traverse boxes that are drawn whole, whose voxels do not matter.
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
