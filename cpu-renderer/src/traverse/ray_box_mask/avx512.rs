//! [`super::RayBoxMask`] with AVX-512: eight boxes at once, those of two y and one z, with masks in mask registers.

use std::arch::x86_64::{
    __m256d, __m512d, __mmask8, _CMP_LT_OQ, _mm512_add_pd, _mm512_castpd256_pd512, _mm512_cmp_pd_mask,
    _mm512_kunpackb, _mm512_kunpackd, _mm512_kunpackw, _mm512_loadu_pd, _mm512_max_pd, _mm512_min_pd,
    _mm512_mul_pd, _mm512_permutexvar_pd, _mm512_set1_pd, _mm512_setr_epi64, _mm512_sub_pd,
};

use super::{IndexRay, Lanes, ROWS};

/// Implements [`super::RayBoxMask::ray_box_mask`].
#[target_feature(enable = "avx512f,avx512bw,avx512dq")]
#[inline]
pub(super) fn ray_box_mask(ray: &IndexRay, corner: __m256d, step: &Lanes, side: f64, from: f64) -> u64 {
    let x = row(ray, 0, corner, step, side);
    let y = row(ray, 1, corner, step, side);
    let z = row(ray, 2, corner, step, side);
    // Eight boxes at once, all x of two y.
    let near_x = _mm512_max_pd(pick(x, [0, 1, 2, 3, 0, 1, 2, 3]), _mm512_set1_pd(from));
    let far_x = pick(x, [4, 5, 6, 7, 4, 5, 6, 7]);
    let near = (
        _mm512_max_pd(near_x, pick(y, [0, 0, 0, 0, 1, 1, 1, 1])),
        _mm512_max_pd(near_x, pick(y, [2, 2, 2, 2, 3, 3, 3, 3])),
    );
    let far = (
        _mm512_min_pd(far_x, pick(y, [4, 4, 4, 4, 5, 5, 5, 5])),
        _mm512_min_pd(far_x, pick(y, [6, 6, 6, 6, 7, 7, 7, 7])),
    );
    let slice = |k: i64| {
        let (near_z, far_z) = (pick(z, [k; 8]), pick(z, [k + 4; 8]));
        let lower = before(_mm512_max_pd(near.0, near_z), _mm512_min_pd(far.0, far_z));
        let upper = before(_mm512_max_pd(near.1, near_z), _mm512_min_pd(far.1, far_z));
        _mm512_kunpackb(upper.into(), lower.into())
    };
    let lower = _mm512_kunpackw(slice(1).into(), slice(0).into());
    let upper = _mm512_kunpackw(slice(3).into(), slice(2).into());
    _mm512_kunpackd(upper.into(), lower.into())
}

/// The t at which four boxes of a row begin, and at which they end.
#[target_feature(enable = "avx512f")]
#[inline]
fn row(ray: &IndexRay, a: usize, corner: __m256d, step: &Lanes, side: f64) -> __m512d {
    let row = &ROWS[usize::from(ray.is_down(a))];
    // SAFETY: eight numbers are read from an array of eight.
    #[allow(unsafe_code)]
    let sides = unsafe { _mm512_loadu_pd(row.as_ptr()) };
    let i = a as i64;
    let corner = pick(_mm512_castpd256_pd512(corner), [i; 8]);
    let planes = _mm512_add_pd(corner, _mm512_mul_pd(sides, _mm512_set1_pd(side)));
    let planes = _mm512_add_pd(planes, _mm512_set1_pd(step[a]));
    let to_planes = _mm512_sub_pd(planes, _mm512_set1_pd(ray.origin[a]));
    _mm512_mul_pd(to_planes, _mm512_set1_pd(ray.inverse[a]))
}

#[target_feature(enable = "avx512f")]
#[inline]
fn pick(of: __m512d, [a, b, c, d, e, f, g, h]: [i64; 8]) -> __m512d {
    _mm512_permutexvar_pd(_mm512_setr_epi64(a, b, c, d, e, f, g, h), of)
}

#[target_feature(enable = "avx512f")]
#[inline]
fn before(near: __m512d, far: __m512d) -> __mmask8 {
    _mm512_cmp_pd_mask::<_CMP_LT_OQ>(near, far)
}
