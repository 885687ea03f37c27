//! How a surface scatters: Lambert under a single-scatter GGX layer, or GGX metal.
//!
//! Local frame: z is the normal on the side that `wi` is on; `wi` points back along the path, `wo` is sampled, as in Cycles.
//!
//! ```text
//! f(wi, wo) = metallic · D G F_metal / (4 cos cos)
//!           + (1−metallic) · D G F_dielectric / (4 cos cos)
//!           + (1−metallic) · (1 − E(wi)) · base / π            E: albedo of the dielectric layer seen from wi
//! ```
//! As in Cycles, the layer's albedo seen from the viewer attenuates what lies below; that is not reciprocal, but keeps the sum of
//! both at or below 1. GGX after Walter et al. 2007, sampled by visible normals (Heitz 2018, JCGT 7(4), listing 1), with
//! height-correlated Smith masking (Heitz 2014, JCGT 3(2), eq. 99).

use std::sync::LazyLock;

use glam::Vec3;
use pumice_scene::Material;

use std::f32::consts::{FRAC_1_PI, PI};

/// Below this α (roughness 0.01) f32 directions are too coarse for the lobe: rounding of the half vector, 1e-7, would change D by
/// more than 1e-3. The lobe is drawn no sharper.
const LEAST_ALPHA: f32 = 1e-4;

/// A material, made ready for one point seen from `wi`.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    wi: Vec3,
    alpha: f32,
    diffuse: Vec3,
    metal_f0: Vec3,
    metallic: f32,
    dielectric_f0: f32,
    specular_chance: f32,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Sampled direction in the local frame.
    pub wo: Vec3,
    /// f · |cos| / pdf.
    pub weight: Vec3,
    /// Density per solid angle of the whole mixture.
    pub pdf: f32,
}

impl Bsdf {
    /// The surface `m` seen from `wi` (local, z > 0).
    pub fn new(m: &Material, wi: Vec3) -> Self {
        let alpha = (m.roughness * m.roughness).max(LEAST_ALPHA);
        let base = Vec3::from_array(m.base_color);
        let f0 = ((m.ior - 1.0) / (m.ior + 1.0)).powi(2) * 2.0 * m.specular;
        let dielectric_f0 = f0.min(1.0);
        let layer_albedo =
            if dielectric_f0 > 0.0 { ALBEDO.get(wi.z, m.roughness, dielectric_f0) } else { 0.0 };
        let diffuse = base * ((1.0 - m.metallic) * (1.0 - layer_albedo));
        let specular = m.metallic * luminance(base) + (1.0 - m.metallic) * layer_albedo;
        let total = specular + luminance(diffuse);
        Self {
            wi,
            alpha,
            diffuse,
            metal_f0: base,
            metallic: m.metallic,
            dielectric_f0,
            specular_chance: if specular <= 0.0 { 0.0 } else { (specular / total).clamp(0.1, 1.0) },
        }
    }

    /// Whether a sampled direction depends on the choice of a lobe.
    #[inline]
    pub fn has_two_lobes(&self) -> bool {
        self.specular_chance > 0.0 && self.specular_chance < 1.0
    }

    /// f · cos and the density of [`Bsdf::sample`], for a direction on the side of `wi`; zero below.
    pub fn eval(&self, wo: Vec3) -> (Vec3, f32) {
        if wo.z <= 0.0 || self.wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let mut f = self.diffuse * (wo.z * FRAC_1_PI);
        let mut pdf = (1.0 - self.specular_chance) * wo.z * FRAC_1_PI;
        if self.specular_chance > 0.0 {
            let h = (self.wi + wo).normalize();
            let (d, lambda_i, lambda_o) =
                (ggx_d(h, self.alpha), lambda(self.wi, self.alpha), lambda(wo, self.alpha));
            let d_g = d / (4.0 * self.wi.z * (1.0 + lambda_i + lambda_o));
            f += self.fresnel(self.wi.dot(h)) * d_g;
            pdf += self.specular_chance * d / (4.0 * self.wi.z * (1.0 + lambda_i));
        }
        (f, pdf)
    }

    /// A direction with density as [`Bsdf::eval`] says; `None` where the sampled microfacet sends light below the surface.
    pub fn sample(&self, u: [f32; 2], choice: f32) -> Option<BsdfSample> {
        let wo = if choice < self.specular_chance {
            let h = sample_visible_normal(self.wi, self.alpha, u);
            2.0 * self.wi.dot(h) * h - self.wi
        } else {
            sample_cosine(u)
        };
        let (f, pdf) = self.eval(wo);
        (pdf > 0.0 && pdf.is_finite()).then(|| BsdfSample { wo, weight: f / pdf, pdf })
    }

    /// Schlick 1994 for both layers.
    fn fresnel(&self, cos: f32) -> Vec3 {
        let s = (1.0 - cos.clamp(0.0, 1.0)).powi(5);
        let schlick = |f0: Vec3| f0 + (Vec3::ONE - f0) * s;
        let mut f = schlick(self.metal_f0) * self.metallic;
        if self.dielectric_f0 > 0.0 {
            f += schlick(Vec3::splat(self.dielectric_f0)) * (1.0 - self.metallic);
        }
        f
    }
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

fn ggx_d(h: Vec3, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    // cos² (a²−1) + 1 without cancellation near the pole: sin² + a² cos².
    let t = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
    a2 / (PI * t * t)
}

/// Smith's Λ.
fn lambda(w: Vec3, alpha: f32) -> f32 {
    let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    ((1.0 + alpha * alpha * tan2).sqrt() - 1.0) / 2.0
}

fn sample_visible_normal(wi: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
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

/// Albedo of the GGX layer with Schlick's Fresnel: E = F0·a + b, a and b by (cosine, roughness). (The split of Karis 2013, §3.)
struct AlbedoTable(Vec<[f32; 2]>);

/// Entries of the table along each side.
pub const ALBEDO_TABLE: usize = 32;

const TABLE: usize = ALBEDO_TABLE;

/// The pairs (a, b), cosines fastest, for roughness and cosine from 0 to 1.
pub fn albedo_table() -> &'static [[f32; 2]] {
    &ALBEDO.0
}

static ALBEDO: LazyLock<AlbedoTable> = LazyLock::new(|| {
    let mut table = Vec::with_capacity(TABLE * TABLE);
    for r in 0..TABLE {
        let roughness = r as f32 / (TABLE - 1) as f32;
        let alpha = (roughness * roughness).max(LEAST_ALPHA);
        for c in 0..TABLE {
            let cos = (c as f32 / (TABLE - 1) as f32).max(1e-3);
            let wi = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let (mut a, mut b) = (0.0f64, 0.0f64);
            const N: u32 = 16;
            for i in 0..N * N {
                let u = [((i % N) as f32 + 0.5) / N as f32, ((i / N) as f32 + 0.5) / N as f32];
                let h = sample_visible_normal(wi, alpha, u);
                let wo = 2.0 * wi.dot(h) * h - wi;
                if wo.z <= 0.0 {
                    continue;
                }
                // Weight of a visible-normal sample: F · G2 / G1.
                let (li, lo) = (lambda(wi, alpha), lambda(wo, alpha));
                let g = f64::from((1.0 + li) / (1.0 + li + lo));
                let s = f64::from((1.0 - wi.dot(h).clamp(0.0, 1.0)).powi(5));
                a += g * (1.0 - s);
                b += g * s;
            }
            table.push([a, b].map(|v| (v / f64::from(N * N)) as f32));
        }
    }
    AlbedoTable(table)
});

impl AlbedoTable {
    fn get(&self, cos: f32, roughness: f32, f0: f32) -> f32 {
        let place = |v: f32| {
            let v = v.clamp(0.0, 1.0) * (TABLE - 1) as f32;
            let i = (v as usize).min(TABLE - 2);
            (i, v - i as f32)
        };
        let ((c, fc), (r, fr)) = (place(cos), place(roughness));
        let at = |r: usize, c: usize| {
            let [a, b] = self.0[r * TABLE + c];
            f0 * a + b
        };
        let row = |r: usize| at(r, c) * (1.0 - fc) + at(r, c + 1) * fc;
        row(r) * (1.0 - fr) + row(r + 1) * fr
    }
}
