//! Receivers for the light along a path: a plain sum, or a sample that is clamped and sorted into passes.
//!
//! ```text
//! light that a ray hit       seen by the camera: emission or environment; otherwise the kind of the first surface, direct after one surface
//! light that was sampled     the kind of the first surface, direct at that surface
//! ```
//! **Kinds** follow Cycles' `film_write_emission_or_background_pass` and `film_write_direct_light` (`kernel/film/light_passes.h`): the
//! scattering at the first surface decides, whatever follows. Of a mixture, each kind gets its part of f in the direction in which the path
//! continued: Lambert and sheen are diffuse, everything else above the surface is glossy, everything below it is transmission.
//!
//! **Clamps** follow `film_clamp_light` there: if the channels of one contribution add up to more than three times the setting, it is
//! scaled down to that. A contribution in Cycles is one lamp; here it is all light that a ray finds at once: the lamps on one segment, or
//! sky and suns together.
//!
//! **Mattes**: the ids of the first surface, counted in the slots of a pixel ([`pumice_picture::cryptomatte`]).
//!
//! **Shadow catchers**: from the first catcher that a camera path hits, the path's light belongs to the catcher and to no light pass, as in
//! Cycles ([`pumice_picture::shadow_catcher`]).

use glam::Vec3;
use pumice_picture::PassSums;
use pumice_picture::cryptomatte::Ids;
use pumice_picture::film::CLASSES;
use pumice_picture::passes::{COLOR_KINDS, LIGHT_KINDS};
use pumice_scene::Settings;

/// Kinds of light; the index of each is its direct light, and that index + 1 its indirect light.
const DIFFUSE: usize = 0;
const GLOSSY: usize = 2;
const TRANSMISSION: usize = 4;
const EMISSION: usize = 6;
const ENVIRONMENT: usize = 7;

/// How scattered light is divided among the kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassWeights {
    /// Diffuse part.
    pub diffuse: Vec3,
    /// Whether the rest passed through the surface (transmission) or was reflected (glossy).
    pub through: bool,
}

/// AOVs of the first surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceAovs {
    /// Diffuse, glossy and transmission colour.
    pub colors: [Vec3; COLOR_KINDS],
    /// Normal in the world, on the side that is seen.
    pub normal: Vec3,
}

/// Receives the light along a path. `vertex` is the number of surfaces that have scattered the path so far.
pub trait FilmSample {
    /// Adds light that a ray passed on its way or hit at its end.
    fn add_emission(&mut self, light: Vec3, vertex: u32);

    /// Adds light that a ray found behind everything.
    fn add_background(&mut self, light: Vec3, vertex: u32);

    /// Adds light that light sampling found at the surface in front of the path, after its BSDF; `share` divides it among the kinds.
    fn add_direct_light(&mut self, light: Vec3, vertex: u32, share: impl FnOnce() -> PassWeights);

    /// The path continues after scattering; `share` divides later light among the kinds.
    fn scatter(&mut self, vertex: u32, share: impl FnOnce() -> PassWeights);

    /// The path reached a surface with these AOVs.
    fn write_aovs(&mut self, vertex: u32, surface: impl FnOnce() -> SurfaceAovs);

    /// The matte ids of the surface that the path reached.
    fn write_ids(&mut self, vertex: u32, ids: impl FnOnce() -> Ids);

    /// Whether the light of shadow catchers is kept apart; a path that hits one then continues twice.
    fn catches(&self) -> bool {
        false
    }

    /// The path has hit its first shadow catcher; `_behind` is the background behind everything.
    fn caught(&mut self, _behind: impl FnOnce() -> Vec3) {}

    /// From here on the path sees shadow catchers alone (`true`), or everything again (`false`).
    fn among_catchers(&mut self, _alone: bool) {}
}

/// The sum that light is added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sink {
    /// The picture.
    Matte,
    /// A shadow catcher, among all objects.
    Caught,
    /// A shadow catcher, among catchers alone.
    Alone,
}

/// The sum of all light, without clamps or passes.
#[derive(Clone, Copy, Debug, Default)]
pub struct ColorSample(pub Vec3);

impl FilmSample for ColorSample {
    #[inline(always)]
    fn add_emission(&mut self, light: Vec3, _: u32) {
        self.0 += light;
    }

    #[inline(always)]
    fn add_background(&mut self, light: Vec3, _: u32) {
        self.0 += light;
    }

    #[inline(always)]
    fn add_direct_light(&mut self, light: Vec3, _: u32, _: impl FnOnce() -> PassWeights) {
        self.0 += light;
    }

    #[inline(always)]
    fn scatter(&mut self, _: u32, _: impl FnOnce() -> PassWeights) {}

    #[inline(always)]
    fn write_aovs(&mut self, _: u32, _: impl FnOnce() -> SurfaceAovs) {}

    #[inline(always)]
    fn write_ids(&mut self, _: u32, _: impl FnOnce() -> Ids) {}
}

/// A sample whose light is clamped and sorted into passes.
#[derive(Clone, Copy, Debug)]
pub struct AovSample {
    /// Light of the picture.
    pub total: Vec3,
    /// 0 where nothing was hit and the film is transparent.
    pub alpha: f32,
    /// Light by kind.
    pub light: [Vec3; LIGHT_KINDS],
    /// AOVs of the first surface; black where there is none.
    pub surface: SurfaceAovs,
    /// Matte ids of the first surface; 0 where there is none.
    pub ids: Ids,
    /// Light of a shadow catcher among all objects, and among catchers alone.
    pub caught: [Vec3; 2],
    /// Background seen behind everything, also past a catcher.
    pub background: Vec3,
    /// Whether anything but a catcher was hit, or the background of an opaque film.
    pub covered: bool,
    sink: Sink,
    scatter_weights: PassWeights,
    transparent: bool,
    kept: PassSums,
    /// Largest sum of a contribution's channels: for light seen directly or scattered once, and for light scattered more often.
    limits: [f32; 2],
}

impl AovSample {
    /// An empty sample for a film that keeps these sums.
    pub fn new(settings: &Settings, kept: PassSums) -> Self {
        let limit = |clamp: f32| if clamp == 0.0 { f32::INFINITY } else { 3.0 * clamp };
        Self {
            total: Vec3::ZERO,
            alpha: 1.0,
            light: [Vec3::ZERO; LIGHT_KINDS],
            surface: SurfaceAovs::default(),
            ids: Ids::default(),
            caught: [Vec3::ZERO; 2],
            background: Vec3::ZERO,
            covered: true,
            sink: Sink::Matte,
            scatter_weights: PassWeights::default(),
            transparent: kept.alpha,
            kept,
            limits: [limit(settings.clamp_direct), limit(settings.clamp_indirect)],
        }
    }

    /// The light, scaled down to the clamp's limit.
    #[inline]
    fn clamped(&self, light: Vec3, indirect: bool) -> Vec3 {
        let limit = self.limits[usize::from(indirect)];
        let sum = light.abs().element_sum();
        if sum > limit { light * (limit / sum) } else { light }
    }

    /// Adds light to the kinds of the first surface, divided by `share`.
    #[inline]
    fn deal(&mut self, light: Vec3, share: PassWeights, indirect: bool) {
        if self.kept.light {
            let diffuse = light * share.diffuse;
            let other = if share.through { TRANSMISSION } else { GLOSSY };
            self.light[DIFFUSE + usize::from(indirect)] += diffuse;
            self.light[other + usize::from(indirect)] += light - diffuse;
        }
    }

    /// Adds light to the sum of the current sink.
    #[inline]
    fn put(&mut self, light: Vec3) {
        match self.sink {
            Sink::Matte => self.total += light,
            Sink::Caught => self.caught[0] += light,
            Sink::Alone => self.caught[1] += light,
        }
    }

    /// Adds this sample, which has this number, to a pixel's sums.
    pub fn add_to(&self, sums: &mut [f32], number: u32) {
        let alpha = self.kept.alpha.then_some(self.alpha);
        let color: Vec3 = self.surface.colors.iter().sum();
        let features = self.kept.features.then_some([color, self.surface.normal]);
        let light = self.kept.light.then(|| self.light.into_iter().chain(self.surface.colors));
        let vectors = features.into_iter().flatten().chain(light.into_iter().flatten());
        let numbers = alpha.into_iter().chain(vectors.flat_map(|v| v.to_array()));
        for (sum, number) in sums.iter_mut().zip(numbers) {
            *sum += number;
        }
        if self.kept.caught {
            let floats = self.kept.caught_floats();
            let at = self.kept.caught_at() + floats * (number % CLASSES) as usize;
            let [all, alone] = self.caught;
            let part = |is: bool| f32::from(u8::from(is));
            let counts = [part(self.covered), part(self.alpha == 0.0)];
            let numbers = all.to_array().into_iter().chain(alone.to_array()).chain(counts);
            let numbers = numbers.chain(self.background.to_array());
            for (sum, number) in sums[at..][..floats].iter_mut().zip(numbers) {
                *sum += number;
            }
        }
        let slots = 2 * self.kept.matte_slots();
        let mut at = self.kept.mattes_at();
        for (id, _) in self.ids.into_iter().zip(self.kept.mattes).filter(|(_, is_kept)| *is_kept) {
            if id != 0.0 {
                matte_add(&mut sums[at..][..slots], id);
            }
            at += slots;
        }
    }
}

/// Counts an id in the slots of a pixel: in its own slot, else a free one, else the one with the least count, which it replaces and
/// continues.
fn matte_add(slots: &mut [f32], id: f32) {
    let (mut least, mut place) = (f32::INFINITY, 0);
    for at in (0..slots.len()).step_by(2) {
        if slots[at] == id || slots[at] == 0.0 {
            place = at;
            break;
        }
        if slots[at + 1] < least {
            (least, place) = (slots[at + 1], at);
        }
    }
    slots[place] = id;
    slots[place + 1] += 1.0;
}

impl FilmSample for AovSample {
    fn add_emission(&mut self, light: Vec3, vertex: u32) {
        let light = self.clamped(light, vertex > 1);
        self.put(light);
        if self.sink != Sink::Matte {
            return;
        }
        if vertex == 0 {
            self.light[EMISSION] += light;
        } else {
            self.deal(light, self.scatter_weights, vertex > 1);
        }
    }

    fn add_background(&mut self, light: Vec3, vertex: u32) {
        if vertex > 0 {
            return self.add_emission(light, vertex);
        }
        let light = self.clamped(light, false);
        if self.sink == Sink::Matte {
            self.light[ENVIRONMENT] += light;
            self.background += light;
            self.covered = !self.transparent;
        }
        if !self.transparent {
            self.put(light);
        } else if self.sink != Sink::Alone {
            self.alpha = 0.0;
        }
    }

    fn add_direct_light(&mut self, light: Vec3, vertex: u32, share: impl FnOnce() -> PassWeights) {
        let light = self.clamped(light, vertex > 0);
        self.put(light);
        if self.sink != Sink::Matte {
            return;
        }
        let share = if vertex == 0 && self.kept.light { share() } else { self.scatter_weights };
        self.deal(light, share, vertex > 0);
    }

    fn scatter(&mut self, vertex: u32, share: impl FnOnce() -> PassWeights) {
        if vertex == 0 && self.kept.light {
            self.scatter_weights = share();
        }
    }

    fn write_aovs(&mut self, vertex: u32, surface: impl FnOnce() -> SurfaceAovs) {
        if vertex == 0 && self.sink != Sink::Alone && (self.kept.light || self.kept.features) {
            self.surface = surface();
        }
    }

    fn write_ids(&mut self, vertex: u32, ids: impl FnOnce() -> Ids) {
        if vertex == 0 && self.sink != Sink::Alone && self.kept.ranks > 0 {
            self.ids = ids();
        }
    }

    fn catches(&self) -> bool {
        self.kept.caught
    }

    fn caught(&mut self, behind: impl FnOnce() -> Vec3) {
        (self.sink, self.covered) = (Sink::Caught, false);
        if self.kept.keeps_behind() {
            let light = self.clamped(behind(), false);
            self.background += light;
            self.light[ENVIRONMENT] += light;
        }
    }

    fn among_catchers(&mut self, alone: bool) {
        self.sink = if alone { Sink::Alone } else { Sink::Caught };
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    /// Checks the guarantees of Space-Saving (Metwally et al. 2005, §3.2) against full counts; counts are exact while there are free slots.
    #[test]
    fn slots_keep_what_covers_most() {
        let mut state = 1u32;
        let mut random = move |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % below
        };
        let (mut evicted, mut checked) = (0, 0);
        for round in 0..200u32 {
            let (mut slots, mut exact) = ([0f32; 16], HashMap::<u32, u32>::new());
            let kinds = 1 + random(40);
            for _ in 0..400 {
                // Some ids are seen often.
                let below = 1 + random(kinds);
                let id = 1.0 + random(below) as f32;
                matte_add(&mut slots, id);
                *exact.entry(id.to_bits()).or_default() += 1;
            }
            let kept: HashMap<u32, f32> = slots
                .as_chunks::<2>()
                .0
                .iter()
                .filter(|s| s[0] != 0.0)
                .map(|s| (s[0].to_bits(), s[1]))
                .collect();
            assert_eq!(kept.values().sum::<f32>(), 400.0, "round {round}");
            for (id, &count) in &exact {
                match kept.get(id) {
                    Some(&told) => {
                        let over = told - count as f32;
                        assert!((0.0..=50.0).contains(&over), "round {round}: {told} for {count}");
                        assert!(exact.len() > 8 || over == 0.0, "round {round}: {told} for {count}");
                    }
                    None => {
                        assert!(count <= 50, "round {round}: {count} of 400 are lost");
                        evicted += 1;
                    }
                }
                checked += 1;
            }
        }
        assert!(evicted > 1000 && checked > evicted + 1000, "{evicted} of {checked}: the rounds try both");
    }
}
