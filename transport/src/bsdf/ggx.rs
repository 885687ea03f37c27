//! Microfacets: GGX after Walter et al. 2007 (EGSR), height-correlated Smith masking (Heitz 2014, JCGT 3(2), eq. 99), sampled by
//! visible normals (Heitz 2018, JCGT 7(4), listing 1).

use std::f32::consts::PI;

use glam::Vec3;

/// Density D of microfacet normals `h`.
pub(super) fn ggx_d(h: Vec3, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    // cos² (a²−1) + 1 without cancellation near the pole: sin² + a² cos².
    let t = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
    a2 / (PI * t * t)
}

/// Smith's Λ for the direction `w`.
pub(super) fn lambda(w: Vec3, alpha: f32) -> f32 {
    let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    ((1.0 + alpha * alpha * tan2).sqrt() - 1.0) / 2.0
}

/// Samples a normal visible from `wi`, with density D·max(wi·h, 0) / ((1 + Λ(wi))·wi.z).
pub(super) fn sample_visible_normal(wi: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    let v = Vec3::new(alpha * wi.x, alpha * wi.y, wi.z).normalize();
    let len2 = v.x * v.x + v.y * v.y;
    let t1 = if len2 > 0.0 { Vec3::new(-v.y, v.x, 0.0) / len2.sqrt() } else { Vec3::X };
    let t2 = v.cross(t1);
    let (r, phi) = (u[0].sqrt(), 2.0 * PI * u[1]);
    let (sin, cos) = phi.sin_cos();
    let p1 = r * cos;
    let s = 0.5 * (1.0 + v.z);
    let p2 = (1.0 - s) * (1.0 - p1 * p1).max(0.0).sqrt() + s * r * sin;
    let n = t1 * p1 + t2 * p2 + v * (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
    Vec3::new(alpha * n.x, alpha * n.y, n.z.max(0.0)).normalize()
}
