//! The mask of the 4 × 4 × 4 equal boxes that a ray passes through, computed at once: each box is compared with the planes around it,
//! without a walk from box to box. A processor mispredicts where a walk turns and where it ends; here there is nothing to predict.
//!
//! ```text
//! near[a][i], far[a][i]     t at which the ray enters and leaves box i of a row along axis a, for i = 0 to 3 in its direction
//! box (i, j, k)             max(near[x][i], near[y][j], near[z][k], from)  <  min(far[x][i], far[y][j], far[z][k])
//! ```
//! A plane is met at `(plane − origin)·inverse` in f64, as everywhere ([`IndexRay::t_of`]), so the mask equals the result of clipping the
//! ray against each box. The product is monotone in the plane, so a ray that passes through a small box also passes through the large one
//! around it, ties and roundings included. Speed depends on how soon one box leads to the next smaller ones, so corners are passed in two
//! parts, and the part that is known late needs only one sum to give all planes.
//!
//! # What made rays faster
//! Nanoseconds for each ray on one core, with 15 % of the labels of two volumes of 512³ voxels shown:
//!
//! | rays through | cortex, camera | cortex, diffuse | cells, camera | cells, diffuse |
//! |---|---|---|---|---|
//! | boxes, found by the hierarchy | 380 | 700 | 220 | 980 |
//! | bricks, compared in f32 by AVX2 | 184 | 302 | 106 | 320 |
//! | the same; a ray is prepared four numbers at once | 183 | 300 | 104 | 317 |
//! | the same; a ray is never stored lane by lane and then read as four | 167 | 297 | 91 | 316 |
//! | the same; masks are mirrored while planes are compared, not afterwards | 155 | 287 | 86 | 310 |
//! | in f64 by AVX2, corners passed in two parts | 154 | 286 | 85 | 304 |
//! | in f64 by AVX-512 | 142 | 257 | 78 | 276 |
//! | the same; boxes that a ray only touches are left out, which f64 allows | 141 | 245 | 77 | 260 |
//! | **the same; a direction of usual size is scaled once instead of twice** | – | – | **74** | – |
//!
//! Latency decides, not the number of instructions. Mirroring masks by eight instructions instead of thirty for each axis, a quarter of all
//! instructions, changed nothing once it was off the critical path from one level to the next. Eight numbers that are stored one by one and
//! read as one wait for each other: two such places took 28 of the 44 ns of a ray that hits nothing. 22 ns of those 44 remain, with three
//! divisions of four numbers among them. Closures passed to `array::map` are not compiled into functions with their own instruction set:
//! with them this took two and a half times as long.

use pumice_core::leaves::flipped;
use pumice_transport::geometry::each_axis;

use super::IndexRay;
use super::f64x4::{Instructions, Lanes, Plain};
use super::mirrored::Octant;
#[cfg(target_arch = "x86_64")]
use super::{
    f64x4::{Avx2, Avx512},
    mirrored::mirrored,
};

/// Positions of the planes of four boxes in a row, in box sides from the lowest: where the boxes begin, then where they end, in the order
/// in which a ray meets them.
type Row = [f64; 8];

/// For a ray that moves up along the row's axis, and for one that moves down.
const ROWS: [Row; 2] = [[0.0, 1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0, 3.0, 2.0, 1.0, 0.0]];

/// Computes masks of boxes with a set of instructions.
pub(super) trait RayBoxMask: Instructions {
    /// Bit x + 4y + 16z is set if `ray` passes, at t > `from`, through that box of the 4³ with this `side` whose lowest corner is `corner +
    /// step`. x, y and z count in the ray's direction: from the top along axes on which it moves down.
    fn ray_box_mask(self, ray: &IndexRay, corner: Self::F64x4, step: &Lanes, side: f64, from: f64) -> u64;

    /// Converts a mask whose x, y and z count up to one that counts in the ray's direction.
    fn mirrored(self, mask: u64, octant: Octant) -> u64;
}

impl RayBoxMask for Plain {
    #[inline]
    fn ray_box_mask(self, ray: &IndexRay, corner: Self::F64x4, step: &Lanes, side: f64, from: f64) -> u64 {
        let rows: [Row; 3] = each_axis(|a| {
            let row = &ROWS[usize::from(ray.is_down(a))];
            row.map(|sides| ray.t_of(a, corner[a] + sides * side + step[a]))
        });
        let mut mask = 0;
        for c in 0..64 {
            let [x, y, z] = each_axis(|a| c >> (2 * a) & 3);
            let greater = |a: f64, b: f64| if a > b { a } else { b };
            let lesser = |a: f64, b: f64| if a < b { a } else { b };
            let near = greater(greater(greater(rows[0][x], from), rows[1][y]), rows[2][z]);
            let far = lesser(lesser(rows[0][4 + x], rows[1][4 + y]), rows[2][4 + z]);
            mask |= u64::from(near < far) << c;
        }
        mask
    }

    #[inline]
    fn mirrored(self, mask: u64, octant: Octant) -> u64 {
        flipped(mask, octant.mirror())
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

/// Implements [`RayBoxMask`] with the functions of a module that are compiled for a kind of processor.
#[cfg(target_arch = "x86_64")]
macro_rules! ray_box_mask_by {
    ($kind:ty: $module:ident) => {
        impl RayBoxMask for $kind {
            #[inline(always)]
            fn ray_box_mask(
                self,
                ray: &IndexRay,
                corner: Self::F64x4,
                step: &Lanes,
                side: f64,
                from: f64,
            ) -> u64 {
                // SAFETY: the processor has the instructions that the function is compiled for: there is no such value where it lacks them.
                #[allow(unsafe_code)]
                unsafe {
                    $module::ray_box_mask(ray, corner.register(), step, side, from)
                }
            }

            #[inline(always)]
            fn mirrored(self, mask: u64, octant: Octant) -> u64 {
                // SAFETY: as above.
                #[allow(unsafe_code)]
                unsafe {
                    mirrored(mask, octant)
                }
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
ray_box_mask_by!(Avx2: avx2);
#[cfg(target_arch = "x86_64")]
ray_box_mask_by!(Avx512: avx512);

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};
    use pumice_transport::RayInWorld;
    use pumice_transport::geometry::Placement;

    use super::super::f64x4::each_way;
    use super::super::index_ray::Start;
    use super::*;

    /// Rays of all kinds around a box of side 64 at 640: oblique, in planes, along axes, through edges and corners, and nearly so.
    fn rays() -> Vec<IndexRay> {
        let mut s = 9u64;
        let mut random = || {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (s >> 11) as f64 / (1u64 << 53) as f64
        };
        let place = Placement::new(DAffine3::IDENTITY).unwrap();
        let mut rays = Vec::new();
        for i in 0..6000 {
            let mut point = |snap: bool| {
                let p = DVec3::new(random(), random(), random()) * 200.0 - 70.0;
                DVec3::splat(640.0) + if snap { (p / 4.0).round() * 4.0 } else { p }
            };
            let (origin, mut target) = (point(i % 3 == 1), point(i % 3 != 0));
            if i % 5 == 0 {
                target.x = origin.x;
            }
            if i % 20 == 0 {
                target.z = origin.z + if i % 40 == 0 { 0.0 } else { 1e-9 };
            }
            if i % 3 == 1 && i % 2 == 0 {
                // Along diagonals of the grid: through edges and corners.
                let signs = [0, 1, 2].map(|bit| if i >> bit & 2 != 0 { 1.0 } else { -1.0 });
                target = origin - DVec3::from(signs) * (origin - DVec3::splat(672.0)).abs().max_element();
            }
            rays.extend(IndexRay::new(
                Plain,
                &place,
                &RayInWorld { origin, direction: target - origin },
                Start::Free,
            ));
        }
        rays
    }

    /// Compares box by box with clipping: a bit is set where clipping leaves more than a point of the ray.
    fn boxes_are_those_that_clipping_finds(by: impl RayBoxMask) {
        let (mut with, mut touched) = (0, 0);
        for ray in rays() {
            for (lo, side, from) in [(640u32, 16, 0.0), (660, 4, 12.5), (672, 1, 30.0)] {
                let (corner, step) = ([lo - 40, lo - 1, lo - 16], [40.0, 1.0, 16.0, 0.0]);
                let fours = by.f64x4(&[corner[0], corner[1], corner[2], 0].map(f64::from));
                let ray_box_mask = by.ray_box_mask(&ray, fours, &step, f64::from(side), from);
                for c in 0..64 {
                    // (Counted in the ray's direction.)
                    let number = |a: usize| (c >> (2 * a) & 3) ^ if ray.is_down(a) { 3 } else { 0 };
                    let lowest = each_axis(|a| corner[a] + step[a] as u32 + side * number(a));
                    let (enter, leave) = ray.clip(lowest, lowest.map(|v| v + side), from);
                    assert_eq!(ray_box_mask >> c & 1 != 0, enter < leave, "{enter} to {leave} of {ray:?}");
                    with += usize::from(enter < leave);
                    touched += usize::from(enter == leave);
                }
            }
        }
        assert!(with > 5000 && touched > 100, "{with} {touched}");
    }

    #[test]
    fn boxes_are_those_that_clipping_finds_by_all_ways() {
        each_way!(boxes_are_those_that_clipping_finds);
    }
}
