//! Denoises a picture by averaging pixels that a statistical test cannot tell apart. The result is smoother, and **biased**.
//!
//! After Sakai, Freude, Auzinger, Hahn and Wimmer 2024 (*A Statistical Approach to Monte Carlo Denoising*, SIGGRAPH Asia): a pixel
//! becomes the mean of the pixels of a square window, itself among them, each with a weight that is the product of
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
//! **Two windows** of 5 × 5 pixels: the first of neighbours, the second of every third pixel of the first one's result, so that a
//! pixel becomes the mean of up to 17 × 17. The variance of the first one's means follows from that of the pixels; where that is not known, from how
//! the window's pixels differ. So the second window has a test at one sample a pixel already. It has no weight for noise, because a mean
//! that takes less from noisier pixels loses the light of rare bright samples.
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
mod welch;
mod windows;

use pumice_core::NoMemory;
use pumice_core::reserve::reserved;

use crate::image::Image;
use crate::metrics::Variance;
pub use denoiser::Denoiser;
pub use guides::Guides;
use light::Light;
pub use welch::WelchTest;
use windows::{FirstWindow, WideWindow};

/// Pixels from the middle of a window to its edge, of which the wide one leaves out some.
const RADIUS: usize = 2;

/// Pixels from one of the wide window to the next. On figures in real light 5 leaves out two thirds of a highlight's surroundings, which then
/// shows as a grid of highlights, and 2 leaves up to a fifth more visible difference.
const WIDE_STEP: usize = 3;

/// Added to a base colour before light is divided by it, so that light on black surfaces is divided by something.
const ALBEDO_FLOOR: f32 = 0.01;

/// The denoised picture. `variance` is that of its pixels, if it is known. A picture whose size is not that of the guides or the variance comes
/// back unchanged.
///
/// # Errors
/// [`NoMemory`] where there is none for 64 bytes a pixel.
pub fn denoised(image: &Image, variance: Option<Variance<'_>>, guides: &Guides) -> Result<Image, NoMemory> {
    let unfit = variance.as_ref().is_some_and(|v| !guides.fit(v.of_mean));
    let mut pixels = reserved(image.pixels.len(), "denoiser: its picture")?;
    pixels.extend_from_slice(&image.pixels);
    if guides.fit(image) && !unfit {
        let test = WelchTest::of(variance.as_ref().map(|v| v.degrees_of_freedom));
        let is_variance_known = variance.is_some();
        let light = Light::of(image, variance.map(|v| v.of_mean), guides)?;
        let smooth = FirstWindow { guides, light: &light, test, is_variance_known }.means()?;
        WideWindow { guides, light: &light, smooth: &smooth, test: WelchTest::wide() }.fill(&mut pixels);
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
