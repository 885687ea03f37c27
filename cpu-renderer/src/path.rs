//! One path of light, walked backwards from the camera.
//!
//! ```text
//! radiance(ray):
//!     repeat
//!         nothing hit ─► what the sky and the suns send, weighted against having been sampled; done
//!         add the surface's emission
//!         bounces used up ─► done
//!         sample one light, add it where nothing is in between
//!         scatter; end a dim path by chance, and make up for it when it goes on
//! ```
//! Paths continue from a voxel's face, never from a point pushed off it.

use glam::{DVec3, Vec3};
use pumice_render::sampler::{BouncePair, PixelSampler};
use pumice_render::{Hit, PathOrigin, RayInWorld, Tracer};
use pumice_scene::Material;

use crate::bsdf::Bsdf;
use crate::lighting::{Lighting, power_heuristic};
use crate::shading_frame::ShadingFrame;

/// Bounce from which a dim path may end by chance: the first ones carry most of the picture.
const ROULETTE_FROM: u32 = 2;

/// Least chance to go on: bounds the factor that makes up for the paths that end to 20.
const LEAST_SURVIVAL: f32 = 0.05;

/// Everything that paths share.
#[derive(Debug)]
pub struct PathScene<'a, T> {
    /// Geometry.
    pub tracer: &'a T,
    /// Lights.
    pub lighting: &'a Lighting,
    /// Materials by instance and dense label.
    pub materials: &'a [Vec<Material>],
    /// As in the settings; counts the scattered rays after the first surface.
    pub bounces: u32,
    /// Whether dim paths end by chance.
    pub russian_roulette: bool,
}

/// The surface that a path is at, seen from where it came.
struct Vertex {
    frame: ShadingFrame,
    origin: DVec3,
    from: PathOrigin,
}

impl Vertex {
    fn new(ray: &RayInWorld, hit: &Hit) -> Self {
        let n = hit.normal_in_world;
        // The side that the ray is on.
        let n = if n.dot(ray.direction) > 0.0 { -n } else { n };
        Self {
            frame: ShadingFrame::new(n),
            origin: ray.origin + ray.direction * hit.t,
            from: PathOrigin::Face(hit.surface),
        }
    }

    /// Local direction back along a ray. A ray that grazes so closely that rounding puts it below is held at the horizon.
    fn wi(&self, ray: &RayInWorld) -> Vec3 {
        let wi = self.frame.local_from_world(-ray.direction.normalize());
        DVec3::new(wi.x, wi.y, wi.z.max(1e-7)).normalize().as_vec3()
    }

    fn ray(&self, direction: DVec3) -> RayInWorld {
        RayInWorld { origin: self.origin, direction }
    }
}

impl<T: Tracer> PathScene<'_, T> {
    fn material(&self, hit: &Hit) -> &Material {
        &self.materials[hit.surface.instance as usize][hit.surface.label as usize]
    }

    /// Radiance that arrives along a camera ray from its first surface, with what comes after it.
    pub fn radiance(&self, ray: RayInWorld, first: Hit, points: &PixelSampler) -> Vec3 {
        let (mut ray, mut hit) = (ray, first);
        let (mut total, mut throughput) = (Vec3::ZERO, Vec3::ONE);
        for bounce in 0.. {
            // The surface's own light.
            let material = self.material(&hit);
            total += throughput * Vec3::from_array(material.emission);
            if bounce > self.bounces {
                break;
            }
            let vertex = Vertex::new(&ray, &hit);
            let bsdf = Bsdf::new(material, vertex.wi(&ray));

            // One light, where nothing is in between.
            let [light_choice, lobe_choice] = points.bounce(bounce, BouncePair::Choice);
            if let Some(light) = self.lighting.sample(light_choice, points.bounce(bounce, BouncePair::Light)) {
                let (f, scatter_pdf) = bsdf.eval(vertex.frame.local_from_world(light.direction).as_vec3());
                let weight = if light.is_point { 1.0 } else { power_heuristic(light.pdf, scatter_pdf) };
                let light_in = f * light.radiance * (weight / light.pdf);
                if light_in.max_element() > 0.0
                    && !self.tracer.occluded(&vertex.ray(light.direction), vertex.from, f64::INFINITY)
                {
                    total += throughput * light_in;
                }
            }

            // Scatter.
            let Some(scattered) = bsdf.sample(points.bounce(bounce, BouncePair::Scatter), lobe_choice) else { break };
            throughput *= scattered.weight;

            // A dim path ends by chance; the chance to go on follows the path's own weight alone, so the mean is unchanged.
            if self.russian_roulette && bounce >= ROULETTE_FROM {
                let survival = throughput.max_element().clamp(LEAST_SURVIVAL, 1.0);
                if points.bounce(bounce, BouncePair::Roulette)[0] >= survival {
                    break;
                }
                throughput /= survival;
            }
            if throughput.max_element() <= 0.0 {
                break;
            }

            // On to the next surface, or out.
            ray = vertex.ray(vertex.frame.world_from_local(scattered.wo.as_dvec3()));
            match self.tracer.first_hit(&ray, vertex.from, f64::INFINITY) {
                Some(next) => hit = next,
                None => {
                    total += throughput * self.lighting.escaped(ray.direction.normalize(), scattered.pdf);
                    break;
                }
            }
        }
        total
    }

    /// Ambient occlusion at a camera ray's first surface: 1 where a cosine-distributed ray finds nothing within `reach`.
    pub fn ambient_occlusion(&self, ray: &RayInWorld, hit: &Hit, points: &PixelSampler, reach: f64) -> f32 {
        let vertex = Vertex::new(ray, hit);
        let local = crate::bsdf::sample_cosine(points.bounce(0, BouncePair::Scatter));
        let direction = vertex.frame.world_from_local(local.as_dvec3()).normalize();
        let reach = if reach == f64::MAX { f64::INFINITY } else { reach };
        if self.tracer.occluded(&vertex.ray(direction), vertex.from, reach) { 0.0 } else { 1.0 }
    }
}
