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
        let Some(mut resting) = self.resting.take() else { return Ok(false) };
        // All pixels count with the film's number of samples here, also those that rest.
        let worst = match self.worst_around() {
            Ok(worst) => worst,
            Err(error) => {
                self.resting = Some(resting);
                return Err(error);
            }
        };
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
        let some = resting.awake < awake;
        self.resting = Some(resting);
        Ok(some)
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
