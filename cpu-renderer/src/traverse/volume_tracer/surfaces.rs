//! Surfaces of a volume: the face through which a ray leaves a label, which of several faces at one place is open, caps where a ray starts
//! or ends within a label, and the element (voxel, cell or box) that a surface belongs to.

use pumice_core::{BoxPlace, BoxView};
use pumice_transport::geometry::lod::DetailLevel;
use pumice_transport::geometry::visible_boxes::clipped_end;
use pumice_transport::geometry::{TIE, each_axis};
use pumice_transport::{BoxBounds, Hit, Surface, SurfaceKind};

use super::super::IndexRay;
use super::super::box_walk::{Crossing, Walk};
use super::VolumeTracer;

/// How a ray that starts in a label leaves it.
pub(super) enum Left {
    /// Through a face.
    Through(Hit),
    /// Not before the end of the queried range.
    Within,
    /// Unknown: the ray starts on the very edge of the label.
    Nowhere,
}

/// Where a ray leaves a box, or a label within it.
struct WayOut {
    step: Crossing,
    /// Whether the label reached to the end of the box, so that another box may go on with it.
    left_box: bool,
    item: u32,
}

impl VolumeTracer {
    /// The face through which a ray that starts in `voxel` of `label` leaves the label.
    pub(super) fn leave(&self, ray: &IndexRay, label: u32, voxel: [u32; 3], t_max: f64) -> Left {
        let mut t = 0.0f64;
        let Some(mut way) = self.way_out(ray, label, voxel, t) else { return Left::Nowhere };
        loop {
            let WayOut { step, left_box, item } = way;
            if step.t >= t_max {
                return Left::Within;
            }
            let after = t.max(step.t);
            match if left_box { self.way_out(ray, label, step.voxel, after) } else { None } {
                Some(next) => (way, t) = (next, after),
                None => {
                    let step =
                        if step.tied.is_power_of_two() { step } else { self.face_out(ray, step, label) };
                    return match step.t {
                        t if t <= 0.0 => Left::Nowhere,
                        t if t >= t_max => Left::Within,
                        _ => Left::Through(self.hit(ray, &step, item, label, true)),
                    };
                }
            }
        }
    }

    /// Where a ray at scaled `t` in `voxel` leaves the box of `label` there, or the label within it; `None` where there is no such box.
    fn way_out(&self, ray: &IndexRay, label: u32, voxel: [u32; 3], t: f64) -> Option<WayOut> {
        if let Some(pages) = &self.pages {
            return pages.with(voxel)?.tracer().way_out(ray, label, voxel, t);
        }
        let item = self.item_with(label, voxel)?;
        let b = self.box_of(item);
        let walk = Walk::begin_in(ray, b.origin, self.clipped_end(&b), t, Some(voxel));
        let (step, left_box) = walk.last_solid(ray, &b, self.detail.level(b.origin, b.extent));
        Some(WayOut { step, left_box, item })
    }

    /// For a hit near an edge of the voxel, where the ray meets several faces at the same t within the walk's precision. Returns the face
    /// that was found if no queried voxel is in front of it, otherwise the first other face that is open in this sense, if any. A path that
    /// continued from a face between two solid voxels would start inside one of them.
    #[cold]
    pub(super) fn open_face(
        &self,
        ray: &IndexRay,
        step: Crossing,
        t_max: f64,
        only: Option<u32>,
    ) -> Crossing {
        let is_open = |face: &Crossing| {
            let (a, mut before) = (face.axis, step.voxel);
            before[a] = if ray.is_down(a) { before[a].wrapping_add(1) } else { before[a].wrapping_sub(1) };
            match only {
                None => self.label_at(before).is_none(),
                Some(label) => !self.has(label, before),
            }
        };
        let others = (0..3).map(|a| step.through(a, ray)).filter(|face| {
            let t = face.t;
            t >= step.t - TIE && t > 0.0 && t < t_max
        });
        std::iter::once(step).chain(others).find(is_open).unwrap_or(step)
    }

    /// The same for a ray that leaves `label`: of the faces crossed at once, the first that does not have `label` behind it.
    #[cold]
    pub(super) fn face_out(&self, ray: &IndexRay, step: Crossing, label: u32) -> Crossing {
        let last = step.voxel_before(ray);
        let is_open = |&a: &usize| {
            let mut behind = last;
            behind[a] = step.voxel[a];
            !self.has(label, behind)
        };
        let mut tied = (0..3).filter(|a| step.tied >> a & 1 != 0);
        tied.find(is_open).map_or(step, |a| step.through(a, ray))
    }

    /// The box of `label` that has an element at `voxel`.
    pub(super) fn item_with(&self, label: u32, voxel: [u32; 3]) -> Option<u32> {
        let mut found = None;
        self.for_each_box_near(voxel, |item| {
            if self.holds(item, voxel) && self.label_of(item) == label {
                found = Some(item);
            }
            found.is_none()
        });
        found
    }

    /// Whether a box of `label` has an element at `voxel`.
    fn has(&self, label: u32, voxel: [u32; 3]) -> bool {
        match &self.pages {
            None => self.item_with(label, voxel).is_some(),
            Some(pages) => pages.with(voxel).is_some_and(|page| page.tracer().has(label, voxel)),
        }
    }

    /// Place of the box of `label` that has an element at `voxel`.
    pub(super) fn place_with(&self, label: u32, voxel: [u32; 3]) -> Option<BoxPlace> {
        match &self.pages {
            None => self.item_with(label, voxel).map(|item| self.volume.place_of_box(item as usize)),
            Some(pages) => pages.with(voxel)?.tracer().place_with(label, voxel),
        }
    }

    /// Calls `visit` with the boxes that may hold `voxel`, until it returns false. No box that holds the voxel is left out.
    pub(super) fn for_each_box_near(&self, voxel: [u32; 3], mut visit: impl FnMut(u32) -> bool) {
        match (&self.bricks, self.boxes.hierarchy()) {
            (Some(bricks), _) => {
                if let Some(brick) = bricks.brick_with(voxel) {
                    bricks.boxes_near(brick, voxel).all(visit);
                }
            }
            (None, Some(hierarchy)) => hierarchy.at_voxel(voxel, &mut visit),
            (None, None) => {}
        }
    }

    pub(super) fn holds(&self, item: u32, voxel: [u32; 3]) -> bool {
        if self.is_hidden(item) {
            return false;
        }
        let place = self.volume.place_of_box(item as usize);
        let hi = clipped_end(place.origin, place.extent, self.volume.info().dims);
        if !(BoxBounds { lo: place.origin, hi }).contains(voxel) {
            return false;
        }
        let level = self.detail.level(place.origin, place.extent);
        if level == DetailLevel::Boxes {
            return true;
        }
        let b = self.volume.box_at(&place);
        match level {
            DetailLevel::Boxes => true,
            DetailLevel::Cells => b.node.occupied >> number_in(&b, voxel, 2) & 1 != 0,
            DetailLevel::Voxels => b.node.has(number_in(&b, voxel, 2), number_in(&b, voxel, 0)),
        }
    }

    pub(super) fn hit(
        &self,
        ray: &IndexRay,
        step: &Crossing,
        item: u32,
        label: u32,
        from_inside: bool,
    ) -> Hit {
        let axis = step.axis;
        let positive = ray.is_down(axis) != from_inside;
        let voxel = if from_inside { step.voxel_before(ray) } else { step.voxel };
        // (A box of a page has no number here.)
        let place = || match &self.pages {
            None => Some(self.volume.place_of_box(item as usize)),
            Some(_) => self.place_with(label, voxel),
        };
        let level = self.level.or_else(|| place().map(|b| self.detail.level(b.origin, b.extent)));
        let element = match level {
            Some(DetailLevel::Cells) => voxel.map(|v| v & !3),
            Some(DetailLevel::Boxes) => place().map_or(voxel, |b| b.origin),
            // (None: a page that cannot be read, whose picture is not shown.)
            Some(DetailLevel::Voxels) | None => voxel,
        };
        Hit {
            t: ray.world_t(axis, step.plane),
            surface: Surface {
                instance: self.instance,
                kind: SurfaceKind::Face,
                voxel: element,
                axis: axis as u8,
                positive,
                plane: step.plane,
                label,
            },
            normal_in_world: self.normals[axis][usize::from(positive)],
            from_inside,
        }
    }

    /// The cap at scaled `t` in a plane of the cuts.
    #[cold]
    pub(super) fn cap(
        &self,
        ray: &IndexRay,
        t: f64,
        plane: u32,
        label: u32,
        voxel: [u32; 3],
        from_inside: bool,
    ) -> Hit {
        Hit {
            t: t / ray.scaled_from_world,
            surface: Surface {
                instance: self.instance,
                kind: SurfaceKind::Cap,
                voxel,
                axis: 0,
                positive: false,
                plane,
                label,
            },
            normal_in_world: self.cuts.planes()[plane as usize].normal_in_world,
            from_inside,
        }
    }

    /// The voxel that contains the ray at scaled `t`.
    pub(super) fn voxel_at(&self, ray: &IndexRay, t: f64) -> [u32; 3] {
        let dims = self.volume.info().dims;
        each_axis(|a| {
            let at = (ray.origin[a] + t * ray.direction[a]).floor();
            at.clamp(0.0, f64::from(dims[a] - 1)) as u32
        })
    }

    /// One past the highest voxel of a surface's element.
    #[inline(always)]
    pub(super) fn element_end(&self, surface: &Surface) -> [u32; 3] {
        let dims = self.volume.info().dims;
        match self.level {
            Some(DetailLevel::Voxels) => surface.voxel.map(|v| v.saturating_add(1)),
            Some(DetailLevel::Cells) => cell_end(surface.voxel, dims),
            _ => self.coarse_element_end(surface),
        }
    }

    pub(super) fn coarse_element_end(&self, surface: &Surface) -> [u32; 3] {
        let voxel_end = surface.voxel.map(|v| v.saturating_add(1));
        let Some(b) = self.place_with(surface.label, surface.voxel) else { return voxel_end };
        let hi = clipped_end(b.origin, b.extent, self.volume.info().dims);
        match self.detail.level(b.origin, b.extent) {
            DetailLevel::Voxels => voxel_end,
            DetailLevel::Cells => cell_end(surface.voxel, hi),
            DetailLevel::Boxes => hi,
        }
    }

    /// One past the box's highest voxel within the volume.
    #[inline(always)]
    pub(super) fn clipped_end(&self, b: &BoxView) -> [u32; 3] {
        clipped_end(b.origin, b.extent, self.volume.info().dims)
    }
}

/// One past the highest voxel of the cell that contains `voxel`, at most `end`.
#[inline(always)]
fn cell_end(voxel: [u32; 3], end: [u32; 3]) -> [u32; 3] {
    each_axis(|a| (voxel[a] | 3).saturating_add(1).min(end[a]))
}

/// Index of the cell (`shift` 2), or of the voxel within its cell (`shift` 0): x + 4y + 16z.
fn number_in(b: &BoxView, voxel: [u32; 3], shift: u32) -> u32 {
    let part = |a: usize| (voxel[a] - b.origin[a]) >> shift & 3;
    part(0) | part(1) << 2 | part(2) << 4
}
