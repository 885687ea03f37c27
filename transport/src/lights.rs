//! The lights of a scene, prepared for sampling: sky, suns, lamps, emissive surfaces, and the choice among them.
//!
//! A constant sky is not sampled: BSDF sampling already follows the reflection of uniform light, so a shadow ray to the sky would cost time
//! and gain nothing. An environment picture, suns and lamps are sampled, and emissive surfaces ([`Emitters`]), all together as one more
//! light: one of them for each surface point. A scattered ray finds emissive surfaces as those that it hits.
//!
//! **Which one.** Each light has a weight at a receiver, about the irradiance that it can give there: a sky by the normal, suns by their
//! cosine, lamps by distance, by the receiver's cosine, by their own and by cone or spread, emissive surfaces by the distance to their middle. A light below the horizon or behind a lamp
//! has none. Nine tenths of the probability are proportional to the weights ([`LightOdds`]). With weights that ignored distance, a lamp far
//! away took most samples from the sky, for 5 times the variance.
//!
//! Few lamps are weighed one after another, tens of them eight at a time, and hundreds are one light whose lamps a tree chooses among
//! ([`lamp_tree.rs`](crate::lamp)).
//!
//! A lamp is not a surface: rays pass through it, and a ray that is scattered towards it finds it if it is nearer than the next hit.

use std::sync::Arc;

use crate::{EnvironmentTable, Hit, ReadyLamp, ReadySun, Receiver, Tracer};
use glam::{DVec3, Vec3};

use crate::emitters::Emitters;
use crate::lamp::{LampTree, ManyLamps};
use crate::light_tree::LightTree;
use crate::sky_irradiance::SkyIrradiance;

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

/// Largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

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
    lamp_sampling: LampSampling,
    /// Whether camera rays see any lamp.
    shows_lamps: bool,
    backdrop: Option<[Vec3; 2]>,
    /// Irradiance of a sampled sky; 0 where it is not sampled.
    sky_irradiance: SkyIrradiance,
    emitters: Option<Arc<Emitters>>,
    /// [`Lights::has_sampled_light`].
    is_sampled: bool,
    strategy: LightStrategy,
}

/// How lamps are weighed and found.
#[derive(Clone, Debug)]
enum LampSampling {
    /// One after another.
    EachAlone,
    /// Several at once.
    Several(Arc<ManyLamps>),
    /// By a tree, as one light.
    Tree(Arc<LampTree>),
}

/// One light; all emissive surfaces together are one, as are the lamps of a tree.
#[derive(Clone, Copy, Debug)]
enum Light {
    Sky,
    Sun(usize),
    Lamp(usize),
    AllLamps,
    Emitters,
}

/// What the probabilities of lights at a receiver are relative to ([`Lights::odds`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightOdds {
    /// Sum of the weights of all lights.
    pub total: f32,
    /// Number of lights whose weight is above 0.
    pub lit: f32,
    /// Weights of the first lights, in the order in which they are chosen.
    first: [f32; KEPT],
}

/// Weights that are kept with the odds. Further ones are computed again where they are needed.
const KEPT: usize = 8;

/// Most irradiance of a light by which it is chosen, so that sums are finite.
const MOST_IRRADIANCE: f32 = 1e30;

/// Part of the probability that all lights that are lit share evenly: a weak light may be the only one that reaches a corner.
const EVENLY: f32 = 0.1;

impl LightOdds {
    /// Probability of a light of this weight.
    #[inline]
    fn share(&self, weight: f32) -> f32 {
        if weight > 0.0 { EVENLY / self.lit + (1.0 - EVENLY) * (weight / self.total) } else { 0.0 }
    }
}

impl Lights {
    /// Lights of a scene without lamps.
    pub fn new(sky: Sky, suns: Vec<ReadySun>, backdrop: Option<[[f32; 3]; 2]>) -> Self {
        let backdrop = backdrop.map(|b| b.map(Vec3::from_array));
        let sky_irradiance = match &sky {
            Sky::Constant(_) => SkyIrradiance::default(),
            Sky::Image(table) => table.irradiance,
        };
        let lights = Self {
            sky,
            suns,
            lamps: Vec::new(),
            lamp_sampling: LampSampling::EachAlone,
            shows_lamps: false,
            backdrop,
            sky_irradiance,
            emitters: None,
            is_sampled: false,
            strategy: LightStrategy::Mis,
        };
        lights.with_lamps(Vec::new())
    }

    /// The same lights with these lamps.
    #[must_use]
    pub fn with_lamps(self, mut lamps: Vec<ReadyLamp>) -> Self {
        let lamp_sampling = match LampTree::new(&mut lamps) {
            Some(tree) => LampSampling::Tree(Arc::new(tree)),
            None => ManyLamps::new(&lamps)
                .map_or(LampSampling::EachAlone, |many| LampSampling::Several(Arc::new(many))),
        };
        let shows_lamps = lamps.iter().any(|lamp| lamp.visible_to_camera);
        let lights = Self { lamps, lamp_sampling, shows_lamps, ..self };
        Self { is_sampled: lights.has_sampled_light(), ..lights }
    }

    /// The same lights with these emissive surfaces.
    #[must_use]
    pub fn with_emitters(self, emitters: Option<Arc<Emitters>>) -> Self {
        let lights = Self { emitters: emitters.filter(|e| e.irradiance() > 0.0), ..self };
        Self { is_sampled: lights.has_sampled_light(), ..lights }
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

    /// The lamps; in the order of their tree where they have one.
    pub fn lamps(&self) -> &[ReadyLamp] {
        &self.lamps
    }

    /// The tree that chooses among lamps, and the irradiance in the world for an importance of 1; `None` where there are few lamps.
    pub fn lamp_tree(&self) -> Option<(&LightTree, f32)> {
        match &self.lamp_sampling {
            LampSampling::Tree(tree) => Some((tree.tree(), tree.irradiance())),
            LampSampling::EachAlone | LampSampling::Several(_) => None,
        }
    }

    /// Colours at the bottom and the top of a backdrop that the camera sees instead of the sky.
    pub fn backdrop(&self) -> Option<[Vec3; 2]> {
        self.backdrop
    }

    /// Irradiance of the sky where it is sampled, else 0.
    pub fn sky_irradiance(&self) -> SkyIrradiance {
        self.sky_irradiance
    }

    /// The emissive surfaces that light sampling can choose.
    pub fn emitters(&self) -> Option<&Arc<Emitters>> {
        self.emitters.as_ref()
    }

    /// The strategy.
    pub fn strategy(&self) -> LightStrategy {
        self.strategy
    }

    /// Whether some light is of a kind that is sampled.
    pub fn has_sampled_light(&self) -> bool {
        let suns = self.suns.iter().any(|sun| sun.irradiance() > 0.0);
        self.sky_irradiance.mean > 0.0 || suns || !self.lamps.is_empty() || self.emitters.is_some()
    }

    /// Whether any light is sampled.
    #[inline]
    pub fn samples_lights(&self) -> bool {
        self.is_sampled && self.strategy != LightStrategy::BsdfOnly
    }

    /// Irradiance that a light can give to a receiver; 0 only where it gives none.
    #[inline]
    fn weight(&self, light: Light, from: &Receiver) -> f32 {
        let weight = match light {
            Light::Sky => self.sky_irradiance.irradiance_at(from),
            Light::Sun(i) => self.suns[i].irradiance_at(from),
            Light::Lamp(i) => self.lamps[i].irradiance_at(from),
            Light::AllLamps => match &self.lamp_sampling {
                LampSampling::Tree(tree) => tree.irradiance_at(from),
                LampSampling::EachAlone | LampSampling::Several(_) => 0.0,
            },
            Light::Emitters => self.emitters.as_ref().map_or(0.0, |e| e.irradiance_at(from)),
        };
        weight.min(MOST_IRRADIANCE)
    }

    /// Number of lights that the lamps are.
    #[inline]
    fn lamp_lights(&self) -> usize {
        if matches!(self.lamp_sampling, LampSampling::Tree(_)) { 1 } else { self.lamps.len() }
    }

    /// Number of all lights.
    #[inline]
    fn count(&self) -> usize {
        self.suns.len() + self.lamp_lights() + 2
    }

    /// The light at this place of the order in which lights are chosen.
    #[inline]
    fn light_at(&self, place: usize) -> Light {
        let (suns, lamps) = (self.suns.len(), self.lamp_lights());
        match place {
            0 => Light::Sky,
            _ if place <= suns => Light::Sun(place - 1),
            _ if place <= suns + lamps => match &self.lamp_sampling {
                LampSampling::Tree(_) => Light::AllLamps,
                LampSampling::EachAlone | LampSampling::Several(_) => Light::Lamp(place - 1 - suns),
            },
            _ => Light::Emitters,
        }
    }

    /// Its inverse.
    #[inline]
    fn place_of(&self, light: Light) -> usize {
        match light {
            Light::Sky => 0,
            Light::Sun(i) => 1 + i,
            Light::Lamp(i) => 1 + self.suns.len() + i,
            Light::AllLamps => 1 + self.suns.len(),
            Light::Emitters => 1 + self.suns.len() + self.lamp_lights(),
        }
    }

    /// Calls `visit` with the place of each light and its weight at a receiver, in order, until it returns false.
    #[inline(always)]
    fn each_weight(&self, from: &Receiver, mut visit: impl FnMut(usize, f32) -> bool) {
        let mut weigh = |place: usize| visit(place, self.weight(self.light_at(place), from));
        let LampSampling::Several(many) = &self.lamp_sampling else {
            for place in 0..self.count() {
                if !weigh(place) {
                    return;
                }
            }
            return;
        };
        let first_lamp = 1 + self.suns.len();
        for place in 0..first_lamp {
            if !weigh(place) {
                return;
            }
        }
        for (first, weights) in many.irradiances_at(&self.lamps, from) {
            for (weight, i) in weights.iter().zip(first..self.lamps.len()) {
                if !visit(first_lamp + i, weight.min(MOST_IRRADIANCE)) {
                    return;
                }
            }
        }
        visit(self.count() - 1, self.weight(Light::Emitters, from));
    }

    /// The odds of all lights at a receiver.
    #[inline]
    pub fn odds(&self, from: &Receiver) -> LightOdds {
        let mut odds = LightOdds::default();
        self.each_weight(from, |place, weight| {
            odds.total += weight;
            odds.lit += if weight > 0.0 { 1.0 } else { 0.0 };
            if let Some(kept) = odds.first.get_mut(place) {
                *kept = weight;
            }
            true
        });
        odds
    }

    /// Probability of sampling a light at a receiver with these odds.
    #[inline]
    fn probability(&self, light: Light, from: &Receiver, odds: &LightOdds) -> f32 {
        let known = odds.first.get(self.place_of(light));
        odds.share(known.copied().unwrap_or_else(|| self.weight(light, from)))
    }

    /// Chooses a light; returns it with its probability, and with the part of that probability at which it was chosen, from 0 to 1.
    #[inline]
    fn choose(&self, from: &Receiver, odds: &LightOdds, mut choice: f32) -> Option<(Light, f32, f32)> {
        let mut chosen = None;
        let mut chance = 0.0;
        let mut goes_on = |place: usize, weight: f32| {
            let probability = odds.share(weight);
            if probability <= 0.0 {
                return true;
            }
            // Rounding may leave a rest beyond the last.
            choice -= chance;
            (chosen, chance) = (Some(place), probability);
            choice >= probability
        };
        match odds.first.get(..self.count()) {
            Some(weights) => _ = weights.iter().zip(0..).all(|(&weight, place)| goes_on(place, weight)),
            None => self.each_weight(from, goes_on),
        }
        chosen.map(|place| (self.light_at(place), chance, (choice / chance).clamp(0.0, BELOW_ONE)))
    }

    /// Samples a light and a direction towards it from a receiver with these odds; `None` where the sample carries no light. `further` gives
    /// more random numbers, and is only called where one of many emissive surfaces is chosen.
    #[inline]
    pub fn sample_light(
        &self,
        from: &Receiver,
        odds: &LightOdds,
        choice: f32,
        u: [f32; 2],
        further: impl FnOnce() -> [f32; 3],
    ) -> Option<LightSample> {
        let (mut light, mut chance, within) = self.choose(from, odds, choice)?;
        let mut further = Some(further);
        let mut further = || further.take().map_or([0.0; 3], |numbers| numbers());
        if let (Light::AllLamps, LampSampling::Tree(tree)) = (light, &self.lamp_sampling) {
            let (lamp, part) = tree.choose(from, [within, further()[0]])?;
            (light, chance) = (Light::Lamp(lamp), chance * part);
        }
        let mut distance = f64::INFINITY;
        let mut instance = None;
        let (direction, radiance, pdf) = match light {
            Light::Sky => {
                let Sky::Image(table) = &self.sky else { return None };
                let (d, l, pdf) = table.sample(u);
                (d, l, Some(pdf))
            }
            Light::Sun(i) => self.suns[i].sample(u),
            Light::Lamp(i) => {
                let s = self.lamps[i].sample(from, u)?;
                distance = f64::from(s.distance) * TOUCHING;
                (s.direction.as_dvec3(), s.radiance, (s.pdf > 0.0).then_some(s.pdf))
            }
            Light::AllLamps => return None,
            Light::Emitters => {
                let [a, b, _] = further();
                let s = self.emitters.as_ref()?.sample(from, within, [a, b], u)?;
                (distance, instance) = (s.distance, Some(s.instance));
                (s.direction, s.radiance, Some(s.pdf))
            }
        };
        let pdf = pdf.map(|p| p * chance);
        let over = pdf.unwrap_or(chance);
        (over > 0.0).then(|| LightSample {
            direction,
            radiance_over_pdf: radiance / over,
            pdf,
            distance,
            instance,
        })
    }

    /// MIS weight of the emission of a surface that a ray hit at `distance`, after scattering at `from` with density `pdf`.
    #[inline]
    pub fn emission_weight<T: Tracer + ?Sized>(
        &self,
        tracer: &T,
        from: &Receiver,
        odds: &LightOdds,
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
        let aimed = emitters.pdf(from, &hit.surface, box_origin, distance)
            * self.probability(Light::Emitters, from, odds);
        self.bsdf_mis_weight(pdf, aimed)
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

    /// Light at infinity that a ray (unit direction) finds which was scattered at `from` with density `pdf`, with its MIS weight.
    #[inline]
    pub fn infinite_emission(&self, from: &Receiver, odds: &LightOdds, direction: DVec3, pdf: f32) -> Vec3 {
        let mut light = match &self.sky {
            Sky::Constant(radiance) => *radiance,
            Sky::Image(table) => {
                let chance = self.probability(Light::Sky, from, odds);
                let (radiance, sky_pdf) = table.eval_with_pdf(direction);
                radiance * self.bsdf_mis_weight(pdf, sky_pdf * chance)
            }
        };
        for (i, sun) in self.suns.iter().enumerate() {
            if let Some((radiance, sun_pdf)) = sun.eval(direction) {
                let chance = self.probability(Light::Sun(i), from, odds);
                light += radiance * self.bsdf_mis_weight(pdf, sun_pdf * chance);
            }
        }
        light
    }

    /// Light of all lamps that a ray (unit direction) passes through within the distance `limit`, where the ray was scattered at `from`
    /// with density `pdf`.
    #[inline]
    pub fn lamp_emission(
        &self,
        from: &Receiver,
        odds: &LightOdds,
        direction: DVec3,
        limit: f64,
        pdf: f32,
    ) -> Vec3 {
        let direction = direction.as_vec3();
        let mut light = Vec3::ZERO;
        let mut meet = |i: usize, lamp: &ReadyLamp| {
            if let Some(met) = lamp.meet(from, direction)
                && f64::from(met.distance) * TOUCHING < limit
            {
                let chance = match &self.lamp_sampling {
                    LampSampling::Tree(tree) => {
                        self.probability(Light::AllLamps, from, odds) * tree.probability(from, i)
                    }
                    LampSampling::EachAlone | LampSampling::Several(_) => {
                        self.probability(Light::Lamp(i), from, odds)
                    }
                };
                light += met.radiance * self.bsdf_mis_weight(pdf, met.pdf * chance);
            }
        };
        self.each_near(from.point, direction, |i| meet(i, &self.lamps[i]));
        light
    }

    /// Light of all lamps that a camera ray (unit direction) passes through within the distance `limit`.
    #[inline]
    pub fn lamp_emission_to_camera(&self, from: DVec3, direction: DVec3, limit: f64) -> Vec3 {
        if !self.shows_lamps {
            return Vec3::ZERO;
        }
        let from = Receiver { point: from, normal: Vec3::Z, both_sides: true };
        let direction = direction.as_vec3();
        let mut light = Vec3::ZERO;
        self.each_near(from.point, direction, |i| {
            let lamp = &self.lamps[i];
            let met = if lamp.visible_to_camera { lamp.meet(&from, direction) } else { None };
            light += met
                .filter(|met| f64::from(met.distance) * TOUCHING < limit)
                .map_or(Vec3::ZERO, |m| m.radiance);
        });
        light
    }

    /// Calls `visit` with the numbers of the lamps that a ray (unit direction) from a point may meet, in order.
    #[inline]
    fn each_near(&self, from: DVec3, direction: Vec3, visit: impl FnMut(usize)) {
        match &self.lamp_sampling {
            LampSampling::EachAlone => (0..self.lamps.len()).for_each(visit),
            LampSampling::Several(many) => many.near(from, direction, visit),
            LampSampling::Tree(tree) => tree.near(from, direction, visit),
        }
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

/// Veach 1997, eq. 9.13 with β = 2, computed from ratios because squares of peaked densities overflow.
#[inline]
fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 {
        return 0.0;
    }
    let r = b / a;
    1.0 / (1.0 + r * r)
}

#[cfg(test)]
mod tests {
    use pumice_scene::{Light as SceneLight, LightShape, Sun};

    use super::*;

    fn lights(lamps: u32) -> Lights {
        let sun = |angle_rad| Sun { direction: [0.3, 0.1, -1.0], strength: 0.2, color: [1.0; 3], angle_rad };
        let lamp = |i: u32| {
            let at = |a: f64| 5.0 * (a * f64::from(i)).sin();
            let shape = LightShape::Point {
                position: [at(1.0), at(2.0), 3.0 + at(3.0)],
                radius: 0.1,
                soft_falloff: false,
            };
            ReadyLamp::new(&SceneLight { shape, power_w: 40.0, color: [1.0; 3], visible_to_camera: i == 2 })
        };
        let suns = vec![ReadySun::new(&sun(0.0)), ReadySun::new(&sun(0.1))];
        Lights::new(Sky::Constant(Vec3::ZERO), suns, None).with_lamps((0..lamps).map(lamp).collect())
    }

    /// Odds, probabilities and the choice are those of each light's weight, asked one by one, whether weights are kept, computed together,
    /// or neither.
    #[test]
    fn lights_are_chosen_by_their_weights() {
        for lamps in [0, 3, 7, 8, 30] {
            let lights = lights(lamps);
            let all: Vec<Light> = std::iter::once(Light::Sky)
                .chain((0..2).map(Light::Sun))
                .chain((0..lamps as usize).map(Light::Lamp))
                .chain([Light::Emitters])
                .collect();
            let mut chosen = std::collections::BTreeSet::new();
            for i in 0..200 {
                let at = |a: f64| 4.0 * (a * f64::from(i)).sin();
                let normal = DVec3::new(at(1.3), at(2.7), 1.0).normalize().as_vec3();
                let from =
                    Receiver { point: DVec3::new(at(1.0), at(0.6), 0.0), normal, both_sides: i % 3 == 0 };
                let odds = lights.odds(&from);
                let weights: Vec<f32> = all.iter().map(|&light| lights.weight(light, &from)).collect();
                let (total, lit) = weights
                    .iter()
                    .fold((0.0, 0.0), |(total, lit), &w| (total + w, lit + f32::from(u8::from(w > 0.0))));
                assert_eq!((odds.total, odds.lit), (total, lit));
                let share = |w: f32| if w > 0.0 { 0.1 / lit + 0.9 * (w / total) } else { 0.0 };
                for (light, weight) in all.iter().zip(&weights) {
                    let probability = lights.probability(*light, &from, &odds);
                    assert!((probability - share(*weight)).abs() <= 1e-6, "{light:?}");
                }
                let choice = i as f32 / 200.0;
                let mut below = 0.0;
                let place = weights.iter().position(|&w| {
                    below += f64::from(share(w));
                    f64::from(choice) < below
                });
                let Some((light, chance, within)) = lights.choose(&from, &odds, choice) else {
                    assert_eq!((place, total), (None, 0.0), "something shines");
                    continue;
                };
                let found = lights.place_of(light);
                // (A choice within f32's rounding of the border is either's.)
                let is_near_border = !(1e-3..1.0 - 1e-3).contains(&within);
                assert!(place == Some(found) || is_near_border, "{place:?} {light:?} {choice} {within}");
                assert!((chance - share(weights[found])).abs() <= 1e-6);
                chosen.insert(found);
            }
            assert!(chosen.len() >= 2 + lamps as usize / 3, "{chosen:?}");
        }
    }

    /// The camera sees the lamp that is shown, and where none is shown, none.
    #[test]
    fn the_camera_sees_lamps_that_are_shown() {
        for (lamps, is_seen) in [(2, false), (3, true), (30, true)] {
            let lights = lights(lamps);
            let lamp = lights.lamps.get(2).map_or(DVec3::ZERO, |lamp| lamp.position);
            let from = DVec3::new(9.0, 8.0, -7.0);
            let seen = lights.lamp_emission_to_camera(from, (lamp - from).normalize(), f64::INFINITY);
            assert_eq!(seen.x > 0.0, is_seen, "{lamps}");
        }
    }
}
