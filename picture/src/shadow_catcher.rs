//! Shadow catchers: the sums of their light, and how colour, alpha and the pass are computed from them.
//!
//! A camera path that hits a catcher continues twice with the same random numbers: once in the whole scene (**all**), and once in a scene
//! of the catchers **alone**. If nothing casts a shadow, both find the same light to the last bit; their quotient is the shadow. The
//! picture without catchers is the **matte**, in which a catcher is a hole. Each class keeps, in addition to its sums of the matte in
//! the film:
//!
//! ```text
//! floats   0 … 2   light of catchers among all things, r g b
//!          3 … 5   the same among catchers alone
//!          6       samples that the matte covers, without those that hit a catcher: on a transparent film those that hit a surface, on
//!                  an opaque one all
//!          7       samples that hit nothing, not even a catcher, if the film is transparent
//!          8 … 10  light from behind everything, also seen through catchers, r g b: only for an opaque film
//! ```
//! With these divided by the number of samples (m matte, c all, a alone, s covered, o open, b behind), per channel and as Cycles'
//! `film_calculate_shadow_catcher` and `…_matte_with_shadow` (`kernel/film/read.h`):
//!
//! ```text
//! shadow  = o + (1 − o) · c/a         c/a is 1 where a is 0
//! alpha   = s + (1 − s) · (1 − mean of shadow's channels, within 0 and 1)
//! colour  = m                         of a transparent film
//!         = m + b · (1 − alpha)       of an opaque one
//! ```
//! **Fading.** With `film.shadow_fade` the shadow of these formulas is 1 − f · (1 − shadow), where f rises from 0 at the border of the
//! picture to 1 at that distance (t² · (3 − 2t)). What is behind a figure then shows unchanged along the border, although the soft
//! shadow under a sky reaches any distance. The pass is as it was caught.
//!
//! If the pass is requested, the shadow is only in the pass and not in the picture: then alpha = s and colour = m on both films.
//!
//! **Error.** Quotients of single classes are noisy where few samples hit a catcher, so the spread is taken over pictures with one
//! class left out (the jackknife: Efron and Stein 1981); for plain sums this equals the estimate of [`crate::film`] exactly. The error
//! is that of the picture over white, because shadows are only in alpha.

use pumice_core::NoMemory;

use crate::film::CLASSES;
use crate::film::{FilmBuffer, STRIDE};
use crate::image::Image;
use crate::passes::PassSums;

const R: usize = CLASSES as usize;

/// Floats of a class, without and with light from behind.
pub const CAUGHT_FLOATS: [usize; 2] = [8, 11];

/// The light behind a transparent picture that is laid over white.
const WHITE: [f64; 3] = [1.0; 3];

/// Sums of some classes of a pixel.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    samples: f64,
    matte: [f64; 3],
    all: [f64; 3],
    alone: [f64; 3],
    covered: f64,
    open: f64,
    behind: [f64; 3],
}

/// Colour, alpha and shadow of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    color: [f64; 3],
    alpha: f64,
    shadow: [f64; 3],
    /// The picture over what is behind it: white where it has alpha.
    laid: [f64; 3],
}

impl Sums {
    fn add(&mut self, samples: f64, film: &[f32], caught: &[f32]) {
        self.samples += samples;
        let three = |to: &mut [f64; 3], from: &[f32]| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to += f64::from(*from));
        };
        three(&mut self.matte, film);
        three(&mut self.all, &caught[..3]);
        three(&mut self.alone, &caught[3..6]);
        self.covered += f64::from(caught[6]);
        self.open += f64::from(caught[7]);
        three(&mut self.behind, &caught[8..]);
    }

    /// What is seen of a pixel of which `shown` is the share of its shadow that has not faded.
    fn seen(&self, kept: PassSums, shown: f64) -> Seen {
        let n = self.samples.max(1.0);
        let part = |sum: f64| (sum / n).clamp(0.0, 1.0);
        let open = part(self.open);
        let shadow = [0, 1, 2].map(|c| {
            let left = if self.alone[c] == 0.0 { 1.0 } else { self.all[c] / self.alone[c] };
            open + (1.0 - open) * left
        });
        let even = 1.0 - shown * (1.0 - (shadow.iter().sum::<f64>() / 3.0).clamp(0.0, 1.0));
        let covered = part(self.covered);
        let matte = self.matte.map(|m| m / n);
        // What is seen of what is behind.
        let left = shadow.map(|s| (1.0 - covered) * if kept.shadow_apart { s } else { even });
        let over = |behind: [f64; 3]| [0, 1, 2].map(|c| matte[c] + behind[c] * left[c]);
        if kept.shadow_apart || kept.alpha {
            let alpha = if kept.shadow_apart { covered } else { 1.0 - left[0] };
            return Seen { color: matte, alpha, shadow, laid: over(WHITE) };
        }
        let color = over(self.behind.map(|b| b / n));
        Seen { color, alpha: 1.0, shadow, laid: color }
    }
}

impl FilmBuffer {
    /// Sums of a pixel with `n` samples, of all classes but one.
    fn caught_without(&self, pixel: usize, n: u32, left_out: Option<usize>) -> Sums {
        let (kept, mut sums) = (self.kept(), Sums::default());
        let film = &self.sums()[pixel * STRIDE..][..STRIDE];
        let floats = kept.caught_floats();
        let caught = &self.pass_sums()[pixel * kept.stride() + kept.caught_at()..][..R * floats];
        for r in (0..R).filter(|&r| Some(r) != left_out) {
            let samples = f64::from((n + CLASSES - 1 - r as u32) / CLASSES);
            sums.add(samples, &film[3 * r..][..3], &caught[r * floats..][..floats]);
        }
        sums
    }

    fn seen_at(&self, pixel: usize) -> Seen {
        self.caught_without(pixel, self.samples_of(pixel), None).seen(self.kept(), self.shadow_shown(pixel))
    }

    /// The share of a pixel's shadow that has not faded.
    fn shadow_shown(&self, pixel: usize) -> f64 {
        let (width, height) = self.size();
        let from_border = |at: usize, of: usize| at.min(of - 1 - at) as f64 + 0.5;
        let distance = from_border(pixel % width, width).min(from_border(pixel / width, height));
        let t = (distance / f64::from(self.kept().shadow_fade.max(1))).min(1.0);
        if self.kept().shadow_fade == 0 { 1.0 } else { t * t * (3.0 - 2.0 * t) }
    }

    fn of_seen<T: Send>(&self, f: impl Fn(Seen) -> T + Sync + Send) -> Result<Vec<T>, NoMemory> {
        self.each_pixel(|pixel| f(self.seen_at(pixel)))
    }

    /// One channel of a pixel with `n` samples laid over what is behind it, and that number's variance.
    pub(crate) fn caught_moments(&self, pixel: usize, channel: usize, n: u32) -> (f64, f64) {
        let shown = self.shadow_shown(pixel);
        let all = self.caught_without(pixel, n, None);
        let value = all.seen(self.kept(), shown).laid[channel];
        if n < CLASSES {
            return (value, f64::INFINITY);
        }
        let spread: f64 = (0..R)
            .map(|r| {
                let others = self.caught_without(pixel, n, Some(r));
                let d =
                    (others.seen(self.kept(), shown).laid[channel] - value) * others.samples / all.samples;
                d * d
            })
            .sum();
        (value, spread * R as f64 / (R - 1) as f64)
    }

    /// The colours of a film with a catcher.
    pub(crate) fn caught_color(&self) -> Result<Image, NoMemory> {
        self.image_of_seen(|seen| seen.color)
    }

    /// Its alpha; `None` where it is opaque.
    pub(crate) fn caught_alpha(&self) -> Result<Option<Vec<f32>>, NoMemory> {
        self.has_alpha().then(|| self.of_seen(|seen| seen.alpha as f32)).transpose()
    }

    /// The share of the catchers' light that is not blocked.
    pub(crate) fn shadow(&self) -> Result<Image, NoMemory> {
        self.image_of_seen(|seen| seen.shadow)
    }

    fn image_of_seen(&self, of: impl Fn(Seen) -> [f64; 3] + Sync + Send) -> Result<Image, NoMemory> {
        let (width, height) = self.size();
        // A quotient of two floats may be too large for one.
        let float = |v: f64| v.min(f64::from(f32::MAX)) as f32;
        Ok(Image::new(width, height, self.of_seen(|seen| of(seen).map(float))?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRANSPARENT: PassSums = PassSums {
        alpha: true,
        features: false,
        light: false,
        mattes: [false; 2],
        ranks: 0,
        caught: true,
        shadow_apart: false,
        shadow_fade: 0,
    };
    const OPAQUE: PassSums = PassSums { alpha: false, ..TRANSPARENT };

    /// 8 samples: 2 of an object, 4 of a catcher, 2 of nothing.
    fn mixed() -> Sums {
        Sums {
            samples: 8.0,
            matte: [2.0, 4.0, 6.0],
            all: [1.0, 2.0, 3.0],
            alone: [4.0, 4.0, 4.0],
            covered: 2.0,
            open: 2.0,
            behind: [8.0; 3],
        }
    }

    /// Worked out by hand from the formulas of the module.
    #[test]
    fn what_is_seen_follows_from_the_sums() {
        let seen = mixed().seen(TRANSPARENT, 1.0);
        // 1/4 + 3/4 · (1/4, 2/4, 3/4)
        assert_eq!(seen.shadow, [0.4375, 0.625, 0.8125]);
        // 1/4 + 3/4 · (1 − 0.625)
        assert_eq!((seen.alpha, seen.color), (0.53125, [0.25, 0.5, 0.75]));
        assert_eq!(seen.laid, [0.25 + 0.46875, 0.5 + 0.46875, 0.75 + 0.46875]);

        let apart = mixed().seen(PassSums { shadow_apart: true, ..TRANSPARENT }, 1.0);
        assert_eq!((apart.alpha, apart.color, apart.shadow), (0.25, seen.color, seen.shadow));
        assert_eq!(apart.laid[0], 0.25 + 0.75 * 0.4375);

        let open = Sums { open: 0.0, covered: 4.0, ..mixed() };
        let opaque = open.seen(OPAQUE, 1.0);
        assert_eq!(opaque.shadow, [0.25, 0.5, 0.75]);
        assert_eq!((opaque.alpha, opaque.color), (1.0, [0.25 + 0.25, 0.5 + 0.25, 0.75 + 0.25]));
    }

    /// Half of a shadow is seen in the picture and in alpha, all of it in the pass, and none changes nothing behind.
    #[test]
    fn a_shadow_fades_in_the_picture_alone() {
        let (all, half, none) =
            (mixed().seen(TRANSPARENT, 1.0), mixed().seen(TRANSPARENT, 0.5), mixed().seen(TRANSPARENT, 0.0));
        assert!(half.shadow == all.shadow && half.color == all.color);
        assert_eq!((half.alpha, none.alpha), (0.25 + 0.75 * 0.5 * 0.375, 0.25));
        let open = Sums { open: 0.0, covered: 4.0, ..mixed() };
        assert_eq!(open.seen(OPAQUE, 0.0).color, [0.25 + 0.5, 0.5 + 0.5, 0.75 + 0.5]);
    }

    /// A dark floor everywhere: nothing of it at the border, the more the farther from the nearest side, all from the width on.
    #[test]
    fn shadows_fade_toward_the_border() {
        let (width, height) = (9, 5);
        let mut film =
            FilmBuffer::with_passes(width, height, PassSums { shadow_fade: 2, ..TRANSPARENT }).unwrap();
        film.sums_mut(1);
        let kept = film.kept();
        for pixel in 0..(width * height) as usize {
            let at = pixel * kept.stride() + kept.caught_at();
            film.pass_sums_mut()[at + 3..at + 6].fill(1.0);
        }
        let alpha = film.caught_alpha().unwrap().unwrap();
        let shown = [0.15625, 0.84375, 1.0];
        for (pixel, &alpha) in alpha.iter().enumerate() {
            let (x, y) = (pixel % 9, pixel / 9);
            let nearest = x.min(8 - x).min(y).min(4 - y);
            assert_eq!(alpha, shown[nearest], "{x}, {y}");
        }
        assert!(film.shadow().unwrap().pixels.iter().all(|&s| s == [0.0; 3]), "the pass is as it was caught");
    }

    /// No light at all, more light than alone, none on either side.
    #[test]
    fn odd_sums_are_no_fault() {
        let dark = Sums { alone: [0.0; 3], ..mixed() }.seen(TRANSPARENT, 1.0);
        assert_eq!((dark.shadow, dark.alpha), ([1.0; 3], 0.25), "without light there is no shadow");
        let glow = Sums { all: [40.0; 3], ..mixed() }.seen(TRANSPARENT, 1.0);
        assert_eq!((glow.shadow[0], glow.alpha), (0.25 + 0.75 * 10.0, 0.25), "light takes no alpha away");
        let none = Sums::default().seen(TRANSPARENT, 1.0);
        assert!(none.alpha == 0.0 && none.color == [0.0; 3] && none.shadow == [1.0; 3]);
    }

    /// One pixel: sample i of class i mod 4 adds a float to each sum.
    fn film_of(kept: PassSums, samples: u32, value: impl Fn(u32, usize) -> f32) -> FilmBuffer {
        let mut film = FilmBuffer::with_passes(1, 1, kept).unwrap();
        let floats = if kept.caught { kept.caught_floats() } else { 0 };
        for i in 0..samples {
            let r = (i % CLASSES) as usize;
            for c in 0..3 {
                film.sums_mut(i + 1)[3 * r + c] += value(i, c);
            }
            for f in 0..floats {
                film.pass_sums_mut()[kept.caught_at() + r * floats + f] += value(i, 3 + f);
            }
        }
        film
    }

    /// Without shadows the picture is a sum: its error is the estimate for sums, whatever the number of samples.
    #[test]
    fn the_error_of_sums_is_that_of_other_films() {
        let noise = |i: u32, c: usize| ((i * 7 + c as u32 * 3) % 11) as f32;
        for samples in [4, 5, 7, 8, 30] {
            // All samples are covered by the matte.
            let caught = film_of(TRANSPARENT, samples, |i, f| match f {
                0..3 => noise(i, f),
                9 => 1.0,
                _ => 0.0,
            });
            let plain = film_of(PassSums::default(), samples, noise);
            for c in 0..3 {
                let (a, b) = (caught.moments(0, c, samples), plain.moments(0, c, samples));
                assert!((a.0 - b.0).abs() < 1e-12 && (a.1 - b.1).abs() < 1e-12 * b.1, "{a:?} {b:?}");
            }
        }
    }

    /// The spread of many films' shadows is what one film's jackknife tells, on average.
    #[test]
    fn the_error_of_a_quotient_is_told() {
        let mut state = 9u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let (mut values, mut told) = (Vec::new(), 0.0);
        for _ in 0..2000 {
            // Light of 0 to 1 from everywhere, of which four tenths are hidden at random.
            let draws: Vec<[f32; 2]> = (0..64).map(|_| [random(), random()]).collect();
            let film = film_of(TRANSPARENT, 64, |i, f| {
                let [light, hidden] = draws[i as usize];
                match f {
                    3..6 => light * f32::from(u8::from(hidden >= 0.4)),
                    6..9 => light,
                    _ => 0.0,
                }
            });
            let (value, var) = film.moments(0, 1, 64);
            values.push(value);
            told += var / 2000.0;
        }
        let mean = values.iter().sum::<f64>() / 2000.0;
        let var = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 1999.0;
        assert!((mean - 0.6).abs() < 4.0 * (var / 2000.0).sqrt() + 1e-3, "{mean}");
        // 2000 films tell a variance to 3 %, four classes each theirs to 80 % / √2000.
        assert!((told / var - 1.0).abs() < 0.15, "{told} for {var}");
    }
}
