//! The nearest face along a ray, by the hierarchy of boxes or by bricks.

use pumice_transport::geometry::bricks::{BrickPart, Bricks};
use pumice_transport::geometry::bvh::LARGEST_INVERSE;
use pumice_transport::geometry::each_axis;
use pumice_transport::geometry::lod::DetailLevel;
use pumice_transport::geometry::visible_boxes::clipped_end;
use pumice_transport::{Bvh, BvhRay};

use super::super::IndexRay;
use super::super::box_walk::{Crossing, Found, Walk};
use super::super::brick_walk::{InBricks, first_voxel};
use super::super::ray_box_mask::RayBoxMask;
use super::VolumeTracer;

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
        if let Some(bricks) = self.bricks.as_ref().filter(|_| only.is_none()) {
            return self.nearest_in_bricks(by, bricks, ray, start, t_max);
        }
        let mut best = Nearest::Nothing;
        let Some((moved, enter_all)) = bvh_ray(&self.bvh, ray, start, t_max) else { return best };
        // A hit beyond best_t cannot win; a hit at best_t may, by its label.
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
            // The content of the box is read only where it matters.
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
                    // With `any`, faces are still searched: otherwise the order of the two results would matter.
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
                        // (The label is looked up when no nearer hit is possible.)
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
