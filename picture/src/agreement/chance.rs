//! The interval in which the ratio of a squared difference to its expected noise lies by chance.
//!
//! The noise of a picture is correlated and has heavy tails, so no formula gives the distribution of the ratio; the pictures do. Half the
//! difference between the means of two random halves of a set has the variance of the set's mean, and no signal. The sum of such a
//! difference for each set, squared and summed over the pixels, is therefore what the ratio's numerator would be without a difference:
//!
//! ```text
//! u = Σ sᵢ aᵢ + Σ sⱼ bⱼ,  s = ± 1/n at random, as many + as −      |u|² = sᵀ G s      G: products of the centred pictures
//! ```
//! A set that is compared with a reference of far less noise has such an interval alone.

use rayon::prelude::*;

use super::PictureSet;
use crate::image::Image;

/// Random halves that are drawn.
const DEALS: usize = 2000;
/// Pictures that are used, of all sets together: the products take time with the square of their number, and 32 have 6 · 10⁸ pairs of
/// halves.
const MOST: usize = 64;

/// Bounds of the middle `1 − level` of the ratio by chance; `None` with fewer than four pictures in a set, which have too few halves.
pub(super) fn chance_interval(sets: &[&PictureSet], mask: &[bool], level: f64) -> Option<[f64; 2]> {
    let most = MOST / sets.len();
    let used: Vec<&[Image]> = sets.iter().map(|set| &set.pictures()[..set.len().min(most) / 2 * 2]).collect();
    if used.iter().any(|pictures| pictures.len() < 4) {
        return None;
    }
    let products = products(&used, mask);
    let n = products.len();
    // What the squared length is on average: the variances of the means, summed over the pixels.
    let mut from = 0;
    let mut expected = 0.0;
    for count in used.iter().map(|pictures| pictures.len()) {
        let trace: f64 = (from..from + count).map(|i| products[i][i]).sum();
        expected += trace / (count as f64 - 1.0) / count as f64;
        from += count;
    }
    if expected <= 0.0 {
        return Some([0.0, 0.0]);
    }
    let mut random = SplitMix(1);
    let mut ratios: Vec<f64> = (0..DEALS)
        .map(|_| {
            let mut signs = Vec::with_capacity(n);
            for count in used.iter().map(|pictures| pictures.len()) {
                let from = signs.len();
                signs.extend((0..count).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 } / count as f64));
                // Fisher and Yates 1938.
                for i in (1..count).rev() {
                    signs.swap(from + i, from + (random.next() % (i as u64 + 1)) as usize);
                }
            }
            let row = |i: usize| -> f64 { products[i].iter().zip(&signs).map(|(p, s)| p * s).sum() };
            (0..n).map(|i| signs[i] * row(i)).sum::<f64>() / expected
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    let at = |share: f64| ratios[((DEALS - 1) as f64 * share).round() as usize];
    Some([at(level / 2.0), at(1.0 - level / 2.0)])
}

/// Products of all pairs of the pictures, each less the mean of its set, over the pixels that are not masked.
fn products(sets: &[&[Image]], mask: &[bool]) -> Vec<Vec<f64>> {
    let centred: Vec<Vec<f32>> = sets
        .iter()
        .flat_map(|&pictures| {
            let mut mean = vec![[0.0f64; 3]; mask.len()];
            for picture in pictures {
                for (sum, pixel) in mean.iter_mut().zip(&picture.pixels) {
                    (0..3).for_each(|c| sum[c] += f64::from(pixel[c]) / pictures.len() as f64);
                }
            }
            pictures.iter().map(move |picture| {
                let pixels = picture.pixels.iter().zip(&mean).zip(mask).filter(|(_, masked)| !**masked);
                pixels
                    .flat_map(|((pixel, mean), _)| [0, 1, 2].map(|c| (f64::from(pixel[c]) - mean[c]) as f32))
                    .collect()
            })
        })
        .collect();
    let product = |a: &[f32], b: &[f32]| -> f64 {
        // Sums of a few thousand products are exact enough in f32 lanes only if they are short.
        a.chunks(256)
            .zip(b.chunks(256))
            .map(|(a, b)| f64::from(a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>()))
            .sum()
    };
    centred.par_iter().map(|a| centred.iter().map(|b| product(a, b)).collect()).collect()
}

/// SplitMix64 (Steele, Lea and Flood 2014): numbers for shuffles.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}
