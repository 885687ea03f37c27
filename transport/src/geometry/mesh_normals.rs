//! Smooth normals of triangles: the normals of the corners, blended over the triangle with barycentric weights.
//!
//! The surface itself stays flat; only the shading normal is blended, as in Cycles: unit normals of the corners in mesh space, weighted,
//! then transformed to the world by the inverse transpose. (For a mesh that a scene uses once, Cycles swaps the last two steps: under
//! uneven scaling its normals then differ, by as much as the corner normals do.)

use glam::{DVec3, Vec3};
use pumice_core::octahedral::{FLAT, decode};

/// Blended normal at `p`, of any length above 0, in the space of the corners; `None` where the triangle's own normal applies.
pub fn blended_normal(corners: [DVec3; 3], normals: [u32; 3], p: DVec3) -> Option<Vec3> {
    if normals == [FLAT; 3] {
        return None;
    }
    let own = (corners[1] - corners[0]).as_vec3().cross((corners[2] - corners[0]).as_vec3());
    let from_p = corners.map(|c| (c - p).as_vec3());
    let mut sum = Vec3::ZERO;
    for i in 0..3 {
        // Twice the area of the triangle between the point and the other two corners, times twice the whole area.
        let weight = from_p[(i + 1) % 3].cross(from_p[(i + 2) % 3]).dot(own).max(0.0);
        let normal = if normals[i] == FLAT { own } else { Vec3::from(decode(normals[i])) };
        sum += normal * (weight / normal.length());
    }
    // Corner normals may be opposite to each other, and a triangle may have no area.
    let largest = sum.abs().max_element();
    (largest > 0.0 && largest.is_finite()).then(|| sum / largest)
}

#[cfg(test)]
mod tests {
    use pumice_core::octahedral::encode;

    use super::*;

    const CORNERS: [DVec3; 3] =
        [DVec3::new(2.0, 2.0, 2.0), DVec3::new(6.0, 2.0, 2.0), DVec3::new(2.0, 10.0, 2.0)];

    fn word(x: f64, y: f64, z: f64) -> u32 {
        encode(DVec3::new(x, y, z).normalize().to_array())
    }

    fn at(u: f64, v: f64) -> DVec3 {
        CORNERS[0] + (CORNERS[1] - CORNERS[0]) * u + (CORNERS[2] - CORNERS[0]) * v
    }

    #[test]
    fn corners_are_met_and_middles_are_between() {
        let n = [DVec3::new(-0.3, 0.0, 1.0), DVec3::new(0.5, 0.1, 1.0), DVec3::new(0.0, 0.8, -0.2)];
        let words = n.map(|n| word(n.x, n.y, n.z));
        let n = n.map(DVec3::normalize);
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.25, 0.5), (0.5, 0.5), (0.1, 0.0)] {
            let expected = (n[0] * (1.0 - u - v) + n[1] * u + n[2] * v).normalize();
            let got = blended_normal(CORNERS, words, at(u, v)).unwrap().as_dvec3().normalize();
            // Decoded normals are off by 7e-5 at most.
            assert!((got - expected).length() < 1.5e-4, "{u} {v}: {got} {expected}");
        }
    }

    #[test]
    fn what_says_nothing_is_the_triangles_own() {
        let up = Vec3::Z;
        assert_eq!(blended_normal(CORNERS, [FLAT; 3], at(0.3, 0.3)), None);
        let mixed = [FLAT, word(1.0, 0.0, 1.0), FLAT];
        assert_eq!(blended_normal(CORNERS, mixed, at(0.0, 0.7)).unwrap().normalize(), up);
        // Opposite to each other, at the midpoint.
        let against = [word(1.0, 0.0, 0.0), word(-1.0, 0.0, 0.0), FLAT];
        assert_eq!(blended_normal(CORNERS, against, at(0.5, 0.0)), None);
        // No area: a line, and a point.
        for corners in [[CORNERS[0], CORNERS[1], CORNERS[1]], [CORNERS[0]; 3]] {
            assert_eq!(blended_normal(corners, against, corners[0]), None);
        }
    }
}
