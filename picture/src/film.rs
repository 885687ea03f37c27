//! The film: sums of samples, kept apart for each class of samples, and the error estimated from them.
//!
//! ```text
//! sums: pixel 0: class 0 (r g b), class 1 (r g b), …   pixel 1: …        f32, rows from the top
//! ```
//! **Estimate.** Sample i belongs to class i mod R. Each class is an unbiased picture of its own, stratified as well as the samples of a
//! pixel of as many would be (see `sampler.rs` in the crate `pumice-transport`). The spread of their means gives the variance of the
//! picture if the classes are independent. They are not quite: all samples together are one sequence, which is better than four of a
//! quarter, so the estimate is somewhat too large, most where few samples meet a smooth integrand:
//! var = Σ (nᵣ/n)² (mᵣ − m)² · R / (R − 1). The relative error is √(mean over pixels and channels of var / (μ² + 0.01)), the square
//! root of what `metrics::rel_mse` finds against a perfect reference. μ² is not known; m² exceeds it by the variance and rises
//! and falls with it, which makes the ratio too small where a pixel is noisy. So μ² is taken from the pixel only as far as it is
//! certain, the rest from the 8 pixels around it (see [`FilmBuffer::error_estimate`]).

use std::ops::Range;

use pumice_core::NoMemory;
use pumice_core::reserve::{check_room, collected_by_threads, zeroed};
use pumice_scene::Adaptive;
use rayon::prelude::*;

use crate::coarse_pixels::CoarsePixels;
use crate::film_memory::film_bytes;
use crate::image::Image;
use crate::metrics::Variance;
use crate::passes::PassSums;
use crate::resting::Resting;

/// Number of classes of samples. A pixel's samples are dealt to them in turn, and the spread of the classes' means
/// gives the error.
pub const CLASSES: u32 = 4;

const R: usize = CLASSES as usize;

/// Floats per pixel.
pub const STRIDE: usize = 3 * R;

/// Degrees of freedom of a pixel's variance, which comes from the spread of the classes' means.
pub const DEGREES_OF_FREEDOM: f64 = (CLASSES - 1) as f64;

/// Rows of the strips that the estimate of the error is added up from: one column of pixels wide, in blocks of this height from the top.
pub const STRIP_ROWS: usize = 32;

/// A film's [variance](FilmBuffer::variance) with its degrees of freedom.
pub fn variance_known(of_mean: &Image) -> Variance<'_> {
    Variance { of_mean, degrees_of_freedom: DEGREES_OF_FREEDOM }
}

/// Added to μ², so that black pixels do not count infinitely: as in `metrics::rel_mse`.
pub(crate) const FLOOR: f64 = 0.01;

/// What the memory of a picture and its passes is for, in errors.
pub const PICTURE: &str = "film: the picture";

/// The sums of samples of a picture; the module describes them.
#[derive(Clone, Debug)]
pub struct FilmBuffer {
    width: usize,
    height: usize,
    sums: Vec<f32>,
    /// Sums of passes, [`PassSums::stride`] floats per pixel.
    pass_sums: Vec<f32>,
    kept: PassSums,
    /// Samples in each pixel of a row, by row: rows differ only after a cancelled pass.
    row_samples: Vec<u32>,
    /// The rows in which some pixels have more samples than `row_samples` says: a device was interrupted there.
    interrupted: Option<Interrupted>,
    /// Which pixels have one sample more than their row, because coarse frames show them; empty where none does.
    early: Vec<bool>,
    /// Which pixels rest, if adaptive sampling is on.
    pub(crate) resting: Option<Resting>,
}

/// Rows in which an unfinished pass has come as far as a column.
#[derive(Clone, Debug)]
struct Interrupted {
    rows: Range<usize>,
    /// Pixels from the left that the pass has done.
    columns: usize,
    /// Samples that they have.
    samples: u32,
}

/// One row of the film, to which samples are added.
#[derive(Debug)]
pub struct FilmRow<'a> {
    /// Its number from the top.
    pub y: u32,
    /// Samples that each pixel has.
    pub samples: &'a mut u32,
    /// [`STRIDE`] floats per pixel.
    pub sums: &'a mut [f32],
    /// [`PassSums::stride`] floats a pixel.
    pub passes: &'a mut [f32],
    /// Per pixel the samples that it may have in all; empty where there is no limit.
    pub most: &'a [u32],
    /// Whether a pixel has one sample more than `samples`; empty where none does.
    pub early: &'a mut [bool],
}

impl FilmBuffer {
    /// A black picture without samples.
    ///
    /// # Errors
    /// As [`FilmBuffer::with_passes`].
    pub fn new(width: u32, height: u32) -> Result<Self, NoMemory> {
        Self::with_passes(width, height, PassSums::default())
    }

    /// A black film without samples, with sums for passes.
    ///
    /// # Errors
    /// [`NoMemory`] says what the film needs, where there is too little.
    pub fn with_passes(width: u32, height: u32, kept: PassSums) -> Result<Self, NoMemory> {
        let what = format!("film: {width} × {height} pixels");
        check_room(&what, film_bytes(u64::from(width) * u64::from(height), kept))?;
        let (width, height) = (width as usize, height as usize);
        let pixels = width * height;
        let (sums, pass_sums) = (zeroed(pixels * STRIDE, &what)?, zeroed(pixels * kept.stride(), &what)?);
        let row_samples = zeroed(height, &what)?;
        let (early, interrupted, resting) = (Vec::new(), None, None);
        Ok(Self { width, height, sums, pass_sums, kept, row_samples, early, interrupted, resting })
    }

    /// Which sums of passes the film keeps.
    pub fn kept(&self) -> PassSums {
        self.kept
    }

    /// All sums of passes, [`PassSums::stride`] floats per pixel, rows from the top.
    pub fn pass_sums(&self) -> &[f32] {
        &self.pass_sums
    }

    /// All sums of passes, to be overwritten together with [`FilmBuffer::sums_mut`].
    pub fn pass_sums_mut(&mut self) -> &mut [f32] {
        &mut self.pass_sums
    }

    /// Samples of one pixel, by its number from the upper left.
    pub fn samples_of(&self, pixel: usize) -> u32 {
        let most = self.resting.as_ref().map_or(u32::MAX, |r| r.rested()[pixel]);
        let (x, y) = (pixel % self.width, pixel / self.width);
        let ahead = self.interrupted.as_ref().filter(|at| x < at.columns && at.rows.contains(&y));
        let is_early = self.early.get(pixel).is_some_and(|&is_early| is_early);
        ahead.map_or(self.row_samples[y] + u32::from(is_early), |at| at.samples).min(most)
    }

    /// Whether no pass over all pixels has begun, so that pixels of coarse frames can have their first sample before the others.
    pub fn is_before_passes(&self) -> bool {
        self.row_samples.iter().all(|&samples| samples == 0) && self.interrupted.is_none()
    }

    /// From now on pixels can have one sample more than their row ([`FilmRow::early`]).
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for a byte a pixel.
    pub fn allow_early(&mut self) -> Result<(), NoMemory> {
        if self.early.is_empty() {
            self.early = zeroed(self.width * self.height, "film: pixels of coarse frames")?;
        }
        Ok(())
    }

    /// The film of a coarse frame whose pixels have their first sample, and no more.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for it.
    pub fn coarse(&self, pixels: &CoarsePixels) -> Result<Self, NoMemory> {
        let [width, height] = pixels.size();
        let mut coarse = Self::with_passes(width, height, self.kept)?;
        let stride = self.kept.stride();
        let places = pixels.rows().flat_map(|y| pixels.columns().map(move |x| [x as usize, y as usize]));
        for (number, [x, y]) in places.enumerate() {
            let of = y * self.width + x;
            coarse.sums[number * STRIDE..][..STRIDE].copy_from_slice(&self.sums[of * STRIDE..][..STRIDE]);
            coarse.pass_sums[number * stride..][..stride]
                .copy_from_slice(&self.pass_sums[of * stride..][..stride]);
        }
        coarse.row_samples.fill(1);
        Ok(coarse)
    }

    /// Removes all samples. From now on pixels rest by this rule, if there is one.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none to keep which pixels rest; then the film stays as it is.
    pub fn rest_by(&mut self, rule: Option<Adaptive>) -> Result<(), NoMemory> {
        let resting = match (rule, self.resting.take()) {
            (None, _) => None,
            (Some(rule), None) => Some(Resting::new(rule, self.width * self.height)?),
            (Some(rule), Some(mut resting)) => {
                resting.wake(rule);
                Some(resting)
            }
        };
        self.clear();
        self.resting = resting;
        Ok(())
    }

    /// All sums, [`STRIDE`] floats per pixel, rows from the top: the starting point of a device that adds samples itself.
    pub fn sums(&self) -> &[f32] {
        &self.sums
    }

    /// All sums, to be overwritten with those that such a device returns, of `samples` samples in every pixel.
    pub fn sums_mut(&mut self, samples: u32) -> &mut [f32] {
        self.row_samples.fill(samples);
        (self.early, self.interrupted) = (Vec::new(), None);
        &mut self.sums
    }

    /// Says that these sums are of a pass that was interrupted on its way to `samples` samples: it has done all rows above `rows`, and
    /// in these the pixels left of the column `columns`.
    pub fn interrupted_at(&mut self, samples: u32, rows: Range<usize>, columns: usize) {
        let done = rows.start.min(self.height);
        self.row_samples[..done].fill(samples);
        self.interrupted = Some(Interrupted { rows, columns, samples });
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Number of strips that the estimate of the error is added up from.
    pub fn strips(&self) -> usize {
        self.width * self.height.div_ceil(STRIP_ROWS)
    }

    /// Pixels across and down.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Heap bytes.
    pub fn bytes(&self) -> u64 {
        let resting = self.resting.as_ref().map_or(0, Resting::bytes);
        let numbers = self.sums.len() + self.pass_sums.len() + self.row_samples.len();
        (numbers * 4 + self.early.len()) as u64 + resting
    }

    /// Removes all samples; no pixel rests.
    pub fn clear(&mut self) {
        if let Some(resting) = &mut self.resting {
            resting.wake(resting.rule());
        }
        self.sums.fill(0.0);
        self.pass_sums.fill(0.0);
        self.row_samples.fill(0);
        self.early.fill(false);
        self.interrupted = None;
    }

    /// Samples of the pixels that do not rest; if rows differ, of those with the fewest.
    pub fn spp(&self) -> u32 {
        self.row_samples.iter().copied().min().unwrap_or(0)
    }

    /// Mean over pixels of the samples that each has after a complete pass to `spp` samples.
    pub fn mean_spp_at(&self, spp: u32) -> f64 {
        self.resting.as_ref().map_or(f64::from(spp), |resting| resting.mean_spp_at(spp))
    }

    /// Mean over pixels of the samples that each has.
    pub fn mean_spp(&self) -> f64 {
        let pixels = self.width * self.height;
        let sum: u64 = (0..pixels).map(|pixel| u64::from(self.samples_of(pixel))).sum();
        sum as f64 / pixels.max(1) as f64
    }

    /// Rows to add to, from the top.
    pub fn rows_mut(&mut self) -> impl Iterator<Item = FilmRow<'_>> {
        let mut passes = self.pass_sums.chunks_mut((self.width * self.kept.stride()).max(1));
        let mut most = self.resting.as_ref().map_or(&[][..], Resting::rested).chunks(self.width.max(1));
        let mut early = self.early.chunks_mut(self.width.max(1));
        self.sums.chunks_mut((self.width * STRIDE).max(1)).zip(&mut self.row_samples).enumerate().map(
            move |(y, (sums, samples))| {
                let passes = passes.next().unwrap_or_default();
                let most = most.next().unwrap_or_default();
                let early = early.next().unwrap_or_default();
                FilmRow { y: y as u32, samples, sums, passes, most, early }
            },
        )
    }

    /// Mean and variance of the mean of one channel of a pixel with `n` samples; with shadow catchers, laid over white.
    #[inline]
    pub(crate) fn moments(&self, pixel: usize, channel: usize, n: u32) -> (f64, f64) {
        if self.kept.caught {
            return self.caught_moments(pixel, channel, n);
        }
        let sums = &self.sums[pixel * STRIDE..][..STRIDE];
        let n_of = |r: usize| f64::from((n + CLASSES - 1 - r as u32) / CLASSES);
        let total = f64::from(n);
        let mean = (0..R).map(|r| f64::from(sums[3 * r + channel])).sum::<f64>() / total;
        let spread: f64 = (0..R)
            .map(|r| {
                let d = (f64::from(sums[3 * r + channel]) - n_of(r) * mean) / total;
                d * d
            })
            .sum();
        (mean, if n < CLASSES { f64::INFINITY } else { spread * R as f64 / (R - 1) as f64 })
    }

    /// The mean of all samples; with shadow catchers, the colours composited from it.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn mean(&self) -> Result<Image, NoMemory> {
        if self.kept.caught {
            return self.caught_color();
        }
        self.picture_of(|film, pixel, channel, n| film.moments(pixel, channel, n).0)
    }

    /// Variance of that mean; infinite with less than one sample per class. With shadow catchers, of the picture over white.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn variance(&self) -> Result<Image, NoMemory> {
        self.picture_of(|film, pixel, channel, n| film.moments(pixel, channel, n).1)
    }

    fn picture_of(
        &self,
        f: impl Fn(&Self, usize, usize, u32) -> f64 + Sync + Send,
    ) -> Result<Image, NoMemory> {
        let pixel = |i: usize| {
            let n = self.samples_of(i);
            if n == 0 { [0.0; 3] } else { [0, 1, 2].map(|c| f(self, i, c, n) as f32) }
        };
        Ok(Image::new(self.width, self.height, self.each_pixel(pixel)?))
    }

    /// What a function gives for each pixel, by its number from the upper left.
    pub(crate) fn each_pixel<T: Send>(
        &self,
        of: impl Fn(usize) -> T + Sync + Send,
    ) -> Result<Vec<T>, NoMemory> {
        collected_by_threads((0..self.width * self.height).into_par_iter().map(of), PICTURE)
    }

    /// Estimated relative error of the whole picture; infinite with less than one sample per class.
    ///
    /// μ² = w·q + (1 − w)·a², q = (m² − var)⁺, w = q / (q + 16 var), where a is the mean of the up to 8 pixels around, without the pixel
    /// itself: a rare bright sample must not raise the value that its error is divided by. One sample s among dim ones of r has var = s²/n²
    /// and m² − var = 2sr/n, little beside s² and much beside r²: so w follows from that difference, not from m².
    pub fn error_estimate(&self) -> f64 {
        if self.spp() < CLASSES {
            return f64::INFINITY;
        }
        let blocks: Vec<usize> = (0..self.height.div_ceil(STRIP_ROWS)).collect();
        let strips: Vec<Vec<f64>> =
            blocks.into_par_iter().map(|block| self.squared_errors_of(block)).collect();
        self.error_of_strips(&strips.concat())
    }

    /// The estimate from the sums of all strips, block by block. They are added in this order, so that it does not depend on the number
    /// of threads, or on who found the sums.
    pub fn error_of_strips(&self, strips: &[f64]) -> f64 {
        let blocks = strips.chunks(self.width.max(1)).map(|strips| strips.iter().sum::<f64>());
        (blocks.sum::<f64>() / (self.height * self.width * 3) as f64).sqrt()
    }

    /// For each strip of a block the sum of var / (μ² + floor) over its channels and pixels.
    fn squared_errors_of(&self, block: usize) -> Vec<f64> {
        let (width, height) = (self.width, self.height);
        let rows = block * STRIP_ROWS..((block + 1) * STRIP_ROWS).min(height);
        let (first, last) = (rows.start.saturating_sub(1), (rows.end + 1).min(height));
        let mut sums = vec![0.0; width];
        let mut moments = vec![(0.0, 0.0); (last - first) * width];
        for channel in 0..3 {
            for (i, m) in moments.iter_mut().enumerate() {
                let pixel = first * width + i;
                *m = self.moments(pixel, channel, self.samples_of(pixel));
            }
            for y in rows.clone() {
                for (x, sum) in sums.iter_mut().enumerate() {
                    let (mean, var) = moments[(y - first) * width + x];
                    if var == 0.0 {
                        continue;
                    }
                    let (mut around, mut n) = (0.0, 0.0);
                    for yy in y.saturating_sub(1)..(y + 2).min(height) {
                        for xx in x.saturating_sub(1)..(x + 2).min(width) {
                            if (xx, yy) != (x, y) {
                                around += moments[(yy - first) * width + xx].0;
                                n += 1.0;
                            }
                        }
                    }
                    around /= f64::max(n, 1.0);
                    let known = (mean * mean - var).max(0.0);
                    let certain = known / (known + 16.0 * var);
                    let square = certain * known + (1.0 - certain) * around * around;
                    *sum += var / (square + FLOOR);
                }
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pass from 4 to 8 samples has done the rows above the fourth, and in the eight from there on two of four pixels. Each pixel has as
    /// much light as samples.
    #[test]
    fn pixels_of_an_interrupted_pass_have_their_own_samples() {
        let has_eight = |pixel: usize| pixel / 4 < 4 || pixel % 4 < 2;
        let mut film = FilmBuffer::new(4, 12).unwrap();
        for (pixel, sums) in film.sums_mut(4).chunks_exact_mut(STRIDE).enumerate() {
            sums.fill(if has_eight(pixel) { 2.0 } else { 1.0 });
        }
        assert!(film.mean().unwrap().pixels.iter().any(|p| *p != [1.0; 3]), "all have four");
        film.interrupted_at(8, 4..12, 2);
        assert!((0..48).all(|pixel| film.samples_of(pixel) == if has_eight(pixel) { 8 } else { 4 }));
        assert!(film.mean().unwrap().pixels.iter().all(|p| *p == [1.0; 3]));
        assert_eq!((film.spp(), film.mean_spp()), (4, (32.0 * 8.0 + 16.0 * 4.0) / 48.0));
        assert_eq!(film.error_estimate(), 0.0);
        film.sums_mut(8);
        assert_eq!((film.spp(), film.mean_spp()), (8, 8.0));
    }

    /// One sample of 16 is brighter than all that is around by a factor of 10 to 10⁵: the estimate is the error that the picture has.
    #[test]
    fn a_single_bright_sample_is_estimated_as_the_error_that_it_is() {
        for bright in [2f32, 30.0, 2e4] {
            let mut film = FilmBuffer::new(9, 9).unwrap();
            let sums = film.sums_mut(16);
            sums.fill(4.0 * 0.2);
            sums[40 * STRIDE..40 * STRIDE + 3].fill(4.0 * 0.2 + bright);
            let relative = f64::from(bright / 16.0).powi(2) / (0.2 * 0.2 + FLOOR);
            let (estimate, truth) = (film.error_estimate(), (relative / 81.0).sqrt());
            assert!((0.85..1.1).contains(&(estimate / truth)), "{bright}: {estimate} for {truth}");
        }
    }
}
