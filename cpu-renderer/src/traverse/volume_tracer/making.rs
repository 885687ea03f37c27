//! Construction of a [`VolumeTracer`]: its bricks or hierarchy, and its cuts; and their memory.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use pumice_core::reserve::collected;
use pumice_core::{CompressedVolume, NoMemory, Pages};
use pumice_scene::CutShape;
use pumice_transport::geometry::LodChoice;
use pumice_transport::geometry::bricks::Bricks;
use pumice_transport::geometry::cuts::Cuts;
use pumice_transport::geometry::drawn_pages::refused;
use pumice_transport::geometry::instance_tree::WorldBounds;
use pumice_transport::geometry::lod::{Detail, DetailLevel};
use pumice_transport::geometry::neighbors::Neighbors;
use pumice_transport::geometry::placement::Placement;
use pumice_transport::{BoxBounds, RenderError};

use super::super::TracedInstance;
use super::VolumeTracer;
use super::drawn_boxes::DrawnBoxes;
use super::pages::{Former, PagedBricks};

pub(super) fn normals(placement: &Placement) -> [[DVec3; 2]; 3] {
    [0, 1, 2].map(|a| [placement.normal(a, false), placement.normal(a, true)])
}

impl VolumeTracer {
    /// Builds the hierarchy over the boxes of visible labels.
    ///
    /// # Errors
    /// [`RenderError::Scene`] if the matrix is singular or there are too many boxes to number; [`RenderError::Memory`].
    pub fn new(instance: u32, traced: &TracedInstance) -> Result<Self, RenderError> {
        if traced.volume.pages().is_some() {
            return Err(refused("a hierarchy of boxes"));
        }
        let is_tight = traced.lod == LodChoice::Voxels;
        Self::of_boxes(instance, traced, || {
            DrawnBoxes::in_hierarchy(&traced.volume, &traced.visible, is_tight)
        })
    }

    /// Builds the bricks of the boxes of visible labels, which take less memory than a hierarchy and are faster. Builds a hierarchy where
    /// bricks are not possible: where boxes have different levels, and where the volume is too sparse.
    ///
    /// # Errors
    /// As [`VolumeTracer::new`].
    pub fn in_bricks(instance: u32, traced: &TracedInstance) -> Result<Self, RenderError> {
        if let Some(pages) = traced.volume.pages() {
            return Self::in_pages(instance, traced, pages, None);
        }
        let is_tight = traced.lod == LodChoice::Voxels;
        Self::of_boxes(instance, traced, || Ok(DrawnBoxes::alone(&traced.volume, &traced.visible, is_tight)))?
            .with_bricks()?
            .complete()
    }

    /// [`VolumeTracer::in_bricks`] of a volume whose boxes are not in memory; pages that `former` draws alike stay.
    pub(super) fn in_pages(
        instance: u32,
        traced: &TracedInstance,
        pages: &Arc<Pages>,
        former: Option<Former<'_>>,
    ) -> Result<Self, RenderError> {
        let TracedInstance { volume, visible, lod, .. } = traced;
        let (detail, is_tight) = (lod.placed(&traced.world_from_index), *lod == LodChoice::Voxels);
        let (paged, drawn) = PagedBricks::new(volume, pages, visible, detail, is_tight, former)?;
        let boxes = || Ok(DrawnBoxes::elsewhere(visible, &drawn, is_tight));
        let tracer = Self::of_boxes(instance, traced, boxes)?;
        Ok(Self { pages: paged.map(Arc::new), wants_bricks: true, ..tracer })
    }

    fn of_boxes(
        instance: u32,
        traced: &TracedInstance,
        boxes: impl FnOnce() -> Result<DrawnBoxes, RenderError>,
    ) -> Result<Self, RenderError> {
        let TracedInstance { volume, world_from_index, lod, .. } = traced;
        let placement = Placement::of_instance(instance, *world_from_index)?;
        if volume.boxes().len() as u64 >> 32 != 0 {
            return Err(RenderError::Scene(format!(
                "instances[{instance}]: {} boxes are more than the limit of 2^32 of one instance",
                volume.boxes().len()
            )));
        }
        let boxes = Arc::new(boxes()?);
        let detail = lod.placed(world_from_index);
        Ok(Self {
            volume: Arc::clone(volume),
            normals: normals(&placement),
            level: level_of(&boxes, &detail),
            detail,
            in_world: boxes.bounds().map(|bounds| WorldBounds::new(bounds, &placement)),
            placement,
            instance,
            boxes,
            bricks: None,
            pages: None,
            wants_bricks: false,
            cuts: Cuts::default(),
            hidden: None,
            widest: None,
            neighbors: None,
        })
    }

    /// Adds a hierarchy where there are no bricks, and where the next camera may ask for other levels.
    pub(super) fn complete(mut self) -> Result<Self, RenderError> {
        if self.pages.is_some() {
            return Ok(self);
        }
        if (self.bricks.is_none() || matches!(self.detail, Detail::ByDistance(_)))
            && let Some(boxes) = self.boxes.with_hierarchy(&self.volume)?
        {
            self.boxes = Arc::new(boxes);
        }
        Ok(self)
    }

    /// Like [`VolumeTracer::new`], with the boxes of hidden labels in the hierarchy, where rays skip them. It serves to measure what
    /// leaving them out saves.
    ///
    /// # Errors
    /// As [`VolumeTracer::new`].
    pub fn with_hidden_labels(instance: u32, traced: &TracedInstance) -> Result<Self, RenderError> {
        let labels = traced.volume.labels().len();
        let all = TracedInstance { visible: vec![true; labels], ..traced.clone() };
        let is_hidden = |label: usize| !traced.visible.get(label).copied().unwrap_or(false);
        Ok(Self { hidden: Some((0..labels).map(is_hidden).collect()), ..Self::new(instance, &all)? })
    }

    /// Adds bricks, which make rays faster. Adds none where boxes have different levels, or where the volume is too sparse. See also
    /// [`VolumeTracer::in_bricks`].
    ///
    /// # Errors
    /// [`RenderError::Memory`] where there is none for the list of the boxes that are drawn.
    pub fn with_bricks(mut self) -> Result<Self, RenderError> {
        self.wants_bricks = true;
        if self.pages.is_some() {
            return Ok(self);
        }
        // (Existing bricks are kept if they have the right level.)
        if self.bricks.as_ref().map(|bricks| *bricks.detail()) != self.level.map(Detail::Same) {
            self.bricks = match self.level {
                Some(level) => Bricks::new(&self.volume, &self.drawn()?, level).map(Arc::new),
                None => None,
            };
        }
        Ok(self)
    }

    /// Cuts these parts of the world away, and restores what was cut away before.
    #[must_use]
    pub fn with_cuts<'a>(mut self, shapes: impl IntoIterator<Item = &'a CutShape>) -> Self {
        self.cuts = Cuts::new(shapes, &self.placement.world_from_index);
        self
    }

    /// Shades voxels with smooth normals, or with those of their faces.
    ///
    /// # Errors
    /// [`RenderError::Memory`] where there is none for the neighbours of boxes.
    pub fn shaded_smooth(mut self, is_smooth: bool) -> Result<Self, RenderError> {
        if !is_smooth {
            self.neighbors = None;
        } else if self.pages.is_some() {
            return Err(refused("smooth shading of voxels (smooth_voxels)"));
        } else if self.neighbors.is_none() {
            let items = self.drawn()?;
            let drawn = items.iter().map(|&item| {
                let b = self.box_of(item);
                (item, self.label_of(item), BoxBounds { lo: b.origin, hi: self.clipped_end(&b) })
            });
            let drawn = collected(items.len(), drawn, "the neighbours of boxes")?;
            self.neighbors = Some(Arc::new(Neighbors::new(self.volume.boxes().len(), &drawn)?));
        }
        Ok(self)
    }

    /// Parts that are cut away.
    pub fn cuts(&self) -> &Cuts {
        &self.cuts
    }

    /// The same boxes at another placement, as another instance, or at other levels of detail. They share the hierarchy where it serves for
    /// both: at any placement, because it is in index space, and at any choice of levels except a change from [`LodChoice::Voxels`] to
    /// another or back (`None`). The result has no cuts.
    ///
    /// # Errors
    /// [`RenderError::Scene`] if the matrix is singular.
    pub fn again(
        &self,
        instance: u32,
        world_from_index: DAffine3,
        lod: LodChoice,
    ) -> Result<Option<Self>, RenderError> {
        if self.boxes.is_tight() != (lod == LodChoice::Voxels) {
            return Ok(None);
        }
        let detail = lod.placed(&world_from_index);
        if self.pages.as_ref().is_some_and(|pages| detail != *pages.detail()) {
            return Ok(None);
        }
        let placement = Placement::of_instance(instance, world_from_index)?;
        let again = Self {
            volume: Arc::clone(&self.volume),
            normals: normals(&placement),
            level: level_of(&self.boxes, &detail),
            detail,
            in_world: self.boxes.bounds().map(|bounds| WorldBounds::new(bounds, &placement)),
            placement,
            instance,
            boxes: Arc::clone(&self.boxes),
            bricks: self.bricks.clone(),
            pages: self.pages.clone(),
            wants_bricks: self.wants_bricks,
            cuts: Cuts::default(),
            hidden: self.hidden.clone(),
            widest: self.widest.clone(),
            neighbors: self.neighbors.clone(),
        };
        if self.wants_bricks { again.with_bricks()?.complete().map(Some) } else { Ok(Some(again)) }
    }

    /// Size on the heap in bytes of the hierarchy, the bricks, and the neighbours for smooth shading; and of the hierarchy and bricks of
    /// more labels that are kept for when these are shown again.
    pub fn bytes(&self) -> u64 {
        self.boxes.bytes()
            + self.brick_bytes()
            + self.neighbors.as_ref().map_or(0, |n| n.bytes())
            + self.widest.as_ref().map_or(0, |w| w.bytes_besides(self))
    }

    /// The part of [`VolumeTracer::bytes`] that bricks take.
    pub fn brick_bytes(&self) -> u64 {
        self.bricks.as_ref().map_or(0, |b| b.bytes()) + self.pages.as_ref().map_or(0, |p| p.bytes())
    }

    /// Indices of the boxes that are drawn, rising; none where these are not in memory.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn drawn(&self) -> Result<Vec<u32>, NoMemory> {
        if self.pages.is_some() {
            return Ok(Vec::new());
        }
        let mut items = self.boxes.items(&self.volume)?;
        items.retain(|&item| !self.is_hidden(item));
        Ok(items)
    }

    /// The volume.
    pub fn volume(&self) -> &Arc<CompressedVolume> {
        &self.volume
    }

    /// Its placement in the world.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// World bounds of the drawn boxes; `None` where there are none.
    pub(in super::super) fn world_bounds(&self) -> Option<WorldBounds> {
        self.in_world
    }

    /// Identifies the boxes: equal for all volumes that share them with their hierarchy, and for no other.
    pub(in super::super) fn hierarchy_address(&self) -> usize {
        Arc::as_ptr(&self.boxes).addr()
    }

    /// Levels of detail of its boxes.
    pub fn detail(&self) -> Detail {
        self.detail
    }

    /// Number of boxes, hidden ones of a hierarchy included.
    pub fn boxes(&self) -> usize {
        self.boxes.len()
    }
}

/// See [`Detail::everywhere`]; `None` where there are no boxes.
fn level_of(boxes: &DrawnBoxes, detail: &Detail) -> Option<DetailLevel> {
    boxes.bounds().and_then(|bounds| detail.everywhere(&bounds))
}
