//! The geometry of one instance of a volume: its bricks or its hierarchy, and the queries of rays.

mod drawn_boxes;
mod making;
mod pages;
mod search;
mod showing;
mod surfaces;

use std::sync::Arc;

use glam::DVec3;
use pumice_core::{BoxView, CompressedVolume};
use pumice_transport::geometry::bricks::Bricks;
use pumice_transport::geometry::cuts::Cuts;
use pumice_transport::geometry::instance_tree::WorldBounds;
use pumice_transport::geometry::lod::{Detail, DetailLevel};
use pumice_transport::geometry::neighbors::Neighbors;
use pumice_transport::geometry::placement::Placement;
use pumice_transport::geometry::voxel_normals::falling_off;
use pumice_transport::{BoxBounds, Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};

use super::IndexRay;
use super::box_walk::{Crossing, Found};
use super::brick_walk::{InBricks, first_voxel};
use super::cut_ray::CutRay;
use super::f64x4::{Instructions, Plain};
use super::index_ray::{Start, surface_of};
use super::ray_box_mask::RayBoxMask;
use drawn_boxes::DrawnBoxes;
pub(super) use pages::PagedBricks;
pub(super) use search::{Nearest, bvh_ray};
use showing::Widest;
use surfaces::Left;

/// Part of its length by which a direction must lead away from a plane to be sure of it: above the roundings of its change of space.
const SURELY: f64 = 64.0 * f64::EPSILON;

/// The geometry of one instance.
#[derive(Clone, Debug)]
pub struct VolumeTracer {
    volume: Arc<CompressedVolume>,
    placement: Placement,
    instance: u32,
    boxes: Arc<DrawnBoxes>,
    /// Their bounds in the world; `None` where nothing is drawn, and for a page of a volume.
    in_world: Option<WorldBounds>,
    /// The drawn voxels with all labels merged, if there is such a form; where there is none, the boxes have a hierarchy.
    bricks: Option<Arc<Bricks>>,
    /// The same where neither they nor the boxes are in memory; there are no `bricks` then.
    pages: Option<Arc<PagedBricks>>,
    /// Whether bricks are wanted where they are possible.
    wants_bricks: bool,
    detail: Detail,
    /// The level of all boxes, where it is certain to be the same: a surface then need not ask its box for the element.
    level: Option<DetailLevel>,
    /// Outward normals in the world: lower and upper face of each axis.
    normals: [[DVec3; 2]; 3],
    /// Parts that are cut away.
    cuts: Cuts,
    /// Whether each label, by dense index, is not drawn; `None` where the boxes have no hidden labels.
    hidden: Option<Arc<[bool]>>,
    /// The most boxes that were drawn of this volume, from which others are made when labels are hidden or shown.
    widest: Option<Arc<Widest>>,
    /// Neighbours of each box, where voxels are shaded smooth.
    neighbors: Option<Arc<Neighbors>>,
}

impl VolumeTracer {
    /// Dense index of the visible label at `voxel`, at the level of detail that is drawn; the lowest if there are several.
    pub fn label_at(&self, voxel: [u32; 3]) -> Option<u32> {
        if let Some(pages) = &self.pages {
            return pages.with(voxel)?.tracer().label_at(voxel);
        }
        let mut label = None;
        self.for_each_box_near(voxel, |item| {
            if self.holds(item, voxel) {
                let found = self.label_of(item);
                label = Some(label.map_or(found, |l: u32| l.min(found)));
            }
            // A voxel belongs to one label; coarser elements overlap.
            label.is_none() || self.level != Some(DetailLevel::Voxels)
        });
        label
    }

    /// The next hit with t in (0, `t_max`) where the ray enters label `label` or, if it starts inside, leaves it (`from_inside`). Other
    /// labels are ignored; seams between boxes of the label are no surfaces.
    pub fn next_boundary(&self, ray: &RayInWorld, label: u32, from: PathOrigin, t_max: f64) -> Option<Hit> {
        let r = self.index_ray(Plain, ray, from)?;
        let t_max = r.scaled_t(t_max);
        if self.cuts.is_empty() {
            return self.surface_along(&r, t_max, Some(label));
        }
        self.kept_surface_along(&self.cut_ray(&r, ray, from), t_max, Some(label), false)
    }

    /// [`Tracer::first_hit`], where hits beyond `best` may be ignored.
    #[inline]
    pub(super) fn first_hit_within(
        &self,
        ray: &RayInWorld,
        from: PathOrigin,
        t_max: f64,
        best: f64,
    ) -> Option<Hit> {
        if self.is_missed(ray, from) {
            return None;
        }
        if self.cuts.is_empty() {
            return self.first_hit_uncut(ray, from, t_max, best);
        }
        let r = self.index_ray(Plain, ray, from)?;
        let t_max = r.reach(t_max, best);
        self.kept_surface_along(&self.cut_ray(&r, ray, from), t_max, None, false)
    }

    /// [`VolumeTracer::first_hit_within`] without cuts. (`KIND` as in [`VolumeTracer::nearest`].)
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

    /// [`Tracer::occluded`] without cuts. (`KIND` as in [`VolumeTracer::nearest`].)
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
        let nearest = match &self.bricks {
            Some(bricks) => match first_voxel(by, &**bricks, &r, 0.0, t_max) {
                None => return false,
                // (Which box it belongs to does not matter.)
                Some((InBricks { found: Found::Face(_), .. }, _)) => return true,
                Some((inside, _)) => self.with_its_box(bricks, inside),
            },
            None => self.nearest::<P, KIND>(by, &r, 0.0, t_max, None, self.any_will_do(from)),
        };
        match nearest {
            Nearest::Nothing => false,
            Nearest::Face { .. } => true,
            Nearest::Inside { label, voxel } => {
                matches!(self.leave(&r, label, voxel, t_max), Left::Through(_))
            }
        }
    }

    /// Whether the ray certainly meets nothing of what is drawn: it passes it by, or leaves it from one of its outermost faces. Half of a
    /// camera's rays do, and preparing a ray for the search costs more than this.
    ///
    /// A ray that continues from a face of this instance starts on that face in its own space, whatever rounding did to its position in the
    /// world; so there only the face and the direction decide.
    #[inline(always)]
    fn is_missed(&self, ray: &RayInWorld, from: PathOrigin) -> bool {
        match surface_of(from, self.instance) {
            None => self.in_world.is_some_and(|bounds| bounds.are_passed_by(ray)),
            Some(face) if face.kind == SurfaceKind::Face => self.is_left(&face, ray.direction),
            Some(_) => false,
        }
    }

    /// Whether the face is on the bounds of all that is drawn and the direction certainly leads away from it.
    #[inline(always)]
    fn is_left(&self, face: &Surface, direction: DVec3) -> bool {
        let Some(BoxBounds { lo, hi }) = self.boxes.bounds() else { return false };
        let axis = usize::from(face.axis.min(2));
        if face.plane != if face.positive { hi[axis] } else { lo[axis] } {
            return false;
        }
        let normal = self.normals[axis][usize::from(face.positive)];
        // Further than rounding turns a direction: each side has five products and sums.
        normal.dot(direction) > SURELY * normal.abs().dot(direction.abs())
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

    /// The ray with its cuts. (The world's ray decides to which side of a cap it goes, because the integrator used that ray.)
    fn cut_ray<'a>(&'a self, ray: &'a IndexRay, in_world: &RayInWorld, from: PathOrigin) -> CutRay<'a> {
        let cap = surface_of(from, self.instance).filter(|s| s.kind == SurfaceKind::Cap);
        let plane = cap.and_then(|cap| Some((cap.plane, self.cuts.planes().get(cap.plane as usize)?)));
        let from = plane.map(|(i, p)| (i, p.normal_in_world.dot(in_world.direction) >= 0.0));
        CutRay { cuts: &self.cuts, ray, from }
    }

    /// The first surface of label `only`, or of any, with scaled t in (0, `t_max`), without cuts.
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

    /// The first surface in the pieces that the cuts keep, piece by piece; with `any`, some surface.
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

    /// Whether the first result of any box is enough for a ray from there ([`Tracer::occluded`]).
    #[inline(always)]
    fn any_will_do(&self, from: PathOrigin) -> bool {
        let is_face = matches!(from, PathOrigin::Face(surface) if surface.kind != SurfaceKind::Triangle);
        is_face && matches!(self.detail, Detail::Same(_))
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
}

impl Tracer for VolumeTracer {
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        self.first_hit_within(ray, from, t_max, f64::INFINITY)
    }

    /// Equals `first_hit(…).is_some()`, but is faster from a face, where the first result of any box is enough. (Not from a free point or a
    /// mesh: inside a label, a seam between two of its boxes would answer first, while only the way out of the label is a surface.) Where
    /// coarse elements of labels overlap and a path starts within another label's element, faces within that element count too, unless
    /// levels depend on distance: then the answer is that of pages, which find faces in order.
    fn occluded(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
        if self.is_missed(ray, from) {
            return false;
        }
        if self.cuts.is_empty() {
            return self.occluded_uncut(ray, from, t_max);
        }
        let Some(r) = self.index_ray(Plain, ray, from) else { return false };
        let t_max = r.scaled_t(t_max);
        self.kept_surface_along(&self.cut_ray(&r, ray, from), t_max, None, self.any_will_do(from)).is_some()
    }

    fn box_origin(&self, face: &Surface) -> Option<[u32; 3]> {
        self.place_with(face.label, face.voxel).map(|place| place.origin)
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
        // In a hollow, the label may fall off to the other side of the face.
        let normal = self.placement.normal_of((outward / largest).as_dvec3());
        let own = self.normals[axis][usize::from(surface.positive)];
        (normal.dot(own) > 0.0).then_some(normal)
    }

    fn is_smooth(&self) -> bool {
        self.neighbors.is_some()
    }

    fn failure(&self) -> Option<String> {
        self.pages.as_ref()?.failure()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DMat3};
    use pumice_oracle::volumes::blobs;
    use pumice_transport::geometry::LodChoice;

    use super::super::TracedInstance;
    use super::*;

    /// Rays that count as missed find nothing in the search that is left out for them: rays of a camera, rays that leave faces in any
    /// direction, and rays along faces, of instances that are turned, mirrored, squeezed and far away, at each level of detail.
    #[test]
    fn missed_rays_find_nothing() {
        let (_, volume) = blobs([90, 70, 60], 80, 9, 8);
        let mut state = 5u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let turned = DMat3::from_rotation_z(0.3) * DMat3::from_diagonal(DVec3::new(-0.5, 0.7, 1.3));
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(3.0, 0.1, 0.0), DVec3::new(0.0, 1.0, 1e-3));
        let (mut passed, mut left, mut found) = (0, 0, 0);
        for (matrix, at) in [(DMat3::IDENTITY, 0.0), (turned, 1e3), (sheared, 0.0), (turned, 1e10)] {
            for lod in [LodChoice::Voxels, LodChoice::Boxes] {
                let world_from_index = DAffine3::from_mat3_translation(matrix, DVec3::splat(at));
                let visible = vec![true; volume.labels().len()];
                let traced = TracedInstance { volume: volume.clone(), world_from_index, visible, lod };
                let tracer = VolumeTracer::in_bricks(0, &traced).unwrap();
                let mut same = |ray: &RayInWorld, from: PathOrigin| {
                    let hit = tracer.first_hit_uncut(ray, from, f64::INFINITY, f64::INFINITY);
                    assert_eq!(tracer.first_hit(ray, from, f64::INFINITY), hit, "{ray:?} {from:?}");
                    assert_eq!(tracer.occluded(ray, from, f64::INFINITY), hit.is_some());
                    let missed = tracer.is_missed(ray, from);
                    *(if from == PathOrigin::Free { &mut passed } else { &mut left }) += u32::from(missed);
                    found += u32::from(hit.is_some());
                    hit
                };
                for _ in 0..1500 {
                    let mut point = |size: f64| {
                        DVec3::new(45.0, 35.0, 30.0) + size * DVec3::new(random(), random(), random())
                    };
                    let [origin, target] =
                        [point(300.0), point(120.0)].map(|p| world_from_index.transform_point3(p));
                    let ray = RayInWorld { origin, direction: target - origin };
                    let Some(hit) = same(&ray, PathOrigin::Free) else { continue };
                    let (from, origin) = (PathOrigin::Face(hit.surface), ray.origin + ray.direction * hit.t);
                    for _ in 0..4 {
                        let direction = matrix * DVec3::new(random(), random(), random());
                        same(&RayInWorld { origin, direction }, from);
                    }
                    let along = matrix.col(usize::from(hit.surface.axis + 1) % 3) * random();
                    same(&RayInWorld { origin, direction: along }, from);
                }
            }
        }
        assert!(passed > 3000 && left > 1000 && found > 10_000, "{passed} {left} {found}");
    }
}
