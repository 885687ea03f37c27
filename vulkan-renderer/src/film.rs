//! The film on the device, and how many samples it has.
//!
//! The sums are those of [`FilmBuffer`]: three floats for each class of each pixel, rows from the top, and the sums of render passes. A
//! sampling pass brings every pixel from `spp` samples to `target`, launch by launch. The next call continues a pass that was cancelled, so
//! each pixel gets each of its samples once and in order, and the picture does not depend on how the pass was divided.
//!
//! The host holds a copy as of the last complete pass that was read. It is what is displayed, and what is restored when the device is lost.

use pumice_picture::FilmBuffer;
use pumice_picture::film::STRIDE;
use pumice_picture::resting::{AWAKE, Resting};
use pumice_scene::Adaptive;
use pumice_transport::RenderError;

use crate::device::{Buffer, DeviceError, Gpu};
use crate::scene::UploadError;
use crate::slices::Cursor;

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
    /// Samples of every pixel that does not rest.
    pub(crate) spp: u32,
    /// The unfinished pass: its target in samples a pixel, and how far it has come.
    pub(crate) pass: Option<(u32, Cursor)>,
    copy: FilmBuffer,
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
        Ok(Self { sums, pass_sums, resting: None, size, spp: 0, pass: None, copy })
    }

    /// Creates the same film on another device, with the samples of the host's copy.
    pub(crate) fn again(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        if self.copy.spp() == 0 {
            self.copy.clear();
        }
        let sums = gpu.buffer_of("the film", bytemuck::cast_slice(self.copy.sums()))?;
        if self.pass_sums.is_some() {
            let made = gpu.buffer_of("the film's passes", bytemuck::cast_slice(self.copy.pass_sums()))?;
            self.pass_sums = Some(made);
        }
        (self.sums, self.spp, self.pass) = (sums, self.copy.spp(), None);
        self.tell_who_rests(gpu)
    }

    /// Removes all samples. `rule` decides which pixels of the next picture rest; with `None` no pixel does.
    ///
    /// # Errors
    /// Those of the device; of the host, where it has no memory to keep which pixels rest.
    pub(crate) fn clear(&mut self, gpu: &Gpu, rule: Option<Adaptive>) -> Result<(), UploadError> {
        self.copy.rest_by(rule).map_err(RenderError::from)?;
        gpu.clear(&self.sums)?;
        self.pass_sums.iter().try_for_each(|sums| gpu.clear(sums))?;
        (self.spp, self.pass, self.resting) = (0, None, None);
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

    /// Brings the host's copy up to date. Does nothing during a pass, when pixels differ in their number of samples.
    pub(crate) fn read(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        if self.copy.spp() == self.spp || self.pass.is_some() {
            return Ok(());
        }
        let mut read = gpu.download(&self.sums, 0, bytemuck::cast_slice_mut(self.copy.sums_mut(self.spp)));
        if let (Ok(()), Some(sums)) = (&read, &self.pass_sums) {
            read = gpu.download(sums, 0, bytemuck::cast_slice_mut(self.copy.pass_sums_mut()));
        }
        if read.is_err() {
            // A partial download is useless. Pixels that rest on the device still do.
            self.copy.sums_mut(0);
        }
        read
    }

    /// The host's copy.
    pub(crate) fn copy(&self) -> &FilmBuffer {
        &self.copy
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let more = self.pass_sums.iter().chain(&self.resting);
        self.sums.bytes() + more.map(Buffer::bytes).sum::<u64>()
    }
}
