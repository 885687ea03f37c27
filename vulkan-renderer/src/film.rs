//! The film on the device, and how far its samples have come.
//!
//! Sums are those of [`FilmBuffer`]: three floats for each replicate of each pixel, rows from the top, and what passes need. A pass brings every pixel
//! from `spp` samples to `target`, launch by launch. A pass that was cancelled is continued by the next one, so each pixel gets
//! each of its samples once and in order, and the picture does not depend on how it was cut.
//!
//! The host holds a copy as of the last whole pass that was read: what is shown, and what is put back when the device is lost.

use pumice_picture::film::STRIDE;
use pumice_picture::resting::{AWAKE, Resting};
use pumice_picture::{FilmBuffer, PassSums};
use pumice_scene::Adaptive;

use crate::device::{Buffer, DeviceError, Gpu};
use crate::slices::Cursor;

/// See the module.
#[derive(Debug)]
pub(crate) struct Film {
    pub(crate) sums: Buffer,
    /// Sums of passes, where any are kept.
    pub(crate) pass_sums: Option<Buffer>,
    pub(crate) size: [u32; 2],
    /// Which pixels rest, where any does: a word each, not 0 of those that do.
    pub(crate) resting: Option<Buffer>,
    /// Samples that every pixel has that does not rest.
    pub(crate) spp: u32,
    /// The pass under way: the samples that it brings pixels to, and where it is.
    pub(crate) pass: Option<(u32, Cursor)>,
    copy: FilmBuffer,
}

impl Film {
    pub(crate) fn new(
        gpu: &Gpu,
        size: [u32; 2],
        kept: PassSums,
        rule: Option<Adaptive>,
    ) -> Result<Self, DeviceError> {
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
        let mut copy = FilmBuffer::with_passes(size[0], size[1], kept);
        copy.rest_by(rule);
        Ok(Self { sums, pass_sums, resting: None, size, spp: 0, pass: None, copy })
    }

    /// The same on another device, with the samples that the host has.
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

    /// Takes all samples away; pixels of the picture to come rest by this rule, if by any.
    pub(crate) fn clear(&mut self, gpu: &Gpu, rule: Option<Adaptive>) -> Result<(), DeviceError> {
        gpu.clear(&self.sums)?;
        self.pass_sums.iter().try_for_each(|sums| gpu.clear(sums))?;
        (self.spp, self.pass, self.resting) = (0, None, None);
        self.copy.rest_by(rule);
        Ok(())
    }

    /// Looks which pixels may rest, if this is where to look.
    pub(crate) fn look(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        if self.spp < self.copy.next_look() || self.pass.is_some() {
            return Ok(());
        }
        self.read(gpu)?;
        if self.copy.look() { self.tell_who_rests(gpu) } else { Ok(()) }
    }

    fn tell_who_rests(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        let words =
            |resting: &Resting| resting.rested().iter().map(|&r| u32::from(r != AWAKE)).collect::<Vec<_>>();
        self.resting = match self.copy.resting().map(words) {
            Some(words) if words.contains(&1) => {
                Some(gpu.buffer_of("which pixels rest", bytemuck::cast_slice(&words))?)
            }
            _ => None,
        };
        Ok(())
    }

    /// Brings the host's copy up to date. Between passes only: within one, pixels differ by samples.
    pub(crate) fn read(&mut self, gpu: &Gpu) -> Result<(), DeviceError> {
        if self.copy.spp() == self.spp || self.pass.is_some() {
            return Ok(());
        }
        let mut read = gpu.download(&self.sums, 0, bytemuck::cast_slice_mut(self.copy.sums_mut(self.spp)));
        if let (Ok(()), Some(sums)) = (&read, &self.pass_sums) {
            read = gpu.download(sums, 0, bytemuck::cast_slice_mut(self.copy.pass_sums_mut()));
        }
        if read.is_err() {
            // A part of it may be there: it is of no use. Who rests on the device does so still.
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
