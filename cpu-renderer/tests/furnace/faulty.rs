//! A copy of the path tracer's loop with one selectable fault that the furnaces must notice.
//!
//! Without a fault it gives the renderer's samples to the bit (a test checks it). So the effect of a fault is due to that fault alone, and
//! the renderer needs no switch for it.

use glam::{DVec3, Vec3};
use pumice_cpu::Surroundings;
use pumice_transport::bsdf::Bsdf;
use pumice_transport::sampler::{BounceSet, PixelSampler};
use pumice_transport::sun::frame_around;
use pumice_transport::{PathOrigin, RayInWorld, Receiver, Tracer};

use crate::naive::Dense;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The renderer as it is.
    None,
    /// Directions are uniform over the hemisphere instead of following the cosine: noisier, but correct.
    EvenDirections,
    /// Paths that survive Russian roulette are not weighted for those that it ended.
    RouletteUncompensated,
    /// The roulette of the shader published with the method: uniform directions, from the first bounce, with the unclamped throughput as
    /// survival probability: where it is above 1, no path ends, but survivors are divided by it all the same.
    RouletteUnclamped,
    /// The density of a scattered direction is reported too large by this factor, everywhere.
    Density(f32),
    /// The same, but only in the MIS weight of sampled lights: the two strategies then use different densities.
    DensityInWeights(f32),
    /// The sum of both MIS weights is this number.
    SumOfWeights(f32),
    /// The MIS weight of sampled lights alone is too large by this factor.
    AimedWeight(f32),
}

pub fn radiance(
    fault: Fault,
    tracer: &Dense,
    around: &Surroundings,
    sampler: &PixelSampler,
    mut ray: RayInWorld,
    t_max: f64,
) -> Vec3 {
    let lights = &around.lights;
    let Some(mut hit) = tracer.first_hit(&ray, PathOrigin::Free, t_max) else {
        return lights.background(ray.direction, 0.5);
    };
    let even = matches!(fault, Fault::EvenDirections | Fault::RouletteUnclamped);
    let (told, told_in_weights) = match fault {
        Fault::Density(factor) => (factor, factor),
        Fault::DensityInWeights(factor) => (1.0, factor),
        _ => (1.0, 1.0),
    };
    let (aimed, scattered) = match fault {
        Fault::SumOfWeights(sum) => (sum, sum),
        Fault::AimedWeight(factor) => (factor, 1.0),
        _ => (1.0, 1.0),
    };
    let (mut total, mut throughput) = (Vec3::ZERO, Vec3::ONE);
    let mut vertex = 0;
    loop {
        let material = around.materials[0].material(hit.surface.label);
        total += throughput * Vec3::from_array(material.emission);
        if vertex > around.settings.bounces || hit.from_inside {
            return total;
        }
        let normal = hit.normal_in_world;
        let (tangent, bitangent) = frame_around(normal);
        let local =
            |w: DVec3| Vec3::new(w.dot(tangent) as f32, w.dot(bitangent) as f32, w.dot(normal) as f32);
        let mut wi = local(-ray.direction.normalize());
        wi.z = wi.z.max(1e-6);
        let bsdf = Bsdf::new(material, wi, false);
        let origin = ray.origin + ray.direction * hit.t;
        let from = PathOrigin::Face(hit.surface);
        let receiver = Receiver { point: origin, normal: normal.as_vec3(), both_sides: false };

        let odds = lights.odds(&receiver);
        let [u, v, which] = sampler.bounce(vertex, BounceSet::Light);
        if lights.samples_lights()
            && let Some(light) = lights.sample_light(&receiver, &odds, which, [u, v], || [0.5; 3])
            && light.direction.dot(normal) > 0.0
        {
            let (f_cos, pdf) = bsdf.eval(local(light.direction));
            let weight = lights.light_mis_weight(light.pdf, pdf * told_in_weights) * aimed;
            let add = throughput * f_cos * light.radiance_over_pdf * weight;
            let shadow_ray = RayInWorld { origin, direction: light.direction };
            if add.max_element() > 0.0 && !tracer.occluded(&shadow_ray, from, f64::INFINITY) {
                total += add;
            }
        }

        let [u, v, lobe] = sampler.bounce(vertex, BounceSet::Scatter);
        let u = [u, v];
        let (wo, weight, pdf) = if even {
            let wo = even_direction(u);
            let pdf = 0.5 * std::f32::consts::FRAC_1_PI;
            (wo, bsdf.eval(wo).0 / pdf, pdf)
        } else {
            let Some(sample) = bsdf.sample(u, lobe) else { return total };
            (sample.wo, sample.weight / told, sample.pdf * told)
        };
        throughput *= weight;
        let most = throughput.max_element();
        if most <= 0.0 {
            return total;
        }

        let u = sampler.bounce(vertex, BounceSet::Survival)[0];
        if fault == Fault::RouletteUnclamped {
            if u >= most {
                return total;
            }
            throughput /= most;
        } else if around.settings.russian_roulette && vertex >= 2 && most < 0.25 {
            let survival = (4.0 * most).max(0.05);
            if u >= survival {
                return total;
            }
            throughput /= if fault == Fault::RouletteUncompensated { 1.0 } else { survival };
        }
        let direction = tangent * f64::from(wo.x) + bitangent * f64::from(wo.y) + normal * f64::from(wo.z);
        if direction.dot(normal) <= 0.0 {
            return total;
        }
        ray = RayInWorld { origin, direction };
        match tracer.first_hit(&ray, from, f64::INFINITY) {
            Some(next) => hit = next,
            None => {
                return total
                    + throughput
                        * lights.infinite_emission(&receiver, &odds, direction.normalize(), pdf)
                        * scattered;
            }
        }
        vertex += 1;
    }
}

/// Uniform direction on the hemisphere (Archimedes: the height is uniform).
fn even_direction([u, v]: [f32; 2]) -> Vec3 {
    let (z, (sin, cos)) = (u.max(1e-6), (std::f32::consts::TAU * v).sin_cos());
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, z)
}
