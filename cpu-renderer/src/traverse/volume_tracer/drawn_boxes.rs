//! The boxes that an instance draws: how many, between which bounds, of which labels; and their hierarchy where rays need one.
//!
//! Bricks answer every query, so a volume that has them needs no hierarchy: without it a cortex of 512³ voxels takes 1.7 MB less. Levels of
//! detail that depend on distance change with the camera from bricks to boxes and back, so there the hierarchy is kept.

use pumice_core::{CompressedVolume, NoMemory};
use pumice_transport::geometry::DrawnInPages;
use pumice_transport::geometry::visible_boxes::{for_each_visible_box, visible_boxes, visible_items};
use pumice_transport::{BoxBounds, Bvh, RenderError};

/// See the module.
#[derive(Debug)]
pub(super) struct DrawnBoxes {
    /// Whether the boxes of a label are among them, by dense index.
    labels: Box<[bool]>,
    count: usize,
    bounds: Option<BoxBounds>,
    /// Whether the bounds are those of the voxels, which requires every box to be drawn as voxels. Otherwise they are those of the boxes,
    /// which contain every level.
    is_tight: bool,
    hierarchy: Option<Bvh>,
}

impl DrawnBoxes {
    /// The boxes of visible labels, with their hierarchy. Its items are indices of boxes.
    ///
    /// # Errors
    /// As [`Bvh::build`].
    pub(super) fn in_hierarchy(
        volume: &CompressedVolume,
        visible: &[bool],
        is_tight: bool,
    ) -> Result<Self, RenderError> {
        let bvh = Bvh::build(visible_boxes(volume, visible, is_tight)?)?;
        let (count, bounds) = (bvh.len(), bvh.bounds());
        Ok(Self { labels: visible.into(), count, bounds, is_tight, hierarchy: Some(bvh) })
    }

    /// The boxes of visible labels alone.
    pub(super) fn alone(volume: &CompressedVolume, visible: &[bool], is_tight: bool) -> Self {
        let (mut count, mut all) = (0, BoxBounds::EMPTY);
        for_each_visible_box(volume, visible, is_tight, |bounds, _| {
            count += 1;
            all = all.union(bounds);
        });
        let bounds = (count > 0).then_some(all);
        Self { labels: visible.into(), count, bounds, is_tight, hierarchy: None }
    }

    /// No box: those of a page are all drawn, and found by bricks.
    pub(super) fn nothing() -> Self {
        Self { labels: Box::default(), count: 0, bounds: None, is_tight: false, hierarchy: None }
    }

    /// So many boxes of visible labels, which are not in memory.
    pub(super) fn elsewhere(visible: &[bool], drawn: &DrawnInPages, is_tight: bool) -> Self {
        Self { labels: visible.into(), count: drawn.boxes, bounds: drawn.bounds, is_tight, hierarchy: None }
    }

    /// The same boxes with a hierarchy; `None` where they have one.
    ///
    /// # Errors
    /// As [`Bvh::build`].
    pub(super) fn with_hierarchy(&self, volume: &CompressedVolume) -> Result<Option<Self>, RenderError> {
        match self.hierarchy {
            Some(_) => Ok(None),
            None => Self::in_hierarchy(volume, &self.labels, self.is_tight).map(Some),
        }
    }

    pub(super) fn hierarchy(&self) -> Option<&Bvh> {
        self.hierarchy.as_ref()
    }

    /// Indices of the boxes, rising.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(super) fn items(&self, volume: &CompressedVolume) -> Result<Vec<u32>, NoMemory> {
        visible_items(volume, &self.labels)
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The box around all boxes; `None` where there are none.
    pub(super) fn bounds(&self) -> Option<BoxBounds> {
        self.bounds
    }

    pub(super) fn is_tight(&self) -> bool {
        self.is_tight
    }

    /// Size on the heap in bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.hierarchy.as_ref().map_or(0, Bvh::bytes) + self.labels.len() as u64
    }
}
