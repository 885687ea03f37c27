//! Reflectance of smooth surfaces.
//!
//! Dielectrics follow Fresnel's equations (Born and Wolf, *Principles of Optics*, §1.5.2); metals follow Schlick's curve with an edge tint
//! (F82-Tint: Kutz, Hasan, Edmondson 2021, *Novel Aspects of the Adobe Standard Material*, §2.1). Averages are over the cosine-weighted
//! hemisphere.

use glam::Vec3;

/// Reflected part of unpolarised light at the cosine `cos`, where the index of refraction beyond the surface is `eta` times that before it;
/// 1 at total internal reflection.
pub(super) fn fresnel_dielectric(cos: f32, eta: f32) -> f32 {
    let g2 = eta * eta - 1.0 + cos * cos;
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    let (s, p) = ((cos - g) / (cos + g), (eta * eta * cos - g) / (eta * eta * cos + g));
    0.5 * (s * s + p * p)
}

/// Reflectance at normal incidence, from the index of refraction.
pub(super) fn f0_from_ior(ior: f32) -> f32 {
    let ratio = (ior - 1.0) / (ior + 1.0);
    ratio * ratio
}

/// Index of refraction from the reflectance at normal incidence, which is limited to 0.99 as in Cycles.
pub(super) fn ior_from_f0(f0: f32) -> f32 {
    let root = f0.clamp(0.0, 0.99).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// Position of the reflectance between that at normal incidence, `f0`, and 1, as a number in [0, 1].
pub(super) fn fresnel_share(cos: f32, eta: f32, f0: f32) -> f32 {
    ((fresnel_dielectric(cos, eta) - f0) / (1.0 - f0)).clamp(0.0, 1.0)
}

/// Average reflectance of a dielectric: the fit of Kulla and Conty 2017, *Revisiting Physically Based Shading at Imageworks*.
pub(super) fn fresnel_dielectric_average(eta: f32) -> f32 {
    if eta < 1.0 {
        0.997_118 + eta * (0.1014 - eta * (0.965_241 + eta * 0.130_607))
    } else {
        (eta - 1.0) / (4.085_67 + 1.000_71 * eta)
    }
}

/// Coefficient of the term cos·(1−cos)⁶ that is subtracted from Schlick's curve, so that the curve is `tint` times its value at the cosine
/// 1/7.
pub(super) fn f82_b(f0: Vec3, tint: Vec3) -> Vec3 {
    const F: f32 = 6.0 / 7.0;
    const F5: f32 = F * F * F * F * F;
    (f0 + (Vec3::ONE - f0) * F5) * (7.0 / (F5 * F)) * (Vec3::ONE - tint)
}

/// Reflectance of a metal.
pub(super) fn fresnel_f82(cos: f32, f0: Vec3, b: Vec3) -> Vec3 {
    let s = (1.0 - cos).clamp(0.0, 1.0);
    let s5 = s * s * s * s * s;
    (f0 + (Vec3::ONE - f0) * s5 - b * (cos * s5 * s)).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Average reflectance of a metal: ∫2μ(1−μ)⁵ dμ = 1/21, ∫2μ²(1−μ)⁶ dμ = 1/126.
pub(super) fn fresnel_f82_average(f0: Vec3, b: Vec3) -> Vec3 {
    f0 + (Vec3::ONE - f0) * (1.0 / 21.0) - b * (1.0 / 126.0)
}
