//! Resolves the film on the device: finds what is asked of a picture each frame and sends that to the host, not the sums.
//!
//! ```text
//!                  ┌─► Color          the mean of each pixel's samples             12 bytes a pixel
//! film's sums ─────┼─► Alpha          the share that hit a surface, if kept         4 bytes a pixel
//!  48 bytes a      └─► SquaredErrors  for the estimate of the error, a sum for      8 bytes for 32 pixels
//!  pixel and more                     each strip of the film
//! ```
//! The shader is the twin of the host's [`FilmBuffer`](pumice_picture::FilmBuffer) and works in doubles of which each operation rounds as the
//! host's does, so the bits are the same.

use pumice_picture::PassSums;
use pumice_picture::film::STRIP_ROWS;

use crate::device::{Buffer, DeviceError, Gpu};
use crate::layout::{Resolve, ResolveStep};
use crate::shaders::resolve_words;
use crate::steps::Steps;

/// The compiled shader.
#[derive(Debug)]
pub struct ResolveProgram(Steps<3>);

impl ResolveProgram {
    /// Compiles the shader.
    ///
    /// # Errors
    /// When the driver refuses it.
    pub fn new(gpu: &Gpu) -> Result<Self, DeviceError> {
        Ok(Self(Steps::new(gpu, &resolve_words(gpu), "a launch that resolves the film")?))
    }

    /// Makes launches smaller, after memory was short or the device was lost.
    pub(crate) fn shrink(&mut self) {
        self.0.shrink();
    }
}

/// The sums of a film on the device, after a complete pass.
#[derive(Clone, Copy, Debug)]
pub struct FilmSums<'a> {
    /// `STRIDE` floats a pixel.
    pub sums: &'a Buffer,
    /// Sums of passes, as many floats a pixel as `kept` says.
    pub pass_sums: Option<&'a Buffer>,
    /// Which pixels rest, as in [`crate::layout::Launch::resting`].
    pub resting: Option<&'a Buffer>,
    /// Samples of each pixel that does not rest.
    pub samples: u32,
    /// What the sums of passes are.
    pub kept: PassSums,
}

/// Memory for resolving films of one size: 12 bytes a pixel.
#[derive(Debug)]
pub struct Resolver {
    size: [u32; 2],
    header: Buffer,
    result: Buffer,
}

impl Resolver {
    /// Allocates it.
    ///
    /// # Errors
    /// When the device has too little memory.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, DeviceError> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let header = gpu.buffer("the header of what resolves the film", size_of::<Resolve>() as u64)?;
        let result = gpu.buffer("the resolved film", pixels * size_of::<[f32; 3]>() as u64)?;
        Ok(Self { size, header, result })
    }

    /// The colours: as `FilmBuffer::mean`, rows from the top.
    ///
    /// # Errors
    /// Those of the device; [`DeviceError::Limit`] where `pixels` are more than the film has.
    pub fn color(
        &self,
        program: &mut ResolveProgram,
        film: &FilmSums<'_>,
        pixels: &mut [[f32; 3]],
    ) -> Result<(), DeviceError> {
        self.run(program, film, ResolveStep::Color, self.size, bytemuck::cast_slice_mut(pixels))
    }

    /// The share of samples that hit a surface, which the film keeps: as `FilmBuffer::alpha`.
    ///
    /// # Errors
    /// As [`Resolver::color`].
    pub fn alpha(
        &self,
        program: &mut ResolveProgram,
        film: &FilmSums<'_>,
        shares: &mut [f32],
    ) -> Result<(), DeviceError> {
        self.run(program, film, ResolveStep::Alpha, self.size, bytemuck::cast_slice_mut(shares))
    }

    /// The sum of squared relative errors in each strip, for `FilmBuffer::error_of_strips`.
    ///
    /// # Errors
    /// As [`Resolver::color`].
    pub fn squared_errors(
        &self,
        program: &mut ResolveProgram,
        film: &FilmSums<'_>,
        strips: &mut [f64],
    ) -> Result<(), DeviceError> {
        let items = [self.size[0], self.size[1].div_ceil(STRIP_ROWS as u32)];
        self.run(program, film, ResolveStep::SquaredErrors, items, bytemuck::cast_slice_mut(strips))
    }

    /// Does a step for so many items across and down, and reads what it found.
    fn run(
        &self,
        program: &mut ResolveProgram,
        film: &FilmSums<'_>,
        step: ResolveStep,
        items: [u32; 2],
        found: &mut [u8],
    ) -> Result<(), DeviceError> {
        let gpu = program.0.gpu.clone();
        let described = Resolve {
            sums: film.sums.address(),
            pass_sums: film.pass_sums.map_or(0, Buffer::address),
            resting: film.resting.map_or(0, Buffer::address),
            result: self.result.address(),
            width: self.size[0],
            height: self.size[1],
            samples: film.samples,
            pass_stride: film.kept.stride() as u32,
        };
        gpu.upload(&self.header, 0, bytemuck::bytes_of(&described))?;
        program.0.run(&self.header, step as usize, items)?;
        gpu.download(&self.result, 0, found)
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.header.bytes() + self.result.bytes()
    }
}
