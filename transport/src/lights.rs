//! The lights of a scene, prepared for sampling: sky, suns, lamps, emissive surfaces, and the choice among them.
//!
//! A constant sky is not sampled: BSDF sampling already follows the reflection of uniform light, so a shadow ray to the sky would cost time
//! and gain nothing. An environment picture, suns and lamps are sampled: one of them for each surface point, with a probability
//! proportional to the irradiance that it can give (for a lamp: at a distance of 1).
//!
//! Emissive surfaces ([`Emitters`]) are sampled too, all together as one more light, whose irradiance is estimated around them. A scattered
//! ray finds them as the surfaces that it hits.
//!
//! A lamp is not a surface: rays pass through it, and a ray that is scattered towards it finds it if it is nearer than the next hit.

use std::f32::consts::PI;

use std::sync::Arc;

use crate::{EnvironmentTable, Hit, ReadyLamp, ReadySun, Receiver, Tracer};
use glam::{DVec3, Vec3};

use crate::emitters::Emitters;

/// Light from infinity.
#[derive(Clone, Debug)]
pub enum Sky {
    /// The same radiance from every direction.
    Constant(Vec3),
    /// An environment picture.
    Image(Arc<EnvironmentTable>),
}

/// A sampled light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub direction: DVec3,
    /// Radiance over density: the light that it adds to a surface with f·cos = 1.
    pub radiance_over_pdf: Vec3,
    /// Density per solid angle, including the choice of the light; `None` for a single direction.
    pub pdf: Option<f32>,
    /// Surfaces nearer than this occlude the light.
    pub distance: f64,
    /// The instance or mesh whose surface emits, if the light is a surface.
    pub instance: Option<u32>,
}

/// Factor on the distance to a lamp or an emissive surface: a hit beyond that, almost touching the light, does not occlude it, because
/// distances to lamps are f32.
pub(crate) const TOUCHING: f64 = 1.0 - 1.0 / 1_048_576.0;

/// How light is found. Each strategy alone finds all light that both can find.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightStrategy {
    /// Light and BSDF sampling, weighted by the power heuristic (Veach 1997, §9.2.4).
    #[default]
    Mis,
    /// Only light sampling (for tests).
    LightsOnly,
    /// Only BSDF sampling (for tests).
    BsdfOnly,
}

/// All lights of a scene (see the module).
#[derive(Clone, Debug)]
pub struct Lights {
    sky: Sky,
    suns: Vec<ReadySun>,
    lamps: Vec<ReadyLamp>,
    backdrop: Option<[Vec3; 2]>,
    /// Cumulative probabilities: of the sky, then each sun, then each lamp.
    cdf: Vec<f32>,
    /// The emissive surfaces, and the probability of sampling them; the other lights share the rest.
    emitters: Option<Arc<Emitters>>,
    emitters_probability: f32,
    strategy: LightStrategy,
}

impl Lights {
    /// Lights of a scene without lamps.
    pub fn new(sky: Sky, suns: Vec<ReadySun>, backdrop: Option<[[f32; 3]; 2]>) -> Self {
        let backdrop = backdrop.map(|b| b.map(Vec3::from_array));
        let lights = Self {
            sky,
            suns,
            lamps: Vec::new(),
            backdrop,
            cdf: Vec::new(),
            emitters: None,
            emitters_probability: 0.0,
            strategy: LightStrategy::Mis,
        };
        lights.with_lamps(Vec::new())
    }

    /// The same lights with these lamps.
    #[must_use]
    pub fn with_lamps(self, lamps: Vec<ReadyLamp>) -> Self {
        let emitters = self.emitters.clone();
        let lights = Self { lamps, ..self };
        Self { cdf: light_cdf(&lights.powers()), ..lights }.with_emitters(emitters)
    }

    /// The same lights with these emissive surfaces.
    #[must_use]
    pub fn with_emitters(self, emitters: Option<Arc<Emitters>>) -> Self {
        let emitters_probability =
            emitters.as_ref().map_or(0.0, |e| self.probability_of_emitters(e.irradiance()));
        Self { emitters: emitters.filter(|_| emitters_probability > 0.0), emitters_probability, ..self }
    }

    /// Probability of sampling emissive surfaces of this irradiance rather than one of the other lights.
    pub fn probability_of_emitters(&self, irradiance: f32) -> f32 {
        if irradiance <= 0.0 {
            return 0.0;
        }
        if self.cdf.is_empty() {
            return 1.0;
        }
        // Same rule as in `light_cdf`.
        let powers = self.powers();
        let lit = powers.iter().filter(|&&p| p > 0.0).count() + 1;
        let total = powers.iter().sum::<f32>() + irradiance;
        let part = if total.is_finite() { irradiance / total } else { 0.5 };
        0.9 * part + 0.1 / lit as f32
    }

    /// Irradiance that the sky, each sun and each lamp can give.
    fn powers(&self) -> Vec<f32> {
        let sky_power = match &self.sky {
            Sky::Constant(_) => 0.0,
            Sky::Image(table) => table.total_radiance(),
        };
        let suns = self.suns.iter().map(ReadySun::irradiance);
        std::iter::once(sky_power)
            .chain(suns)
            .chain(self.lamps.iter().map(|l| l.power() / 4.0 / PI))
            .collect()
    }

    /// The same lights with this strategy.
    #[must_use]
    pub fn with_strategy(mut self, finding: LightStrategy) -> Self {
        self.strategy = finding;
        self
    }

    /// The sky.
    pub fn sky(&self) -> &Sky {
        &self.sky
    }

    /// The suns.
    pub fn suns(&self) -> &[ReadySun] {
        &self.suns
    }

    /// The lamps.
    pub fn lamps(&self) -> &[ReadyLamp] {
        &self.lamps
    }

    /// Colours at the bottom and the top of a backdrop that the camera sees instead of the sky.
    pub fn backdrop(&self) -> Option<[Vec3; 2]> {
        self.backdrop
    }

    /// Cumulative probabilities: of the sky, then each sun, then each lamp; empty where none of them is sampled.
    pub fn cdf(&self) -> &[f32] {
        &self.cdf
    }

    /// The emissive surfaces that light sampling can choose.
    pub fn emitters(&self) -> Option<&Arc<Emitters>> {
        self.emitters.as_ref()
    }

    /// Probability of sampling an emissive surface.
    pub fn emitters_probability(&self) -> f32 {
        self.emitters_probability
    }

    /// The strategy.
    pub fn strategy(&self) -> LightStrategy {
        self.strategy
    }

    /// Whether any light is sampled.
    #[inline]
    pub fn samples_lights(&self) -> bool {
        (!self.cdf.is_empty() || self.emitters.is_some()) && self.strategy != LightStrategy::BsdfOnly
    }

    #[inline]
    fn probability(&self, light: usize) -> f32 {
        match self.cdf.get(light) {
            Some(&end) => {
                (end - if light == 0 { 0.0 } else { self.cdf[light - 1] }) * (1.0 - self.emitters_probability)
            }
            None => 0.0,
        }
    }

    /// Samples a light and a direction towards it; `None` where [`Lights::samples_lights`] is false or the sample carries no light.
    /// `further` gives more random numbers, and is only called where one of many emissive surfaces is chosen.
    #[inline]
    pub fn sample_light(
        &self,
        from: &Receiver,
        choice: f32,
        u: [f32; 2],
        further: impl FnOnce() -> [f32; 2],
    ) -> Option<LightSample> {
        let Some(emitters) = &self.emitters else { return self.sample_infinite_or_lamp(from, choice, u) };
        if choice >= self.emitters_probability {
            let choice = (choice - self.emitters_probability) / (1.0 - self.emitters_probability);
            return self.sample_infinite_or_lamp(from, choice, u);
        }
        let s = emitters.sample(from, choice / self.emitters_probability, further(), u)?;
        let pdf = s.pdf * self.emitters_probability;
        Some(LightSample {
            direction: s.direction,
            radiance_over_pdf: s.radiance / pdf,
            pdf: Some(pdf),
            distance: s.distance,
            instance: Some(s.instance),
        })
    }

    /// MIS weight of the emission of a surface that a ray hit at `distance`, after scattering at `from` with density `pdf`.
    #[inline]
    pub fn emission_weight<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        from: &Receiver,
        hit: &Hit,
        distance: f64,
        pdf: f32,
    ) -> f32 {
        let Some(emitters) = &self.emitters else { return 1.0 };
        // Light sampling does not choose insides, nor the front of a label that touches the one that the path leaves.
        if hit.is_seen_from_within() || hit.t == 0.0 {
            return 1.0;
        }
        let box_origin = || tracer.box_origin(&hit.surface);
        let aimed = emitters.pdf(from, &hit.surface, box_origin, distance) * self.emitters_probability;
        self.bsdf_mis_weight(pdf, aimed)
    }

    /// [`Lights::sample_light`] for lights that are not surfaces.
    #[inline]
    pub fn sample_infinite_or_lamp(&self, from: &Receiver, choice: f32, u: [f32; 2]) -> Option<LightSample> {
        let light = self.cdf.partition_point(|&e| e <= choice);
        let chance = self.probability(light);
        let mut distance = f64::INFINITY;
        let (direction, radiance, pdf) = if light == 0 {
            let Sky::Image(table) = &self.sky else { return None };
            let (d, l, pdf) = table.sample(u);
            (d, l, Some(pdf))
        } else if let Some(sun) = self.suns.get(light - 1) {
            sun.sample(u)
        } else {
            let s = self.lamps.get(light - 1 - self.suns.len())?.sample(from, u)?;
            distance = f64::from(s.distance) * TOUCHING;
            (s.direction.as_dvec3(), s.radiance, (s.pdf > 0.0).then_some(s.pdf))
        };
        let pdf = pdf.map(|p| p * chance);
        let over = pdf.unwrap_or(chance);
        (over > 0.0).then(|| LightSample {
            direction,
            radiance_over_pdf: radiance / over,
            pdf,
            distance,
            instance: None,
        })
    }

    /// MIS weight of sampled light that BSDF sampling would have found with density `other`.
    #[inline]
    pub fn light_mis_weight(&self, pdf: Option<f32>, other: f32) -> f32 {
        match (pdf, self.strategy) {
            (Some(p), LightStrategy::Mis) => power_heuristic(p, other),
            _ => 1.0,
        }
    }

    #[inline]
    fn bsdf_mis_weight(&self, pdf: f32, light: f32) -> f32 {
        match self.strategy {
            LightStrategy::Mis => power_heuristic(pdf, light),
            LightStrategy::LightsOnly if light > 0.0 => 0.0,
            _ => 1.0,
        }
    }

    /// Light at infinity that a scattered ray (unit direction, sampled with density `pdf`) finds, with its MIS weight.
    #[inline]
    pub fn infinite_emission(&self, direction: DVec3, pdf: f32) -> Vec3 {
        let mut light = match &self.sky {
            Sky::Constant(radiance) => *radiance,
            Sky::Image(table) => {
                table.eval(direction) * self.bsdf_mis_weight(pdf, table.pdf(direction) * self.probability(0))
            }
        };
        for (i, sun) in self.suns.iter().enumerate() {
            if let Some((radiance, sun_pdf)) = sun.eval(direction) {
                light += radiance * self.bsdf_mis_weight(pdf, sun_pdf * self.probability(i + 1));
            }
        }
        light
    }

    /// Light of all lamps that a ray (unit direction) passes through within the distance `limit`, where the ray was scattered at `from`
    /// with density `pdf`.
    #[inline]
    pub fn lamp_emission(&self, from: &Receiver, direction: DVec3, limit: f64, pdf: f32) -> Vec3 {
        let direction = direction.as_vec3();
        let mut light = Vec3::ZERO;
        for (i, lamp) in self.lamps.iter().enumerate() {
            if let Some(met) = lamp.meet(from, direction)
                && f64::from(met.distance) * TOUCHING < limit
            {
                let chance = self.probability(1 + self.suns.len() + i);
                light += met.radiance * self.bsdf_mis_weight(pdf, met.pdf * chance);
            }
        }
        light
    }

    /// Light of all lamps that a camera ray (unit direction) passes through within the distance `limit`.
    #[inline]
    pub fn lamp_emission_to_camera(&self, from: DVec3, direction: DVec3, limit: f64) -> Vec3 {
        let from = Receiver { point: from, normal: Vec3::Z, both_sides: true };
        let direction = direction.as_vec3();
        let seen = self.lamps.iter().filter(|l| l.visible_to_camera).filter_map(|l| l.meet(&from, direction));
        seen.filter(|met| f64::from(met.distance) * TOUCHING < limit).map(|met| met.radiance).sum()
    }

    /// Radiance of a camera ray that hits nothing; `down` is 0 at the top of the picture and 1 at the bottom. The camera does not see suns.
    #[inline]
    pub fn background(&self, direction: DVec3, down: f32) -> Vec3 {
        match (&self.backdrop, &self.sky) {
            (Some([bottom, top]), _) => top.lerp(*bottom, down.clamp(0.0, 1.0)),
            (None, Sky::Constant(radiance)) => *radiance,
            (None, Sky::Image(table)) => table.eval(direction),
        }
    }
}

/// Cumulative probabilities of lights with these powers; empty where all powers are 0.
fn light_cdf(powers: &[f32]) -> Vec<f32> {
    let total: f32 = powers.iter().sum();
    let lit = powers.iter().filter(|&&p| p > 0.0).count() as f32;
    let mut ends = Vec::new();
    if total > 0.0 && total.is_finite() {
        let mut end = 0.0;
        for p in powers {
            // A tenth is distributed evenly: a weak light may be the only one that reaches a corner.
            end += if *p > 0.0 { 0.9 * p / total + 0.1 / lit } else { 0.0 };
            ends.push(end);
        }
        // The last light with a probability above 0 ends at exactly 1, despite rounding.
        for e in ends.iter_mut().rev() {
            if *e < end {
                break;
            }
            *e = 1.0;
        }
    }
    ends
}

/// Veach 1997, eq. 9.13 with β = 2, computed from ratios because squares of peaked densities overflow.
#[inline]
fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 {
        return 0.0;
    }
    let r = b / a;
    1.0 / (1.0 + r * r)
}
