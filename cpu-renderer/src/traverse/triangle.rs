//! A ray against a triangle, without cracks between triangles.
//!
//! Woop, Benthin, Wald 2013, *Watertight Ray/Triangle Intersection* (JCGT 2.1): the triangle is translated and sheared so that the ray runs
//! along an axis from the origin. What remains is whether a point of a plane lies within a triangle, which three edge functions decide.
//! Each depends on the ray and two corners alone, and only changes its sign when the corners are swapped: a ray between two triangles with
//! a common edge hits one of them or both.
//!
//! Differences from the paper:
//!
//! * Corners are subtracted from the ray's origin in f64 and only then rounded: nearby corners keep their digits, however large the mesh.
//! * An edge function that is 0 in f32 is evaluated exactly, by products of f32 in f64, and each by itself (the paper repeats all three).
//!   Rounding is monotone: a result that is not 0 has the sign of the exact one. So every sign is exact for the sheared corners.
//! * The distance is that of the triangle's plane in f64, from which paths continue, and not one of f32. Where the ray grazes the plane,
//!   the f32 of the shear may put a hit before or behind the triangle: the distance is clamped to that of the corners.

use glam::DVec3;

/// A ray prepared for triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleRay {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// Axes: two across the ray, and the one along which its direction is largest.
    axes: [usize; 3],
    shear: [f32; 2],
}

impl TriangleRay {
    /// `direction` is finite and not 0.
    #[inline]
    pub(crate) fn new(origin: DVec3, direction: DVec3) -> Self {
        let size = direction.abs();
        let z = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        // Swapping the axes keeps the orientation of the corners; nothing here needs it, but a twin must agree.
        let axes = if direction[z] < 0.0 { [y, x, z] } else { [x, y, z] };
        let along = direction[z];
        let shear = [(direction[axes[0]] / along) as f32, (direction[axes[1]] / along) as f32];
        Self { origin, direction, axes, shear }
    }

    /// Offset of a corner from the ray, after translation and shear.
    #[inline]
    fn beside(&self, from_origin: DVec3) -> [f32; 2] {
        let [x, y, z] = self.axes;
        let along = from_origin[z] as f32;
        [from_origin[x] as f32 - self.shear[0] * along, from_origin[y] as f32 - self.shear[1] * along]
    }

    /// t at which the ray, extended to a whole line, meets the triangle.
    #[inline]
    pub(crate) fn meet(&self, corners: [DVec3; 3]) -> Option<f64> {
        let [a, b, c] = corners.map(|p| p - self.origin);
        let (at_a, at_b, at_c) = (self.beside(a), self.beside(b), self.beside(c));
        let (u, v, w) = (edge(at_c, at_b), edge(at_a, at_c), edge(at_b, at_a));
        let (any_below, any_above) = (u < 0.0 || v < 0.0 || w < 0.0, u > 0.0 || v > 0.0 || w > 0.0);
        // Signs of both kinds: the ray passes beside the triangle. All 0: the ray sees the triangle edge on.
        if any_below == any_above {
            return None;
        }
        let normal = (b - a).cross(c - a);
        let t = normal.dot(a) / normal.dot(self.direction);
        let z = self.axes[2];
        let (least, most) = (a[z].min(b[z]).min(c[z]), a[z].max(b[z]).max(c[z]));
        let along = self.direction[z];
        let (first, last) = if along < 0.0 { (most, least) } else { (least, most) };
        let (first, last) = (first / along, last / along);
        // Not `clamp`: t is NaN where the plane is undefined.
        Some(if t > first { if t < last { t } else { last } } else { first })
    }
}

/// Twice the area of the triangle of `p`, `q` and the ray; only its sign (±1) where f32 gives 0.
#[inline]
fn edge(p: [f32; 2], q: [f32; 2]) -> f32 {
    let area = p[0] * q[1] - p[1] * q[0];
    if area != 0.0 {
        return area;
    }
    // Products of two f32 are exact in f64.
    let more = f64::from(p[0]) * f64::from(q[1]);
    let less = f64::from(p[1]) * f64::from(q[0]);
    f32::from(i8::from(more > less) - i8::from(more < less))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    #[test]
    fn a_ray_meets_a_triangle_from_both_sides_and_not_beside_it() {
        let triangle = [at(0.0, 0.0, 0.0), at(4.0, 0.0, 0.0), at(0.0, 4.0, 0.0)];
        for (x, y, expected) in [(1.0, 1.0, true), (2.5, 2.5, false), (-0.1, 1.0, false), (2.0, 2.0, true)] {
            for side in [-1.0, 1.0] {
                let ray = TriangleRay::new(at(x, y, 3.0 * side), at(0.0, 0.0, -2.0 * side));
                let t = ray.meet(triangle);
                assert_eq!(t, expected.then_some(1.5), "at ({x}, {y}) from {side}");
            }
        }
        // Edge on, and a triangle that is degenerate to a line.
        assert_eq!(TriangleRay::new(at(-1.0, 1.0, 0.0), at(1.0, 0.0, 0.0)).meet(triangle), None);
        let line = [at(0.0, 0.0, 0.0), at(1.0, 1.0, 0.0), at(2.0, 2.0, 0.0)];
        assert_eq!(TriangleRay::new(at(1.0, 1.0, 1.0), at(0.0, 0.0, -1.0)).meet(line), None);
    }

    #[test]
    fn edges_that_f32_cannot_tell_are_told_exactly() {
        // (1 + ε)(1 − ε) = 1 − ε² is 1 in f32: the exact area is −ε².
        let e = f32::EPSILON;
        let (p, q) = ([1.0 + e, 1.0], [1.0, 1.0 - e]);
        assert_eq!(p[0] * q[1] - p[1] * q[0], 0.0, "as f32 has it");
        assert_eq!([edge(p, q), edge(q, p), edge(p, p)], [-1.0, 1.0, 0.0]);
        // Below the smallest f32.
        let tiny = 1e-30;
        assert_eq!([edge([tiny, 0.0], [0.0, tiny]), edge([0.0, tiny], [tiny, 0.0])], [1.0, -1.0]);
    }
}
