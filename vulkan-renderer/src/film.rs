//! The film on the device, and how many samples it has.
//!
//! The sums are those of [`FilmBuffer`]: three floats for each class of each pixel, rows from the top, and the sums of render passes. A
//! sampling pass brings every pixel from `spp` samples to `target`, launch by launch. The next call continues a pass that was cancelled, so
//! each pixel gets each of its samples once and in order, and the picture does not depend on how the pass was divided.
//!
//! What is asked each frame is [resolved](crate::resolve) on the device: colours, alpha, and sums for the estimate of the error. The host's
//! copy of the sums is read where the whole film is needed: for a picture with its passes, when it is decided which pixels rest, after a
//! pass was cancelled, and each time that [`KEPT_SECONDS`] of samples have been added since. It is what is restored when the device is lost.

use std::time::Duration;

use pumice_core::reserve::zeroed;
use pumice_picture::film::{CLASSES, PICTURE, STRIDE};
use pumice_picture::resting::{AWAKE, Resting};
use pumice_picture::{FilmBuffer, Image};
use pumice_scene::Adaptive;
use pumice_transport::RenderError;

use crate::device::{Buffer, DeviceError, Gpu};
use crate::machine::DeviceContext;
use crate::resolve::{FilmSums, ResolveProgram, Resolver};
use crate::scene::UploadError;
use crate::slices::{BAND, Cursor};

/// Seconds of samples after which the host reads the film, so that a lost device takes no more with it. Reading 99.5 MB (1920 × 1080)
/// takes a card's bus less than a hundredth of that.
const KEPT_SECONDS: f64 = 5.0;

/// How far sampling has come: samples of every pixel that does not rest, and the unfinished pass with its target in samples a pixel.
type Reached = (u32, Option<(u32, Cursor)>);

/// The film's buffers on the device, and the host's copy.
#[derive(Debug)]
pub(crate) struct Film {
    pub(crate) sums: Buffer,
    /// Sums of render passes, where the film keeps any.
    pub(crate) pass_sums: Option<Buffer>,
    pub(crate) size: [u32; 2],
    /// Which pixels rest (have converged): one word a pixel, the samples that it has, or 0 where it does not rest. `None` where no pixel
    /// rests.
    pub(crate) resting: Option<Buffer>,
    /// Samples that each pixel has been given, where volumes are drawn in pages, once a launch asked for it.
    samples_done: Option<Buffer>,
    /// Samples of every pixel that does not rest.
    pub(crate) spp: u32,
    /// The unfinished pass: its target in samples a pixel, and how far it has come.
    pub(crate) pass: Option<(u32, Cursor)>,
    copy: FilmBuffer,
    /// How far sampling had come when the copy was read.
    copied: Reached,
    /// Time of the launches since then.
    since_copied: Duration,
    /// Memory for resolving, once something was asked.
    resolver: Option<Resolver>,
}

impl Film {
    /// A film without samples; `copy` is an empty one of the host, which knows by which rule pixels rest.
    pub(crate) fn new(gpu: &Gpu, copy: FilmBuffer) -> Result<Self, DeviceError> {
        let (size, kept) = (<[usize; 2]>::from(copy.size()).map(|n| n as u32), copy.kept());
        let bytes_a_float = u64::from(size[0]) * u64::from(size[1]) * 4;
        let bytes = bytes_a_float * STRIDE as u64;
        let sums = gpu.buffer("the film", bytes)?;
        gpu.clear(&sums)?;
        let mut pass_sums = None;
        if kept.stride() > 0 {
            let made = gpu.buffer("the film's passes", bytes_a_float * kept.stride() as u64)?;
            gpu.clear(&made)?;
            pass_sums = Some(made);
        }
        Ok(Self {
            sums,
            pass_sums,
            resting: None,
            samples_done: None,
            size,
            spp: 0,
            pass: None,
            copy,
            copied: (0, None),
            since_copied: Duration::ZERO,
            resolver: None,
        })
    }

    /// Creates the same film on another device, with the samples of the host's copy.
    pub(crate) fn again(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        (self.resolver, self.samples_done) = (None, None);
        if self.copied.0 == 0 {
            self.copy.clear();
            self.copied = (0, None);
        }
        let sums = gpu.buffer_of("the film", bytemuck::cast_slice(self.copy.sums()))?;
        if self.pass_sums.is_some() {
            let made = gpu.buffer_of("the film's passes", bytemuck::cast_slice(self.copy.pass_sums()))?;
            self.pass_sums = Some(made);
        }
        self.sums = sums;
        (self.spp, self.pass) = self.copied;
        self.since_copied = Duration::ZERO;
        self.tell_who_rests(gpu)
    }

    /// Removes all samples. `rule` decides which pixels of the next picture rest; with `None` no pixel does.
    ///
    /// # Errors
    /// Those of the device; of the host, where it has no memory to keep which pixels rest.
    pub(crate) fn clear(&mut self, gpu: &Gpu, rule: Option<Adaptive>) -> Result<(), UploadError> {
        self.copy.rest_by(rule).map_err(RenderError::from)?;
        gpu.clear(&self.sums)?;
        self.pass_sums.iter().chain(&self.samples_done).try_for_each(|sums| gpu.clear(sums))?;
        (self.spp, self.pass, self.resting) = (0, None, None);
        (self.copied, self.since_copied) = ((0, None), Duration::ZERO);
        Ok(())
    }

    /// Decides which pixels rest, if the film has reached the sample count of the next check.
    ///
    /// # Errors
    /// Those of the device; of the host, where it has no memory to decide it.
    pub(crate) fn look(&mut self, gpu: &Gpu) -> Result<(), UploadError> {
        if self.spp < self.copy.next_look() || self.pass.is_some() {
            return Ok(());
        }
        self.read(gpu)?;
        if self.copy.look().map_err(RenderError::from)? {
            self.tell_who_rests(gpu)?;
        }
        Ok(())
    }

    fn tell_who_rests(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        let word = |&rested: &u32| if rested == AWAKE { 0 } else { rested };
        let words = |resting: &Resting| resting.rested().iter().map(word).collect::<Vec<_>>();
        self.resting = match self.copy.resting().map(words) {
            Some(words) if words.iter().any(|&word| word != 0) => {
                Some(gpu.buffer_of("which pixels rest", bytemuck::cast_slice(&words))?)
            }
            _ => None,
        };
        Ok(())
    }

    /// The samples that each pixel has been given, in launches with pages since the film was cleared: one word a pixel, at most those of the
    /// unfinished pass.
    pub(crate) fn samples_done(&mut self, gpu: &Gpu) -> Result<u64, DeviceError> {
        let buffer = match self.samples_done.take() {
            Some(made) => made,
            None => {
                let made = gpu.buffer("the samples of pixels", 4 * self.copy.pixels() as u64)?;
                gpu.clear(&made)?;
                made
            }
        };
        Ok(self.samples_done.insert(buffer).address())
    }

    /// A launch of samples took so long.
    pub(crate) fn add_time(&mut self, taken: Duration) {
        self.since_copied += taken;
    }

    /// Reads the film, if many samples would be lost with the device.
    pub(crate) fn keep(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        if self.since_copied.as_secs_f64() < KEPT_SECONDS { Ok(()) } else { self.read(gpu) }
    }

    /// Whether the host's copy has all samples.
    fn is_copied(&self) -> bool {
        self.copied == (self.spp, self.pass)
    }

    /// Brings the host's copy up to date.
    pub(crate) fn read(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        if self.is_copied() {
            return Ok(());
        }
        // A partial download is useless. Pixels that rest on the device still do.
        self.copied = (0, None);
        gpu.download(&self.sums, 0, bytemuck::cast_slice_mut(self.copy.sums_mut(self.spp)))?;
        if let Some(sums) = &self.pass_sums {
            gpu.download(sums, 0, bytemuck::cast_slice_mut(self.copy.pass_sums_mut()))?;
        }
        if let Some((target, at)) = self.pass {
            let rows = at.y as usize..(at.y + BAND) as usize;
            self.copy.interrupted_at(target, rows, at.x as usize);
        }
        (self.copied, self.since_copied) = ((self.spp, self.pass), Duration::ZERO);
        Ok(())
    }

    /// Whether the host is asked and not the device: where it has all samples, and, after reading them, during an unfinished pass, when
    /// pixels differ in their number of samples.
    fn is_hosts(&mut self, gpu: &Gpu) -> Result<bool, DeviceError> {
        if self.pass.is_some() || self.copy.kept().caught {
            self.read(gpu)?;
        }
        Ok(self.is_copied())
    }

    /// Has the device find something of each pixel or strip.
    fn resolve(
        &mut self,
        machine: &mut DeviceContext,
        step: impl FnOnce(&Resolver, &mut ResolveProgram, &FilmSums<'_>) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        let resolver = match self.resolver.take() {
            Some(made) => made,
            None => Resolver::new(&machine.gpu, self.size)?,
        };
        let film = FilmSums {
            sums: &self.sums,
            pass_sums: self.pass_sums.as_ref(),
            resting: self.resting.as_ref(),
            samples: self.spp,
            kept: self.copy.kept(),
        };
        step(&resolver, machine.resolving()?, &film)?;
        self.resolver = Some(resolver);
        Ok(())
    }

    /// The colours so far.
    ///
    /// # Errors
    /// Those of the device; of the host, where it has no memory for them.
    pub(crate) fn color(&mut self, machine: &mut DeviceContext) -> Result<Image, UploadError> {
        if self.is_hosts(&machine.gpu)? {
            return Ok(self.copy.mean().map_err(RenderError::from)?);
        }
        let [width, height] = self.size.map(|n| n as usize);
        let mut pixels = zeroed(width * height, PICTURE).map_err(RenderError::from)?;
        self.resolve(machine, |resolver, program, film| resolver.color(program, film, &mut pixels))?;
        Ok(Image::new(width, height, pixels))
    }

    /// The share of each pixel's samples that hit a surface, where the film keeps it.
    ///
    /// # Errors
    /// As [`Film::color`].
    pub(crate) fn alpha(&mut self, machine: &mut DeviceContext) -> Result<Option<Vec<f32>>, UploadError> {
        if self.is_hosts(&machine.gpu)? {
            return Ok(self.copy.alpha().map_err(RenderError::from)?);
        }
        if !self.copy.has_alpha() {
            return Ok(None);
        }
        let mut shares = zeroed(self.copy.pixels(), PICTURE).map_err(RenderError::from)?;
        self.resolve(machine, |resolver, program, film| resolver.alpha(program, film, &mut shares))?;
        Ok(Some(shares))
    }

    /// The estimated relative error of the picture so far; infinite until it can be estimated.
    ///
    /// # Errors
    /// As [`Film::color`].
    pub(crate) fn error_estimate(&mut self, machine: &mut DeviceContext) -> Result<f64, UploadError> {
        if self.spp < CLASSES {
            return Ok(f64::INFINITY);
        }
        if self.is_hosts(&machine.gpu)? {
            return Ok(self.copy.error_estimate());
        }
        let mut strips = zeroed(self.copy.strips(), PICTURE).map_err(RenderError::from)?;
        self.resolve(machine, |resolver, program, film| resolver.squared_errors(program, film, &mut strips))?;
        Ok(self.copy.error_of_strips(&strips))
    }

    /// Mean over pixels of the samples that each has after the last complete pass.
    pub(crate) fn mean_spp(&self) -> f64 {
        self.copy.mean_spp_at(self.spp)
    }

    /// Frees the memory for resolving, which can be made again.
    pub(crate) fn drop_resolver(&mut self) {
        self.resolver = None;
    }

    /// The host's copy, as it was read last.
    pub(crate) fn copy(&self) -> &FilmBuffer {
        &self.copy
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let more = self
            .pass_sums
            .iter()
            .chain(&self.resting)
            .chain(&self.samples_done)
            .map(Buffer::bytes)
            .sum::<u64>();
        self.sums.bytes() + more + self.resolver.as_ref().map_or(0, Resolver::bytes)
    }
}
