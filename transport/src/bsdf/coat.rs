//! The layers on top of a surface: fibres (sheen), and below them a clear coat whose colour absorbs light that passes it.

use glam::Vec3;
use pumice_scene::Material;

use super::LEAST_ALPHA_SQUARED;
use super::fresnel::{f0_from_ior, fresnel_dielectric, fresnel_dielectric_average};
use super::ggx::{ggx_d, lambda, sample_visible_normal};
use super::sheen::Sheen;
use super::tables::{
    FRESNEL_SHARE, REFLECTION, REFLECTION_AVERAGE, gain, index_place, table_1d, table_2d, table_3d,
};

/// A dielectric layer with its own roughness. Multiple scattering is always included, as in Cycles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    weight: f32,
    alpha: f32,
    eta: f32,
    /// Reflection towards the viewer, for choosing a lobe.
    pub(super) albedo: f32,
}

impl Coat {
    /// No coat.
    pub(super) const NONE: Self = Self { weight: 0.0, alpha: 0.0, eta: 1.0, albedo: 0.0 };

    /// The coat of `m` seen at the cosine `cos`, and the weight that remains for everything below it.
    #[inline(never)]
    pub(super) fn new(m: &Material, cos: f32) -> (Self, Vec3) {
        let (eta, f0) = (m.coat_ior, f0_from_ior(m.coat_ior));
        let kept = table_2d(REFLECTION, 32, m.coat_roughness, cos);
        let average = table_1d(REFLECTION_AVERAGE, 32, m.coat_roughness);
        let gain = gain(Vec3::splat(fresnel_dielectric_average(eta)), kept, average).x;
        let share = table_3d(FRESNEL_SHARE, 16, m.coat_roughness, cos, index_place(eta));
        // An index of 1 reflects nothing; this hides the rounding of the table's last digit.
        let layer = if eta > 1.0 { m.coat * gain * kept * (f0 + (1.0 - f0) * share) } else { 0.0 };
        let coat = Self {
            weight: if eta > 1.0 { m.coat * gain } else { 0.0 },
            alpha: m.coat_roughness * m.coat_roughness,
            eta,
            albedo: layer,
        };
        // Beer's law along the refracted ray; the tint is the transmission at normal incidence. An index of 1 at grazing incidence leaves a
        // cosine of 0; clamped to a thousand times the thickness it is black.
        let cos_t = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(1e-6).sqrt();
        let passed = m.coat_tint.map(|t| 1.0 + m.coat * (t.powf(1.0 / cos_t) - 1.0));
        (coat, Vec3::from_array(passed) * (1.0 - layer).clamp(0.0, 1.0))
    }

    pub(super) fn is_mirror(&self) -> bool {
        self.alpha * self.alpha <= LEAST_ALPHA_SQUARED
    }

    /// Reflection of a microfacet whose cosine with `wi` is `cos`.
    pub(super) fn reflectance(&self, cos: f32) -> Vec3 {
        Vec3::splat(self.weight * fresnel_dielectric(cos, self.eta))
    }

    /// f · cos and the density of [`Coat::sample`].
    #[inline(never)]
    pub(super) fn eval(&self, wi: Vec3, wo: Vec3) -> (Vec3, f32) {
        let h = (wi + wo).normalize();
        let (d, lambda_i, lambda_o) = (ggx_d(h, self.alpha), lambda(wi, self.alpha), lambda(wo, self.alpha));
        let common = d / (4.0 * wi.z);
        (self.reflectance(wi.dot(h)) * (common / (1.0 + lambda_i + lambda_o)), common / (1.0 + lambda_i))
    }

    /// Samples a reflected direction; it is invalid where z is below 0.
    pub(super) fn sample(&self, wi: Vec3, u: [f32; 2]) -> Vec3 {
        let h = sample_visible_normal(wi, self.alpha, u);
        2.0 * wi.dot(h) * h - wi
    }
}

/// The sheen of `m` seen at the cosine `cos`, its coat at `coat_cos`, and the weight that remains for everything below both.
#[inline]
pub(super) fn coat_and_sheen(m: &Material, cos: f32, coat_cos: f32) -> (Sheen, Coat, Vec3) {
    let (sheen, left) = if m.sheen > 0.0 { Sheen::new(m, cos) } else { (Sheen::NONE, 1.0) };
    let (mut coat, below) = if m.coat > 0.0 { Coat::new(m, coat_cos) } else { (Coat::NONE, Vec3::ONE) };
    coat.weight *= left;
    coat.albedo *= left;
    (sheen, coat, below * left)
}

/// Radiance that a surface emits at the cosine `cos`, after what its coat and sheen absorb.
#[inline]
pub fn emitted(m: &Material, cos: f32) -> Vec3 {
    let light = Vec3::from_array(m.emission);
    if (m.coat > 0.0 || m.sheen > 0.0) && light != Vec3::ZERO {
        light * coat_and_sheen(m, cos, cos).2
    } else {
        light
    }
}
