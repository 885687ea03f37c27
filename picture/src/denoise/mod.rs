//! Denoises a picture by averaging pixels that a statistical test cannot tell apart. The result is smoother, and **biased**.
//!
//! After Sakai, Freude, Auzinger, Hahn and Wimmer 2024 (*A Statistical Approach to Monte Carlo Denoising*, SIGGRAPH Asia): a pixel
//! becomes the mean of the neighbours in a square window, itself among them, each with a weight that is the product of
//!
//! ```text
//! label        1 where both pixels show the same label of the same instance, else 0
//! surface      1 to 0 as normal or base colour of the first surface differ: a joint bilateral filter
//! test         0 where Welch's t test rejects that the means of both pixels are equal, in any channel, else 1
//! noise        1, or the pixel's variance over the mean of both where the neighbour is noisier, the least of the channels
//! ```
//! The test is what keeps shadows, reflections and all else that no surface tells: as samples are added, it tells apart what differs,
//! and the picture converges to the mean of its samples. The last weight keeps a noisy highlight out of the dark pixels beside it: the test
//! cannot tell them apart for a long time, and such highlights left up to 2.8 times the error of the unfiltered picture. With fewer samples
//! than classes (four) no variance is known; then everything may be equal, and label and surface decide alone.
//!
//! Light is divided by the base colour before, and multiplied by that of its own pixel after. Within a label the base colour is one and
//! the same, so this changes nothing on pure pixels, and carries over light between pixels that an edge mixes differently.
//!
//! What shows no surface stays as it is, and so does what is not finite. The window is read from the noisy picture in the same order for
//! every pixel, so the result is the same for any number of threads. This is its form for the processor; a Vulkan renderer has a twin, which
//! computes the same on its device (`vulkan-renderer/shaders/denoise.glsl`).
//!
//! The filter asks of the film a mean and its variance for each pixel, with the variance's degrees of freedom, and nothing else: see
//! [`Variance`].

mod guides;
mod light;
mod planes;
mod welch;

use pumice_core::NoMemory;
use pumice_core::reserve::reserved;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::image::Image;
use crate::metrics::Variance;
pub use guides::Guides;
use guides::likeness;
use light::Light;
use planes::{LANES, Lanes, lanes, three_lanes};
pub use welch::WelchTest;

/// Pixels from the middle of the window to its edge: 5 × 5 pixels, which take 0.5 CPU seconds at 1920 × 1080 on a busy machine. On figures in
/// real light 7 × 7 pixels, twice as many, have a tenth less error at 4 samples, the same at 16 and more at 64.
const RADIUS: usize = 2;

/// Probability that the test tells apart two pixels of one mean, by channel. With 0.05 the error is larger by a few per cent, with 0.002 the
/// same.
const LEVEL: f64 = 0.01;

/// Added to a base colour before light is divided by it, so that light on black surfaces is divided by something.
const ALBEDO_FLOOR: f32 = 0.01;

/// A filter that a picture went through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Denoiser {
    /// The filter of this module. Its name in files says that the picture is no longer the mean of its samples.
    #[serde(rename = "statistical, biased")]
    Statistical,
}

/// The denoised picture. `variance` is that of its pixels, if it is known. A picture whose size is not that of the guides or the variance comes
/// back unchanged.
///
/// # Errors
/// [`NoMemory`] where there is none for 40 bytes a pixel.
pub fn denoised(image: &Image, variance: Option<Variance<'_>>, guides: &Guides) -> Result<Image, NoMemory> {
    let unfit = variance.as_ref().is_some_and(|v| !guides.fit(v.of_mean));
    let mut pixels = reserved(image.pixels.len(), "denoiser: its picture")?;
    pixels.extend_from_slice(&image.pixels);
    if guides.fit(image) && !unfit {
        let test = WelchTest::of(variance.as_ref().map(|v| v.degrees_of_freedom));
        let light = Light::of(image, variance.map(|v| v.of_mean), guides)?;
        let filter = Filter { guides, light, test };
        filter.fill(&mut pixels);
    }
    Ok(Image::new(image.width, image.height, pixels))
}

/// What light is divided by.
#[inline(always)]
fn divisor(albedo: f32) -> f32 {
    albedo + ALBEDO_FLOOR
}

/// The filter of one picture.
struct Filter<'a> {
    guides: &'a Guides,
    light: Light,
    test: WelchTest,
}

/// What is compared of pixels beside each other.
struct Compared {
    mean: [Lanes; 3],
    variance: [Lanes; 3],
    normal: [Lanes; 3],
    albedo: [Lanes; 3],
    label: Lanes<u32>,
    instance: Lanes<u32>,
}

impl Filter<'_> {
    /// Replaces the colours of the pixels that take part.
    fn fill(&self, pixels: &mut [[f32; 3]]) {
        let layout = self.guides.layout;
        pixels.par_chunks_mut(layout.width.max(1)).enumerate().for_each(|(y, row)| {
            for (chunk, pixels) in row.chunks_mut(LANES).enumerate() {
                let x = chunk * LANES;
                let at = layout.place(x, y);
                if lanes(&self.light.takes_part, at) == [0.0; LANES] {
                    continue;
                }
                let (light, weight) = self.window(x, y);
                // The pixel itself is one of the window, with weight 1, so that no sum of weights of one that takes part is 0. What is added is
                // the window's mean difference from the pixel's own light, so that equal light stays equal to the bit.
                for (lane, pixel) in pixels.iter_mut().enumerate() {
                    if self.light.takes_part[at + lane] > 0.0 {
                        for c in 0..3 {
                            let d = divisor(self.guides.albedo[c][at + lane]);
                            pixel[c] += d * (light[c][lane] / weight[lane]);
                        }
                    }
                }
            }
        });
    }

    /// For the pixels from (x, y) to the right: sums over the window of the weighted differences of light, and of the weights.
    #[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
    fn window(&self, x: usize, y: usize) -> ([Lanes; 3], Lanes) {
        let layout = self.guides.layout;
        let own = self.compared(layout.place(x, y));
        let (mut light, mut weight) = ([[0.0; LANES]; 3], [0.0; LANES]);
        for of_row in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(layout.height) {
            for column in 0..=2 * RADIUS {
                let at = layout.place(x, of_row) + column - RADIUS;
                let other = self.compared(at);
                let weights = self.weights(&own, &other, &lanes(&self.light.takes_part, at));
                for lane in 0..LANES {
                    weight[lane] += weights[lane];
                }
                for c in 0..3 {
                    for lane in 0..LANES {
                        light[c][lane] += weights[lane] * (other.mean[c][lane] - own.mean[c][lane]);
                    }
                }
            }
        }
        (light, weight)
    }

    /// Weights of some pixels for others, as the module says. Each inner loop is over lanes and has no branch, so that it becomes vector
    /// instructions.
    #[expect(clippy::needless_range_loop, reason = "lanes of several arrays side by side")]
    #[inline(always)]
    fn weights(&self, p: &Compared, q: &Compared, takes_part: &Lanes) -> Lanes {
        let (mut normal, mut albedo, mut weights) = ([0.0; LANES], [0.0; LANES], *takes_part);
        for c in 0..3 {
            for lane in 0..LANES {
                let d = q.normal[c][lane] - p.normal[c][lane];
                normal[lane] += d * d;
            }
            for lane in 0..LANES {
                let d = q.albedo[c][lane] - p.albedo[c][lane];
                albedo[lane] += d * d;
            }
            for lane in 0..LANES {
                let d = q.mean[c][lane] - p.mean[c][lane];
                let weight = self.test.weight(d, p.variance[c][lane], q.variance[c][lane]);
                weights[lane] = weights[lane].min(weight);
            }
        }
        for lane in 0..LANES {
            let is_of_label = (p.label[lane] == q.label[lane]) & (p.instance[lane] == q.instance[lane]);
            weights[lane] = if is_of_label { weights[lane] } else { 0.0 };
        }
        for lane in 0..LANES {
            weights[lane] *= likeness(normal[lane], albedo[lane]);
        }
        weights
    }

    #[inline(always)]
    fn compared(&self, at: usize) -> Compared {
        Compared {
            mean: three_lanes(&self.light.mean, at),
            variance: three_lanes(&self.light.variance, at),
            normal: three_lanes(&self.guides.normal, at),
            albedo: three_lanes(&self.guides.albedo, at),
            label: lanes(&self.guides.label, at),
            instance: lanes(&self.guides.instance, at),
        }
    }
}

#[cfg(test)]
mod tests;
