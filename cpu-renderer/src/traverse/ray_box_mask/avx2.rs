//! [`super::RayBoxMask`] with AVX2: four boxes at once, those of one y and z.

use std::arch::x86_64::{
    __m256d, __m256i, _CMP_LT_OQ, _mm256_add_pd, _mm256_castpd_ps, _mm256_castps_si256, _mm256_cmp_pd,
    _mm256_loadu_pd, _mm256_max_pd, _mm256_min_pd, _mm256_movemask_epi8, _mm256_mul_pd, _mm256_packs_epi16,
    _mm256_packs_epi32, _mm256_permute4x64_pd, _mm256_set1_pd, _mm256_shuffle_ps, _mm256_sub_pd, _pdep_u32,
};

use super::{IndexRay, Lanes, ROWS};

/// Implements [`super::RayBoxMask::ray_box_mask`].
#[target_feature(enable = "avx2,bmi2")]
#[inline]
pub(super) fn ray_box_mask(ray: &IndexRay, corner: __m256d, step: &Lanes, side: f64, from: f64) -> u64 {
    let x = row(ray, 0, _mm256_permute4x64_pd::<0x00>(corner), step, side);
    let y = row(ray, 1, _mm256_permute4x64_pd::<0x55>(corner), step, side);
    let z = row(ray, 2, _mm256_permute4x64_pd::<0xAA>(corner), step, side);
    // Four boxes at once, all x: by y, then by z.
    let near_x = _mm256_max_pd(x.0, _mm256_set1_pd(from));
    let (near_y, far_y) = (each(y.0), each(y.1));
    let (mut near, mut far) = ([near_x; 4], [x.1; 4]);
    for j in 0..4 {
        near[j] = _mm256_max_pd(near_x, near_y[j]);
        far[j] = _mm256_min_pd(x.1, far_y[j]);
    }
    let (near_z, far_z) = (each(z.0), each(z.1));
    let (mut mask, mut k) = (0, 0);
    while k < 4 {
        let lower = slice(&near, &far, near_z[k], far_z[k]);
        let upper = slice(&near, &far, near_z[k + 1], far_z[k + 1]);
        // One bit for each box: the first two x of each y and z, then the others.
        let bits = _mm256_movemask_epi8(_mm256_packs_epi16(lower, upper)) as u32;
        let bits = _pdep_u32(bits, 0x3333_3333) | _pdep_u32(bits >> 16, 0xCCCC_CCCC);
        mask |= u64::from(bits) << (16 * k);
        k += 2;
    }
    mask
}

/// The t at which four boxes of a row begin, and at which they end.
#[target_feature(enable = "avx2")]
#[inline]
fn row(ray: &IndexRay, a: usize, corner: __m256d, step: &Lanes, side: f64) -> (__m256d, __m256d) {
    let row = &ROWS[usize::from(ray.is_down(a))];
    let side = _mm256_set1_pd(side);
    // SAFETY: `row` has eight numbers; the first four are read, then the last four.
    #[allow(unsafe_code)]
    let (near, far) = unsafe { (_mm256_loadu_pd(row.as_ptr()), _mm256_loadu_pd(row.as_ptr().add(4))) };
    let near = _mm256_add_pd(corner, _mm256_mul_pd(near, side));
    let far = _mm256_add_pd(corner, _mm256_mul_pd(far, side));
    (t_of(ray, a, near, step), t_of(ray, a, far, step))
}

#[target_feature(enable = "avx2")]
#[inline]
fn t_of(ray: &IndexRay, a: usize, planes: __m256d, step: &Lanes) -> __m256d {
    let planes = _mm256_add_pd(planes, _mm256_set1_pd(step[a]));
    let to_planes = _mm256_sub_pd(planes, _mm256_set1_pd(ray.origin[a]));
    _mm256_mul_pd(to_planes, _mm256_set1_pd(ray.inverse[a]))
}

/// Each of the four numbers, broadcast to four lanes.
#[target_feature(enable = "avx2")]
#[inline]
fn each(numbers: __m256d) -> [__m256d; 4] {
    [
        _mm256_permute4x64_pd::<0x00>(numbers),
        _mm256_permute4x64_pd::<0x55>(numbers),
        _mm256_permute4x64_pd::<0xAA>(numbers),
        _mm256_permute4x64_pd::<0xFF>(numbers),
    ]
}

/// The boxes of one z: 16 bits each, all set or none.
#[target_feature(enable = "avx2")]
#[inline]
fn slice(near: &[__m256d; 4], far: &[__m256d; 4], near_z: __m256d, far_z: __m256d) -> __m256i {
    let first = two_rows(near[0], far[0], near[1], far[1], near_z, far_z);
    let others = two_rows(near[2], far[2], near[3], far[3], near_z, far_z);
    _mm256_packs_epi32(first, others)
}

/// Packs half of the 64 bits of each of eight boxes.
#[target_feature(enable = "avx2")]
#[inline]
fn two_rows(
    near: __m256d,
    far: __m256d,
    other_near: __m256d,
    other_far: __m256d,
    near_z: __m256d,
    far_z: __m256d,
) -> __m256i {
    let one = before(_mm256_max_pd(near, near_z), _mm256_min_pd(far, far_z));
    let other = before(_mm256_max_pd(other_near, near_z), _mm256_min_pd(other_far, far_z));
    _mm256_castps_si256(_mm256_shuffle_ps::<0b10_00_10_00>(_mm256_castpd_ps(one), _mm256_castpd_ps(other)))
}

#[target_feature(enable = "avx2")]
#[inline]
fn before(near: __m256d, far: __m256d) -> __m256d {
    _mm256_cmp_pd::<_CMP_LT_OQ>(near, far)
}
