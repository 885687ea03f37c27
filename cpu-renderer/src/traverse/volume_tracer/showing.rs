//! The same volume with other labels shown. What was built for many labels serves for fewer of them:
//!
//! ```text
//! shown before   shown now            boxes                                  bricks
//! the widest     the same labels      the widest                             the widest
//! the widest     most of them         the widest; hidden ones are skipped    copied, but where a hidden box reaches into
//! the widest     few of them          of the few; the widest are kept        built of the few
//! any            others               of these, the widest from now on       built
//! ```
//! Of a volume on disk, pages that have none of the labels that changed stay ([`super::pages`]).
//!
//! Every way draws the same picture, bit by bit.

use std::sync::Arc;

use pumice_transport::RenderError;
use pumice_transport::geometry::visible_boxes::count_visible;

use super::super::TracedInstance;
use super::VolumeTracer;
use super::pages::Former;

/// Rays skip hidden boxes while at least one of so many boxes in the hierarchy is shown; below that a hierarchy of these alone is built.
const MASKED_BOXES_A_SHOWN_ONE: u64 = 4;

/// The tracer of the most labels that were shown.
#[derive(Debug)]
pub(super) struct Widest {
    /// The labels that it draws, by dense index.
    labels: Vec<bool>,
    tracer: VolumeTracer,
}

impl Widest {
    /// Size on the heap in bytes of what `drawn` does not use itself.
    pub(super) fn bytes_besides(&self, drawn: &VolumeTracer) -> u64 {
        let Self { tracer, .. } = self;
        let boxes = if Arc::ptr_eq(&tracer.boxes, &drawn.boxes) { 0 } else { tracer.boxes.bytes() };
        let shares_bricks = match (&tracer.bricks, &drawn.bricks) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        boxes + if shares_bricks { 0 } else { tracer.brick_bytes() }
    }

    fn covers(&self, visible: &[bool]) -> bool {
        visible.iter().zip(&self.labels).all(|(visible, has)| !visible || *has)
    }
}

impl VolumeTracer {
    /// The tracer of another choice of labels, with flat voxels and without cuts; and whether boxes were gathered for it. `before` are
    /// the labels that `self` draws.
    ///
    /// # Errors
    /// As [`VolumeTracer::new`].
    pub fn showing(
        &self,
        before: &[bool],
        instance: u32,
        traced: &TracedInstance,
    ) -> Result<(Self, bool), RenderError> {
        if let Some(pages) = traced.volume.pages() {
            let former = self.pages.as_deref().map(|paged| Former { paged, visible: before });
            return Ok((Self::in_pages(instance, traced, pages, former)?, true));
        }
        let place = |tracer: &Self| tracer.again(instance, traced.world_from_index, traced.lod);
        let (labels, wide) = match &self.widest {
            Some(widest) => (widest.labels.clone(), place(&widest.tracer)?),
            None => (before.to_vec(), place(self)?),
        };
        let visible = &traced.visible;
        let Some(tracer) = wide else { return built(instance, traced, None) };
        let widest = Widest { labels, tracer: Self { neighbors: None, widest: None, ..tracer } };
        if !widest.covers(visible) {
            return built(instance, traced, None);
        }
        let shown = count_visible(&self.volume, visible);
        if shown.saturating_mul(MASKED_BOXES_A_SHOWN_ONE) < widest.tracer.boxes.len() as u64 {
            return built(instance, traced, Some(Arc::new(widest)));
        }
        if widest.labels == *visible {
            return Ok((widest.tracer, false));
        }
        let hidden: Arc<[bool]> = visible.iter().map(|visible| !visible).collect();
        let wide = widest.tracer.clone();
        let bricks = wide.bricks.as_ref().and_then(|bricks| bricks.without(&self.volume, &hidden));
        let widest = Some(Arc::new(widest));
        let shown = Self { bricks: bricks.map(Arc::new), hidden: Some(hidden), widest, ..wide };
        Ok((shown.complete()?, false))
    }
}

fn built(
    instance: u32,
    traced: &TracedInstance,
    widest: Option<Arc<Widest>>,
) -> Result<(VolumeTracer, bool), RenderError> {
    Ok((VolumeTracer { widest, ..VolumeTracer::in_bricks(instance, traced)? }, true))
}
