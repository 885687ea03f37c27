//! How a surface scatters light: Blender's Principled BSDF as Cycles computes it (formulas and sources in `docs/materials.md`).
//!
//! Local frame: z is the normal on the side of `wi`; `wi` points back along the path and `wo` is sampled, as in Cycles.
//!
//! ```text
//! sheen                       upright fibres                                       alone at the top
//! coat                        clear layer, its colour absorbs what passes          alone below it
//! metal      metallic         ┐
//! glass      transmission     ├ microfacets of one roughness: one lobe, one half vector
//! dielectric layer            ┘
//! diffuse                     Lambert, below the dielectric layer
//! ```
//! The part of the light that a layer reflects towards the viewer is subtracted from everything below it, as in Cycles. That is not
//! reciprocal, but keeps the sum at or below 1. A lobe sharper than [`LEAST_ALPHA_SQUARED`] is a mirror: light sampling contributes nothing
//! to it.
//!
//! Where the shading normal differs from the geometric one, microfacets and coat may use a third normal ([`SpecularNormal`]). Where the
//! horizons of that normal and of the shading normal disagree about a direction, light sampling does not see these lobes there, but
//! sampling the lobes does (as in Cycles). The caller rejects directions below the surface itself.

mod coat;
mod fresnel;
mod ggx;
mod sheen;
mod specular_normal;
pub mod tables;

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use pumice_scene::Material;

pub use coat::emitted;
use coat::{Coat, coat_and_sheen};
use fresnel::{
    f0_from_ior, f82_b, fresnel_dielectric_average, fresnel_f82, fresnel_f82_average, fresnel_share,
    ior_from_f0,
};
use ggx::{ggx_d, lambda, sample_visible_normal};
use sheen::Sheen;
pub use specular_normal::SpecularNormal;
use tables::{
    FRESNEL_SHARE, GLASS, GLASS_AVERAGE, INSIDE, REFLECTION, REFLECTION_AVERAGE, gain, index_place, table_1d,
    table_2d, table_3d,
};

/// Lobes with a smaller α² are mirrors, as in Cycles: f32 directions are too coarse for them.
pub const LEAST_ALPHA_SQUARED: f32 = 2e-10;

/// Indices of refraction nearer to 1 than this do not spread light, as in Cycles: rounding loses the half vector.
pub const LEAST_BEND: f32 = 1e-4;

/// Least cosine of the viewer: a grazing ray may round to 0 or below, but still sees the front.
pub const LEAST_VIEW: f32 = 1e-6;

/// Least weight of an existing lobe other than Lambert's when a lobe is chosen, as a share of the sum of all albedos. It bounds the ratio of
/// the lobe's reflection to its density to about ten.
const LEAST_SHARE: f32 = 0.1;

/// A material, prepared for one point seen from `wi`.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    /// Direction to the viewer, for microfacets and coat.
    wi: Vec3,
    /// Direction to the viewer, for Lambert and sheen.
    shading_wi: Vec3,
    specular_normal: SpecularNormal,
    /// GGX α of metal, glass and dielectric layer.
    alpha: f32,
    /// Weights of the lobes, reduced by the layers above; 0 where a lobe is absent.
    diffuse: Vec3,
    metal: Vec3,
    metal_f0: Vec3,
    metal_b: Vec3,
    specular: Vec3,
    specular_f0: Vec3,
    specular_eta: f32,
    glass: Vec3,
    glass_f0: Vec3,
    glass_tint: Vec3,
    /// Index of refraction beyond the surface, divided by that before it.
    glass_eta: f32,
    coat: Coat,
    sheen: Sheen,
    /// Probabilities of sampling microfacets, coat, sheen and the Lambert lobe.
    microfacet_probability: f32,
    coat_probability: f32,
    sheen_probability: f32,
    diffuse_probability: f32,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Sampled direction in the local frame.
    pub wo: Vec3,
    /// Whether the direction passes through the surface: `wo.z` is then below 0, unless the specular normal is tilted.
    pub through: bool,
    /// f · |cos| / pdf.
    pub weight: Vec3,
    /// Density per solid angle of the whole mixture; infinite for the single direction of a mirror.
    pub pdf: f32,
}

impl Bsdf {
    /// The surface of `m` seen from `wi` (local frame, z > 0). `from_inside` says that `wi` is on the side where the material is.
    pub fn new(m: &Material, wi: Vec3, from_inside: bool) -> Self {
        Self::made(m, wi, wi, from_inside)
    }

    /// Like [`Bsdf::new`], shaded by a normal other than the surface's own: `wi` (of any z) and `specular_normal` are in that normal's
    /// frame.
    pub fn with_specular_normal(
        m: &Material,
        wi: Vec3,
        specular_normal: SpecularNormal,
        from_inside: bool,
    ) -> Self {
        let to = specular_normal.to_microfacets(wi);
        let seen = |w: Vec3| Vec3::new(w.x, w.y, w.z.max(LEAST_VIEW));
        let b = Self { specular_normal, ..Self::made(m, seen(to), seen(wi), from_inside) };
        if to.z > 0.0 {
            return b;
        }
        // The shading normal is on the far side of the surface: specular lobes are not seen (as in Cycles).
        let (metal, specular, glass, coat) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Coat::NONE);
        let mut b =
            Self { metal, specular, glass, coat, microfacet_probability: 0.0, coat_probability: 0.0, ..b };
        b.choose(0.0);
        b
    }

    fn made(m: &Material, wi: Vec3, shading_wi: Vec3, from_inside: bool) -> Self {
        // Layers on top.
        let (sheen, coat, mut weight) = coat_and_sheen(m, shading_wi.z, wi.z);
        let mut b = Self { sheen, coat, shading_wi, ..Self::nothing(wi, m.roughness * m.roughness) };
        let base = Vec3::from_array(m.base_color);
        let tint = Vec3::from_array(m.specular_tint);
        let kept = |at, average_at| match m.multiscatter {
            true => (table_2d(at, 32, m.roughness, wi.z), table_1d(average_at, 32, m.roughness)),
            false => (1.0, 1.0),
        };
        let (mut shine, mut gloss) = (0.0, 0.0);

        // Metal.
        if m.metallic > 0.0 {
            let (kept, average) = kept(REFLECTION, REFLECTION_AVERAGE);
            b.metal_f0 = base;
            b.metal_b = f82_b(base, tint);
            let reflected = fresnel_f82_average(base, b.metal_b);
            b.metal = weight * m.metallic * gain(reflected, kept, average);
            gloss += luminance(b.metal * reflected);
            weight *= 1.0 - m.metallic;
        }

        // Glass.
        if m.transmission > 0.0 {
            b.set_glass(m, weight * m.transmission, from_inside);
            gloss += luminance(b.glass);
            weight *= 1.0 - m.transmission;
        }

        // The dielectric layer, and the diffuse light that passes it.
        let mut f0 = f0_from_ior(m.ior);
        let mut eta = m.ior;
        if m.specular != 0.5 {
            f0 *= 2.0 * m.specular;
            eta = ior_from_f0(f0);
        }
        if eta != 1.0 && weight.max_element() > 0.0 {
            let (kept, average) = kept(REFLECTION, REFLECTION_AVERAGE);
            b.specular_f0 = (f0 * tint).min(Vec3::ONE);
            b.specular_eta = eta;
            let reflected = share_to_white(b.specular_f0, average_share(eta));
            let gain = gain(reflected, kept, average);
            let share = table_3d(FRESNEL_SHARE, 16, m.roughness, wi.z, index_place(eta));
            let layer = gain * kept * share_to_white(b.specular_f0, share);
            b.specular = weight * gain;
            shine = luminance(weight * layer);
            weight *= (1.0 - layer.max_element()).clamp(0.0, 1.0);
        }
        b.diffuse = weight * base;

        b.choose(gloss + shine);
        b
    }

    /// Sets the glass lobe to this weight.
    #[inline(never)]
    fn set_glass(&mut self, m: &Material, weight: Vec3, from_inside: bool) {
        self.glass_eta = if from_inside { 1.0 / m.ior } else { m.ior };
        self.glass_f0 = (f0_from_ior(m.ior) * Vec3::from_array(m.specular_tint)).min(Vec3::ONE);
        // Light passes the surface twice, on the way in and out.
        self.glass_tint = Vec3::from_array(m.base_color.map(f32::sqrt));
        self.glass = weight;
        if m.multiscatter {
            let side = if from_inside { INSIDE } else { 0 };
            let place = index_place(m.ior);
            let kept = table_3d(GLASS + side, 16, m.roughness, self.wi.z, place);
            let average = table_2d(GLASS_AVERAGE + side, 16, m.roughness, place);
            // Transmitted light makes up most of the colour; where nothing is transmitted, reflected light does.
            let once = match self.glass_tint == Vec3::ZERO {
                true => share_to_white(self.glass_f0, average_share(self.glass_eta)),
                false => self.glass_tint,
            };
            self.glass *= gain(once, kept, average);
        }
    }

    /// Sets the probability of each lobe in proportion to its reflection.
    fn choose(&mut self, microfacets: f32) {
        let (coat, sheen, diffuse) =
            (self.coat.albedo, luminance(self.sheen.albedo), luminance(self.diffuse));
        let least = LEAST_SHARE * (microfacets + coat + sheen + diffuse);
        let raised = |albedo: f32| if albedo > 0.0 { albedo.max(least) } else { 0.0 };
        let (microfacets, coat, sheen) = (raised(microfacets), raised(coat), raised(sheen));
        let total = microfacets + coat + sheen + diffuse;
        if total > 0.0 {
            self.microfacet_probability = microfacets / total;
            self.coat_probability = coat / total;
            self.sheen_probability = sheen / total;
            self.diffuse_probability = diffuse / total;
        }
    }

    /// Whether light passes through the surface.
    #[inline]
    pub fn transmits(&self) -> bool {
        self.glass != Vec3::ZERO
    }

    #[inline]
    fn is_mirror(&self) -> bool {
        self.alpha * self.alpha <= LEAST_ALPHA_SQUARED
    }

    /// f · |cos| and the density of [`Bsdf::sample`] for any direction; zero below a surface that does not transmit.
    pub fn eval(&self, wo: Vec3) -> (Vec3, f32) {
        if self.wi.z <= 0.0 || wo.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let to = self.specular_normal.to_microfacets(wo);
        if wo.z < 0.0 {
            return if self.transmits() && to.z < 0.0 { self.eval_below(to) } else { (Vec3::ZERO, 0.0) };
        }
        let (mut f, mut pdf) = (Vec3::ZERO, 0.0);
        if self.microfacet_probability > 0.0 && !self.is_mirror() && to.z > 0.0 {
            (f, pdf) = self.microfacets((self.wi + to).normalize(), to);
        }
        self.add_others(wo, to, &mut f, &mut pdf);
        (f, pdf)
    }

    /// Samples a direction with the density of [`Bsdf::eval`]; `None` where the sampled microfacet sends light to the wrong side.
    pub fn sample(&self, u: [f32; 2], choice: f32) -> Option<BsdfSample> {
        if choice < self.microfacet_probability {
            return self.sample_microfacets(u, choice / self.microfacet_probability);
        }
        let in_coat = choice < self.microfacet_probability + self.coat_probability;
        if in_coat && self.coat.is_mirror() {
            return Some(self.mirrored(self.coat.reflectance(self.wi.z) / self.coat_probability));
        }
        let in_sheen = choice < self.microfacet_probability + self.coat_probability + self.sheen_probability;
        let mut is_above = true;
        let wo = if in_coat {
            let to = self.coat.sample(self.wi, u);
            let wo = self.specular_normal.from_microfacets(to);
            is_above = to.z > 0.0;
            if is_above && wo.z <= 0.0 {
                let (f, pdf) = self.coat.eval(self.wi, to);
                return sampled(wo, false, f, self.coat_probability * pdf);
            }
            wo
        } else if in_sheen {
            self.sheen.sample(self.shading_wi, sample_cosine(u))
        } else {
            sample_cosine(u)
        };
        let (f, pdf) = if is_above && wo.z > 0.0 { self.eval(wo) } else { (Vec3::ZERO, 0.0) };
        sampled(wo, false, f, pdf)
    }

    /// The sample in the mirror's direction.
    fn mirrored(&self, weight: Vec3) -> BsdfSample {
        let wo = self.specular_normal.from_microfacets(Vec3::new(-self.wi.x, -self.wi.y, self.wi.z));
        BsdfSample { wo, through: false, weight, pdf: f32::INFINITY }
    }

    /// Adds the contributions above the surface of the lobes without microfacets and of the coat, for light from or to `wo`. `to` is the
    /// same direction in the coat's frame.
    #[inline]
    fn add_others(&self, wo: Vec3, to: Vec3, f: &mut Vec3, pdf: &mut f32) {
        if wo.z <= 0.0 {
            return;
        }
        *f += self.diffuse * (wo.z * FRAC_1_PI);
        *pdf += self.diffuse_probability * wo.z * FRAC_1_PI;
        if self.coat_probability > 0.0 && !self.coat.is_mirror() && to.z > 0.0 {
            let (coat, coat_pdf) = self.coat.eval(self.wi, to);
            *f += coat;
            *pdf += self.coat_probability * coat_pdf;
        }
        if self.sheen_probability > 0.0 {
            let sheen_pdf = self.sheen.pdf(self.shading_wi, wo);
            *f += self.sheen.albedo * sheen_pdf;
            *pdf += self.sheen_probability * sheen_pdf;
        }
    }

    /// The diffuse part (Lambert and sheen, as in Cycles) of `f`, which is the result of [`Bsdf::eval`] for `wo`, as a ratio; 0 where f is
    /// 0.
    pub fn diffuse_share(&self, wo: Vec3, f: Vec3) -> Vec3 {
        if wo.z <= 0.0 {
            return Vec3::ZERO;
        }
        let mut diffuse = self.diffuse * (wo.z * FRAC_1_PI);
        if self.sheen_probability > 0.0 {
            diffuse += self.sheen.albedo * self.sheen.pdf(self.shading_wi, wo);
        }
        let part = |d: f32, f: f32| if f > 0.0 { (d / f).min(1.0) } else { 0.0 };
        Vec3::new(part(diffuse.x, f.x), part(diffuse.y, f.y), part(diffuse.z, f.z))
    }

    /// Approximate albedos of `m` under uniform light: diffuse, glossy, transmission. Above 0 wherever such light can occur.
    #[inline(never)]
    pub fn colors(&self, m: &Material) -> [Vec3; 3] {
        let mut glossy = Vec3::splat(self.coat.albedo);
        let mut transmission = Vec3::ZERO;
        let kept = if m.multiscatter { table_2d(REFLECTION, 32, m.roughness, self.wi.z) } else { 1.0 };
        glossy += self.metal * fresnel_f82_average(self.metal_f0, self.metal_b) * kept;
        if self.specular != Vec3::ZERO {
            glossy +=
                self.specular * share_to_white(self.specular_f0, average_share(self.specular_eta)) * kept;
        }
        if self.transmits() {
            let side = if self.glass_eta < 1.0 { INSIDE } else { 0 };
            let kept = match m.multiscatter {
                true => table_3d(GLASS + side, 16, m.roughness, self.wi.z, index_place(m.ior)),
                false => 1.0,
            };
            let reflected = share_to_white(self.glass_f0, average_share(self.glass_eta));
            glossy += self.glass * reflected * kept;
            transmission = self.glass * (Vec3::ONE - reflected) * self.glass_tint * kept;
        }
        [self.diffuse + self.sheen.albedo, glossy, transmission]
    }

    /// Reflected and transmitted part at a microfacet whose cosine with `wi` is `cos`.
    #[inline]
    fn reflectance(&self, cos: f32) -> (Vec3, Vec3) {
        let mut reflected = self.metal * fresnel_f82(cos, self.metal_f0, self.metal_b);
        if self.specular != Vec3::ZERO {
            let share = fresnel_share(cos, self.specular_eta, f0_from_ior(self.specular_eta));
            reflected += self.specular * share_to_white(self.specular_f0, share);
        }
        let mut passed = Vec3::ZERO;
        if self.transmits() {
            let share = fresnel_share(cos, self.glass_eta, f0_from_ior(self.glass_eta));
            let glass = share_to_white(self.glass_f0, share);
            reflected += self.glass * glass;
            passed = self.glass * (Vec3::ONE - glass) * self.glass_tint;
        }
        (reflected, passed)
    }

    /// f · |cos| of the microfacets and their part of the density, where `h` is the microfacet normal that sends light from `wi` to `wo`.
    fn microfacets(&self, h: Vec3, wo: Vec3) -> (Vec3, f32) {
        let cos = self.wi.dot(h);
        let (reflected, passed) = self.reflectance(cos);
        let share = share_reflected(reflected, passed);
        let (d, lambda_i, lambda_o) =
            (ggx_d(h, self.alpha), lambda(self.wi, self.alpha), lambda(wo, self.alpha));
        let (f, chance, per_normal) = if wo.z > 0.0 {
            (reflected, share, 0.25)
        } else {
            // Walter et al. 2007, eq. 17; both sides divided by the index squared.
            let cos_o = wo.dot(h);
            let x = cos / self.glass_eta + cos_o;
            (passed, 1.0 - share, (cos * cos_o).abs() / (x * x))
        };
        let common = d * per_normal / self.wi.z;
        (
            f * (common / (1.0 + lambda_i + lambda_o)),
            self.microfacet_probability * chance * common / (1.0 + lambda_i),
        )
    }

    /// [`Bsdf::eval`] for a direction through the surface.
    #[inline(never)]
    fn eval_below(&self, wo: Vec3) -> (Vec3, f32) {
        if self.is_mirror() || (self.glass_eta - 1.0).abs() < LEAST_BEND {
            return (Vec3::ZERO, 0.0);
        }
        let h = -(self.wi + self.glass_eta * wo).normalize();
        let h = if h.z < 0.0 { -h } else { h };
        // No microfacet that is visible from both sides refracts one direction into the other.
        if self.wi.dot(h) <= 0.0 || wo.dot(h) >= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        self.microfacets(h, wo)
    }

    fn sample_microfacets(&self, u: [f32; 2], choice: f32) -> Option<BsdfSample> {
        let h = if self.is_mirror() { Vec3::Z } else { sample_visible_normal(self.wi, self.alpha, u) };
        let cos = self.wi.dot(h);
        let (reflected, passed) = self.reflectance(cos);
        let share = share_reflected(reflected, passed);
        if choice < share {
            if self.is_mirror() {
                return Some(self.mirrored(reflected / (share * self.microfacet_probability)));
            }
            let to = 2.0 * cos * h - self.wi;
            if to.z <= 0.0 {
                return None;
            }
            let wo = self.specular_normal.from_microfacets(to);
            let (mut f, mut pdf) = self.microfacets(h, to);
            self.add_others(wo, to, &mut f, &mut pdf);
            sampled(wo, false, f, pdf)
        } else {
            let cos_t = (1.0 - (1.0 - cos * cos) / (self.glass_eta * self.glass_eta)).max(0.0).sqrt();
            let to = ((cos / self.glass_eta - cos_t) * h - self.wi / self.glass_eta).normalize();
            if to.z >= 0.0 {
                return None;
            }
            let wo = self.specular_normal.from_microfacets(to);
            if self.is_mirror() || (self.glass_eta - 1.0).abs() < LEAST_BEND {
                let weight = passed / ((1.0 - share) * self.microfacet_probability);
                return Some(BsdfSample { wo, through: true, weight, pdf: f32::INFINITY });
            }
            let (f, pdf) = self.microfacets(h, to);
            sampled(wo, true, f, pdf)
        }
    }

    fn nothing(wi: Vec3, alpha: f32) -> Self {
        Self {
            wi,
            shading_wi: wi,
            specular_normal: SpecularNormal::NONE,
            alpha,
            diffuse: Vec3::ZERO,
            metal: Vec3::ZERO,
            metal_f0: Vec3::ZERO,
            metal_b: Vec3::ZERO,
            specular: Vec3::ZERO,
            specular_f0: Vec3::ZERO,
            specular_eta: 1.0,
            glass: Vec3::ZERO,
            glass_f0: Vec3::ZERO,
            glass_tint: Vec3::ZERO,
            glass_eta: 1.0,
            coat: Coat::NONE,
            sheen: Sheen::NONE,
            microfacet_probability: 0.0,
            coat_probability: 0.0,
            sheen_probability: 0.0,
            diffuse_probability: 0.0,
        }
    }
}

/// A sample with this density; `None` where the density is 0 or not finite.
#[inline]
fn sampled(wo: Vec3, through: bool, f: Vec3, pdf: f32) -> Option<BsdfSample> {
    (pdf > 0.0 && pdf.is_finite()).then(|| BsdfSample { wo, through, weight: f / pdf, pdf })
}

/// Probability of reflection at a microfacet that both reflects and transmits.
fn share_reflected(reflected: Vec3, passed: Vec3) -> f32 {
    let passed = luminance(passed);
    if passed > 0.0 { luminance(reflected) / (luminance(reflected) + passed) } else { 1.0 }
}

/// Interpolates from `f0` to white.
fn share_to_white(f0: Vec3, share: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * share
}

/// Average of [`fresnel_share`] over the cosine-weighted hemisphere.
fn average_share(eta: f32) -> f32 {
    let f0 = f0_from_ior(eta);
    ((fresnel_dielectric_average(eta) - f0) / (1.0 - f0)).clamp(0.0, 1.0)
}

/// Rec. 709 luminance.
#[inline]
pub fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Cosine-distributed direction (Malley), disk by concentric map (Shirley and Chiu 1997).
pub fn sample_cosine(u: [f32; 2]) -> Vec3 {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if x == 0.0 && y == 0.0 {
        return Vec3::Z;
    }
    let (r, angle) =
        if x.abs() > y.abs() { (x, PI / 4.0 * (y / x)) } else { (y, PI / 2.0 - PI / 4.0 * (x / y)) };
    let (s, c) = angle.sin_cos();
    Vec3::new(r * c, r * s, (1.0 - r * r).max(0.0).sqrt())
}
