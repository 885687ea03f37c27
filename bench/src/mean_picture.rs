//! The mean of independent pictures with its variance: a reference for other pictures whose own error is known.

use pumice_picture::Image;
use pumice_picture::metrics::rel_mse::EPSILON;

/// The mean of each value (three per pixel), and the variance of that mean.
#[derive(Clone, Debug)]
pub(crate) struct MeanPicture {
    pub(crate) values: Vec<f64>,
    pub(crate) variances: Vec<f64>,
}

impl MeanPicture {
    /// The mean of at least two pictures of one size.
    pub(crate) fn of(batches: &[Image]) -> Self {
        let n = batches.len() as f64;
        let flat = |i: &Image| i.pixels.iter().flatten().map(|&v| f64::from(v)).collect::<Vec<f64>>();
        let all: Vec<Vec<f64>> = batches.iter().map(flat).collect();
        let values: Vec<f64> = (0..all[0].len()).map(|i| all.iter().map(|b| b[i]).sum::<f64>() / n).collect();
        let variances = values
            .iter()
            .enumerate()
            .map(|(i, m)| all.iter().map(|b| (b[i] - m).powi(2)).sum::<f64>() / (n - 1.0) / n)
            .collect();
        Self { values, variances }
    }

    /// Expected relMSE of this picture due to its own noise.
    pub(crate) fn own_rel_mse(&self) -> f64 {
        let each = self.values.iter().zip(&self.variances).map(|(v, s)| s / (v * v + EPSILON));
        each.sum::<f64>() / self.values.len() as f64
    }

    /// relMSE against a reference, minus its expected part due to the noise of both: 0 on average if both have the same expectation.
    pub(crate) fn rel_mse_without_noise(&self, reference: &Self) -> f64 {
        let squared = |i: usize| {
            let (value, expected) = (self.values[i], reference.values[i]);
            let noise = self.variances[i] + reference.variances[i];
            ((value - expected).powi(2) - noise) / (expected * expected + EPSILON)
        };
        (0..self.values.len()).map(squared).sum::<f64>() / self.values.len() as f64
    }

    /// Difference of the sums of all values of two pictures, in standard errors of independent values. The channels of a pixel depend on
    /// each other, so two pictures of the same expectation differ by some 1.7 of them where channels are equal, not by 1.
    pub(crate) fn disagreement(&self, other: &Self) -> f64 {
        let difference: f64 = self.values.iter().zip(&other.values).map(|(a, b)| a - b).sum();
        let variance: f64 = self.variances.iter().chain(&other.variances).sum();
        difference.abs() / variance.sqrt()
    }

    /// The mean as a picture of this size in pixels.
    pub(crate) fn image(&self, size: [u32; 2]) -> Image {
        let [width, height] = size.map(|s| s as usize);
        let pixels = self.values.as_chunks::<3>().0.iter().map(|p| p.map(|v| v as f32)).collect();
        Image::new(width, height, pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(values: &[f32]) -> MeanPicture {
        let images: Vec<Image> = values.iter().map(|&v| Image::new(1, 1, vec![[v; 3]])).collect();
        MeanPicture::of(&images)
    }

    /// Expected values computed by hand: the means are 2 and 7, and the variances of the means 1 and 4.
    #[test]
    fn noise_is_known_and_taken_off() {
        let (a, b) = (mean(&[1.0, 3.0]), mean(&[5.0, 9.0]));
        assert_eq!((a.values[0], a.variances[0]), (2.0, 1.0));
        assert!((a.own_rel_mse() - 1.0 / 4.01).abs() < 1e-12);
        assert!((b.rel_mse_without_noise(&a) - (25.0 - 5.0) / 4.01).abs() < 1e-12);
        assert!((a.rel_mse_without_noise(&a) + 2.0 / 4.01).abs() < 1e-12);
        assert_eq!(a.image([1, 1]).pixels, [[2.0; 3]]);
    }
}
