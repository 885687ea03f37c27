//! The film while it is being exposed: sums of samples by replicate, and the first-hit passes.
//!
//! A pixel's samples are dealt in turn to the sampler's replicates, which are independent; the spread of the replicates' means
//! is therefore an honest measure of the picture's error, which the spread of stratified samples is not.

use pumice_render::sampler::REPLICATES;
use pumice_render::{Image, Picture};

const R: usize = REPLICATES as usize;

/// Sums over the samples of one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Exposure {
    /// Radiance by replicate.
    pub(crate) color: [[f32; 3]; R],
    /// Base colour of the first surface.
    pub(crate) albedo: [f32; 3],
    /// Its normal towards the camera.
    pub(crate) normal: [f32; 3],
    /// Distance along the view axis, through the pixel's centre; infinite where nothing is.
    pub(crate) depth: f32,
    /// Dense label index + 1 there, or 0.
    pub(crate) label: u32,
}

/// All pixels, and how many samples each row has.
#[derive(Clone, Debug)]
pub(crate) struct FilmStore {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) exposures: Vec<Exposure>,
    /// Rows differ only after a cancel in the middle of a sample.
    pub(crate) samples_of_row: Vec<u32>,
}

/// Samples in replicate `r` of `n` samples dealt in turn.
fn dealt(n: u32, r: usize) -> f32 {
    (n / REPLICATES + u32::from((r as u32) < n % REPLICATES)) as f32
}

impl FilmStore {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            exposures: vec![Exposure::default(); width * height],
            samples_of_row: vec![0; height],
        }
    }

    /// Mean radiance and the variance of that mean; the variance is infinite with fewer samples than replicates.
    fn mean_and_variance(&self, pixel: usize) -> ([f32; 3], [f32; 3]) {
        let n = self.samples_of_row[pixel / self.width];
        let e = &self.exposures[pixel];
        if n == 0 {
            return ([0.0; 3], [f32::INFINITY; 3]);
        }
        let (mut mean, mut variance) = ([0f32; 3], [f32::INFINITY; 3]);
        for c in 0..3 {
            mean[c] = e.color.iter().map(|sum| sum[c]).sum::<f32>() / n as f32;
            if n >= REPLICATES {
                // Σ w (m_r − m)² / (R − 1) with weights n_r/n: for equal n_r the textbook variance of a mean of R values. With
                // n not a multiple of R the last samples weigh a little too little; it is exact again at the next multiple.
                let spread: f32 = (0..R)
                    .map(|r| {
                        let w = dealt(n, r);
                        w / n as f32 * (e.color[r][c] / w - mean[c]).powi(2)
                    })
                    .sum();
                variance[c] = spread / (R - 1) as f32;
            }
        }
        (mean, variance)
    }

    /// √(mean over pixels and channels of variance / (mean² + 0.01)): the root of the relMSE that a comparison with the true
    /// picture would give, by the definition of `pumice_render::metrics::rel_mse`. Infinite until every row has a sample in each
    /// replicate twice.
    pub(crate) fn error_estimate(&self) -> f64 {
        if self.exposures.is_empty() || self.samples_of_row.iter().any(|&n| n < 2 * REPLICATES) {
            return f64::INFINITY;
        }
        let sum: f64 = (0..self.exposures.len())
            .map(|i| {
                let (mean, variance) = self.mean_and_variance(i);
                (0..3).map(|c| f64::from(variance[c]) / (f64::from(mean[c]).powi(2) + 0.01)).sum::<f64>()
            })
            .sum();
        (sum / (3 * self.exposures.len()) as f64).sqrt()
    }

    /// The picture as it stands.
    pub(crate) fn picture(&self) -> Picture {
        let all: Vec<_> = (0..self.exposures.len()).map(|i| self.mean_and_variance(i)).collect();
        let image = |pixels| Image::new(self.width, self.height, pixels);
        let mean_of = |pick: fn(&Exposure) -> [f32; 3]| {
            let pixels = self.exposures.iter().enumerate().map(|(i, e)| {
                let n = self.samples_of_row[i / self.width].max(1) as f32;
                pick(e).map(|v| v / n)
            });
            image(pixels.collect())
        };
        let known = self.samples_of_row.iter().all(|&n| n >= REPLICATES);
        Picture {
            color: image(all.iter().map(|v| v.0).collect()),
            variance: known.then(|| image(all.iter().map(|v| v.1).collect())),
            depth: Some(self.exposures.iter().map(|e| e.depth).collect()),
            label: Some(self.exposures.iter().map(|e| e.label).collect()),
            albedo: Some(mean_of(|e| e.albedo)),
            normal: Some(mean_of(|e| e.normal)),
            provenance: None,
        }
    }
}
