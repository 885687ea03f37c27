//! The nearest face along a ray, by bricks or by the hierarchy of boxes.
//!
//! Bricks have all labels merged: the first voxel that they find is the nearest of all. Where one label is asked for, they say which boxes
//! of it are near the ray, and these are walked through as those that the hierarchy finds.

use pumice_transport::geometry::bricks::Bricks;
use pumice_transport::geometry::bvh::LARGEST_INVERSE;
use pumice_transport::geometry::each_axis;
use pumice_transport::geometry::lod::DetailLevel;
use pumice_transport::geometry::visible_boxes::clipped_end;
use pumice_transport::{Bvh, BvhRay};

use super::super::IndexRay;
use super::super::box_walk::{Crossing, Found, Walk};
use super::super::brick_walk::{InBricks, first_voxel, for_each_brick_along};
use super::super::f64x4::Plain;
use super::super::ray_box_mask::RayBoxMask;
use super::VolumeTracer;
use super::pages::PagedBricks;

/// The nearest result among the boxes along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) enum Nearest {
    Nothing,
    Inside { label: u32, voxel: [u32; 3] },
    Face { step: Crossing, item: u32, label: u32 },
}

impl VolumeTracer {
    /// The nearest face with scaled t in (`start`, `t_max`), or the state at `start`. With `any`, the first face that is found.
    ///
    /// Each call site has its own `KIND`: the function that visits a box then has only one caller, and the compiler inlines it.
    #[inline(always)]
    pub(in super::super) fn nearest<P: RayBoxMask, const KIND: u8>(
        &self,
        by: P,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
        only: Option<u32>,
        any: bool,
    ) -> Nearest {
        match (&self.bricks, only) {
            (Some(bricks), None) => return self.nearest_in_bricks(by, bricks, ray, start, t_max),
            (Some(bricks), Some(label)) => {
                return self.nearest_of_label(bricks, ray, start, t_max, label, any);
            }
            (None, _) => {}
        }
        if let Some(pages) = &self.pages {
            return self.nearest_in_pages(pages, ray, start, t_max, only, any);
        }
        let mut search = Search { best: Nearest::Nothing, best_t: t_max, start, t_max, only, any };
        let along = self.boxes.hierarchy().and_then(|h| Some((h, bvh_ray(h, ray, start, t_max)?)));
        let Some((hierarchy, (moved, enter_all))) = along else { return Nearest::Nothing };
        let limit = |t: f64| (t - enter_all) as f32 * 1.000_001 + moved.pad;
        hierarchy.along_ray(&moved, limit(t_max), |item| {
            let is_enough = !self.is_hidden(item) && search.visit(self, ray, item);
            if is_enough { -1.0 } else { limit(search.best_t) }
        });
        search.found(self)
    }

    /// [`VolumeTracer::nearest`] of one label, in bricks.
    #[cold]
    #[inline(never)]
    fn nearest_of_label(
        &self,
        bricks: &Bricks,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
        label: u32,
        any: bool,
    ) -> Nearest {
        if self.hidden.as_ref().is_some_and(|hidden| hidden.get(label as usize).copied().unwrap_or(true)) {
            return Nearest::Nothing;
        }
        let mut search = Search::of_label(label, start, t_max, any);
        for_each_brick_along(Plain, bricks, ray, start, t_max, |_, brick| {
            search.visit_brick(self, bricks, ray, brick, label)
        });
        search.found(self)
    }

    /// [`VolumeTracer::nearest`] in pages. The box of a face has its number in the page, which nothing asks for.
    #[cold]
    #[inline(never)]
    fn nearest_in_pages(
        &self,
        pages: &PagedBricks,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
        only: Option<u32>,
        any: bool,
    ) -> Nearest {
        let Some(label) = only else { return self.find_first_in_pages(pages, ray, start, t_max) };
        let mut search = Search::of_label(label, start, t_max, any);
        for_each_brick_along(Plain, pages, ray, start, t_max, |page, brick| {
            search.visit_brick(page.tracer(), page, ray, brick, label)
        });
        search.found(self)
    }

    /// [`VolumeTracer::nearest`] of all labels, in pages. (`KIND` as in [`VolumeTracer::nearest`].)
    #[inline(always)]
    pub(in super::super) fn first_in_pages<P: RayBoxMask, const KIND: u8>(
        &self,
        by: P,
        pages: &PagedBricks,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
    ) -> Nearest {
        match first_voxel(by, pages, ray, start, t_max) {
            Some((first, page)) => page.tracer().with_its_box(&page, first),
            None => Nearest::Nothing,
        }
    }

    /// [`VolumeTracer::nearest`] in bricks, which are visited in order: the first result is the nearest.
    #[inline(always)]
    fn nearest_in_bricks<P: RayBoxMask>(
        &self,
        by: P,
        bricks: &Bricks,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
    ) -> Nearest {
        match first_voxel(by, bricks, ray, start, t_max) {
            Some((first, _)) => self.with_its_box(bricks, first),
            None => Nearest::Nothing,
        }
    }

    /// A voxel that was found in bricks, with the box that it belongs to.
    #[inline(always)]
    pub(super) fn with_its_box(&self, bricks: &Bricks, InBricks { found, brick }: InBricks) -> Nearest {
        let box_with = |voxel| bricks.box_with(&self.volume, brick, voxel, |item| self.holds(item, voxel));
        let label_of = |item| bricks.label_of(&self.volume, item);
        let nearest = match found {
            Found::Nothing => None,
            Found::Inside(voxel) => {
                box_with(voxel).map(|item| Nearest::Inside { label: label_of(item), voxel })
            }
            Found::Face(step) => {
                box_with(step.voxel).map(|item| Nearest::Face { step, item, label: label_of(item) })
            }
        };
        nearest.unwrap_or(Nearest::Nothing)
    }
}

/// A search among boxes that come in any order.
struct Search {
    best: Nearest,
    /// A hit beyond it cannot win; a hit at it may, by its label.
    best_t: f64,
    start: f64,
    t_max: f64,
    only: Option<u32>,
    any: bool,
}

impl Search {
    fn of_label(label: u32, start: f64, t_max: f64, any: bool) -> Self {
        Self { best: Nearest::Nothing, best_t: t_max, start, t_max, only: Some(label), any }
    }

    /// Walks through the boxes of a label that reach into a brick. Returns up to which t others are wanted.
    fn visit_brick(
        &mut self,
        tracer: &VolumeTracer,
        bricks: &Bricks,
        ray: &IndexRay,
        brick: usize,
        label: u32,
    ) -> f64 {
        // (A box that reaches into several bricks is walked through again, with the same result.)
        for &item in bricks.items_of(brick) {
            if bricks.label_of(&tracer.volume, item) == label && self.visit(tracer, ray, item) {
                return f64::NEG_INFINITY;
            }
        }
        self.best_t
    }

    /// Label of a box; where one is asked for, all boxes have it.
    #[inline(always)]
    fn label_of(&self, tracer: &VolumeTracer, item: u32) -> u32 {
        match self.only {
            Some(label) => label,
            None => tracer.label_of(item),
        }
    }

    /// Walks through a box that is drawn. Returns whether no other box needs to be visited.
    #[inline(always)]
    fn visit(&mut self, tracer: &VolumeTracer, ray: &IndexRay, item: u32) -> bool {
        let Self { start, t_max, only, any, .. } = *self;
        let place = tracer.volume.place_of_box(item as usize);
        let hi = clipped_end(place.origin, place.extent, tracer.volume.info().dims);
        let (enter, leave) = ray.clip(place.origin, hi, start);
        if enter >= leave || enter > self.best_t {
            return false;
        }
        let walk = Walk::begin(ray, place.origin, hi, enter);
        // The content of the box is read only where it matters.
        let found = match tracer.detail.level(place.origin, place.extent) {
            DetailLevel::Boxes => walk.whole_box(ray, enter == start),
            level => walk.first_solid(ray, &tracer.volume.box_at(&place), level, enter == start),
        };
        match found {
            Found::Nothing => {}
            Found::Face(step) if step.t >= t_max || step.t > self.best_t => {}
            Found::Inside(_) | Found::Face(_) if only.is_some_and(|l| l != tracer.label_of(item)) => {}
            Found::Inside(voxel) => {
                let found = tracer.label_of(item);
                if !matches!(self.best, Nearest::Inside { label, .. } if label <= found) {
                    self.best = Nearest::Inside { label: found, voxel };
                }
                // With `any`, faces are still searched: otherwise the order of the two results would matter.
                self.best_t = if any { self.best_t } else { start };
            }
            Found::Face(step) => {
                let wins = match &self.best {
                    Nearest::Nothing => true,
                    Nearest::Inside { .. } => any,
                    Nearest::Face { step: other, item: other_item, .. } => {
                        step.t < other.t
                            || (self.label_of(tracer, item), step.voxel)
                                < (self.label_of(tracer, *other_item), other.voxel)
                    }
                };
                if wins {
                    self.best_t = step.t;
                    // (The label is looked up when no nearer hit is possible.)
                    self.best = Nearest::Face { step, item, label: u32::MAX };
                    return any;
                }
            }
        }
        false
    }

    fn found(self, tracer: &VolumeTracer) -> Nearest {
        match self.best {
            Nearest::Face { step, item, .. } => {
                Nearest::Face { step, item, label: self.label_of(tracer, item) }
            }
            other => other,
        }
    }
}

/// The ray moved to the hierarchy's bounds, and the scaled t of the move.
#[inline(always)]
pub(in super::super) fn bvh_ray(bvh: &Bvh, ray: &IndexRay, start: f64, t_max: f64) -> Option<(BvhRay, f64)> {
    let bounds = bvh.bounds()?;
    let (enter, leave) = ray.clip(bounds.lo, bounds.hi, start);
    if enter >= leave || enter >= t_max {
        return None;
    }
    let far = ray.origin.iter().fold(enter, |m, o| m.max(o.abs()));
    Some((
        BvhRay {
            origin: each_axis(|a| {
                let at = ray.origin[a] + enter * ray.direction[a];
                at.clamp(f64::from(bounds.lo[a]), f64::from(bounds.hi[a])) as f32
            }),
            // A component below 2⁻⁶⁰ moves the ray by less than 2⁻³⁶ voxels within the largest volume, far less than the pad.
            inverse: each_axis(|a| ray.inverse[a].clamp(-LARGEST_INVERSE, LARGEST_INVERSE) as f32),
            // Three f64 roundings of the move.
            pad: bvh.pad() + (far * 4.0 * f64::EPSILON) as f32,
        },
        enter,
    ))
}
