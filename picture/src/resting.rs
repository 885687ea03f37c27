//! Adaptive sampling: pixels with enough samples rest, taking no more (Blender's *Noise Threshold*).
//!
//! At certain numbers of samples the film is examined. A pixel's squared error is the mean over channels of var / (μ² + 0.01), as
//! in [`FilmBuffer::error_estimate`]; four classes make it coarse, so it is averaged over 3 × 3 pixels. A pixel rests for good
//! if no such mean within one pixel of it is above the threshold: a noisy pixel keeps its neighbours awake, as in Cycles, which dilates
//! by the same distance.
//!
//! ```text
//! examined   at min_spp (a multiple of the classes), then each time after a quarter more samples: a few times per doubling
//! rested     per pixel the samples that it had when it came to rest, or AWAKE
//! ```
//! The film is examined at fixed numbers of samples and only after complete passes, so the result does not depend on time, threads or
//! slices. A pixel's own samples decide when it rests, which biases the picture slightly (docs/error-against-time.md says how much).

use pumice_core::NoMemory;
use pumice_core::reserve::{collected_by_threads, reserved};
use pumice_scene::Adaptive;
use rayon::prelude::*;

use crate::film::CLASSES;
use crate::film::FilmBuffer;

/// What memory is for, in errors.
const WHAT: &str = "film: which pixels rest";

/// The value of a pixel that does not rest.
pub const AWAKE: u32 = u32::MAX;

/// Which pixels rest, and by which rule; the module describes it.
#[derive(Clone, Debug)]
pub struct Resting {
    rule: Adaptive,
    next_look: u32,
    rested: Vec<u32>,
    awake: usize,
}

impl Resting {
    /// A film of `pixels` pixels, none of which rests.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for a number a pixel.
    pub(crate) fn new(rule: Adaptive, pixels: usize) -> Result<Self, NoMemory> {
        let mut rested = reserved(pixels, WHAT)?;
        rested.resize(pixels, AWAKE);
        Ok(Self { rule, next_look: first_look(rule), rested, awake: pixels })
    }

    /// Wakes all pixels, which from now on rest by this rule.
    pub(crate) fn wake(&mut self, rule: Adaptive) {
        (self.rule, self.next_look, self.awake) = (rule, first_look(rule), self.rested.len());
        self.rested.fill(AWAKE);
    }

    /// Per pixel the samples that it had when it came to rest, or [`AWAKE`].
    pub fn rested(&self) -> &[u32] {
        &self.rested
    }

    /// The rule by which pixels come to rest.
    pub(crate) fn rule(&self) -> Adaptive {
        self.rule
    }

    /// Mean over pixels of the samples that each has, where those that do not rest have `spp`.
    pub(crate) fn mean_spp_at(&self, spp: u32) -> f64 {
        let sum: u64 = self.rested.iter().map(|&rested| u64::from(rested.min(spp))).sum();
        sum as f64 / self.rested.len().max(1) as f64
    }

    /// Heap bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.rested.len() as u64 * 4
    }
}

/// The number of samples at which a film is examined first.
fn first_look(rule: Adaptive) -> u32 {
    rule.min_spp.max(CLASSES).next_multiple_of(CLASSES)
}

impl FilmBuffer {
    /// The number of samples at which the film is examined next, which no pass may exceed; [`u32::MAX`] if never.
    pub fn next_look(&self) -> u32 {
        self.resting.as_ref().map_or(u32::MAX, |r| r.next_look)
    }

    /// Whether every pixel rests: further samples change nothing.
    pub fn all_rest(&self) -> bool {
        self.resting.as_ref().is_some_and(|r| r.awake == 0)
    }

    /// Which pixels rest, if adaptive sampling is on.
    pub fn resting(&self) -> Option<&Resting> {
        self.resting.as_ref()
    }

    /// Examines the film if its number of samples says so; returns whether some pixels came to rest.
    ///
    /// # Errors
    /// [`NoMemory`], where there is none for the errors of all pixels; the film stays as it is.
    pub fn look(&mut self) -> Result<bool, NoMemory> {
        let spp = self.spp();
        if spp < self.next_look() {
            return Ok(false);
        }
        // The sums of a pixel that rests are of its own samples, fewer than the film's.
        let worst = self.worst_around()?;
        let Some(resting) = &mut self.resting else { return Ok(false) };
        let steps = spp / CLASSES;
        resting.next_look = steps.saturating_add((steps / 4).max(1)).saturating_mul(CLASSES);
        let bar = resting.rule.threshold * resting.rule.threshold;
        let awake = resting.awake;
        for (rested, worst) in resting.rested.iter_mut().zip(&worst) {
            if *rested == AWAKE && *worst <= bar {
                *rested = spp;
                resting.awake -= 1;
            }
        }
        Ok(resting.awake < awake)
    }

    /// The worst mean error of 3 × 3 pixels within one pixel of each pixel.
    fn worst_around(&self) -> Result<Vec<f32>, NoMemory> {
        let (width, height) = self.size();
        let errors = self.squared_errors()?;
        let mean = around(&errors, width, height, |values| {
            let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
            sum / n
        })?;
        around(&mean, width, height, |values| values.fold(0.0, f32::max))
    }

    /// Mean over channels of var / (μ² + floor), pixel by pixel.
    fn squared_errors(&self) -> Result<Vec<f32>, NoMemory> {
        let (width, height) = self.size();
        let error = |pixel: usize| {
            let n = self.samples_of(pixel);
            let of_channel = |channel| {
                let (mean, var) = self.moments(pixel, channel, n);
                var / (mean * mean + crate::film::FLOOR)
            };
            ((0..3).map(of_channel).sum::<f64>() / 3.0) as f32
        };
        collected_by_threads((0..width * height).into_par_iter().map(error), WHAT)
    }
}

/// Combines the value of each pixel with those of its up to eight neighbours, in a fixed order.
fn around(
    of: &[f32],
    width: usize,
    height: usize,
    f: impl Fn(&mut dyn Iterator<Item = f32>) -> f32 + Sync,
) -> Result<Vec<f32>, NoMemory> {
    let value = |pixel: usize| {
        let (x, y) = (pixel % width, pixel / width);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        f(&mut rows.flat_map(|y| columns.clone().map(move |x| of[y * width + x])))
    };
    collected_by_threads((0..width * height).into_par_iter().map(value), WHAT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::STRIDE;

    /// Sets the samples of one class of a pixel so that its squared error is `error`, and those of the others to 0. With the sum s of n samples,
    /// mean and standard deviation of the mean are both s / n, so the error is (s / n)² / ((s / n)² + 0.01).
    fn set(sums: &mut [f32], pixel: usize, samples: f32, error: f32) {
        let sum = samples * (0.01 * error / (1.0 - error)).sqrt();
        sums[pixel * STRIDE..][..STRIDE].fill(0.0);
        sums[pixel * STRIDE..][..3].fill(sum);
    }

    #[test]
    fn a_pixel_that_rests_is_judged_with_its_own_samples() {
        let mut film = FilmBuffer::new(4, 1).unwrap();
        film.rest_by(Some(Adaptive { threshold: 0.5, min_spp: 8 })).unwrap();
        let rested = |film: &FilmBuffer| film.resting().unwrap().rested().to_vec();
        // The threshold's square is 0.25. The last pixel is noisy, so the means around all but the first are above it.
        for (pixel, error) in [0.22, 0.22, 0.22, 0.5].into_iter().enumerate() {
            set(film.sums_mut(8), pixel, 8.0, error);
        }
        assert!(film.look().unwrap());
        assert_eq!(rested(&film), [8, AWAKE, AWAKE, AWAKE]);
        // The sums of the first stay. Its error is still 0.22, so the mean of the first two is 0.255, which keeps the second awake; with twelve
        // samples the error of the same sums would be 0.11 and the mean 0.2.
        for (pixel, error) in [(1, 0.29), (2, 0.02), (3, 0.02)] {
            set(film.sums_mut(12), pixel, 12.0, error);
        }
        assert!(film.look().unwrap());
        assert_eq!(rested(&film), [8, AWAKE, 12, 12]);
        // A control: with the mean just below the threshold's square the second rests too.
        set(film.sums_mut(16), 1, 16.0, 0.27);
        assert!(film.look().unwrap() && film.all_rest());
    }
}
