//! Denoises a picture by averaging pixels that a statistical test cannot tell apart. The result is smoother, and **biased**.
//!
//! After Sakai, Freude, Auzinger, Hahn and Wimmer 2024 (*A Statistical Approach to Monte Carlo Denoising*, SIGGRAPH Asia): a pixel
//! becomes the mean of the pixels of a square window, itself among them, each with a weight that is the product of
//!
//! ```text
//! label        1 where both pixels show the same label of the same instance, else 0
//! surface      1 to 0 as normal or base colour of the first surface differ: a joint bilateral filter
//! test         0 where Welch's t test rejects that the means of both pixels are equal, in any channel, else 1
//! noise        1, or four times the pixel's variance over the mean of both where the neighbour is much noisier, the least of the channels
//! ```
//! The test is what keeps shadows, reflections and all else that no surface tells: as samples are added, it tells apart what differs,
//! and the picture converges to the mean of its samples. The last weight keeps a noisy highlight out of the dark pixels beside it: the test
//! cannot tell them apart for a long time, and such highlights left up to 2.8 times the error of the unfiltered picture. With fewer samples
//! than classes (four) no variance is known; then everything may be equal, and label and surface decide alone.
//!
//! **Three windows** of 5 × 5 pixels: the first of neighbours, the second of every third pixel of the first one's result, the third of every
//! ninth of the second one's, so that a pixel becomes the mean of up to 53 × 53. A picture that is no larger than a few such squares has no third
//! window. The variance of a window's means follows from that of what it averages; where that of the pixels is not known, from how those of the
//! first window differ. So the wide windows have a test at one sample a pixel already. They have no weight for noise, because a mean that takes less
//! from noisier pixels loses the light of rare bright samples.
//!
//! **What noise does not explain comes back**: the result is a mixture of the noisy and the filtered picture, with more of the noisy one where the
//! filter changed more than the variance says. Without this, reflections of bright spots have up to 1.4 times the error of the noisy
//! picture at 64 samples; with it, less than two thirds.
//!
//! Light is divided by the base colour before, and multiplied by that of its own pixel after. Within a label the base colour is one and
//! the same, so this changes nothing on pure pixels, and carries over light between pixels that an edge mixes differently.
//!
//! What shows no surface stays as it is, and so does what is not finite. Each window is read in the same order for
//! every pixel, so the result is the same for any number of threads. This is its form for the processor; a Vulkan renderer has a twin, which
//! computes the same on its device (`vulkan-renderer/shaders/denoise.glsl`).
//!
//! The filter asks of the film a mean and its variance for each pixel, with the variance's degrees of freedom, and nothing else: see
//! [`Variance`].

mod denoiser;
mod guides;
mod light;
mod planes;
mod shrink;
mod upsample;
mod welch;
mod windows;

use pumice_core::reserve::reserved;
use pumice_core::{Job, NoMemory};

use crate::image::Image;
use crate::metrics::Variance;
pub use denoiser::Denoiser;
pub use guides::{GuideSurface, Guides};
use light::Light;
use planes::Means;
use shrink::Shrinkage;
pub use upsample::{Enlarged, upsampled};
pub use welch::WelchTest;
use windows::{FirstWindow, WideWindow, Window};

/// Pixels from the middle of a window to its edge, of which the wide one leaves out some.
const RADIUS: usize = 2;

/// Pixels from one of a wide window to the next, of the second window and the third. On figures in real light 5 in the second leaves out two thirds
/// of a highlight's surroundings, which then shows as a grid of highlights, and 2 leaves up to a fifth more visible difference.
const WIDE_STEPS: [usize; 2] = [3, 9];

/// Pixels of a picture's shorter side from which on there is a third window. At 270 it leaves a tenth less visible difference of one sample on figures
/// in real light, at 1080 a quarter; at 135, where it reaches over two fifths of the picture, 5 to 10 % more of four samples or more.
const LEAST_SIDE: usize = 256;

/// Added to a base colour before light is divided by it, so that light on black surfaces is divided by something.
const ALBEDO_FLOOR: f32 = 0.01;

/// The denoised picture. `variance` is that of its pixels, if it is known. A picture whose size is not that of the guides or the variance comes
/// back unchanged.
///
/// # Errors
/// [`NoMemory`] where there is none for 64 bytes a pixel.
pub fn denoised(image: &Image, variance: Option<Variance<'_>>, guides: &Guides) -> Result<Image, NoMemory> {
    denoised_with(image, variance, guides, wide_steps(image.width, image.height), &Job::new())
}

/// As [`denoised`]; `None` soon after `job` is cancelled.
///
/// # Errors
/// As [`denoised`].
pub fn denoised_unless_cancelled(
    image: &Image,
    variance: Option<Variance<'_>>,
    guides: &Guides,
    job: &Job,
) -> Result<Option<Image>, NoMemory> {
    let smooth = denoised_with(image, variance, guides, wide_steps(image.width, image.height), job)?;
    Ok((!job.is_cancelled()).then_some(smooth))
}

/// Pixels from one of a wide window to the next, of the second window and the third of a picture of this size; 0 where there is no third.
pub fn wide_steps(width: usize, height: usize) -> [usize; 2] {
    let [second, third] = WIDE_STEPS;
    [second, if width.min(height) >= LEAST_SIDE { third } else { 0 }]
}

/// As [`denoised`], with wide windows of these steps. A picture of no use where `job` is cancelled.
fn denoised_with(
    image: &Image,
    variance: Option<Variance<'_>>,
    guides: &Guides,
    [second, third]: [usize; 2],
    job: &Job,
) -> Result<Image, NoMemory> {
    let unfit = variance.as_ref().is_some_and(|v| !guides.fit(v.of_mean));
    let mut pixels = reserved(image.pixels.len(), "denoiser: its picture")?;
    pixels.extend_from_slice(&image.pixels);
    if guides.fit(image) && !unfit {
        let test = WelchTest::of(variance.as_ref().map(|v| v.degrees_of_freedom));
        let variance = variance.map(|v| v.of_mean);
        let is_variance_known = variance.is_some();
        let mut light = Light::of(image, variance, guides)?;
        let mut first = Means::zeroes(guides.layout)?;
        FirstWindow { guides, light: &light, test, is_variance_known }.find(&mut first, job);
        let (test, takes_part) = (WelchTest::wide(), &light.takes_part);
        // The light is not needed any more, and its memory is.
        WideWindow { guides, takes_part, from: &first, test, step: second }.find(&mut light.means, job);
        // With a step of 0 it is the mean of the pixel alone.
        WideWindow { guides, takes_part, from: &light.means, test, step: third }.fill(&mut pixels, job);
        if let Some(variance) = variance
            && !job.is_cancelled()
        {
            // The first window's means are not needed any more, and their memory is.
            let ([noise, ..], [change, ..]) = (first.mean, first.variance);
            let told = [image, variance];
            Shrinkage::of(told, &pixels, guides, takes_part, [noise, change]).shrink(image, &mut pixels);
        }
    }
    Ok(Image::new(image.width, image.height, pixels))
}

/// What light is divided by.
#[inline(always)]
fn divisor(albedo: f32) -> f32 {
    albedo + ALBEDO_FLOOR
}

#[cfg(test)]
mod tests;
