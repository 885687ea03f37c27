//! What light arrives from infinity: suns as cones, the sky as a constant or a picture; sampled towards and looked up.
//!
//! Each light is a technique of its own for multiple importance sampling: a scattered ray that escapes meets the sky and every
//! sun whose disk it falls in, each weighted against the chance that the light would have been sampled in that direction (power
//! heuristic, Veach 1997, §9.2.4). A sky that is the same from everywhere is not sampled at all: scattering finds it as well.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use pumice_render::environment::EnvironmentMap;
use pumice_scene::Sun;

use crate::shading_frame::ShadingFrame;

/// A sun, made ready.
#[derive(Clone, Copy, Debug)]
pub struct SunCone {
    frame: ShadingFrame,
    /// Radiance of its disk; where it is a point, its irradiance.
    radiance: Vec3,
    /// 1 − cos of half its angle, exact for small angles too; 0 is a point.
    one_minus_cos: f64,
}

impl SunCone {
    /// Radiance = strength / (π sin²(angle/2)), so that a surface that faces the sun receives `strength` (Cycles'
    /// `distant_light_area`; its disk is uniform in solid angle over the cone here as there).
    pub fn new(sun: &Sun) -> Self {
        let half_rad = sun.angle_rad / 2.0;
        let one_minus_cos = 2.0 * (half_rad / 2.0).sin().powi(2);
        let irradiance = Vec3::from_array(sun.color) * sun.strength;
        let area = PI * half_rad.sin().powi(2);
        Self {
            frame: ShadingFrame::new(-DVec3::from_array(sun.direction).normalize()),
            radiance: if one_minus_cos > 0.0 { irradiance / area as f32 } else { irradiance },
            one_minus_cos,
        }
    }

    /// Density per solid angle within the cone.
    fn pdf(&self) -> f64 {
        1.0 / (2.0 * PI * self.one_minus_cos)
    }

    fn contains(&self, direction: DVec3) -> bool {
        // |d − n|² = 2 (1 − cos) keeps its digits for narrow cones, where 1 − d·n would lose them.
        (direction - self.frame.normal).length_squared() < 2.0 * self.one_minus_cos
    }

    fn sample(&self, u: [f32; 2]) -> DVec3 {
        let above = f64::from(u[0]) * self.one_minus_cos;
        let sin = (above * (2.0 - above)).sqrt();
        let (sin_phi, cos_phi) = (2.0 * PI * f64::from(u[1])).sin_cos();
        self.frame.world_from_local(DVec3::new(sin * cos_phi, sin * sin_phi, 1.0 - above))
    }
}

/// Radiance that arrives where nothing is hit.
#[derive(Debug)]
pub enum Sky {
    /// The same from everywhere.
    Constant(Vec3),
    /// An equirectangular picture.
    Image(EnvironmentMap),
}

/// All lights.
#[derive(Debug)]
pub struct Lighting {
    sky: Sky,
    suns: Vec<SunCone>,
}

/// A sampled direction to a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit vector towards the light, world space.
    pub direction: DVec3,
    /// Radiance, or irradiance of a point.
    pub radiance: Vec3,
    /// Density per solid angle, the choice of light included; for a point the chance of its choice.
    pub pdf: f32,
    /// Whether scattering can never find it.
    pub is_point: bool,
}

impl Lighting {
    /// Lights of a scene.
    pub fn new(sky: Sky, suns: &[Sun]) -> Self {
        Self { sky, suns: suns.iter().filter(|s| s.strength > 0.0).map(SunCone::new).collect() }
    }

    /// Lights that are sampled: all suns, and the sky if it is a picture.
    fn sampled(&self) -> usize {
        self.suns.len() + usize::from(matches!(self.sky, Sky::Image(_)))
    }

    /// A direction to one of the lights; `None` where there is none to sample.
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Option<LightSample> {
        let count = self.sampled();
        let i = ((choice * count as f32) as usize).min(count.checked_sub(1)?);
        let chance = 1.0 / count as f32;
        match (self.suns.get(i), &self.sky) {
            (Some(sun), _) => {
                let is_point = sun.one_minus_cos <= 0.0;
                Some(LightSample {
                    direction: if is_point { sun.frame.normal } else { sun.sample(u) },
                    radiance: sun.radiance,
                    pdf: if is_point { chance } else { chance * sun.pdf() as f32 },
                    is_point,
                })
            }
            (None, Sky::Image(map)) => {
                let (direction, radiance, pdf) = map.sample(u);
                (pdf > 0.0).then_some(LightSample { direction, radiance, pdf: pdf * chance, is_point: false })
            }
            (None, Sky::Constant(_)) => None,
        }
    }

    /// What a scattered ray with density `scatter_pdf` finds in `direction` (unit), weighted for multiple importance sampling.
    pub fn escaped(&self, direction: DVec3, scatter_pdf: f32) -> Vec3 {
        let chance = 1.0 / self.sampled().max(1) as f32;
        let mut found = match &self.sky {
            Sky::Constant(radiance) => *radiance,
            Sky::Image(map) => {
                map.radiance(direction) * power_heuristic(scatter_pdf, chance * map.pdf(direction))
            }
        };
        for sun in &self.suns {
            if sun.one_minus_cos > 0.0 && sun.contains(direction) {
                found += sun.radiance * power_heuristic(scatter_pdf, chance * sun.pdf() as f32);
            }
        }
        found
    }

    /// What the camera sees where it hits nothing; the disks of suns are not drawn, as in Cycles.
    pub fn background(&self, direction: DVec3) -> Vec3 {
        match &self.sky {
            Sky::Constant(radiance) => *radiance,
            Sky::Image(map) => map.radiance(direction),
        }
    }
}

/// a² / (a² + b²) without overflow.
#[inline]
pub fn power_heuristic(a: f32, b: f32) -> f32 {
    if a == 0.0 {
        return 0.0;
    }
    let r = b / a;
    1.0 / (1.0 + r * r)
}
