//! One instance of a volume: its hierarchy, and the questions that rays ask of it.

mod making;

use std::sync::Arc;

use glam::DVec3;
use pumice_core::{BoxView, CompressedVolume};
use pumice_transport::geometry::bricks::{BrickPart, Bricks};
use pumice_transport::geometry::bvh::LARGEST_INVERSE;
use pumice_transport::geometry::cuts::Cuts;
use pumice_transport::geometry::lod::{Detail, DetailLevel};
use pumice_transport::geometry::neighbors::Neighbors;
use pumice_transport::geometry::placement::Placement;
use pumice_transport::geometry::visible_boxes::clipped_end;
use pumice_transport::geometry::voxel_normals::falling_off;
use pumice_transport::geometry::{TIE, each_axis};
use pumice_transport::{BoxBounds, Bvh, BvhRay, Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};

use super::IndexRay;
use super::box_walk::{Crossing, Found, Walk};
use super::brick_walk::{InBricks, first_voxel};
use super::cut_ray::CutRay;
use super::f64x4::{Instructions, Plain};
use super::index_ray::{Start, surface_of};
use super::ray_box_mask::RayBoxMask;

/// Geometry of one instance.
#[derive(Debug)]
pub struct VolumeTracer {
    volume: Arc<CompressedVolume>,
    placement: Placement,
    instance: u32,
    /// Items are numbers of boxes.
    bvh: Arc<Bvh>,
    /// What is drawn, all labels in one, where there is such a form: it answers what does not ask for one label.
    bricks: Option<Arc<Bricks>>,
    /// Whether there shall be such a form where there can be.
    wants_bricks: bool,
    detail: Detail,
    /// The level of all boxes, where it is one for certain: then no surface asks its box which element it is of.
    level: Option<DetailLevel>,
    /// Whether the hierarchy's bounds are those of the voxels, at which level every box is. Otherwise they are the boxes' own, which hold
    /// every level.
    tight: bool,
    /// Outward normals in the world: lower and upper face of each axis.
    normals: [[DVec3; 2]; 3],
    /// What is taken away.
    cuts: Cuts,
    /// Labels that are in the hierarchy and not drawn.
    hidden: Option<Arc<[bool]>>,
    /// Where voxels are shaded smooth.
    neighbors: Option<Arc<Neighbors>>,
}

/// How a ray that starts in a label leaves it.
enum Left {
    /// Through a face.
    Through(Hit),
    /// Not before the end of what was asked about.
    Within,
    /// Nowhere that can be told: the ray starts on the label's very edge.
    Nowhere,
}

/// What the nearest of the boxes along a ray answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Nearest {
    Nothing,
    Inside { label: u32, voxel: [u32; 3] },
    Face { step: Crossing, item: u32, label: u32 },
}

impl VolumeTracer {
    /// Dense index of the visible label at `voxel`, at the level of detail that is drawn: the lowest where several are.
    pub fn label_at(&self, voxel: [u32; 3]) -> Option<u32> {
        let mut label = None;
        self.bvh.at_voxel(voxel, |item| {
            if self.holds(item, voxel) {
                let found = self.label_of(item);
                label = Some(label.map_or(found, |l: u32| l.min(found)));
            }
            // Voxels belong to one label; coarser elements overlap.
            label.is_none() || self.level != Some(DetailLevel::Voxels)
        });
        label
    }

    /// The next t in (0, `t_max`) where the ray enters label `label` or, when it starts inside of it, leaves it
    /// (`from_inside`). Other labels are as if they were not there; seams between boxes of the label are no surfaces.
    pub fn next_boundary(&self, ray: &RayInWorld, label: u32, from: PathOrigin, t_max: f64) -> Option<Hit> {
        let r = self.index_ray(Plain, ray, from)?;
        let t_max = r.scaled_t(t_max);
        if self.cuts.is_empty() {
            return self.surface_along(&r, t_max, Some(label));
        }
        self.kept_surface_along(&self.cut_ray(&r, ray, from), t_max, Some(label), false)
    }

    /// [`Tracer::first_hit`], where nothing farther than `best` is of interest.
    #[inline]
    pub(super) fn first_hit_within(
        &self,
        ray: &RayInWorld,
        from: PathOrigin,
        t_max: f64,
        best: f64,
    ) -> Option<Hit> {
        if self.cuts.is_empty() {
            return self.first_hit_uncut(ray, from, t_max, best);
        }
        let r = self.index_ray(Plain, ray, from)?;
        let t_max = r.reach(t_max, best);
        self.kept_surface_along(&self.cut_ray(&r, ray, from), t_max, None, false)
    }

    /// The same where nothing is cut. (A `KIND` as [`VolumeTracer::nearest`] has one.)
    #[inline(always)]
    pub(super) fn first_hit_by<P: RayBoxMask, const KIND: u8>(
        &self,
        by: P,
        ray: &RayInWorld,
        from: PathOrigin,
        t_max: f64,
        best: f64,
    ) -> Option<Hit> {
        let r = self.index_ray(by, ray, from)?;
        let t_max = r.reach(t_max, best);
        let nearest = self.nearest::<P, KIND>(by, &r, 0.0, t_max, None, false);
        self.surface_of_nearest(&r, nearest, t_max, None)
    }

    /// [`Tracer::occluded`] where nothing is cut. (A `KIND` as [`VolumeTracer::nearest`] has one.)
    #[inline(always)]
    pub(super) fn occluded_by<P: RayBoxMask, const KIND: u8>(
        &self,
        by: P,
        ray: &RayInWorld,
        from: PathOrigin,
        t_max: f64,
    ) -> bool {
        let Some(r) = self.index_ray(by, ray, from) else { return false };
        let t_max = r.scaled_t(t_max);
        match self.nearest::<P, KIND>(by, &r, 0.0, t_max, None, any_will_do(from)) {
            Nearest::Nothing => false,
            Nearest::Face { .. } => true,
            Nearest::Inside { label, voxel } => {
                matches!(self.leave(&r, label, voxel, t_max), Left::Through(_))
            }
        }
    }

    #[inline(always)]
    fn index_ray<I: Instructions>(&self, by: I, ray: &RayInWorld, from: PathOrigin) -> Option<IndexRay> {
        let start = match surface_of(from, self.instance) {
            None => Start::Free,
            Some(face) if face.kind == SurfaceKind::Face => Start::Face(face, self.element_end(&face)),
            Some(cap) => match self.cuts.planes().get(cap.plane as usize) {
                Some(plane) if plane.axis < 3 => Start::Plane(plane.axis as usize, plane.across_axis()),
                _ => Start::Free,
            },
        };
        IndexRay::new(by, &self.placement, ray, start)
    }

    /// The ray, for the cuts. (The world's ray decides to which side of a cap it goes: the integrator saw that one.)
    fn cut_ray<'a>(&'a self, ray: &'a IndexRay, in_world: &RayInWorld, from: PathOrigin) -> CutRay<'a> {
        let cap = surface_of(from, self.instance).filter(|s| s.kind == SurfaceKind::Cap);
        let plane = cap.and_then(|cap| Some((cap.plane, self.cuts.planes().get(cap.plane as usize)?)));
        let from = plane.map(|(i, p)| (i, p.normal_in_world.dot(in_world.direction) >= 0.0));
        CutRay { cuts: &self.cuts, ray, from }
    }

    /// The first surface of label `only`, or of any, with scaled t in (0, `t_max`), where nothing is cut.
    fn surface_along(&self, ray: &IndexRay, t_max: f64, only: Option<u32>) -> Option<Hit> {
        let nearest = self.find_nearest(ray, 0.0, t_max, only, false);
        self.surface_of_nearest(ray, nearest, t_max, only)
    }

    #[inline(always)]
    fn surface_of_nearest(
        &self,
        ray: &IndexRay,
        nearest: Nearest,
        t_max: f64,
        only: Option<u32>,
    ) -> Option<Hit> {
        match nearest {
            Nearest::Nothing => None,
            Nearest::Face { step, item, label } => Some(self.face_hit(ray, step, item, label, t_max, only)),
            Nearest::Inside { label, voxel } => match self.leave(ray, label, voxel, t_max) {
                Left::Through(hit) => Some(hit),
                Left::Within | Left::Nowhere => None,
            },
        }
    }

    /// The same among what the cuts left, piece by piece; with `any`, some surface will do.
    fn kept_surface_along(&self, cut: &CutRay, t_max: f64, only: Option<u32>, any: bool) -> Option<Hit> {
        let ray = cut.ray;
        let mut t = 0.0;
        loop {
            let (start, entry) = cut.kept_from(t);
            if start >= t_max {
                return None;
            }
            let (end, exit) = cut.kept_to(start);
            let limit = end.min(t_max);
            match (self.find_nearest(ray, start, limit, only, any), entry) {
                (Nearest::Nothing, _) => {}
                (Nearest::Face { step, item, label }, _) => {
                    return Some(self.face_hit(ray, step, item, label, limit, only));
                }
                (Nearest::Inside { label, voxel }, Some(plane)) => {
                    return Some(self.cap(ray, start, plane, label, voxel, false));
                }
                (Nearest::Inside { label, voxel }, None) => match self.leave(ray, label, voxel, limit) {
                    Left::Through(hit) => return Some(hit),
                    Left::Within if end < t_max => {
                        return Some(self.cap(ray, end, exit, label, self.voxel_at(ray, end), true));
                    }
                    Left::Within | Left::Nowhere => return None,
                },
            }
            if end >= t_max {
                return None;
            }
            t = end;
        }
    }

    fn face_hit(
        &self,
        ray: &IndexRay,
        step: Crossing,
        item: u32,
        label: u32,
        t_max: f64,
        only: Option<u32>,
    ) -> Hit {
        let step = if step.is_near_edge(ray) { self.open_face(ray, step, t_max, only) } else { step };
        self.hit(ray, &step, item, label, false)
    }

    /// The nearest face with scaled t in (`start`, `t_max`), or what is at `start`. With `any`, the first found will do.
    ///
    /// A `KIND` for each place that calls it: what visits a box is then a function with one caller, into which it is compiled.
    #[inline(always)]
    pub(super) fn nearest<P: RayBoxMask, const KIND: u8>(
        &self,
        by: P,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
        only: Option<u32>,
        any: bool,
    ) -> Nearest {
        if let Some(bricks) = self.bricks.as_ref().filter(|_| only.is_none()) {
            return self.nearest_in_bricks(by, bricks, ray, start, t_max);
        }
        let mut best = Nearest::Nothing;
        let Some((moved, enter_all)) = bvh_ray(&self.bvh, ray, start, t_max) else { return best };
        // What is hit after best_t cannot win; what is hit at it may, by its label.
        let mut best_t = t_max;
        let limit = |t: f64| (t - enter_all) as f32 * 1.000_001 + moved.pad;
        self.bvh.along_ray(&moved, limit(best_t), |item| {
            if self.is_hidden(item) {
                return limit(best_t);
            }
            let place = self.volume.place_of_box(item as usize);
            let hi = clipped_end(place.origin, place.extent, self.volume.info().dims);
            let (enter, leave) = ray.clip(place.origin, hi, start);
            if enter >= leave || enter > best_t {
                return limit(best_t);
            }
            let walk = Walk::begin(ray, place.origin, hi, enter);
            // What is in the box is read only where it matters.
            let found = match self.detail.level(place.origin, place.extent) {
                DetailLevel::Boxes => walk.whole_box(ray, enter == start),
                level => walk.first_solid(ray, &self.volume.box_at(&place), level, enter == start),
            };
            match found {
                Found::Nothing => {}
                Found::Face(step) if step.t >= t_max || step.t > best_t => {}
                Found::Inside(_) | Found::Face(_) if only.is_some_and(|l| l != self.label_of(item)) => {}
                Found::Inside(voxel) => {
                    let found = self.label_of(item);
                    if !matches!(best, Nearest::Inside { label, .. } if label <= found) {
                        best = Nearest::Inside { label: found, voxel };
                    }
                    // With `any`, a face is looked for all the same: else it would matter which of the two came first.
                    best_t = if any { best_t } else { start };
                }
                Found::Face(step) => {
                    let wins = match &best {
                        Nearest::Nothing => true,
                        Nearest::Inside { .. } => any,
                        Nearest::Face { step: other, item: other_item, .. } => {
                            step.t < other.t
                                || (self.label_of(item), step.voxel)
                                    < (self.label_of(*other_item), other.voxel)
                        }
                    };
                    if wins {
                        best_t = step.t;
                        // (Its label is looked up once nothing nearer can come.)
                        best = Nearest::Face { step, item, label: u32::MAX };
                        if any {
                            return -1.0;
                        }
                    }
                }
            }
            limit(best_t)
        });
        if let Nearest::Face { item, label, .. } = &mut best {
            *label = self.label_of(*item);
        }
        best
    }

    /// The same by bricks, which are asked in their order: the first found is the nearest.
    #[inline(always)]
    fn nearest_in_bricks<P: RayBoxMask>(
        &self,
        by: P,
        bricks: &Bricks,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
    ) -> Nearest {
        let Some(InBricks { found, brick }) = first_voxel(by, bricks, ray, start, t_max) else {
            return Nearest::Nothing;
        };
        let part_of = |voxel| bricks.part(brick, voxel, |item| self.holds(item, voxel));
        let nearest = match found {
            Found::Nothing => None,
            Found::Inside(voxel) => part_of(voxel).map(|part| Nearest::Inside { label: part.label, voxel }),
            Found::Face(step) => {
                let face = |part: BrickPart| Nearest::Face { step, item: part.item, label: part.label };
                part_of(step.voxel).map(face)
            }
        };
        nearest.unwrap_or(Nearest::Nothing)
    }

    /// The face through which a ray that starts in `voxel` of `label` leaves the label.
    fn leave(&self, ray: &IndexRay, label: u32, mut voxel: [u32; 3], t_max: f64) -> Left {
        let mut t = 0.0f64;
        let Some(mut item) = self.item_with(label, voxel) else { return Left::Nowhere };
        loop {
            let b = self.box_of(item);
            let hi = self.clipped_end(&b);
            let walk = Walk::begin_in(ray, b.origin, hi, t, Some(voxel));
            let (step, left_box) = walk.last_solid(ray, &b, self.detail.level(b.origin, b.extent));
            if step.t >= t_max {
                return Left::Within;
            }
            match self.item_with(label, step.voxel).filter(|_| left_box) {
                Some(next) => (item, voxel, t) = (next, step.voxel, t.max(step.t)),
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

    /// Near an edge of the voxel that is entered, where several of its faces are met as nearly at once as the walk can tell: the
    /// face that was found if nothing that the ray asks for stands before it, else the first that is open in this way, if any.
    /// A path that goes on from a face between two solid voxels would start inside one of them.
    #[cold]
    fn open_face(&self, ray: &IndexRay, step: Crossing, t_max: f64, only: Option<u32>) -> Crossing {
        let is_open = |face: &Crossing| {
            let (a, mut before) = (face.axis, step.voxel);
            before[a] = if ray.is_down(a) { before[a].wrapping_add(1) } else { before[a].wrapping_sub(1) };
            match only {
                None => self.label_at(before).is_none(),
                Some(label) => self.item_with(label, before).is_none(),
            }
        };
        let others = (0..3).map(|a| step.through(a, ray)).filter(|face| {
            let t = face.t;
            t >= step.t - TIE && t > 0.0 && t < t_max
        });
        std::iter::once(step).chain(others).find(is_open).unwrap_or(step)
    }

    /// The same for a ray that leaves `label`: of the faces crossed at once, the first that has something else behind it.
    #[cold]
    fn face_out(&self, ray: &IndexRay, step: Crossing, label: u32) -> Crossing {
        let last = step.voxel_before(ray);
        let is_open = |&a: &usize| {
            let mut behind = last;
            behind[a] = step.voxel[a];
            self.item_with(label, behind).is_none()
        };
        let mut tied = (0..3).filter(|a| step.tied >> a & 1 != 0);
        tied.find(is_open).map_or(step, |a| step.through(a, ray))
    }

    /// The box of `label` that has an element at `voxel`.
    fn item_with(&self, label: u32, voxel: [u32; 3]) -> Option<u32> {
        let mut found = None;
        self.bvh.at_voxel(voxel, |item| {
            if self.holds(item, voxel) && self.label_of(item) == label {
                found = Some(item);
            }
            found.is_none()
        });
        found
    }

    fn holds(&self, item: u32, voxel: [u32; 3]) -> bool {
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

    fn hit(&self, ray: &IndexRay, step: &Crossing, item: u32, label: u32, from_inside: bool) -> Hit {
        let axis = step.axis;
        let positive = ray.is_down(axis) != from_inside;
        let voxel = if from_inside { step.voxel_before(ray) } else { step.voxel };
        let place = || self.volume.place_of_box(item as usize);
        let level = self.level.unwrap_or_else(|| {
            let b = place();
            self.detail.level(b.origin, b.extent)
        });
        let element = match level {
            DetailLevel::Voxels => voxel,
            DetailLevel::Cells => voxel.map(|v| v & !3),
            DetailLevel::Boxes => place().origin,
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
    fn cap(&self, ray: &IndexRay, t: f64, plane: u32, label: u32, voxel: [u32; 3], from_inside: bool) -> Hit {
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

    /// The voxel where the ray is at scaled `t`.
    fn voxel_at(&self, ray: &IndexRay, t: f64) -> [u32; 3] {
        let dims = self.volume.info().dims;
        each_axis(|a| {
            let at = (ray.origin[a] + t * ray.direction[a]).floor();
            at.clamp(0.0, f64::from(dims[a] - 1)) as u32
        })
    }

    /// One past the highest voxel of a surface's element.
    #[inline(always)]
    fn element_end(&self, surface: &Surface) -> [u32; 3] {
        let dims = self.volume.info().dims;
        match self.level {
            Some(DetailLevel::Voxels) => surface.voxel.map(|v| v.saturating_add(1)),
            Some(DetailLevel::Cells) => cell_end(surface.voxel, dims),
            _ => self.coarse_element_end(surface),
        }
    }

    fn coarse_element_end(&self, surface: &Surface) -> [u32; 3] {
        let voxel_end = surface.voxel.map(|v| v.saturating_add(1));
        let Some(item) = self.item_with(surface.label, surface.voxel) else { return voxel_end };
        let b = self.volume.place_of_box(item as usize);
        let hi = clipped_end(b.origin, b.extent, self.volume.info().dims);
        match self.detail.level(b.origin, b.extent) {
            DetailLevel::Voxels => voxel_end,
            DetailLevel::Cells => cell_end(surface.voxel, hi),
            DetailLevel::Boxes => hi,
        }
    }

    #[inline(always)]
    fn is_hidden(&self, item: u32) -> bool {
        self.hidden.as_ref().is_some_and(|hidden| hidden[self.label_of(item) as usize])
    }

    #[inline(always)]
    fn box_of(&self, item: u32) -> BoxView<'_> {
        self.volume.get_box(item as usize)
    }

    #[inline(always)]
    fn label_of(&self, item: u32) -> u32 {
        self.volume.label_of_box(item as usize)
    }

    /// One past the box's highest voxel within the volume.
    #[inline(always)]
    fn clipped_end(&self, b: &BoxView) -> [u32; 3] {
        clipped_end(b.origin, b.extent, self.volume.info().dims)
    }
}

impl Tracer for VolumeTracer {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        self.first_hit_within(ray, from, t_max, f64::INFINITY)
    }

    /// As `first_hit(…).is_some()`, in less time from a face, where the first box that answers will do. (Not from a free point or a
    /// mesh: within a label, a seam between two of its boxes would answer first, and only the way out of the label is a surface.) Where
    /// coarse elements of labels overlap and a path starts within another's, faces within that one count too.
    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        if self.cuts.is_empty() {
            return self.occluded_uncut(ray, from, t_max);
        }
        let Some(r) = self.index_ray(Plain, ray, from) else { return false };
        let t_max = r.scaled_t(t_max);
        self.kept_surface_along(&self.cut_ray(&r, ray, from), t_max, None, any_will_do(from)).is_some()
    }

    fn box_origin(&self, face: &Surface) -> Option<[u32; 3]> {
        self.item_with(face.label, face.voxel).map(|item| self.volume.place_of_box(item as usize).origin)
    }

    fn smooth_normal(&self, surface: &Surface, point: DVec3) -> Option<DVec3> {
        // Caps and coarse elements are flat.
        let neighbors = self.neighbors.as_ref().filter(|_| surface.kind == SurfaceKind::Face)?;
        let item = self.item_with(surface.label, surface.voxel)?;
        let b = self.volume.place_of_box(item as usize);
        if self.detail.level(b.origin, b.extent) != DetailLevel::Voxels {
            return None;
        }
        let axis = usize::from(surface.axis.min(2));
        let mut p = self.placement.index_from_world(point - self.placement.world_from_index.translation);
        p[axis] = f64::from(surface.plane);
        let boxes = neighbors.of(item).iter().map(|&near| {
            let b = self.box_of(near);
            (b, self.detail.level(b.origin, b.extent), self.clipped_end(&b))
        });
        let outward = falling_off(boxes, p);
        let largest = outward.abs().max_element();
        if largest <= 0.0 {
            return None;
        }
        // In a hollow the label may fall off to the other side of the face.
        let normal = self.placement.normal_of((outward / largest).as_dvec3());
        let own = self.normals[axis][usize::from(surface.positive)];
        (normal.dot(own) > 0.0).then_some(normal)
    }

    fn is_smooth(&self) -> bool {
        self.neighbors.is_some()
    }
}

/// Whether the first box that answers will do for a ray from there ([`Tracer::occluded`] of [`VolumeTracer`]).
#[inline(always)]
fn any_will_do(from: PathOrigin) -> bool {
    matches!(from, PathOrigin::Face(surface) if surface.kind != SurfaceKind::Triangle)
}

/// The ray moved to the hierarchy's bounds, and the scaled t of the move.
#[inline(always)]
pub(super) fn bvh_ray(bvh: &Bvh, ray: &IndexRay, start: f64, t_max: f64) -> Option<(BvhRay, f64)> {
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
            // A component below 2⁻⁶⁰ moves the ray by less than 2⁻³⁶ voxels within the largest volume: far below the pad.
            inverse: each_axis(|a| ray.inverse[a].clamp(-LARGEST_INVERSE, LARGEST_INVERSE) as f32),
            // Three f64 roundings of the move.
            pad: bvh.pad() + (far * 4.0 * f64::EPSILON) as f32,
        },
        enter,
    ))
}

/// One past the highest voxel of a voxel's cell, which ends at `end` at the latest.
#[inline(always)]
fn cell_end(voxel: [u32; 3], end: [u32; 3]) -> [u32; 3] {
    each_axis(|a| (voxel[a] | 3).saturating_add(1).min(end[a]))
}

/// Number of the cell (`shift` 2) or of the voxel in its cell (`shift` 0): x + 4y + 16z.
fn number_in(b: &BoxView, voxel: [u32; 3], shift: u32) -> u32 {
    let part = |a: usize| (voxel[a] - b.origin[a]) >> shift & 3;
    part(0) | part(1) << 2 | part(2) << 4
}
