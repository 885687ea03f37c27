//! One path, from the camera to its end.
//!
//! ```text
//! for each vertex 0, 1, …, all light goes to a `FilmSample`:
//!     add the lamps that the ray passed
//!     nothing hit → add the sky and the suns in that direction, weighted; end
//!     the camera's first shadow catcher → continue twice, with the same random numbers: among catchers alone, and among all objects
//!     go straight on where the surface is transparent (alpha); that is no vertex
//!     add the surface's emission; end here if this vertex is beyond the last that receives light
//!     sample a light; add it if it is not occluded, weighted
//!     scatter; end by Russian roulette where the throughput is low
//! ```
//! Geometry is f64 and exact from face to face, light is f32; each random number has a named dimension; [`crate::crossing`] handles how
//! paths enter and leave labels.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use pumice_picture::PassSums;
use pumice_scene::{Mode, Settings};
use pumice_transport::bsdf::{Bsdf, LEAST_VIEW, SpecularNormal, emitted, sample_cosine};
use pumice_transport::lights::{LightOdds, Lights};
use pumice_transport::material_table::MaterialTables;
use pumice_transport::sampler::{BounceSet, PixelSampler};
use pumice_transport::sun::frame_around;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Receiver, Tracer};

use crate::crossing::{MAX_TRANSPARENT_SURFACES, first_hit, may_touch, next_hit, visibility};
use crate::film_sample::{AovSample, ColorSample, FilmSample, PassWeights, SurfaceAovs};

/// First vertex after which Russian roulette may end a path: the first bounces carry most of the light, and ending them costs more noise
/// than it saves time.
const FIRST_ROULETTE: u32 = 2;

/// Throughput below which Russian roulette may end a path; a path that survives has this throughput. Ending paths of higher throughput saves
/// little time, because most leave the scene after a few surfaces, and adds much noise (`docs/error-against-time.md`, *Russian roulette*).
const ROULETTE_THROUGHPUT: f32 = 0.25;

/// Least survival probability, which bounds the weight of surviving paths.
const LEAST_SURVIVAL: f32 = 0.05;

/// Everything that a path meets except geometry.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// Sky, suns, lamps, emissive surfaces, and backdrop.
    pub lights: Arc<Lights>,
    /// Material tables of the instances, then of the meshes.
    pub materials: MaterialTables,
    /// Mode, bounces, roulette.
    pub settings: Settings,
}

/// Orthonormal frame on a surface, with the normal as z.
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

/// A straight segment of a path, which continues through transparent surfaces.
#[derive(Clone, Copy)]
struct Way {
    /// Start of the segment: the camera, or the last scattering.
    from: Receiver,
    /// With which odds lights were sampled there.
    odds: LightOdds,
    /// Density of its direction; `None` from the camera.
    pdf: Option<f32>,
    /// Length so far, in world units.
    gone: f64,
}

impl Way {
    /// Light of lamps between the length so far and the next surface, or `t_max` where there is none.
    #[inline]
    fn lamps(&self, lights: &Lights, direction: DVec3, next: Option<&Hit>, t_max: f64) -> Vec3 {
        if lights.lamps().is_empty() {
            return Vec3::ZERO;
        }
        let length = direction.length();
        let direction = direction / length;
        let up_to = |limit: f64| match self.pdf {
            Some(pdf) => lights.lamp_emission(&self.from, &self.odds, direction, limit, pdf),
            None => lights.lamp_emission_to_camera(self.from.point, direction, limit),
        };
        let light = up_to(self.gone + next.map_or(t_max, |h| h.t) * length);
        if self.gone > 0.0 { light - up_to(self.gone) } else { light }
    }
}

/// The objects that a path sees.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Among {
    /// All objects; the camera path has hit no shadow catcher.
    All,
    /// All objects, after the first catcher.
    Caught,
    /// Shadow catchers alone, after the first.
    Catchers,
}

/// A camera path in front of a surface.
#[derive(Clone, Copy)]
struct Start {
    ray: RayInWorld,
    hit: Hit,
    t_max: f64,
    way: Way,
    /// Surfaces passed straight through.
    passed: u32,
    among: Among,
}

/// Radiance along a camera ray that is clipped at `t_max`; `down` is the height in the picture, from 0 at the top to 1 at the bottom.
#[inline]
pub fn radiance<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    sampler: &PixelSampler,
    camera_ray: RayInWorld,
    t_max: f64,
    down: f32,
) -> Vec3 {
    if around.settings.clamps() {
        let mut sorted = AovSample::new(&around.settings, PassSums::default());
        follow(tracer, around, sampler, camera_ray, t_max, down, &mut sorted);
        return sorted.total;
    }
    let mut total = ColorSample::default();
    follow(tracer, around, sampler, camera_ray, t_max, down, &mut total);
    total.0
}

/// Like [`radiance`], with all light added to a [`FilmSample`].
#[inline]
pub fn follow<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    sampler: &PixelSampler,
    camera_ray: RayInWorld,
    t_max: f64,
    down: f32,
    film_sample: &mut impl FilmSample,
) {
    let hit = first_hit(tracer, &camera_ray, t_max);
    if !around.lights.lamps().is_empty() && around.settings.mode != Mode::AmbientOcclusion {
        let length = camera_ray.direction.length();
        let limit = hit.as_ref().map_or(t_max, |h| h.t) * length;
        film_sample.add_emission(
            around.lights.lamp_emission_to_camera(camera_ray.origin, camera_ray.direction / length, limit),
            0,
        );
    }
    let Some(hit) = hit else {
        return film_sample.add_background(around.lights.background(camera_ray.direction, down), 0);
    };
    let bounces = match around.settings.mode {
        Mode::AmbientOcclusion => {
            return ambient(tracer, around, sampler, &camera_ray, &hit, down, film_sample);
        }
        Mode::OneBounce => 0,
        Mode::Path => around.settings.bounces,
    };
    let from = Receiver { point: camera_ray.origin, normal: Vec3::Z, both_sides: true };
    let way = Way { from, odds: LightOdds::default(), pdf: None, gone: 0.0 };
    let start = Start { ray: camera_ray, hit, t_max, way, passed: 0, among: Among::All };
    path(tracer, around, sampler, start, bounces, down, film_sample);
}

/// 1 where a cosine-distributed ray hits nothing within reach, else 0: the light that a white surface would scatter from a white sky.
fn ambient<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    sampler: &PixelSampler,
    ray: &RayInWorld,
    hit: &Hit,
    down: f32,
    film_sample: &mut impl FilmSample,
) {
    let normal = hit.normal_towards_ray();
    let frame =
        Frame::new(tracer.shading_normal(hit, ray.origin + ray.direction * hit.t, normal).unwrap_or(normal));
    let white = [Vec3::ONE, Vec3::ZERO, Vec3::ZERO];
    let materials = &around.materials[hit.surface.instance as usize];
    let catches = film_sample.catches() && materials.catches();
    if catches {
        film_sample.caught(|| around.lights.background(ray.direction, down));
    }
    film_sample.write_ids(0, || materials.ids_of(hit.surface.label));
    film_sample.write_aovs(0, || SurfaceAovs { colors: white, normal: frame.normal.as_vec3() });
    if hit.is_seen_from_within() {
        return;
    }
    let [u, v, _] = sampler.bounce(0, BounceSet::Scatter);
    let direction = frame.world(sample_cosine([u, v]));
    let ray = RayInWorld { origin: ray.origin + ray.direction * hit.t, direction };
    let above = direction.dot(normal) > 0.0;
    let (from, reach) = (PathOrigin::Face(hit.surface), around.settings.ao_distance);
    let all_of_it = || PassWeights { diffuse: Vec3::ONE, through: false };
    let light = |open: bool| Vec3::splat(f32::from(u8::from(open)));
    film_sample.add_direct_light(light(above && !tracer.occluded(&ray, from, reach)), 0, all_of_it);
    if catches && let Some(catchers) = tracer.catchers() {
        film_sample.among_catchers(true);
        film_sample.add_direct_light(light(above && !catchers.occluded(&ray, from, reach)), 0, all_of_it);
    }
}

fn path<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    sampler: &PixelSampler,
    start: Start,
    bounces: u32,
    down: f32,
    film_sample: &mut impl FilmSample,
) {
    let lights = &around.lights;
    let mut throughput = Vec3::ONE;
    let Start { mut ray, mut hit, mut t_max, mut way, mut passed, mut among } = start;
    // Number of surfaces that scattered the path.
    let mut vertex = 0u32;
    // Whether a path outside of all labels of an instance started within the coarse element of another label there.
    let mut buried = false;
    loop {
        let materials = &around.materials[hit.surface.instance as usize];
        let material = materials.material(hit.surface.label);

        // The camera's first shadow catcher.
        if materials.catches() && among == Among::All && vertex == 0 && film_sample.catches() {
            film_sample.caught(|| lights.background(ray.direction.normalize(), down));
            if let Some(catchers) = tracer.catchers() {
                let start = Start { ray, hit, t_max, way, passed, among: Among::Catchers };
                film_sample.among_catchers(true);
                path(catchers, around, sampler, start, bounces, down, film_sample);
                film_sample.among_catchers(false);
            }
            among = Among::Caught;
        }
        let step = vertex + passed;
        let origin = ray.origin + ray.direction * hit.t;

        // Straight on where the surface is transparent.
        if material.alpha < 1.0 && sampler.bounce(step, BounceSet::Survival)[1] >= material.alpha {
            passed += 1;
            if passed > MAX_TRANSPARENT_SURFACES {
                return;
            }
            ray.origin = origin;
            t_max -= hit.t;
            way.gone += hit.t * ray.direction.length();
            buried = false;
            let next = next_hit(tracer, &ray, &hit, t_max);
            film_sample
                .add_emission(throughput * way.lamps(lights, ray.direction, next.as_ref(), t_max), vertex);
            match next {
                Some(next) => hit = next,
                None => {
                    let direction = ray.direction.normalize();
                    let light = match way.pdf {
                        Some(pdf) => lights.infinite_emission(&way.from, &way.odds, direction, pdf),
                        None => lights.background(direction, down),
                    };
                    return film_sample.add_background(throughput * light, vertex);
                }
            }
            continue;
        }

        // The side that is seen.
        let normal = if hit.from_inside { -hit.normal_in_world } else { hit.normal_in_world };
        let smooth = tracer.shading_normal(&hit, origin, normal);
        let frame = Frame::new(smooth.unwrap_or(normal));
        let mut wi = frame.local(-ray.direction.normalize());
        // Emission uses the geometric normal, because light sampling knows no other.
        let own = smooth.map(|_| frame.local(normal));
        let cos = own.map_or(wi.z, |own| wi.dot(own)).max(LEAST_VIEW);
        let mut light = emitted(material, cos);
        if let Some(pdf) = way.pdf
            && light != Vec3::ZERO
        {
            let distance = way.gone + hit.t * ray.direction.length();
            light *= lights.emission_weight(tracer, &way.from, &way.odds, &hit, distance, pdf);
        }
        film_sample.add_emission(throughput * light, vertex);
        if vertex > bounces || buried {
            return;
        }
        let bsdf = match own {
            Some(own) => {
                Bsdf::with_specular_normal(material, wi, SpecularNormal::new(own, wi), hit.from_inside)
            }
            None => {
                wi.z = cos;
                Bsdf::new(material, wi, hit.from_inside)
            }
        };
        film_sample
            .write_ids(vertex, || around.materials[hit.surface.instance as usize].ids_of(hit.surface.label));
        film_sample.write_aovs(vertex, || SurfaceAovs {
            colors: bsdf.colors(material),
            normal: frame.normal.as_vec3(),
        });
        let receiver =
            Receiver { point: origin, normal: frame.normal.as_vec3(), both_sides: bsdf.transmits() };
        // Sample a light.
        let mut odds = LightOdds::default();
        if lights.samples_lights() {
            odds = lights.odds(&receiver);
            let [u, v, which] = sampler.bounce(step, BounceSet::Light);
            let further = || sampler.bounce(step, BounceSet::Emitter);
            if let Some(light) = lights.sample_light(&receiver, &odds, which, [u, v], further)
                && (light.direction.dot(frame.normal) > 0.0 || bsdf.transmits())
                && (among != Among::Catchers
                    || light.instance.is_none_or(|i| around.materials[i as usize].catches()))
            {
                let wo = frame.local(light.direction);
                let (f_cos, pdf) = bsdf.eval(wo);
                let add =
                    throughput * f_cos * light.radiance_over_pdf * lights.light_mis_weight(light.pdf, pdf);
                let shadow_ray = RayInWorld { origin, direction: light.direction };
                if add.max_element() > 0.0 {
                    let seen = visibility(tracer, around, &shadow_ray, &hit, light.distance);
                    film_sample.add_direct_light(add * seen, vertex, || PassWeights {
                        diffuse: bsdf.diffuse_share(wo, f_cos),
                        through: wo.z < 0.0,
                    });
                }
            }
        }

        // Scatter.
        let [u, v, lobe] = sampler.bounce(step, BounceSet::Scatter);
        let Some(sample) = bsdf.sample([u, v], lobe) else {
            return;
        };
        throughput *= sample.weight;
        let most = throughput.max_element();
        if most <= 0.0 {
            return;
        }
        // The single direction of a mirror belongs to the mirror alone.
        film_sample.scatter(vertex, || PassWeights {
            diffuse: match sample.pdf.is_finite() {
                true => bsdf.diffuse_share(sample.wo, sample.weight * sample.pdf),
                false => Vec3::ZERO,
            },
            through: sample.through,
        });

        // End by Russian roulette; surviving paths are weighted for those that end (Arvo and Kirk 1990).
        if around.settings.russian_roulette && vertex >= FIRST_ROULETTE && most < ROULETTE_THROUGHPUT {
            let survival = (most * (1.0 / ROULETTE_THROUGHPUT)).max(LEAST_SURVIVAL);
            if sampler.bounce(step, BounceSet::Survival)[0] >= survival {
                return;
            }
            throughput /= survival;
        }
        let direction = frame.world(sample.wo);
        // Only if the direction is on the side of the geometric surface for which it was sampled.
        let above = direction.dot(normal);
        if above == 0.0 || (above > 0.0) == sample.through {
            return;
        }
        ray = RayInWorld { origin, direction };
        t_max = f64::INFINITY;
        way = Way { from: receiver, odds, pdf: Some(sample.pdf), gone: 0.0 };
        let outward = (above > 0.0) != hit.from_inside;
        let next = next_hit(tracer, &ray, &hit, t_max);
        vertex += 1;
        film_sample.add_emission(throughput * way.lamps(lights, direction, next.as_ref(), t_max), vertex);
        match next {
            Some(next) => {
                // (A mesh or another instance may well stand inside of a label.)
                let same_volume = hit.surface.instance == next.surface.instance;
                buried = outward && same_volume && next.is_seen_from_within() && !may_touch(direction, &hit);
                hit = next;
            }
            None => {
                let light = lights.infinite_emission(&receiver, &odds, direction.normalize(), sample.pdf);
                return film_sample.add_background(throughput * light, vertex);
            }
        }
    }
}
