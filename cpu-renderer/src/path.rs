//! One path: from the camera, scattered at surfaces, lit by suns and sky.
use glam::{DVec3, Vec3};
use pumice_render::sampler::{BouncePair, PixelSampler};
use pumice_render::{PathOrigin, RayInWorld, Tracer};
use pumice_scene::{Material, Mode};

use crate::bsdf::{Bsdf, luminance};

/// A sun, made ready.
#[derive(Clone, Copy, Debug)]
pub struct ReadySun {
    /// Unit vector towards its centre.
    pub towards: DVec3,
    /// Radiance of its disk, or irradiance where it is a point.
    pub radiance: Vec3,
    /// 1 − cos of half its angle; 0 is a point.
    pub one_minus_cos: f64,
}

/// What light paths need to know.
pub struct Lighting<'a> {
    pub sky: Vec3,
    pub backdrop: Option<[Vec3; 2]>,
    pub suns: Vec<ReadySun>,
    pub materials: &'a dyn Fn(u32, u32) -> Material,
    pub mode: Mode,
    pub bounces: u32,
    pub roulette: bool,
}

/// A right-handed frame around a normal: Duff et al. 2017, JCGT 6(1).
fn frame(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Radiance along a camera ray.
pub fn radiance<T: Tracer>(
    tracer: &T,
    light: &Lighting<'_>,
    s: &PixelSampler,
    mut ray: RayInWorld,
    screen_y: f32,
) -> Vec3 {
    let mut from = PathOrigin::Free;
    let (mut total, mut throughput) = (Vec3::ZERO, Vec3::ONE);
    let mut pdf = 0f32;
    for bounce in 0.. {
        let Some(hit) = tracer.first_hit(&ray, from, f64::INFINITY) else {
            if bounce == 0 {
                return light.backdrop.map_or(light.sky, |[a, b]| a.lerp(b, screen_y));
            }
            total += throughput * light.sky;
            let d = ray.direction.normalize();
            for sun in &light.suns {
                let cos = d.dot(sun.towards);
                if sun.one_minus_cos > 0.0 && 1.0 - cos < sun.one_minus_cos {
                    let light_pdf =
                        (1.0 / (2.0 * std::f64::consts::PI * sun.one_minus_cos)) as f32 / light.suns.len() as f32;
                    total += throughput * sun.radiance * (pdf * pdf / (pdf * pdf + light_pdf * light_pdf));
                }
            }
            return total;
        };
        let m = (light.materials)(hit.surface.instance, hit.surface.label);
        total += throughput * Vec3::from_array(m.emission);
        if bounce > light.bounces {
            return total;
        }
        let d = ray.direction.normalize();
        let n = if hit.normal_in_world.dot(d) > 0.0 { -hit.normal_in_world } else { hit.normal_in_world };
        let (t, b) = frame(n);
        let to_local = |w: DVec3| Vec3::new(w.dot(t) as f32, w.dot(b) as f32, w.dot(n) as f32);
        let to_world = |w: Vec3| t * f64::from(w.x) + b * f64::from(w.y) + n * f64::from(w.z);
        let wi = to_local(-d).max(Vec3::new(-2.0, -2.0, 1e-6));
        let bsdf = Bsdf::new(&m, wi.normalize());
        let origin = ray.origin + ray.direction * hit.t;
        from = PathOrigin::Face(hit.surface);
        let choice = s.bounce(bounce, BouncePair::Choice);
        if !light.suns.is_empty() {
            let i = ((choice[0] * light.suns.len() as f32) as usize).min(light.suns.len() - 1);
            let sun = &light.suns[i];
            let u = s.bounce(bounce, BouncePair::Light);
            let (st, sb) = frame(sun.towards);
            let omc = f64::from(u[0]) * sun.one_minus_cos;
            let sin = (omc * (2.0 - omc)).max(0.0).sqrt();
            let (sp, cp) = (2.0 * std::f64::consts::PI * f64::from(u[1])).sin_cos();
            let w = st * (sin * cp) + sb * (sin * sp) + sun.towards * (1.0 - omc);
            let (f, bsdf_pdf) = bsdf.eval(to_local(w));
            if f.max_element() > 0.0 {
                let weight = if sun.one_minus_cos > 0.0 {
                    let p = (1.0 / (2.0 * std::f64::consts::PI * sun.one_minus_cos)) as f32 / light.suns.len() as f32;
                    p / (p * p + bsdf_pdf * bsdf_pdf)
                } else {
                    light.suns.len() as f32
                };
                let shadow = RayInWorld { origin, direction: w };
                if !tracer.occluded(&shadow, from, f64::INFINITY) {
                    total += throughput * f * sun.radiance * weight;
                }
            }
        }
        let Some(sample) = bsdf.sample(s.bounce(bounce, BouncePair::Scatter), choice[1]) else { return total };
        throughput *= sample.weight;
        pdf = sample.pdf;
        if light.roulette && bounce >= 2 {
            let keep = luminance(throughput).max(throughput.max_element()).clamp(0.05, 1.0);
            if s.bounce(bounce, BouncePair::Roulette)[0] >= keep {
                return total;
            }
            throughput /= keep;
        }
        if throughput.max_element() <= 0.0 {
            return total;
        }
        ray = RayInWorld { origin, direction: to_world(sample.wo) };
    }
    total
}
