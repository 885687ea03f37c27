//! What a [`VolumeTracer`] is made of, before a ray is traced: its hierarchy, its bricks, its cuts; and what they take.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use pumice_core::CompressedVolume;
use pumice_scene::CutShape;
use pumice_transport::geometry::LodChoice;
use pumice_transport::geometry::bricks::Bricks;
use pumice_transport::geometry::cuts::Cuts;
use pumice_transport::geometry::instance_tree::WorldBounds;
use pumice_transport::geometry::lod::{Detail, DetailLevel};
use pumice_transport::geometry::neighbors::Neighbors;
use pumice_transport::geometry::placement::Placement;
use pumice_transport::geometry::visible_boxes::visible_boxes;
use pumice_transport::{BoxBounds, Bvh, RenderError};

use super::super::TracedInstance;
use super::VolumeTracer;

fn normals(placement: &Placement) -> [[DVec3; 2]; 3] {
    [0, 1, 2].map(|a| [placement.normal(a, false), placement.normal(a, true)])
}

impl VolumeTracer {
    /// Builds the hierarchy over the boxes of visible labels.
    ///
    /// # Errors
    /// [`RenderError::Scene`] when the matrix is singular or there are too many boxes to number.
    pub fn new(instance: u32, traced: &TracedInstance) -> Result<Self, RenderError> {
        let TracedInstance { volume, world_from_index, visible, lod } = traced;
        let placement = Placement::of_instance(instance, *world_from_index)?;
        if volume.boxes().len() as u64 >> 32 != 0 {
            return Err(RenderError::Scene(format!(
                "instances[{instance}]: {} boxes are more than the limit of 2^32 of one instance",
                volume.boxes().len()
            )));
        }
        let tight = *lod == LodChoice::Voxels;
        let bvh = Arc::new(Bvh::build(visible_boxes(volume, visible, tight))?);
        let detail = lod.placed(world_from_index);
        Ok(Self {
            volume: Arc::clone(volume),
            normals: normals(&placement),
            level: level_of(&bvh, &detail),
            detail,
            placement,
            instance,
            bvh,
            bricks: None,
            wants_bricks: false,
            tight,
            cuts: Cuts::default(),
            hidden: None,
            neighbors: None,
        })
    }

    /// The same with the boxes of hidden labels in the hierarchy, where rays pass over them: what it saves to leave them out can be
    /// measured against it.
    ///
    /// # Errors
    /// As [`VolumeTracer::new`].
    pub fn with_hidden_labels(instance: u32, traced: &TracedInstance) -> Result<Self, RenderError> {
        let labels = traced.volume.labels().len();
        let all = TracedInstance { visible: vec![true; labels], ..traced.clone() };
        let is_hidden = |label: usize| !traced.visible.get(label).copied().unwrap_or(false);
        Ok(Self { hidden: Some((0..labels).map(is_hidden).collect()), ..Self::new(instance, &all)? })
    }

    /// With bricks beside the hierarchy: more bytes, and rays in less time. Without them where boxes have different levels, and where the
    /// volume is too sparse.
    #[must_use]
    pub fn with_bricks(mut self) -> Self {
        self.wants_bricks = true;
        // (Kept ones are of the level that they were made for.)
        if self.bricks.as_ref().map(|bricks| bricks.level()) != self.level {
            let drawn = self.bvh.items().iter().copied().filter(|&item| !self.is_hidden(item));
            let made =
                self.level.and_then(|level| Bricks::new(&self.volume, &drawn.collect::<Vec<_>>(), level));
            self.bricks = made.map(Arc::new);
        }
        self
    }

    /// Takes these parts of the world away, and puts back what was taken before.
    #[must_use]
    pub fn with_cuts<'a>(mut self, shapes: impl IntoIterator<Item = &'a CutShape>) -> Self {
        self.cuts = Cuts::new(shapes, &self.placement.world_from_index);
        self
    }

    /// Shades voxels by how their label falls off about them, or again as they lie.
    #[must_use]
    pub fn shaded_smooth(mut self, is_smooth: bool) -> Self {
        if !is_smooth {
            self.neighbors = None;
        } else if self.neighbors.is_none() {
            let drawn = self.drawn().iter().map(|&item| {
                let b = self.box_of(item);
                (item, self.label_of(item), BoxBounds { lo: b.origin, hi: self.clipped_end(&b) })
            });
            let drawn: Vec<_> = drawn.collect();
            self.neighbors = Some(Arc::new(Neighbors::new(self.volume.boxes().len(), &drawn)));
        }
        self
    }

    /// What is taken away.
    pub fn cuts(&self) -> &Cuts {
        &self.cuts
    }

    /// The same boxes elsewhere, as another instance or at other levels of detail, where the hierarchy serves for both and is shared: at
    /// any place, for it is of index space, and at any choice of levels but from [`LodChoice::Voxels`] to another or back (`None`). Nothing is cut.
    ///
    /// # Errors
    /// [`RenderError::Scene`] when the matrix is singular.
    pub fn again(
        &self,
        instance: u32,
        world_from_index: DAffine3,
        lod: LodChoice,
    ) -> Result<Option<Self>, RenderError> {
        if self.tight != (lod == LodChoice::Voxels) {
            return Ok(None);
        }
        let placement = Placement::of_instance(instance, world_from_index)?;
        let detail = lod.placed(&world_from_index);
        let again = Self {
            volume: Arc::clone(&self.volume),
            normals: normals(&placement),
            level: level_of(&self.bvh, &detail),
            detail,
            placement,
            instance,
            bvh: Arc::clone(&self.bvh),
            bricks: self.bricks.clone(),
            wants_bricks: self.wants_bricks,
            tight: self.tight,
            cuts: Cuts::default(),
            hidden: self.hidden.clone(),
            neighbors: self.neighbors.clone(),
        };
        Ok(Some(if self.wants_bricks { again.with_bricks() } else { again }))
    }

    /// Heap bytes of the hierarchy, of bricks, and of what smooth shading needs besides.
    pub fn bytes(&self) -> u64 {
        self.bvh.bytes() + self.brick_bytes() + self.neighbors.as_ref().map_or(0, |n| n.bytes())
    }

    /// How many of them are of bricks.
    pub fn brick_bytes(&self) -> u64 {
        self.bricks.as_ref().map_or(0, |b| b.bytes())
    }

    /// Numbers of the boxes that are drawn.
    pub fn drawn(&self) -> &[u32] {
        self.bvh.items()
    }

    /// The volume.
    pub fn volume(&self) -> &Arc<CompressedVolume> {
        &self.volume
    }

    /// Where it is.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Where what is drawn of it is in the world; `None` where nothing is.
    pub(in super::super) fn world_bounds(&self) -> Option<WorldBounds> {
        self.bvh.bounds().map(|bounds| WorldBounds::new(bounds, &self.placement))
    }

    /// The same for all that share its hierarchy, and for no other.
    pub(in super::super) fn hierarchy_address(&self) -> usize {
        Arc::as_ptr(&self.bvh).addr()
    }

    /// Levels of its boxes.
    pub fn detail(&self) -> Detail {
        self.detail
    }

    /// Number of boxes that are drawn.
    pub fn boxes(&self) -> usize {
        self.bvh.len()
    }
}

/// See [`Detail::everywhere`]; of no box, none.
fn level_of(bvh: &Bvh, detail: &Detail) -> Option<DetailLevel> {
    bvh.bounds().and_then(|bounds| detail.everywhere(&bounds))
}
