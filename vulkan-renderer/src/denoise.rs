//! The [denoiser](pumice_picture::denoise) on the device: one compute shader on every backend, whose twin is the host's filter.
//!
//! ```text
//! first surfaces of a tile ──► Guides ──► guides ─────────────┐   once for a scene
//! film's sums, or mean and variance ──► Light ──► Pooled ──► FirstWindow ──► SecondWindow ──► ThirdWindow ──► Shrink ──► picture, to the host
//! ```
//! Each arrow is a step ([`DenoiseStep`]) over the whole picture, in launches that are kept as short as those of samples. Mean and variance
//! come from the sums on the device; the host sends them where it alone computes them: with shadow catchers, and during a pass that was
//! cancelled, when pixels differ in their number of samples.
//!
//! The result has the bits of the host's filter on a device whose single-precision quotients are rounded correctly. Vulkan lets their last
//! bits be wrong.

use std::time::Duration;

use bytemuck::Zeroable as _;
use pumice_picture::Image;
use pumice_picture::denoise::{WelchTest, wide_steps};
use pumice_picture::film::CLASSES;
use pumice_picture::metrics::Variance;

use crate::device::{Buffer, DeviceError, Gpu};
use crate::layout::{Denoise, DenoiseStep, Guide, PixelLight, SurfaceAovsRecord};
use crate::shaders::denoise_words;
use crate::slices::Tile;
use crate::steps::Steps;

/// The compiled shader.
#[derive(Debug)]
pub struct DenoiseProgram(Steps<7>);

impl DenoiseProgram {
    /// Compiles the shader.
    ///
    /// # Errors
    /// When the driver refuses it.
    pub fn new(gpu: &Gpu) -> Result<Self, DeviceError> {
        Ok(Self(Steps::new(gpu, &denoise_words(gpu), "a launch of the denoiser")?))
    }

    /// Makes launches smaller, after memory was short or the device was lost.
    pub(crate) fn shrink(&mut self) {
        self.0.shrink();
    }
}

/// The noisy picture that is denoised.
#[derive(Clone, Copy, Debug)]
pub enum Noisy<'a> {
    /// Sums on the device, of so many samples in each pixel that does not rest.
    Film {
        /// `STRIDE` floats a pixel.
        sums: &'a Buffer,
        /// Which pixels rest, as in [`crate::layout::Launch::resting`].
        resting: Option<&'a Buffer>,
        /// Samples of each pixel that does not rest.
        samples: u32,
    },
    /// Mean and, where it is known, variance on the host.
    Host {
        /// The mean of the samples.
        mean: &'a Image,
        /// Its variance.
        variance: Option<Variance<'a>>,
    },
}

/// Memory for denoising pictures of one size, with the guides of a scene: 112 bytes a pixel.
#[derive(Debug)]
pub struct PictureDenoiser {
    size: [u32; 2],
    header: Buffer,
    guides: Buffer,
    image: Buffer,
    variance: Buffer,
    light: Buffer,
    light_variance: Buffer,
    pooled_variance: Buffer,
    smooth_mean: Buffer,
}

impl PictureDenoiser {
    /// Allocates it; no guide is known yet.
    ///
    /// # Errors
    /// When the device has too little memory.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, DeviceError> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let channels = 3 * size_of::<f32>() as u64;
        let buffer = |what, bytes_a_pixel: u64| gpu.buffer(what, pixels * bytes_a_pixel);
        Ok(Self {
            size,
            header: gpu.buffer("the denoiser's header", size_of::<Denoise>() as u64)?,
            guides: buffer("the denoiser's guides", size_of::<Guide>() as u64)?,
            image: buffer("the denoiser's picture", channels)?,
            variance: buffer("the denoiser's variance", channels)?,
            light: buffer("the denoiser's light", size_of::<PixelLight>() as u64)?,
            light_variance: buffer("the denoiser's variance of light", channels)?,
            pooled_variance: buffer("the denoiser's pooled variance", channels)?,
            smooth_mean: buffer("the denoiser's means", channels)?,
        })
    }

    /// What every step reads.
    fn described(&self) -> Denoise {
        Denoise {
            guides: self.guides.address(),
            image: self.image.address(),
            variance: self.variance.address(),
            light: self.light.address(),
            light_variance: self.light_variance.address(),
            pooled_variance: self.pooled_variance.address(),
            smooth_mean: self.smooth_mean.address(),
            width: self.size[0],
            height: self.size[1],
            wide_steps: wide_steps(self.size[0] as usize, self.size[1] as usize).map(|step| step as u32),
            ..Denoise::zeroed()
        }
    }

    /// Makes the guides of a tile from its first surfaces on the device, [`SurfaceAovsRecord`]s in the order of its pixels.
    ///
    /// # Errors
    /// Those of the device.
    pub(crate) fn guide(
        &self,
        program: &DenoiseProgram,
        surfaces: &Buffer,
        tile: &Tile,
    ) -> Result<Duration, DeviceError> {
        let header = Denoise { surfaces: surfaces.address(), ..self.described() };
        program.0.gpu.upload(&self.header, 0, bytemuck::bytes_of(&header))?;
        program.0.launch(&self.header, DenoiseStep::Guides as usize, tile)
    }

    /// Makes the guides of the whole picture from first surfaces on the host, rows from the top.
    ///
    /// # Errors
    /// Those of the device.
    pub fn guide_all(
        &self,
        program: &DenoiseProgram,
        surfaces: &[SurfaceAovsRecord],
    ) -> Result<(), DeviceError> {
        let surfaces = program.0.gpu.buffer_of("first surfaces", bytemuck::cast_slice(surfaces))?;
        let [width, height] = self.size;
        self.guide(program, &surfaces, &Tile { x: 0, y: 0, width, height })?;
        Ok(())
    }

    /// Denoises a picture into `pixels`, rows from the top. `test` is the first window's, for the variance's degrees of freedom.
    ///
    /// # Errors
    /// Those of the device; [`DeviceError::Limit`] where `pixels` are more than the picture has.
    pub fn denoise(
        &self,
        program: &mut DenoiseProgram,
        noisy: &Noisy<'_>,
        test: WelchTest,
        pixels: &mut [[f32; 3]],
    ) -> Result<(), DeviceError> {
        // Describe the picture, and send what the host has of it.
        let gpu = program.0.gpu.clone();
        let wide_t_squared = WelchTest::wide().t_squared();
        let header = Denoise { t_squared: test.t_squared(), wide_t_squared, ..self.described() };
        let header = match *noisy {
            Noisy::Film { sums, resting, samples } => Denoise {
                sums: sums.address(),
                resting: resting.map_or(0, Buffer::address),
                samples,
                is_variance_known: u32::from(samples >= CLASSES),
                ..header
            },
            Noisy::Host { mean, variance } => {
                gpu.upload(&self.image, 0, bytemuck::cast_slice(&mean.pixels))?;
                if let Some(variance) = &variance {
                    gpu.upload(&self.variance, 0, bytemuck::cast_slice(&variance.of_mean.pixels))?;
                }
                Denoise { is_variance_known: u32::from(variance.is_some()), ..header }
            }
        };
        gpu.upload(&self.header, 0, bytemuck::bytes_of(&header))?;

        // Take the surfaces' colours out of the light, pool its variance, average windows, and return what noise does not explain.
        let windows = [DenoiseStep::FirstWindow, DenoiseStep::SecondWindow, DenoiseStep::ThirdWindow];
        let shrink = (header.is_variance_known != 0).then_some(DenoiseStep::Shrink);
        for step in [DenoiseStep::Light, DenoiseStep::Pooled].into_iter().chain(windows).chain(shrink) {
            program.0.run(&self.header, step as usize, self.size)?;
        }

        // Read the result.
        gpu.download(&self.image, 0, bytemuck::cast_slice_mut(pixels))
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        let of_light = [&self.light, &self.light_variance, &self.pooled_variance, &self.smooth_mean];
        let all = [&self.header, &self.guides, &self.image, &self.variance].into_iter().chain(of_light);
        all.map(Buffer::bytes).sum()
    }
}
