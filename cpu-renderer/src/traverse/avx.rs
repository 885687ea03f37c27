//! The search through a volume's hierarchy and boxes, or through its bricks, compiled again for processors with AVX2 and with AVX-512:
//! their registers hold four or eight f64 numbers, and counting bits is one instruction. Rust never fuses a product and a sum, so all
//! versions give the same bits.

use pumice_transport::{Hit, PathOrigin, RayInWorld};

use super::IndexRay;
use super::f64x4::Plain;
#[cfg(target_arch = "x86_64")]
use super::f64x4::{Avx2, Avx512};
use super::volume_tracer::{Nearest, PagedBricks, VolumeTracer};

/// Defines methods that call a generic one compiled for the instructions of this processor. (`KIND` as in [`VolumeTracer::nearest`].)
macro_rules! by_what_the_processor_has {
    ($($(#[$doc:meta])* $name:ident = $generic:ident, $kind:literal: ($($arg:ident: $type:ty),*) -> $result:ty;)*) => {
        $(
            $(#[$doc])*
            #[inline]
            pub(super) fn $name(&self, $($arg: $type),*) -> $result {
                #[cfg(target_arch = "x86_64")]
                {
                    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512bw,avx512dq,avx512vl")]
                    #[inline(never)]
                    fn widest(by: Avx512, tracer: &VolumeTracer, $($arg: $type),*) -> $result {
                        tracer.$generic::<_, $kind>(by, $($arg),*)
                    }
                    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
                    #[inline(never)]
                    fn wide(by: Avx2, tracer: &VolumeTracer, $($arg: $type),*) -> $result {
                        tracer.$generic::<_, $kind>(by, $($arg),*)
                    }
                    // SAFETY: the processor has the instructions that each is compiled for: there is no `Avx512` and no `Avx2` where it
                    // lacks them.
                    #[allow(unsafe_code)]
                    unsafe {
                        if let Some(by) = Avx512::new() {
                            return widest(by, self, $($arg),*);
                        }
                        if let Some(by) = Avx2::new() {
                            return wide(by, self, $($arg),*);
                        }
                    }
                }
                #[inline(never)]
                fn plain(tracer: &VolumeTracer, $($arg: $type),*) -> $result {
                    tracer.$generic::<_, $kind>(Plain, $($arg),*)
                }
                plain(self, $($arg),*)
            }
        )*
    };
}

impl VolumeTracer {
    by_what_the_processor_has! {
        /// [`VolumeTracer::nearest`].
        find_nearest = nearest, 0:
            (ray: &IndexRay, start: f64, t_max: f64, only: Option<u32>, any: bool) -> Nearest;
        /// [`VolumeTracer::first_hit_by`].
        first_hit_uncut = first_hit_by, 1:
            (ray: &RayInWorld, from: PathOrigin, t_max: f64, best: f64) -> Option<Hit>;
        /// [`VolumeTracer::occluded_by`].
        occluded_uncut = occluded_by, 2: (ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool;
        /// [`VolumeTracer::first_in_pages`].
        find_first_in_pages = first_in_pages, 3:
            (pages: &PagedBricks, ray: &IndexRay, start: f64, t_max: f64) -> Nearest;
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};
    use pumice_oracle::volumes::blobs;
    use pumice_transport::RayInWorld;
    use pumice_transport::geometry::LodChoice;

    use super::super::TracedInstance;
    use super::super::f64x4::each_way;
    use super::super::index_ray::Start;
    use super::super::ray_box_mask::RayBoxMask;
    use super::*;

    /// Same results to the bit, at every level of detail, with and without `any`.
    fn finds_what_the_plain_way_does(by: impl RayBoxMask) {
        let (_, volume) = blobs([90, 70, 60], 50, 9, 8);
        let mut s = 3u64;
        let mut random = || {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let (mut faces, mut inside) = (0, 0);
        let ways = [
            (LodChoice::Voxels, true),
            (LodChoice::Voxels, false),
            (LodChoice::Cells, false),
            (LodChoice::Boxes, false),
        ];
        for (lod, with_bricks) in ways {
            let instance = TracedInstance {
                volume: volume.clone(),
                world_from_index: DAffine3::IDENTITY,
                visible: (0..volume.labels().len()).map(|l| l % 4 != 1).collect(),
                lod,
            };
            let tracer = VolumeTracer::new(0, &instance).unwrap();
            let tracer = if with_bricks { tracer.with_bricks().unwrap() } else { tracer };
            assert_eq!(tracer.brick_bytes() > 0, with_bricks);
            for _ in 0..4000 {
                let mut point =
                    || DVec3::new(45.0, 35.0, 30.0) + 120.0 * DVec3::new(random(), random(), random());
                let (origin, target) = (point(), point());
                let ray = RayInWorld { origin, direction: target - origin };
                let place = tracer.placement();
                let Some(in_index) = IndexRay::new(Plain, place, &ray, Start::Free) else { continue };
                let same = IndexRay::new(by, place, &ray, Start::Free);
                assert_eq!(format!("{same:?}"), format!("{:?}", Some(in_index)));
                for any in [false, true] {
                    let plain = tracer.nearest::<_, 9>(Plain, &in_index, 0.0, f64::INFINITY, None, any);
                    let found = tracer.nearest::<_, 9>(by, &in_index, 0.0, f64::INFINITY, None, any);
                    assert_eq!(plain, found, "{lod:?} {ray:?}");
                    faces += usize::from(matches!(plain, Nearest::Face { .. }));
                    inside += usize::from(matches!(plain, Nearest::Inside { .. }));
                }
                // The public method returns the result of the generic one.
                let hit =
                    tracer.first_hit_by::<_, 9>(by, &ray, PathOrigin::Free, f64::INFINITY, f64::INFINITY);
                assert_eq!(hit, tracer.first_hit_uncut(&ray, PathOrigin::Free, f64::INFINITY, f64::INFINITY));
                let occluded = tracer.occluded_by::<_, 9>(by, &ray, PathOrigin::Free, f64::INFINITY);
                assert_eq!(occluded, hit.is_some());
                assert_eq!(occluded, tracer.occluded_uncut(&ray, PathOrigin::Free, f64::INFINITY));
            }
        }
        assert!(faces > 3000 && inside > 300, "{faces} {inside}");
    }

    #[test]
    fn all_ways_find_what_the_plain_one_does() {
        each_way!(finds_what_the_plain_way_does);
    }
}
