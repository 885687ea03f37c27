//! How much of the filter's change a pixel gets: all of it where noise explains it, less where it is larger than noise.
//!
//! Let y be a noisy pixel, f what the filter made of it and x what it would be without noise. Of the mixtures y + a (f − y) that with the least
//! mean squared error has a = E[(y − x)(y − f)] / E[(y − f)²]. Of the noise of y, f has hardly any, so the dividend is the variance of y:
//!
//! ```text
//! a = Σ var(y) / Σ (y − f)²    at most 1, over the pixels of the same label up to REACH away
//! ```
//! This is shrinkage towards the filtered picture, after James and Stein (1961, *Estimation with Quadratic Loss*), in its positive part. Where the
//! filter blurs what is not noise, the divisor outgrows the dividend, and what it blurred comes back. The variance falls as samples are added, and
//! with it a, wherever the filter has a bias.
//!
//! Each channel is divided by f² + 0.01, as in `metrics::rel_mse`, so that bright pixels do not decide for all. A pixel whose variance is not known
//! says nothing, and where none is known a is 1.

use multiversion::multiversion;
use rayon::prelude::*;

use super::guides::Guides;
use super::light::UNKNOWN;
use super::planes::{LANES, Lanes, MARGIN, lanes};
use crate::image::Image;

/// Pixels from one to the furthest that its share is told from, along either axis. With 2 single pixels are left noisy by chance, with 6 the error
/// of fine reflections is larger by a few per cent.
const REACH: usize = 4;

/// Added to a squared value before something is divided by it: as in `metrics::rel_mse`.
const FLOOR: f32 = 0.01;

/// What tells the share of the noisy picture in each pixel.
pub(super) struct Shrinkage<'a> {
    guides: &'a Guides,
    takes_part: &'a [f32],
    /// Of each pixel that takes part the relative variance of its channels, summed; else 0.
    noise: Vec<f32>,
    /// Of each pixel that takes part the relative squared change of its channels, summed; else 0.
    change: Vec<f32>,
}

impl<'a> Shrinkage<'a> {
    /// Of a picture, the variance of its pixels, and what the filter made of it. `planes` are 0 where a pixel takes no part.
    pub(super) fn of(
        [image, variance]: [&Image; 2],
        filtered: &[[f32; 3]],
        guides: &'a Guides,
        takes_part: &'a [f32],
        [mut noise, mut change]: [Vec<f32>; 2],
    ) -> Self {
        let layout = guides.layout;
        let rows = (noise.par_chunks_mut(layout.stride()), change.par_chunks_mut(layout.stride()));
        rows.into_par_iter().enumerate().for_each(|(y, (noise, change))| {
            for x in 0..layout.width {
                let pixel = y * layout.width + x;
                if takes_part[layout.place(x, y)] > 0.0 {
                    let told = noise_and_change(image.pixels[pixel], variance.pixels[pixel], filtered[pixel]);
                    [noise[MARGIN + x], change[MARGIN + x]] = told;
                }
            }
        });
        Self { guides, takes_part, noise, change }
    }

    /// Gives the filtered pixels that take part their share of the noisy ones.
    pub(super) fn shrink(&self, noisy: &Image, filtered: &mut [[f32; 3]]) {
        let width = self.guides.layout.width.max(1);
        let rows = filtered.par_chunks_mut(width).zip(noisy.pixels.par_chunks(width)).enumerate();
        rows.for_each(|(y, (filtered, noisy))| shrink_row(self, y, noisy, filtered));
    }

    /// 1 − a of the pixels from (x, y) to the right.
    #[inline(always)]
    fn share_of_noisy(&self, x: usize, y: usize) -> Lanes {
        let layout = self.guides.layout;
        let at = layout.place(x, y);
        let (label, instance) = (lanes(&self.guides.label, at), lanes(&self.guides.instance, at));
        let (mut noise, mut change) = ([0.0f32; LANES], [0.0f32; LANES]);
        for row in y.saturating_sub(REACH)..(y + REACH + 1).min(layout.height) {
            for column in 0..=2 * REACH {
                let other = layout.place(x, row) + column - REACH;
                let (of_label, of_instance) =
                    (lanes(&self.guides.label, other), lanes(&self.guides.instance, other));
                let (of_noise, of_change) = (lanes(&self.noise, other), lanes(&self.change, other));
                for lane in 0..LANES {
                    let is_of_label = (of_label[lane] == label[lane]) & (of_instance[lane] == instance[lane]);
                    noise[lane] += if is_of_label { of_noise[lane] } else { 0.0 };
                    change[lane] += if is_of_label { of_change[lane] } else { 0.0 };
                }
            }
        }
        let mut share = [0.0; LANES];
        for lane in 0..LANES {
            share[lane] = if noise[lane] < change[lane] { 1.0 - noise[lane] / change[lane] } else { 0.0 };
        }
        share
    }
}

/// One row of [`Shrinkage::shrink`].
#[multiversion(targets("x86_64+avx2+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn shrink_row(shrinkage: &Shrinkage<'_>, y: usize, noisy: &[[f32; 3]], filtered: &mut [[f32; 3]]) {
    let layout = shrinkage.guides.layout;
    for (chunk, (noisy, filtered)) in noisy.chunks(LANES).zip(filtered.chunks_mut(LANES)).enumerate() {
        let x = chunk * LANES;
        let takes_part = lanes(shrinkage.takes_part, layout.place(x, y));
        if *takes_part == [0.0; LANES] {
            continue;
        }
        let share = shrinkage.share_of_noisy(x, y);
        for (lane, (noisy, filtered)) in noisy.iter().zip(filtered).enumerate() {
            if takes_part[lane] > 0.0 {
                for c in 0..3 {
                    filtered[c] += share[lane] * (noisy[c] - filtered[c]);
                }
            }
        }
    }
}

/// Relative variance and relative squared change of a pixel that takes part, summed over its channels; 0 where a variance is not known.
#[inline]
fn noise_and_change(noisy: [f32; 3], variance: [f32; 3], filtered: [f32; 3]) -> [f32; 2] {
    let (mut noise, mut change) = (0.0, 0.0);
    for c in 0..3 {
        let weight = 1.0 / (filtered[c] * filtered[c] + FLOOR);
        let d = noisy[c] - filtered[c];
        noise += weight * variance[c];
        change += weight * (d * d);
    }
    // Negative, infinite or no number: as if it were not known.
    let is_known = variance.iter().all(|of| (0.0..UNKNOWN).contains(of));
    if is_known { [noise, change] } else { [0.0; 2] }
}

#[cfg(test)]
mod tests {
    use super::super::planes::Layout;
    use super::*;
    use crate::picture::Picture;

    const WIDTH: usize = 41;
    const HEIGHT: usize = 13;

    /// Against the definition in f64: at the edges of the picture, where meshes have the label of the room around the rows, beside pixels that show
    /// nothing, and beside variances that are not known.
    #[test]
    fn shares_are_those_of_the_definition() {
        let mut state = 3u64;
        let mut draw = |n: u64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % n
        };
        let pixels = WIDTH * HEIGHT;
        let label: Vec<u32> = (0..pixels).map(|i| (i % WIDTH / 17 + draw(12) as usize / 11) as u32).collect();
        let instance: Vec<u32> = (0..pixels).map(|i| (i / WIDTH / 6) as u32).collect();
        let sound: Vec<bool> = (0..pixels).map(|_| draw(5) > 0).collect();
        let image = |of: &mut dyn FnMut() -> f32| {
            Image::new(WIDTH, HEIGHT, (0..pixels).map(|_| [of(), of(), of()]).collect())
        };
        let noisy = image(&mut || draw(100) as f32 / 50.0);
        let filtered = image(&mut || draw(100) as f32 / 90.0);
        let variance = image(&mut || match draw(40) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => -1.0,
            n => n as f32 / 25.0,
        });
        let picture = Picture {
            depth: Some(sound.iter().map(|&s| if s { 1.0 } else { f32::INFINITY }).collect()),
            label: Some(label.clone()),
            instance: Some(instance.clone()),
            normal: Some(Image::new(WIDTH, HEIGHT, vec![[0.0, 0.0, 1.0]; pixels])),
            albedo: Some(Image::new(WIDTH, HEIGHT, vec![[0.5; 3]; pixels])),
            ..Picture::of(noisy.clone())
        };
        let guides = Guides::of(&picture).unwrap().unwrap();
        let layout: Layout = guides.layout;
        let planes = [layout.zeroes().unwrap(), layout.zeroes().unwrap()];
        let shrinkage =
            Shrinkage::of([&noisy, &variance], &filtered.pixels, &guides, &guides.is_surface, planes);
        let mut shrunk = filtered.pixels.clone();
        shrinkage.shrink(&noisy, &mut shrunk);

        let is_known = |j: usize| variance.pixels[j].iter().all(|v| (0.0..1e18).contains(v));
        let mut seen = [0; 3];
        for i in 0..pixels {
            let (mut noise, mut change) = (0.0f64, 0.0f64);
            for j in (0..pixels).filter(|&j| sound[j] && is_known(j)) {
                let near = (i % WIDTH).abs_diff(j % WIDTH) <= 4 && (i / WIDTH).abs_diff(j / WIDTH) <= 4;
                if near && label[i] == label[j] && instance[i] == instance[j] {
                    for c in 0..3 {
                        let f = f64::from(filtered.pixels[j][c]);
                        noise += f64::from(variance.pixels[j][c]) / (f * f + 0.01);
                        change += (f64::from(noisy.pixels[j][c]) - f).powi(2) / (f * f + 0.01);
                    }
                }
            }
            let a = if noise < change { noise / change } else { 1.0 };
            let of = if !sound[i] {
                0
            } else if a < 1.0 {
                1
            } else {
                2
            };
            seen[of] += 1;
            for (c, &got) in shrunk[i].iter().enumerate() {
                let (y, f) = (f64::from(noisy.pixels[i][c]), f64::from(filtered.pixels[i][c]));
                let expected = if sound[i] { y + a * (f - y) } else { f };
                // Sums of 243 positive floats, of which each addition is off by 2⁻²⁴ at most.
                assert!((f64::from(got) - expected).abs() < 5e-5, "pixel {i}: {got} {expected}");
            }
        }
        assert!(seen.iter().all(|&n| n > 20), "{seen:?}: all kinds of pixels");
    }
}
