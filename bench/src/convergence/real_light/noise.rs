//! Noise of a renderer: the variance of a pixel between pictures of independent seeds, as part of what the pixel shows.
//!
//! ```text
//! noise   = mean over pixels and channels of  s² / (µ² + 0.01)      s²: between R pictures, divided by R − 1
//! ratio   = noise of ours / noise of theirs, with the same µ
//! ```
//! For two renderers without bias this is the relMSE against the true picture, and it needs no long reference: a reference of many samples
//! costs more than all measured pictures together, and where one program samples worst, its own error would be charged to both. Only the
//! weights need µ. They come from all pictures of both programs, each program counted once, so neither is favoured. That both draw the
//! same picture is checked apart ([`MeanPicture::disagreement`]), because a program that misses light has no noise from it.
//!
//! **Interval.** The picture is cut into blocks of 4 × 4 pixels. Blocks are drawn with replacement, for both programs the same ones, and the
//! ratio is taken of their sums; 2.5 % of the ratios lie below the interval and 2.5 % above (percentile bootstrap: Efron 1979). Blocks,
//! because Pumice's first samples make the errors of neighbours depend on each other. Seeds are not resampled: with few of them the
//! variance of a resample is too small by 1/R. Rare bright paths make some blocks heavy, so they widen the interval.

use pumice_picture::metrics::rel_mse::EPSILON;

use crate::mean_picture::MeanPicture;
use crate::ray_sets::mix;

/// Side of a block in pixels.
const BLOCK: usize = 4;
/// Resamples of the bootstrap: the ends of the interval are known to about a tenth of its length.
const RESAMPLES: u64 = 1_000;

/// Weight of each value's variance: 1 / (µ² + 0.01).
#[derive(Clone, Debug)]
pub(super) struct Weights(Vec<f64>);

impl Weights {
    /// Weights by the mean of these pictures, all of one size; at least one.
    pub(super) fn of(means: &[&MeanPicture]) -> Self {
        let n = means.len() as f64;
        let weight = |i: usize| {
            let mean = means.iter().map(|m| m.values[i]).sum::<f64>() / n;
            1.0 / (mean * mean + EPSILON)
        };
        Self((0..means.first().map_or(0, |m| m.values.len())).map(weight).collect())
    }
}

/// The noise of one renderer in one picture (see the module).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Noise {
    /// Weighted variances, added up by block.
    blocks: Vec<f64>,
    values: usize,
}

/// A ratio with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// The ratio.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Noise {
    /// The noise of a picture, from the mean of `pictures` of them, each `width` pixels wide.
    pub(super) fn of(mean: &MeanPicture, pictures: usize, weights: &Weights, width: usize) -> Self {
        let height = mean.values.len() / (3 * width);
        let across = width.div_ceil(BLOCK);
        let mut blocks = vec![0.0; across * height.div_ceil(BLOCK)];
        for (i, (variance, weight)) in mean.variances.iter().zip(&weights.0).enumerate() {
            let (x, y) = (i / 3 % width, i / 3 / width);
            // The variance of a picture is that of the mean times their number.
            blocks[y / BLOCK * across + x / BLOCK] += variance * pictures as f64 * weight;
        }
        Self { blocks, values: mean.values.len() }
    }

    /// The mean over pixels and channels.
    pub(super) fn mean(&self) -> f64 {
        self.blocks.iter().sum::<f64>() / self.values as f64
    }

    /// This noise over another one of the same picture; `None` where that is 0.
    pub(super) fn over(&self, other: &Self) -> Option<Ratio> {
        let ratio = |ours: f64, theirs: f64| (theirs > 0.0).then(|| ours / theirs);
        let value = ratio(self.blocks.iter().sum(), other.blocks.iter().sum())?;
        let count = self.blocks.len() as u64;
        let resample = |number: u64| {
            let drawn = (0..count).map(|k| (mix(number * count + k) % count) as usize);
            let sums = drawn.fold((0.0, 0.0), |(a, b), i| (a + self.blocks[i], b + other.blocks[i]));
            ratio(sums.0, sums.1)
        };
        let mut found: Vec<f64> = (0..RESAMPLES).filter_map(resample).collect();
        found.sort_by(f64::total_cmp);
        let end = |share: f64| found.get((share * found.len() as f64) as usize).copied();
        Some(Ratio { value, low: end(0.025)?, high: end(0.975)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pumice_picture::Image;

    const WIDTH: usize = 40;
    const PIXELS: usize = 40 * 28;

    fn unit(i: u64) -> f64 {
        (mix(i) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A renderer of known noise: value v of every pixel is 0.2 + v, plus an even distribution of the variance `variance` · (1 + v).
    fn pictures(count: u64, variance: f64, key: u64) -> Vec<Image> {
        let value = |picture: u64, pixel: usize, v: usize| {
            let u = unit(mix(key) ^ (picture << 40 | (3 * pixel + v) as u64));
            let spread = (12.0 * variance * (1.0 + v as f64)).sqrt();
            (0.2 + v as f64 + spread * (u - 0.5)) as f32
        };
        let image = |picture| {
            let pixels = (0..PIXELS).map(|p| [0, 1, 2].map(|v| value(picture, p, v))).collect();
            Image::new(WIDTH, PIXELS / WIDTH, pixels)
        };
        (0..count).map(image).collect()
    }

    fn noise(mean: &MeanPicture, weights: &Weights) -> Noise {
        Noise::of(mean, 4, weights, WIDTH)
    }

    /// Closed form: σ² · mean over channels of (1 + v) / ((0.2 + v)² + 0.01).
    #[test]
    fn the_noise_of_a_known_renderer_is_found() {
        let mean = MeanPicture::of(&pictures(4, 0.01, 1));
        let found = noise(&mean, &Weights::of(&[&mean])).mean();
        let exact = 0.01 * (1.0 / 0.05 + 2.0 / 1.45 + 3.0 / 4.85) / 3.0;
        // s² of four even numbers has a relative standard error of √(2/3 − 1.2/4) = 0.61, of 1,120 pixels 1.8 %; 4 of them, and the
        // weights' own noise, σ²/4 · 3 / 0.05² · 0.2² of the first channel: 4 %.
        assert!((found / exact - 1.0).abs() < 0.11, "{found} for {exact}");
        // Negative control: the variance of the mean instead of that of a picture is a fourth.
        assert!((Noise::of(&mean, 1, &Weights::of(&[&mean]), WIDTH).mean() / exact - 0.25).abs() < 0.03);
    }

    /// In 200 comparisons of renderers whose variances have the ratio 2.5, 95 % of the intervals contain it: binomial, 190 ± 3.1, of which 4
    /// are allowed, and percentile intervals of 70 blocks are a little short.
    #[test]
    fn the_interval_contains_the_ratio_as_often_as_it_says() {
        let mut inside = 0;
        let mut contains_one = 0;
        for round in 0..200 {
            let [ours, theirs] = [(0.025, 2 * round), (0.01, 2 * round + 1)]
                .map(|(variance, key)| MeanPicture::of(&pictures(4, variance, 77 + key)));
            let weights = Weights::of(&[&ours, &theirs]);
            let found = noise(&ours, &weights).over(&noise(&theirs, &weights)).unwrap();
            assert!(found.low < found.value && found.value < found.high);
            inside += u32::from(found.low < 2.5 && 2.5 < found.high);
            contains_one += u32::from(found.low < 1.0);
        }
        assert!((176..=200).contains(&inside), "{inside}");
        // Negative control: no interval contains a wrong ratio.
        assert_eq!(contains_one, 0);
    }

    /// Two pictures whose value 0.5 ± d of one channel of one pixel differs: their mean has the variance d², each picture 2 d².
    #[test]
    fn a_variance_counts_in_its_block_with_the_weight_of_all_programs() {
        let image = |value: f32| {
            let mut pixels = vec![[0.5; 3]; 10 * 6];
            pixels[5 * 10 + 9][1] = value;
            Image::new(10, 6, pixels)
        };
        let one = MeanPicture::of(&[image(0.25), image(0.75)]);
        let other = MeanPicture::of(&[image(2.0), image(3.0)]);
        let weights = Weights::of(&[&one, &other]);
        let found = Noise::of(&one, 2, &weights, 10);
        // Blocks of 4 × 4 in 10 × 6 pixels: 3 across, 2 down; pixel (9, 5) is in the last. The means are 0.5 and 2.5.
        let expected = 2.0 * 0.0625 / (1.5f64.powi(2) + 0.01);
        assert_eq!(found.blocks.len(), 6);
        assert!((found.blocks[5] - expected).abs() < 1e-12 && found.blocks[..5] == [0.0; 5], "{found:?}");
        assert!((found.mean() - expected / 180.0).abs() < 1e-12);
    }

    #[test]
    fn a_renderer_without_noise_has_no_ratio() {
        let still = MeanPicture::of(&vec![Image::new(WIDTH, PIXELS / WIDTH, vec![[0.5; 3]; PIXELS]); 4]);
        let moving = MeanPicture::of(&pictures(4, 0.01, 5));
        let weights = Weights::of(&[&still, &moving]);
        let [still, moving] = [&still, &moving].map(|m| noise(m, &weights));
        assert_eq!((still.mean(), moving.over(&still)), (0.0, None));
        assert_eq!(still.over(&moving).unwrap(), Ratio { value: 0.0, low: 0.0, high: 0.0 });
    }
}
