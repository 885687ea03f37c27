//! Surfaces that are shaded with a normal other than their own.
//!
//! ```text
//!        N  shading: Lambert, sheen            If N mirrors the viewer below the surface, that reflection would be lost. Microfacets and
//!        │   N′ microfacets, coat              coat then use N turned towards Ng just so far that the mirrored direction is 0.01 above
//!        │  ╱  ╱ Ng  geometric: sides          the surface (or 0.9 of the viewer's height, if that is less). Same as Cycles'
//!    ────┴──────────                           `ensure_valid_specular_reflection` (`kernel/closure/bsdf_util.h`).
//! ```
//! All vectors are in the frame whose z axis is N. Since microfacets are isotropic, they may use any frame around N′; this is the one that
//! turns N′ to z by the shortest rotation.

use glam::Vec3;

/// Least height of a mirrored direction above the surface, and its limit as a part of the viewer's height (both as in Cycles).
const LEAST_HEIGHT: f32 = 0.01;
const PART_OF_HEIGHT: f32 = 0.9;

/// Heights below this are rounding errors.
const LEAST_COSINE: f32 = 1e-6;

/// Transform from the frame of the shading normal to that of the microfacets' normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularNormal {
    /// The microfacets' normal, in the frame of the shading normal.
    normal: Vec3,
}

impl SpecularNormal {
    /// Both normals are the same.
    pub const NONE: Self = Self { normal: Vec3::Z };

    /// For a surface with this geometric normal, seen from `wi` on its side; both in the frame of the shading normal.
    pub fn new(geometric: Vec3, wi: Vec3) -> Self {
        let height = wi.dot(geometric).max(LEAST_COSINE);
        let least = LEAST_HEIGHT.min(PART_OF_HEIGHT * height);
        let mirrored = Vec3::new(-wi.x, -wi.y, wi.z);
        if mirrored.dot(geometric) >= least {
            return Self::NONE;
        }
        // Among the unit vectors Nx X + Nz Ng in the plane of both normals, find the one that mirrors wi to the least height: 2 (Nx Ix + Nz
        // Iz) Nz − Iz = least, which is a quadratic equation in Nz².
        let across = Vec3::Z - geometric.z * geometric;
        let length = across.length();
        if length < LEAST_COSINE {
            return Self::NONE;
        }
        let across = across / length;
        let ix = wi.dot(across);
        let a = ix * ix + height * height;
        let b = 2.0 * (a + height * least);
        let c = (least + height) * (least + height);
        let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
        let nz2 = 0.25 * (if ix < 0.0 { b + root } else { b - root }) / a;
        let (nx, nz) = ((1.0 - nz2).max(0.0).sqrt(), nz2.max(0.0).sqrt());
        Self { normal: (nx * across + nz * geometric).normalize() }
    }

    /// Whether the microfacets use the shading normal itself.
    #[inline]
    pub fn is_none(&self) -> bool {
        self.normal == Vec3::Z
    }

    /// Transforms a direction to the frame of the microfacets.
    #[inline]
    pub fn to_microfacets(&self, w: Vec3) -> Vec3 {
        if self.is_none() {
            return w;
        }
        let (n, cos) = (self.normal, self.normal.dot(w));
        let part = (cos + w.z) / (1.0 + n.z).max(LEAST_COSINE);
        Vec3::new(w.x - n.x * part, w.y - n.y * part, cos)
    }

    /// Transforms a direction from the frame of the microfacets.
    #[inline]
    pub fn from_microfacets(&self, w: Vec3) -> Vec3 {
        if self.is_none() {
            return w;
        }
        let n = self.normal;
        let part = (n.dot(w) + w.z) / (1.0 + n.z).max(LEAST_COSINE);
        w - (n + Vec3::Z) * part + n * (2.0 * w.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..400).map(|i| {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 400.0;
            let (s, c) = (i as f32 * 2.399_963).sin_cos();
            Vec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z)
        })
    }

    /// Checks the definition: the mirrored direction is at the least height or above it, and turned no further than necessary.
    #[test]
    fn mirrored_directions_are_above_the_surface() {
        let (mut tilted, mut straight) = (0, 0);
        for geometric in directions().filter(|n| n.z > 0.05) {
            for wi in directions().filter(|w| w.dot(geometric) > 1e-3) {
                let specular_normal = SpecularNormal::new(geometric, wi);
                let n = specular_normal.normal;
                let mirrored = 2.0 * n.dot(wi) * n - wi;
                let height = mirrored.dot(geometric);
                let least = 0.01f32.min(0.9 * wi.dot(geometric));
                if specular_normal.is_none() {
                    straight += 1;
                    assert!(height >= least - 1e-6, "{geometric} {wi}: {height}");
                } else {
                    tilted += 1;
                    // The square root of a small difference is inaccurate.
                    assert!((height - least).abs() < 2e-3, "{geometric} {wi}: {height} not {least}");
                    assert!(
                        n.dot(wi) > 0.0 && n.dot(geometric) > geometric.z - 1e-4,
                        "{geometric} {wi}: {n}"
                    );
                }
            }
        }
        assert!(tilted > 10_000 && straight > 10_000, "{tilted} {straight}");
    }

    #[test]
    fn frames_turn_there_and_back() {
        for n in directions().filter(|n| n.z > -0.9) {
            let specular_normal = SpecularNormal { normal: n };
            assert!((specular_normal.to_microfacets(n) - Vec3::Z).length() < 1e-5);
            for w in directions().step_by(7) {
                let there = specular_normal.to_microfacets(w);
                assert!((there.length() - 1.0).abs() < 1e-4 && (there.z - n.dot(w)).abs() < 1e-5, "{n} {w}");
                assert!((specular_normal.from_microfacets(there) - w).length() < 1e-4, "{n} {w}");
            }
        }
        let w = Vec3::new(0.1, 0.2, 0.3);
        assert_eq!(
            (SpecularNormal::NONE.to_microfacets(w), SpecularNormal::NONE.from_microfacets(w)),
            (w, w)
        );
    }

    /// The result is finite for every pair of vectors, also for normals that only a broken mesh has.
    #[test]
    fn normals_on_the_wrong_side_make_no_nan() {
        let all: Vec<_> = directions().chain([Vec3::Z, -Vec3::Z, Vec3::X]).collect();
        for &geometric in &all {
            for &wi in &all {
                let specular_normal = SpecularNormal::new(geometric, wi);
                assert!(specular_normal.normal.is_finite(), "{geometric} {wi}");
                assert!(
                    specular_normal.to_microfacets(wi).is_finite()
                        && specular_normal.from_microfacets(wi).is_finite()
                );
            }
        }
    }
}
