//! The search through a volume's hierarchy and boxes, compiled a second time for processors with AVX2: eight children of a node fit in
//! one of its registers, and counting bits is one instruction. Rust never fuses a product and a sum, so both give the same bits.

use super::IndexRay;
use super::volume_tracer::{Nearest, VolumeTracer};

impl VolumeTracer {
    /// [`VolumeTracer::nearest`], by the instructions that this processor has.
    #[inline]
    pub(super) fn find_nearest(
        &self,
        ray: &IndexRay,
        start: f64,
        t_max: f64,
        only: Option<u32>,
        any: bool,
    ) -> Nearest {
        #[cfg(target_arch = "x86_64")]
        if is_wide() {
            // SAFETY: the processor has the instructions that the function is compiled for, as it was just asked.
            #[allow(unsafe_code)]
            return unsafe { self.nearest_wide(ray, start, t_max, only, any) };
        }
        self.nearest_plain(ray, start, t_max, only, any)
    }

    #[inline(never)]
    fn nearest_plain(&self, ray: &IndexRay, start: f64, t_max: f64, only: Option<u32>, any: bool) -> Nearest {
        self.nearest::<0>(ray, start, t_max, only, any)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    #[inline(never)]
    fn nearest_wide(&self, ray: &IndexRay, start: f64, t_max: f64, only: Option<u32>, any: bool) -> Nearest {
        self.nearest::<1>(ray, start, t_max, only, any)
    }
}

/// Whether the processor has all that [`VolumeTracer::nearest_wide`] is compiled for. (The answers are kept: this reads a word.)
#[cfg(target_arch = "x86_64")]
#[inline]
fn is_wide() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};
    use pumice_oracle::volumes::blobs;
    use pumice_render::RayInWorld;

    use super::super::index_ray::Start;
    use super::super::{LodChoice, TracedInstance};
    use super::*;

    /// To the bit, at every level of detail, whether the first found will do or not.
    #[test]
    fn the_way_of_this_processor_finds_what_the_plain_one_does() {
        let (_, volume) = blobs([90, 70, 60], 50, 9, 8);
        let mut s = 3u64;
        let mut random = || {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let (mut faces, mut inside) = (0, 0);
        for lod in [LodChoice::Voxels, LodChoice::Cells, LodChoice::Boxes] {
            let instance = TracedInstance {
                volume: volume.clone(),
                world_from_index: DAffine3::IDENTITY,
                visible: (0..volume.labels().len()).map(|l| l % 4 != 1).collect(),
                lod,
            };
            let tracer = VolumeTracer::new(0, &instance).unwrap();
            for _ in 0..4000 {
                let mut point =
                    || DVec3::new(45.0, 35.0, 30.0) + 120.0 * DVec3::new(random(), random(), random());
                let (origin, target) = (point(), point());
                let ray = RayInWorld { origin, direction: target - origin };
                let Some(ray) = tracer.placement().ray(&ray, Start::Free) else { continue };
                for any in [false, true] {
                    let plain = tracer.nearest_plain(&ray, 0.0, f64::INFINITY, None, any);
                    let found = tracer.find_nearest(&ray, 0.0, f64::INFINITY, None, any);
                    assert_eq!(plain, found, "{lod:?} {ray:?}");
                    faces += usize::from(matches!(plain, Nearest::Face { .. }));
                    inside += usize::from(matches!(plain, Nearest::Inside { .. }));
                }
            }
        }
        assert!(faces > 3000 && inside > 300, "{faces} {inside}");
    }
}
