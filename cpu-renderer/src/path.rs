//! One path, from the camera to its end.
//!
//! ```text
//! for each vertex 0, 1, …:
//!     nothing hit → add the sky and the suns in that direction, weighted; end
//!     add the surface's emission; end here if this vertex is past the last that is lit
//!     aim at a light; add it where nothing stands between, weighted
//!     scatter; end by Russian roulette where little is left
//! ```
//! Beyond that: geometry is f64 and exact from face to face, light is f32; each number drawn has a named dimension; a surface seen
//! from inside a label shows its emission alone.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use pumice_render::sampler::{BouncePair, PixelSampler};
use pumice_render::sun::frame_around;
use pumice_render::{Hit, PathOrigin, RayInWorld, Tracer};
use pumice_scene::{Mode, Settings};

use crate::bsdf::{Bsdf, sample_cosine};
use crate::lights::Lights;
use crate::looks::Looks;

/// First vertex after which Russian roulette may end a path: the first bounces carry most of the light, and cutting them costs
/// more noise than time.
const FIRST_ROULETTE: u32 = 2;

/// Least chance to go on: a path that survives is never weighted by more than this says.
const LEAST_SURVIVAL: f32 = 0.05;

/// Everything a path meets but geometry.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// Sky, suns, backdrop.
    pub lights: Arc<Lights>,
    /// Looks of each instance's labels.
    pub looks: Vec<Arc<Looks>>,
    /// Mode, bounces, roulette.
    pub settings: Settings,
}

/// Orthonormal frame on a face: z is its normal.
struct Frame {
    tangent: DVec3,
    bitangent: DVec3,
    normal: DVec3,
}

impl Frame {
    #[inline]
    fn new(normal: DVec3) -> Self {
        let (tangent, bitangent) = frame_around(normal);
        Self { tangent, bitangent, normal }
    }

    #[inline]
    fn local(&self, w: DVec3) -> Vec3 {
        Vec3::new(w.dot(self.tangent) as f32, w.dot(self.bitangent) as f32, w.dot(self.normal) as f32)
    }

    #[inline]
    fn world(&self, w: Vec3) -> DVec3 {
        self.tangent * f64::from(w.x) + self.bitangent * f64::from(w.y) + self.normal * f64::from(w.z)
    }
}

/// Radiance along a camera ray that sees up to `t_max`; `down` says where in the picture it is, 0 top to 1 bottom.
#[inline]
pub fn radiance<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    sampler: &PixelSampler,
    camera_ray: RayInWorld,
    t_max: f64,
    down: f32,
) -> Vec3 {
    let Some(hit) = tracer.first_hit(&camera_ray, PathOrigin::Free, t_max) else {
        return around.lights.behind(camera_ray.direction, down);
    };
    match around.settings.mode {
        Mode::AmbientOcclusion => ambient(tracer, around, sampler, &camera_ray, &hit),
        Mode::OneBounce => path(tracer, around, sampler, camera_ray, hit, 0),
        Mode::Path => path(tracer, around, sampler, camera_ray, hit, around.settings.bounces),
    }
}

/// 1 where a cosine-distributed ray meets nothing within reach, else 0.
fn ambient<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    sampler: &PixelSampler,
    ray: &RayInWorld,
    hit: &Hit,
) -> Vec3 {
    if hit.from_inside {
        return Vec3::ZERO;
    }
    let frame = Frame::new(hit.normal_in_world);
    let direction = frame.world(sample_cosine(sampler.bounce(0, BouncePair::Scatter)));
    let ray = RayInWorld { origin: ray.origin + ray.direction * hit.t, direction };
    let open = direction.dot(frame.normal) > 0.0
        && !tracer.occluded(&ray, PathOrigin::Face(hit.surface), around.settings.ao_distance);
    Vec3::splat(f32::from(u8::from(open)))
}

fn path<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    sampler: &PixelSampler,
    mut ray: RayInWorld,
    mut hit: Hit,
    bounces: u32,
) -> Vec3 {
    let lights = &around.lights;
    let (mut total, mut throughput) = (Vec3::ZERO, Vec3::ONE);
    let mut vertex = 0u32;
    loop {
        let material = around.looks[hit.surface.instance as usize].material(hit.surface.label);
        total += throughput * Vec3::from_array(material.emission);
        if vertex > bounces || hit.from_inside {
            return total;
        }
        let frame = Frame::new(hit.normal_in_world);
        let mut wi = frame.local(-ray.direction.normalize());
        // A grazing ray may round to 0 or below: it still sees the front.
        wi.z = wi.z.max(1e-6);
        let bsdf = Bsdf::new(material, wi);
        let origin = ray.origin + ray.direction * hit.t;
        let from = PathOrigin::Face(hit.surface);
        let mut choice = None;

        // Aim at a light.
        if lights.any_aimed() {
            let [which, lobe] = sampler.bounce(vertex, BouncePair::Choice);
            choice = Some(lobe);
            if let Some(light) = lights.sample(which, sampler.bounce(vertex, BouncePair::Light))
                && light.direction.dot(frame.normal) > 0.0
            {
                let (f_cos, pdf) = bsdf.eval(frame.local(light.direction));
                let add = throughput * f_cos * light.radiance_over_pdf * lights.aimed_weight(light.pdf, pdf);
                let shadow_ray = RayInWorld { origin, direction: light.direction };
                if add.max_element() > 0.0 && !tracer.occluded(&shadow_ray, from, f64::INFINITY) {
                    total += add;
                }
            }
        }

        // Scatter.
        let lobe = match choice {
            Some(lobe) => lobe,
            None if bsdf.has_two_lobes() => sampler.bounce(vertex, BouncePair::Choice)[1],
            None => 0.5,
        };
        let Some(sample) = bsdf.sample(sampler.bounce(vertex, BouncePair::Scatter), lobe) else {
            return total;
        };
        throughput *= sample.weight;
        let most = throughput.max_element();
        if most <= 0.0 {
            return total;
        }

        // End by Russian roulette; who survives stands for who does not (Arvo and Kirk 1990).
        if around.settings.russian_roulette && vertex >= FIRST_ROULETTE && most < 1.0 {
            let survival = most.max(LEAST_SURVIVAL);
            if sampler.bounce(vertex, BouncePair::Roulette)[0] >= survival {
                return total;
            }
            throughput /= survival;
        }
        let direction = frame.world(sample.wo);
        if direction.dot(frame.normal) <= 0.0 {
            return total;
        }
        ray = RayInWorld { origin, direction };
        match tracer.first_hit(&ray, from, f64::INFINITY) {
            Some(next) => hit = next,
            None => return total + throughput * lights.found(direction.normalize(), sample.pdf),
        }
        vertex += 1;
    }
}
