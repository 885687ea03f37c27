//! The oracle for any placement: takes the f64 numbers of matrix, origin and direction as exact, and marches in index space in rational
//! numbers, without any rounding.
//!
//! Every f64 is a multiple of 2⁻¹⁶⁰ (the generators ensure it). With M the matrix, v = origin − translation and D the direction as such
//! whole numbers, Cramer's rule makes the ray in index space a fraction of whole numbers of about 700 bits:
//!
//! ```text
//! position(t) = (o + t·d) / e       o = adj(M)·v    d = adj(M)·D    e = det(M) > 0
//! plane p of axis a at t = (p·e − oₐ) / dₐ
//! ```
//! Comparisons use f64 quotients first, which have a relative error of about 2⁻⁵¹; closer values are compared exactly, by multiplication.

#![allow(clippy::expect_used, reason = "test helpers: a failure is a failed test")]

use glam::{DAffine3, DVec3};
use num_bigint::BigInt;
use num_traits::{Signed, ToPrimitive, Zero};

/// Fraction bits of every number.
const BITS: i32 = 160;

fn whole(x: f64) -> BigInt {
    assert!(x.is_finite());
    if x == 0.0 {
        return BigInt::zero();
    }
    let bits = x.abs().to_bits();
    let exponent = (bits >> 52) as i32 - 1075;
    assert!(exponent >= -1074, "{x} is subnormal");
    let mantissa = BigInt::from((bits & ((1 << 52) - 1)) | 1 << 52);
    let shift = exponent + BITS;
    let size = if shift >= 0 {
        mantissa << shift
    } else {
        let coarse: BigInt = &mantissa >> -shift;
        assert!(&coarse << -shift == mantissa, "{x} is finer than 2^-{BITS}");
        coarse
    };
    if x < 0.0 { -size } else { size }
}

fn float(x: &BigInt) -> f64 {
    x.to_f64().expect("below 2^1023")
}

fn floor_quotient(n: &BigInt, d: &BigInt) -> BigInt {
    let q = n / d;
    if (&q * d) != *n && n.is_negative() != d.is_negative() { q - 1 } else { q }
}

type Row = [BigInt; 3];

fn dot(a: &Row, b: &Row) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &Row, b: &Row) -> Row {
    [0, 1, 2].map(|i| &a[(i + 1) % 3] * &b[(i + 2) % 3] - &a[(i + 2) % 3] * &b[(i + 1) % 3])
}

/// An f64 matrix with its exact adjugate and determinant, and bounds of the errors of their f64 values.
pub struct ExactPlace {
    pub world_from_index: DAffine3,
    translation: Row,
    adjugate: [Row; 3],
    determinant: BigInt,
    /// The minors of the adjugate with the absolute values of their two products added, over the determinant: no cancellation.
    sizes: [DVec3; 3],
    /// The determinant, computed in the same way.
    determinant_size: f64,
}

/// 2⁻⁵³: the relative error of one rounding.
const U: f64 = f64::EPSILON / 2.0;

impl ExactPlace {
    pub fn new(world_from_index: DAffine3) -> Self {
        let m = world_from_index.matrix3;
        let columns = [m.x_axis, m.y_axis, m.z_axis];
        let exact = columns.map(|c| c.to_array().map(whole));
        let adjugate = [0, 1, 2].map(|i| cross(&exact[(i + 1) % 3], &exact[(i + 2) % 3]));
        let determinant = dot(&exact[0], &adjugate[0]);
        assert!(!determinant.is_zero());
        let sign = |r: Row| if determinant.is_negative() { r.map(|x| -x) } else { r };
        let det = m.determinant().abs();
        let sizes = [0, 1, 2].map(|i| {
            let (a, b) = (columns[(i + 1) % 3].abs(), columns[(i + 2) % 3].abs());
            DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x) / det
        });
        Self {
            world_from_index,
            translation: world_from_index.translation.to_array().map(whole),
            adjugate: adjugate.map(sign),
            determinant: determinant.abs(),
            determinant_size: columns[0].abs().dot(sizes[0]),
            sizes,
        }
    }

    /// Bound, for each axis, of the error of computing `inverse(M)·v` in f64 by adjugate and determinant, where v itself was rounded once.
    ///
    /// In units of [`U`] and to first order: a minor is off by 2 of its size (two products, then the difference, which is no larger), v by
    /// 1, a sum of three products by 3, so adj·v by 6; the quotient adds 1; the determinant is off by 2 + 3 of its size. Together (7 +
    /// 5·size(det)/det) of size(adj)·|v|/det; a hundredth is added for the products of errors.
    fn rounding(&self, v: DVec3) -> [f64; 3] {
        self.sizes.map(|row| 1.01 * U * (7.0 + 5.0 * self.determinant_size) * row.dot(v.abs()))
    }
}

/// A distance along a ray: a fraction (denominator above 0) and its f64 value.
#[derive(Clone, Debug)]
pub struct Time {
    n: BigInt,
    d: BigInt,
    pub value: f64,
}

impl Time {
    fn new(n: BigInt, d: BigInt) -> Self {
        let (n, d) = if d.is_negative() { (-n, -d) } else { (n, d) };
        let value = float(&n) / float(&d);
        Self { n, d, value }
    }

    fn zero() -> Self {
        Self { n: BigInt::zero(), d: BigInt::from(1), value: 0.0 }
    }

    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        // Two conversions and a division each: 3 U, doubled.
        if (self.value - other.value).abs() > 12.0 * U * self.value.abs().max(other.value.abs()) {
            return self.value.total_cmp(&other.value);
        }
        (&self.n * &other.d).cmp(&(&other.n * &self.d))
    }

    pub fn less(&self, other: &Self) -> bool {
        self.cmp(other).is_lt()
    }
}

/// A ray in index space.
pub struct RationalRay {
    o: Row,
    d: Row,
    e: BigInt,
    /// Error bounds of the renderer's origin and direction, in voxels.
    origin_error: [f64; 3],
    direction_error: [f64; 3],
    /// Length of the direction in index space.
    pub length: f64,
}

impl RationalRay {
    /// The exact ray of these f64 numbers.
    pub fn new(place: &ExactPlace, origin: DVec3, direction: DVec3) -> Self {
        let o = origin.to_array().map(whole);
        let v = [0, 1, 2].map(|a| &o[a] - &place.translation[a]);
        let w = direction.to_array().map(whole);
        let mut ray = Self {
            o: place.adjugate.each_ref().map(|row| dot(row, &v)),
            d: place.adjugate.each_ref().map(|row| dot(row, &w)),
            e: place.determinant.clone(),
            origin_error: place.rounding(origin - place.world_from_index.translation),
            direction_error: place.rounding(direction),
            length: 0.0,
        };
        ray.length = (0..3).map(|a| ray.component(a).powi(2)).sum::<f64>().sqrt();
        ray
    }

    /// The same ray as it leaves a face of `voxel`: exactly on the face's plane, never back through it, and in the voxel in front of it.
    /// Like the renderer, it keeps to the face's rectangle by 2⁻²⁸, also where the path's origin in the world was rounded to a point beside
    /// it, or where the first hit was at an edge that a walk treated as hit.
    #[must_use]
    pub fn leaving_face(mut self, voxel: [u32; 3], axis: usize, plane: u32, positive: bool) -> Self {
        self.o[axis] = &self.e * plane;
        self.origin_error = [0, 1, 2].map(|a| {
            if a == axis {
                return 0.0;
            }
            let above = |p: u32| float(&(&self.o[a] - &self.e * p)) / float(&self.e);
            let beside = (-above(voxel[a])).max(above(voxel[a] + 1)).max(0.0);
            assert!(beside <= WALK_CHORD, "a path starts {beside} voxels beside its face");
            self.origin_error[a] + 2f64.powi(-28) + beside
        });
        if self.d[axis].is_zero() || self.d[axis].is_negative() == positive {
            assert!(self.component(axis).abs() <= self.direction_error[axis], "the ray points into the face");
            self.d[axis] = BigInt::zero();
            if !positive {
                // A ray in a plane belongs to the voxel above it; this ray's voxel is below.
                self.o[axis] = (&self.e * (2 * i64::from(plane) - 1)) / 2;
            }
        }
        self
    }

    pub fn component(&self, a: usize) -> f64 {
        float(&self.d[a]) / float(&self.e)
    }

    /// The t of plane `p` of axis `a`; the ray's component along `a` must not be 0.
    fn plane(&self, a: usize, p: i64) -> Time {
        Time::new(&self.e * p - &self.o[a], self.d[a].clone())
    }

    /// Distance of the position at t above plane `p` of axis `a`, where t is taken as exact; one rounding of the exact difference.
    fn above(&self, a: usize, p: i64, t: f64) -> f64 {
        let t = whole(t);
        let n = ((&self.o[a] - &self.e * p) << BITS) + t * &self.d[a];
        float(&n) / float(&(&self.e << BITS))
    }

    /// Bound of the distance between the exact position and the renderer's at t: origin, direction, and the four roundings of the distance
    /// of a plane (subtraction, reciprocal, product, scale), each a share of the way along the axis.
    fn error(&self, a: usize, t: f64) -> f64 {
        self.origin_error[a] + t * (self.direction_error[a] + 4.0 * U * self.component(a).abs())
    }

    /// As `ExactRay::march`: visits each voxel of `0..dims` that the ray passes through at t > 0 with a chord above 0, in order.
    pub fn march(&self, dims: [u32; 3], mut visit: impl FnMut([i64; 3], &Time, &Time) -> bool) {
        let moving: Vec<usize> = (0..3).filter(|&a| !self.d[a].is_zero()).collect();
        let down = |a: usize| self.d[a].is_negative();
        let mut t = Time::zero();
        for &a in &moving {
            let near = self.plane(a, if down(a) { i64::from(dims[a]) } else { 0 });
            if t.less(&near) {
                t = near;
            }
        }
        let mut v = [0, 1, 2].map(|a| {
            let (n, d) = (&self.o[a] * &t.d + &t.n * &self.d[a], &t.d * &self.e);
            let floor = if down(a) { -floor_quotient(&-n, &d) - 1 } else { floor_quotient(&n, &d) };
            floor.to_i64().unwrap_or(-1)
        });
        let next = |a: usize, v: i64| self.plane(a, v + i64::from(!down(a)));
        let mut ahead = [0, 1, 2].map(|a| moving.contains(&a).then(|| next(a, v[a])));
        while (0..3).all(|a| v[a] >= 0 && v[a] < i64::from(dims[a])) {
            let Some(leave) = ahead.iter().flatten().reduce(|x, y| if y.less(x) { y } else { x }).cloned()
            else {
                return;
            };
            if !visit(v, &t, &leave) {
                return;
            }
            for &a in &moving {
                if ahead[a].as_ref().is_some_and(|t| !leave.less(t)) {
                    v[a] += if down(a) { -1 } else { 1 };
                    ahead[a] = Some(next(a, v[a]));
                }
            }
            t = leave;
        }
    }

    /// Whether the renderer's ray certainly starts in `voxel`.
    fn starts_in(&self, voxel: [i64; 3]) -> bool {
        (0..3).all(|a| {
            let error = self.error(a, 0.0);
            self.above(a, voxel[a], 0.0) > error && self.above(a, voxel[a] + 1, 0.0) < -error
        })
    }

    /// Length in voxels of the part of (0, `until`) along which the renderer's ray is certainly in `voxel`: the exact chord, less the error
    /// bounds of its planes.
    fn certain_chord(&self, voxel: [i64; 3], until: f64) -> f64 {
        let moving = || (0..3).filter(|&a| !self.d[a].is_zero());
        let far = |a: usize| self.plane(a, voxel[a] + i64::from(self.d[a].is_positive())).value;
        let near = |a: usize| self.plane(a, voxel[a] + i64::from(self.d[a].is_negative())).value;
        // The error grows with t, so it is taken at the chord's end.
        let end = moving().map(far).fold(until, f64::min).max(0.0);
        let (mut enter, mut leave) = (0.0f64, end);
        for (a, &v) in voxel.iter().enumerate() {
            let error = self.error(a, end);
            if self.d[a].is_zero() {
                if self.above(a, v, 0.0) < error || self.above(a, v + 1, 0.0) > -error {
                    return 0.0;
                }
            } else {
                let error_t = error / self.component(a).abs();
                enter = enter.max(near(a) + error_t);
                leave = leave.min(far(a) - error_t);
            }
        }
        (leave - enter).max(0.0) * self.length
    }
}

/// Longest chord that the walk through a box may skip, because it orders planes in f32 (`traverse::box_walk`, on ties).
pub const WALK_CHORD: f64 = 2e-5;

pub mod judge;
